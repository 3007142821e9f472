"""The rasterizer for views whose places lie on the device: many views at once, each of its own world."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import warp as wp

from ..launch import RecordedLaunch
from ..numerics import linear_of, translation_of
from ..records import NOT_DRAWN, CameraRecord, GeometryRecord, World
from .first_hits import box_pixels, clip_matrix, triangles_of
from .raster import DrawList, Raster
from .raster_kernels import HEADER, OPTIONS, RasterTask, Triangles
from .worlds import Worlds

#: Pixels along a side of a tile: `ViewTile` in view_raster.h.
_TILE = 64
#: Triangles times tiles of a view that are drawn without sorting them into bins first, at most.
_MOST_UNSORTED = 1 << 14


@wp.struct
class Views:
    """Where V views are, and what of the instances each sees: its world, of `lists`.

    Draw k of a view is member k of its world. View v has `stride` entries of `matrices`, from points to clip space,
    and of `boxes`, left, top, right and bottom of the pixels that a draw may cover. `bare` (M,) is 1 for members that
    rays alone find, whose boxes in object space are `lowers` and `uppers`; `marks` (V H, W) is 1 in their pixels.

    A view has so many `tiles`, and a world `most_faces` at most.
    """

    cameras: wp.array(dtype=CameraRecord)
    worlds: wp.array(dtype=wp.int32)
    lists: Worlds
    lens: wp.mat44d
    size: wp.vec2i
    stride: wp.int32
    tiles: wp.int32
    most_faces: wp.int32
    matrices: wp.array(dtype=wp.mat44d)
    boxes: wp.array(dtype=wp.vec4i)
    bare: wp.array(dtype=wp.int32)
    lowers: wp.array(dtype=wp.vec3)
    uppers: wp.array(dtype=wp.vec3)
    marks: wp.array2d(dtype=wp.uint8)


class ViewRaster:
    """Triangles of a scene as many perspective views see them.

    Attributes:
        first_face: (M,) int32, the first face of each member of a world in the pictures of that world.
        others: whether there are shapes that only rays find.
        seen: `Raster` of pictures (V H, W) one below the other, without depth; drawn over by each `draw`.
        marks: (V H, W) uint8, 1 where shapes may be seen that only rays find.
    """

    def __init__(
        self,
        geometries: Sequence[GeometryRecord],
        geometry: np.ndarray,
        boxes: np.ndarray,
        lists: Worlds,
        lens: CameraRecord,
        device: str,
        threads: int | None,
    ) -> None:
        """For worlds over instances of these shapes; `lens` has no place.

        Args:
            geometries: the shapes.
            geometry: (I,) the shape of each instance.
            boxes: (G, 2, 3) object boxes of the shapes that only rays find, empty ones of the others.
            lists: the worlds' instances.
            lens: size, window and clipping range of all views.
            device: of the scene.
            threads: CPU threads.

        Raises:
            ValueError: more triangles than int32 can number.
        """
        self._device, self._threads = wp.get_device(device), threads
        self._meshes = [triangles_of(g, device) for g in geometries]  # arrays of structs do not keep what they point to
        members, self._starts = lists.members.numpy(), lists.starts.numpy()
        self._mesh = geometry[members] if len(members) else np.zeros(0, np.int32)
        faces = np.array([len(mesh.indices) // 3 for mesh in self._meshes] or [0], np.int64)[self._mesh]
        before = np.cumsum(faces) - faces
        ends = [range(self._starts[w], self._starts[w + 1]) for w in range(lists.count)]
        first = np.concatenate([before[r] - before[r][:1] for r in ends] or [before])
        most = max((int(faces[r].sum()) for r in ends), default=0)
        if most >= 2**31 - 1:
            raise ValueError(f"{most} triangles are more than one picture has face numbers for")
        self.first_face = wp.array(first.astype(np.int32), dtype=wp.int32, device=device)
        record = self._views = Views()
        record.lists, record.size = lists, wp.vec2i(lens.width, lens.height)
        record.lens = _lens_matrix(lens)
        record.stride = int(np.diff(self._starts).max(initial=1))
        record.tiles, record.most_faces = -(-lens.width // _TILE) * -(-lens.height // _TILE), most
        corners = boxes[self._mesh] if len(self._mesh) else np.zeros((0, 2, 3))
        bare = corners[:, 0, 0] < corners[:, 1, 0]
        self.others = bool(bare.any())
        record.bare = wp.array(bare.astype(np.int32), dtype=wp.int32, device=device)
        record.lowers, record.uppers = (
            wp.array(np.ascontiguousarray(corners[:, k], np.float32), dtype=wp.vec3, device=device) for k in range(2)
        )
        self._task = task = RasterTask()
        task.meshes = wp.array(self._meshes, dtype=Triangles, device=device)
        task.mesh = wp.array(self._mesh.astype(np.int32), dtype=wp.int32, device=device)
        task.first_face, task.width, task.height = self.first_face, lens.width, lens.height
        self._sorted = self._device.is_cpu and most * record.tiles > _MOST_UNSORTED
        self._lists: dict[int, DrawList] = {}

    def see(self, world: World, cameras: wp.array, worlds: wp.array) -> None:
        """Prepare for views (V,) of `worlds` (V,), both read by each `draw`, as is `world`."""
        views, record, task = len(cameras), self._views, self._task
        width, height = record.size
        record.cameras, record.worlds = cameras, worlds
        record.matrices = wp.zeros(views * record.stride, dtype=wp.mat44d, device=self._device)
        record.boxes = wp.zeros(views * record.stride, dtype=wp.vec4i, device=self._device)
        planes = wp.empty((3, views * height, width), wp.float32, device=self._device)
        self.seen = Raster(planes[0].view(wp.int32), planes[1], planes[2], None)
        task.face, task.u, task.v = self.seen[:3]
        task.matrices = record.matrices
        marked = (views * height, width) if self.others else (0, 0)
        self.marks = record.marks = wp.zeros(marked, dtype=wp.uint8, device=self._device)
        matrices = _view_matrices, views * record.stride, [world, record]
        rows = [(_mark_rows, views * height, [record], 16)] if self.others else []
        launches = [(*matrices, 64), *rows]
        if not self._device.is_cpu:
            self._keep_keys(views)
            pixels = views * width * height
            launches += [(_keyed_faces(), views * record.most_faces, [task, record], 1)] if record.most_faces else []
            launches += [(_keyed_pixels(), pixels, [task, record], 1)]
        elif not self._sorted:
            launches += [(_tile_kernel(), views * record.tiles, [task, record], 1)]
        self._launches = [
            RecordedLaunch(kernel, count, arguments, self._device, self._threads, smallest_chunk=smallest)
            for kernel, count, arguments, smallest in launches
        ]

    def look_at(self, worlds: wp.array) -> None:
        """Let the views see other worlds (V,)."""
        self._views.worlds = worlds

    def draw(self) -> None:
        """Fill `seen` and `marks`."""
        if not self._device.is_cpu:
            self._task.keys.fill_(2**64 - 1)
            self._task.taken.zero_()
        for launch in self._launches:
            launch.run()
        if self._sorted:
            self._draw_sorted()

    def _keep_keys(self, views: int) -> None:
        """Room for what CUDA's kernels leave to each other."""
        task, pixels = self._task, self._task.width * self._task.height
        task.keys = wp.empty(views * pixels, wp.uint64, device=self._device)
        task.entries = wp.empty(3 * views * self._views.most_faces, wp.int32, device=self._device)
        task.taken = wp.zeros(views, wp.int32, device=self._device)
        task.faults = wp.zeros(1, wp.int32, device=self._device)

    def _draw_sorted(self) -> None:
        """Views of many triangles, one after the other (CPU)."""
        stride, height = self._views.stride, self._task.height
        for view, world in enumerate(self._views.worlds.numpy().clip(0, self._views.lists.count - 1)):
            if world not in self._lists:
                draws = self._mesh[self._starts[world] : self._starts[world + 1]]
                self._lists[world] = DrawList(self._meshes, draws, self._device)
            draws = self._lists[world]
            draws.place(self._views.matrices[view * stride : (view + 1) * stride])
            rows = slice(view * height, (view + 1) * height)
            part = Raster(*(plane[rows] for plane in self.seen[:3]), None)
            draws.rasterize(self._task.width, height, self._threads, into=part)


def _lens_matrix(lens: CameraRecord) -> wp.mat44d:
    """From a view's own frame to clip space."""
    at_origin = CameraRecord()
    at_origin.rotation = wp.mat33(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    at_origin.window, at_origin.near = lens.window, lens.near
    return wp.mat44d(*clip_matrix(at_origin, np.zeros((0, 2, 3))).reshape(-1))


@wp.kernel(module="unique", enable_backward=False)
def _view_matrices(first: wp.int32, world: World, views: Views):
    item = first + wp.tid()
    view = item // views.stride
    number = wp.clamp(views.worlds[view], 0, views.lists.count - 1)
    member = views.lists.starts[number] + item - view * views.stride
    if member < views.lists.starts[number + 1]:
        i = views.lists.members[member]
        camera = views.cameras[view]
        place = world.instances[i]
        back = wp.mat33d(wp.transpose(camera.rotation))
        turned = back * wp.mat33d(linear_of(place.to_world))
        moved = back * (wp.vec3d(translation_of(place.to_world)) - wp.vec3d(camera.position))
        views.matrices[item] = views.lens * affine(turned, moved)
        box = wp.vec4i()
        if place.placed != wp.static(NOT_DRAWN):
            if views.bare[member] != 0:
                box = box_pixels(views.matrices[item], views.lowers[member], views.uppers[member], views.size)
            else:
                to_clip = views.lens * affine(back, -(back * wp.vec3d(camera.position)))
                box = box_pixels(to_clip, world.lowers[i], world.uppers[i], views.size)
        else:
            # Positions that are not finite are not drawn.
            views.matrices[item] = wp.mat44d(wp.float64(wp.nan))
        views.boxes[item] = box


@wp.func
def affine(linear: wp.mat33d, translation: wp.vec3d) -> wp.mat44d:
    """A matrix for column vectors."""
    m = wp.mat44d()
    for a in range(3):
        for b in range(3):
            m[a, b] = linear[a, b]
        m[a, 3] = translation[a]
    m[3, 3] = wp.float64(1.0)
    return m


@wp.kernel(module="unique", enable_backward=False)
def _mark_rows(first: wp.int32, views: Views):
    row = first + wp.tid()
    view = row // views.size[1]
    y = row - view * views.size[1]
    for x in range(views.size[0]):
        views.marks[row, x] = wp.uint8(0)
    number = wp.clamp(views.worlds[view], 0, views.lists.count - 1)
    begin = views.lists.starts[number]
    for member in range(begin, views.lists.starts[number + 1]):
        if views.bare[member] != 0:
            box = views.boxes[view * views.stride + member - begin]
            if box[1] <= y and y < box[3]:
                for x in range(box[0], box[2]):
                    views.marks[row, x] = wp.uint8(1)


_NATIVE = HEADER + (Path(__file__).parent / "view_raster.h").read_text()


@cache
def _tile_kernel() -> wp.Kernel:
    """A tile of a view an item (CPU)."""

    @wp.func_native(_NATIVE + "ViewTile::run(task, views, item);")
    def draw_tile(task: RasterTask, views: Views, item: wp.int32): ...

    @wp.kernel(module="unique", enable_backward=False, module_options=OPTIONS)
    def draw_tiles(first: wp.int32, task: RasterTask, views: Views):
        draw_tile(task, views, first + wp.tid())

    return draw_tiles


@cache
def _keyed_faces() -> wp.Kernel:
    """A face of a view an item (CUDA)."""

    @wp.func_native(
        _NATIVE
        + """
        int view = item / views.most_faces, face = item % views.most_faces;
        ViewTask::make(task, views, view);
        if (face < ViewTask::faces(task))
            Keyed::draw(task, face);
        """
    )
    def draw_face(task: RasterTask, views: Views, item: wp.int32): ...

    @wp.kernel(module="unique", enable_backward=False, module_options=OPTIONS)
    def draw_view_faces(first: wp.int32, task: RasterTask, views: Views):
        draw_face(task, views, first + wp.tid())

    return draw_view_faces


@cache
def _keyed_pixels() -> wp.Kernel:
    """A pixel of a view an item: large triangles, then what users see (CUDA)."""

    @wp.func_native(
        _NATIVE
        + """
        int pixels = task.width * task.height, view = item / pixels, pixel = item % pixels;
        ViewTask::make(task, views, view);
        Keyed::draw_large(task, pixel % task.width, pixel / task.width);
        Keyed::finish(task, pixel % task.width, pixel / task.width);
        """
    )
    def draw_pixel(task: RasterTask, views: Views, item: wp.int32): ...

    @wp.kernel(module="unique", enable_backward=False, module_options=OPTIONS)
    def draw_view_pixels(first: wp.int32, task: RasterTask, views: Views):
        draw_pixel(task, views, first + wp.tid())

    return draw_view_pixels
