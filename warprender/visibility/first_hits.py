"""The first hit of the ray through each pixel's centre, in one buffer, whoever finds it: rays or the rasterizer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Protocol

import numpy as np
import warp as wp

from ..camera import camera_ray_function
from ..launch import launch, launch_pixels
from ..numerics import linear_of, translation_of
from ..records import NOT_DRAWN, CameraRecord, DeviceScene, GeometryRecord, Hit, Ray, World
from .raster import DrawList, Raster
from .raster_kernels import Triangles
from .rays import miss
from .sdf import ray_functions

#: Pixels from their centres that points may lie at, as reconstruction filters ask.
FARTHEST_OFFSET = 2.0


class FirstHits(Protocol):
    """A way to find first hits."""

    def follow(self, scene: DeviceScene, camera: CameraRecord) -> None:
        """See the scene, whose instances may have moved, from a camera of the same size and effects."""

    def find(self, threads: int | None = None) -> wp.array2d(dtype=Hit):
        """(H, W) hits, row 0 at the top. The array is overwritten by the next call."""


class RayHits:
    """First hits by one ray a pixel."""

    def __init__(
        self,
        scene: DeviceScene,
        camera: CameraRecord,
        effects: tuple[str, ...],
        device: str,
        sdfs: tuple[wp.Function, ...] = (),
    ) -> None:
        """`effects` are the camera's, by name; `sdfs` the signed distance functions that occur."""
        self._kernel = _ray_kernel(effects, sdfs)
        self._hits = wp.empty((camera.height, camera.width), Hit, device=device)
        self.follow(scene, camera)

    def follow(self, scene: DeviceScene, camera: CameraRecord) -> None:
        """See `FirstHits`."""
        self._scene, self._camera = scene, camera

    def find(self, threads: int | None = None) -> wp.array2d(dtype=Hit):
        """See `FirstHits`."""
        arguments = [self._scene, self._camera, self._hits]
        launch_pixels(self._kernel, self._camera.width, self._camera.height, arguments, self._hits.device, threads)
        return self._hits


class RasterHits:
    """First hits by the rasterizer: triangles by their edges, and rays where other shapes may be.

    Points go to clip space by one float64 matrix, of the same float32 placement that rays meet, and are rounded once.
    Raster and rays therefore differ only at centres within 2^-24 of the picture's width of an edge, and where surfaces
    are equally deep as float32.
    """

    def __init__(
        self,
        scene: DeviceScene,
        geometries: Sequence[GeometryRecord],
        instances: np.ndarray,
        rayed: np.ndarray,
        boxes: Callable[[], np.ndarray],
        camera: CameraRecord,
        effects: tuple[str, ...],
        device: str,
        painter: bool = False,
        sdfs: tuple[wp.Function, ...] = (),
    ) -> None:
        """For the instances of a scene, which may move.

        Args:
            scene: the scene on its device.
            geometries: the host's copies of `scene.geometries`.
            instances: (I,) ints, the geometry of each instance.
            rayed: (G, 2, 3) object boxes of the geometries that only rays find, empty ones of the others.
            boxes: returns the boxes (I, 2, 3) of the instances in the scene's coordinates, NaN for what is not drawn;
                called for orthographic cameras.
            camera: a pinhole or an orthographic camera without clipping planes.
            effects: the camera's, by name.
            device: of the scene.
            painter: draw by the painter's algorithm, without a depth buffer.
            sdfs: the signed distance functions that occur; rays find them.

        Raises:
            ValueError: more triangles than int32 can number.
        """
        self._draws = DrawList([triangles_of(g, device) for g in geometries], instances, device)
        self._seen: Raster | None = None
        self._draw = self._draws.paint if painter else self._draws.rasterize
        self._boxes, self._device = boxes, device
        corners = rayed[instances]
        boxed = np.flatnonzero(corners[:, 0, 0] < corners[:, 1, 0])
        self._rayed = ForRays()
        self._rayed.instances = wp.array(boxed.astype(np.int32), dtype=wp.int32, device=device)
        self._rayed.lowers, self._rayed.uppers = (
            wp.array(np.ascontiguousarray(corners[boxed, k], np.float32), dtype=wp.vec3, device=device)
            for k in range(2)
        )
        self._rayed.boxes = wp.empty(len(boxed), dtype=wp.vec4i, device=device)
        self._by_ray = wp.zeros((camera.height, camera.width), dtype=wp.uint8, device=device)
        self._hits = wp.empty((camera.height, camera.width), Hit, device=device)
        self._kernel = _raster_kernel(effects, bool(len(boxed)), sdfs)
        self.follow(scene, camera)

    def follow(self, scene: DeviceScene, camera: CameraRecord) -> None:
        """See `FirstHits`."""
        self._scene, self._camera = scene, camera
        boxes = self._boxes() if camera.orthographic else np.zeros((0, 2, 3))
        self._to_clip = clip_matrix(camera, boxes)
        self._shift((0.0, 0.0))
        if len(self._rayed.instances):
            size = wp.vec2i(camera.width, camera.height)
            arguments = [self._draws.matrices, scene.world, size, self._rayed]
            launch(_box_pixels, len(self._rayed.instances), arguments, self._device)
            launch(_mark_rows, camera.height, [self._rayed, self._by_ray], self._device, smallest_chunk=16)

    def _shift(self, offset: tuple[float, float]) -> None:
        """Take instances to clip space for points at this offset from the centres."""
        to_clip = wp.mat44d(*_moved(self._to_clip, self._camera, offset).reshape(-1))
        arguments = [to_clip, self._scene.world, self._draws.matrices]
        launch(_matrices_to_clip, len(self._draws.matrices), arguments, self._device)
        self._offset = offset

    def find(self, threads: int | None = None, offset: tuple[float, float] = (0.0, 0.0)) -> wp.array2d(dtype=Hit):
        """See `FirstHits`; of the rays through points that lie `offset` pixels from the centres, to the right and down.

        `offset` is at most `FARTHEST_OFFSET` either way.
        """
        if offset != self._offset:
            self._shift(offset)
        self._seen = seen = self._draw(self._camera.width, self._camera.height, threads, into=self._seen)
        arguments = [self._scene, self._camera, self._draws.first_face, seen.face, seen.u, seen.v, self._by_ray]
        size = self._camera.width, self._camera.height
        arguments = [*arguments, wp.vec2(*offset), self._hits]
        launch_pixels(self._kernel, *size, arguments, self._hits.device, threads)
        return self._hits


def _moved(to_clip: np.ndarray, camera: CameraRecord, offset: tuple[float, float]) -> np.ndarray:
    """The clip matrix under which pixel centres lie where points at this offset from them lay before."""
    shift = np.eye(4)
    shift[0, 3], shift[1, 3] = -2.0 * offset[0] / camera.width, 2.0 * offset[1] / camera.height
    return shift @ to_clip


def clip_matrix(camera: CameraRecord, boxes: np.ndarray) -> np.ndarray:
    """(4, 4) float64, from the scene's coordinates to clip space, for column vectors.

    Depth z / w runs from -1 on the near plane to 0 at infinity (perspective), where float32 is as fine as the depth
    itself, or to 1 behind the last of the `boxes` (I, 2, 3) (orthographic). The far plane is left to whoever reads the
    hits: what is behind it hides nothing.
    """
    rotation = np.array(camera.rotation, np.float64).reshape(3, 3)
    position = np.array(camera.position, np.float64)
    view = np.eye(4)
    view[:3, :3], view[:3, 3] = rotation.T, -rotation.T @ position
    left, bottom, right, top = np.array(camera.window, np.float64)
    x, y = (right + left) / (right - left), (top + bottom) / (top - bottom)
    projection = np.zeros((4, 4))
    projection[0, 0], projection[1, 1] = 2 / (right - left), 2 / (top - bottom)
    if camera.orthographic:
        boxes = boxes[np.isfinite(boxes).all((1, 2))].astype(np.float64)
        middle, reach = boxes.sum(1) / 2, (boxes[:, 1] - boxes[:, 0]) / 2
        farthest = (-(middle @ view[2, :3]) - view[2, 3] + reach @ np.abs(view[2, :3])).max(initial=camera.near)
        depth = max(1.01 * (farthest - camera.near), 1e-6 * abs(camera.near), 1e-30)
        projection[0, 3], projection[1, 3] = -x, -y
        projection[2, 2:] = -2 / depth, -2 * camera.near / depth - 1
        projection[3, 3] = 1
    else:
        projection[0, 2], projection[1, 2] = x, y
        projection[2, 3] = -camera.near
        projection[3, 2] = -1
    return projection @ view


@wp.struct
class ForRays:
    """Instances (S,) that only rays find, the corners of their boxes in object space, where inf has no end, and left,
    top, right, bottom of the pixels that may see each.
    """

    instances: wp.array(dtype=wp.int32)
    lowers: wp.array(dtype=wp.vec3)
    uppers: wp.array(dtype=wp.vec3)
    boxes: wp.array(dtype=wp.vec4i)


@wp.kernel(module="unique", enable_backward=False)
def _matrices_to_clip(first: wp.int32, to_clip: wp.mat44d, world: World, matrices: wp.array(dtype=wp.mat44d)):
    i = first + wp.tid()
    place = world.instances[i]
    placed = wp.mat44d()
    for a in range(3):
        for b in range(4):
            placed[a, b] = wp.float64(place.to_world[a, b])
            # Positions that are not finite are not drawn.
            if place.placed == wp.static(NOT_DRAWN):
                placed[a, b] = wp.float64(wp.nan)
    placed[3, 3] = wp.float64(1.0)
    matrices[i] = to_clip * placed


@wp.func
def box_pixels(to_clip: wp.mat44d, lower: wp.vec3, upper: wp.vec3, size: wp.vec2i) -> wp.vec4i:
    """Left, top, right and bottom of the pixels of a picture that may see a box; all of them where it has no end."""
    low = wp.vec2d(wp.float64(wp.inf), wp.float64(wp.inf))
    high = -low
    before_eye = wp.bool(True)
    for k in range(8):
        corner = wp.vec4d(
            wp.float64(wp.where((k & 1) != 0, upper[0], lower[0])),
            wp.float64(wp.where((k & 2) != 0, upper[1], lower[1])),
            wp.float64(wp.where((k & 4) != 0, upper[2], lower[2])),
            wp.float64(1.0),
        )
        clip = to_clip * corner
        # A box without an end is not before the eye, nor is what the numbers do not hold.
        before_eye = before_eye and clip[3] > wp.float64(0.0) and wp.isfinite(clip[0] + clip[1] + clip[3])
        at = wp.vec2d(clip[0] / clip[3], -clip[1] / clip[3])
        low = wp.min(low, at)
        high = wp.max(high, at)
    box = wp.vec4i(0, 0, size[0], size[1])
    if before_eye:
        for a in range(2):
            pixels = wp.float64(size[a])
            half = wp.float64(0.5)
            margin = wp.float64(wp.static(1.0 + FARTHEST_OFFSET))
            # Clamped first: what lies far outside has no int32.
            begin = wp.clamp((low[a] * half + half) * pixels - margin, wp.float64(0.0), pixels)
            end = wp.clamp((high[a] * half + half) * pixels + margin, wp.float64(0.0), pixels)
            box[a] = wp.int32(wp.floor(begin))
            box[a + 2] = wp.int32(wp.ceil(end))
    return box


@wp.kernel(module="unique", enable_backward=False)
def _box_pixels(first: wp.int32, matrices: wp.array(dtype=wp.mat44d), world: World, size: wp.vec2i, rayed: ForRays):
    i = first + wp.tid()
    instance = rayed.instances[i]
    box = box_pixels(matrices[instance], rayed.lowers[i], rayed.uppers[i], size)
    if world.instances[instance].placed == wp.static(NOT_DRAWN):
        box = wp.vec4i(0, 0, 0, 0)
    rayed.boxes[i] = box


@wp.kernel(module="unique", enable_backward=False)
def _mark_rows(first: wp.int32, rayed: ForRays, by_ray: wp.array2d(dtype=wp.uint8)):
    y = first + wp.tid()
    for x in range(by_ray.shape[1]):
        by_ray[y, x] = wp.uint8(0)
    for i in range(rayed.boxes.shape[0]):
        box = rayed.boxes[i]
        if box[1] <= y and y < box[3]:
            for x in range(box[0], box[2]):
                by_ray[y, x] = wp.uint8(1)


def triangles_of(geometry: GeometryRecord, device: str) -> Triangles:
    """The geometry's triangles; none of a sphere's."""
    triangles = Triangles()
    triangles.points = geometry.points if geometry.points is not None else wp.empty(0, wp.vec3, device=device)
    triangles.indices = geometry.indices if geometry.indices is not None else wp.empty(0, wp.int32, device=device)
    return triangles


@cache
def _ray_kernel(effects: tuple[str, ...], sdfs: tuple[wp.Function, ...]) -> wp.Kernel:
    camera_ray = camera_ray_function(effects)
    closest, _, _ = ray_functions(sdfs)

    @wp.kernel(module="unique", enable_backward=False)
    def ray_hits(
        first: wp.int32, columns: wp.int32, scene: DeviceScene, camera: CameraRecord, hits: wp.array2d(dtype=Hit)
    ):
        begin = (first + wp.tid()) * columns
        y = begin // camera.width
        for x in range(begin - y * camera.width, begin - y * camera.width + columns):
            ray = camera_ray(camera, wp.float32(x) + 0.5, wp.float32(y) + 0.5, wp.vec2(0.5, 0.5))
            hits[y, x] = closest(scene, ray)

    return ray_hits


@wp.func
def draw_of(first_face: wp.array(dtype=wp.int32), first: wp.int32, end: wp.int32, face: wp.int32) -> wp.int32:
    """Of the draws from number `first` up to `end`, the last whose first face is not behind `face`."""
    low = first
    high = end - 1
    while low < high:
        middle = (low + high + 1) // 2
        if first_face[middle] <= face:
            low = middle
        else:
            high = middle - 1
    return low


@wp.func
def rastered(scene: DeviceScene, ray: Ray, instance: int, triangle: int, u: float, v: float) -> Hit:
    """The hit of a ray with the triangle that the rasterizer saw; a miss behind the ray's end."""
    hit = miss()
    geometry = scene.instances[instance].geometry
    i = scene.geometries[geometry].indices[3 * triangle]
    j = scene.geometries[geometry].indices[3 * triangle + 1]
    k = scene.geometries[geometry].indices[3 * triangle + 2]
    p0 = scene.geometries[geometry].points[i]
    p1 = scene.geometries[geometry].points[j]
    p2 = scene.geometries[geometry].points[k]
    p = p0 + (p1 - p0) * u + (p2 - p0) * v
    placed = scene.world.instances[instance].to_world
    p = linear_of(placed) * p + translation_of(placed)
    t = wp.max(wp.dot(p - ray.origin, ray.direction), 0.0)
    if t < ray.t_max:
        hit.t = t
        hit.instance = instance
        hit.face = triangle
        hit.u = u
        hit.v = v
    return hit


@cache
def _raster_kernel(effects: tuple[str, ...], by_rays: bool, sdfs: tuple[wp.Function, ...]) -> wp.Kernel:
    """`by_rays`: whether there are pixels that rays look into."""
    camera_ray = camera_ray_function(effects)
    closest, _, _ = ray_functions(sdfs)

    @wp.kernel(module="unique", enable_backward=False)
    def raster_hits(
        first: wp.int32,
        columns: wp.int32,
        scene: DeviceScene,
        camera: CameraRecord,
        first_face: wp.array(dtype=wp.int32),
        face: wp.array2d(dtype=wp.int32),
        u: wp.array2d(dtype=wp.float32),
        v: wp.array2d(dtype=wp.float32),
        by_ray: wp.array2d(dtype=wp.uint8),
        offset: wp.vec2,
        hits: wp.array2d(dtype=Hit),
    ):
        begin = (first + wp.tid()) * columns
        y = begin // camera.width
        for x in range(begin - y * camera.width, begin - y * camera.width + columns):
            hit = miss()
            px = wp.float32(x) + 0.5 + offset[0]
            py = wp.float32(y) + 0.5 + offset[1]
            if wp.static(by_rays):
                if by_ray[y, x] != wp.uint8(0):
                    hit = closest(scene, camera_ray(camera, px, py, wp.vec2(0.5, 0.5)))
            if face[y, x] >= 0 and by_ray[y, x] == wp.uint8(0):
                ray = camera_ray(camera, px, py, wp.vec2(0.5, 0.5))
                instance = draw_of(first_face, 0, first_face.shape[0], face[y, x])
                hit = rastered(scene, ray, instance, face[y, x] - first_face[instance], u[y, x], v[y, x])
            hits[y, x] = hit

    return raster_hits
