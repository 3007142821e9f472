"""Rasterization: which triangle each pixel centre sees, by homogeneous edge functions and a depth buffer.

Coverage is exact for the float32 clip coordinates: a sign that double precision does not settle is found with exact
sums (raster.h). Triangles may cross the eye plane; nothing is clipped but per pixel (Olano and Greer 1997).

On the CPU triangles are sorted middle: chunks of triangles go to bins of the picture by count, prefix sum and scatter,
then each bin is drawn by one thread, so that no two threads write one address. On CUDA one thread draws one triangle
and the nearest wins by an atomic minimum of depth and face in one 64-bit key (Laine and Karras, "High-Performance
Software Rasterization on GPUs", 2011, weigh both).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import warp as wp

from ..launch import launch, thread_count
from .raster_input import device_of, index_array, position_array
from .raster_kernels import RasterTask, Triangles, bin_kernel, fill_kernel, keyed_kernels, painter_kernels

#: Pixels along a side of the picture, at most: the error bounds of raster.h count on it.
LARGEST_SIDE = 16384
#: Triangles in a chunk, integers that it may leave for bins, and bins at most: `Binner` in raster.h.
_CHUNK, _ROOM, _MOST_BINS = 2048, 14336, 1024
_SMALLEST_SHIFT = 6
#: Rows that the painter draws in one item: `Painter` in raster.h.
_BAND_ROWS = 16

_CULL = {"none": 0, "back": -1, "front": 1}


class Raster(NamedTuple):
    """What each pixel centre sees: arrays (H, W), row 0 at the top.

    Attributes:
        face: int32, -1 where nothing is seen.
        u: float32, perspective-correct weight of vertex 1; 0 on a miss.
        v: float32, that of vertex 2.
        depth: float32 z / w in [-1, 1], smaller is nearer; 1 on a miss.
    """

    face: wp.array
    u: wp.array
    v: wp.array
    depth: wp.array


def rasterize(
    clip_positions: np.ndarray | wp.array,
    indices: np.ndarray | wp.array,
    width: int,
    height: int,
    device: str | wp.Device | None = None,
    threads: int | None = None,
    cull: str = "none",
) -> Raster:
    """Find the nearest triangle at every pixel centre.

    Args:
        clip_positions: (N, 4) float32 clip-space positions, numpy or a `wp.array(dtype=wp.vec4)`. +y is up, row 0
            of the picture is at y = w. Triangles with a coordinate that is not finite are not drawn.
        indices: (F, 3) or (3 F,) int.
        width: of the picture in pixels.
        height: likewise.
        device: "cpu" or a CUDA device; None takes that of a `wp.array` given, else the CPU.
        threads: CPU threads, None for all cores. The picture does not depend on it.
        cull: "none", "back" or "front"; a front face turns counter-clockwise.

    Returns:
        A `Raster`. Of equally deep triangles (as float32) the one with the smaller index is seen. Where centres lie
        on an edge, the triangle owns those on its left and top edges.

    Raises:
        ValueError: a size, shape or index out of range.
        MemoryError: the picture does not fit the device's memory.
    """
    device = device_of(clip_positions, indices, device)
    triangles = Triangles()
    triangles.clip = position_array(clip_positions, device)
    triangles.indices = index_array(indices, device)
    return DrawList([triangles], [0], device).rasterize(width, height, threads, cull)


class DrawList:
    """What one picture shows: D draws of meshes, each mesh stored once however often it is drawn.

    The number of a face in the picture is `first_face` of its draw plus its index in the mesh.

    Attributes:
        first_face: (D,) int32 on the device.
        matrices: (D,) `wp.mat44d` on the device, from points to clip space, for column vectors. Zero until set; not
            read for meshes of clip positions.
    """

    def __init__(self, meshes: Sequence[Triangles], draws: Sequence[int] | np.ndarray, device: str | wp.Device) -> None:
        """Take meshes, whose arrays are read anew for each picture, and for each draw the number of its mesh.

        Raises:
            ValueError: more triangles than int32 can number.
        """
        self.device = wp.get_device(device)
        self._meshes = list(meshes)  # arrays of structs do not keep what they point to
        self._mesh = np.asarray(draws, np.int32)
        faces = np.array([len(mesh.indices) // 3 for mesh in self._meshes], np.int64)[self._mesh]
        if faces.sum() >= 2**31 - 1:
            raise ValueError(f"{faces.sum()} triangles are more than one picture has face numbers for")
        self._face_count = int(faces.sum())
        first_face = np.cumsum(faces) - faces
        self.first_face = wp.array(first_face.astype(np.int32), dtype=wp.int32, device=self.device)
        self.matrices = wp.zeros(len(self._mesh), wp.mat44d, device=self.device)
        self._task = task = RasterTask()
        task.meshes = wp.array(self._meshes, dtype=Triangles, device=self.device)
        task.mesh = wp.array(self._mesh, dtype=wp.int32, device=self.device)
        task.first_face, task.matrices = self.first_face, self.matrices
        # What CUDA's kernels leave to each other, made for the first picture.
        self._kept: tuple[wp.array, wp.array] | None = None
        self._large: tuple[wp.array, wp.array] | None = None
        task.chunks = wp.array(_chunks(first_face, self._face_count), dtype=wp.int32, device=self.device)

    def place(self, matrices: wp.array) -> None:
        """Take the draws to clip space by another array (D,) of matrices."""
        self.matrices = self._task.matrices = matrices

    def rasterize(
        self, width: int, height: int, threads: int | None = None, cull: str = "none", into: Raster | None = None
    ) -> Raster:
        """What each pixel centre sees; arguments and errors as of `rasterize`.

        `into` is an earlier picture of this size to draw over, for fresh memory costs more than the drawing.
        """
        seen = self._begin(width, height, cull, into)
        if self.device.is_cpu:
            self._draw_in_bins(thread_count(threads))
        else:
            self._draw_by_keys()
        return seen

    def paint(self, width: int, height: int, threads: int | None = None, into: Raster | None = None) -> Raster:
        """The same by the painter's algorithm: triangles are drawn back to front, each over those before it.

        They are sorted by the depth of the mean of their clip positions, so triangles that overlap in a cycle, pass
        through each other, or are long, come out wrong; `rasterize` gets them right.
        """
        seen, task = self._begin(width, height, "none", into), self._task
        self._prepare_keys()
        sort_depth = wp.empty(self._face_count, wp.float32, device=self.device)
        measure, paint_bands = painter_kernels()
        launch(measure, self._face_count, [task, sort_depth], self.device, threads)
        self._check_faults(task.faults.numpy())
        farthest_first = np.lexsort((-np.arange(self._face_count), -sort_depth.numpy()))
        task.order = wp.array(farthest_first, dtype=wp.int32, device=self.device)
        bands = -(-task.height // _BAND_ROWS)
        launch(paint_bands, bands, [task], self.device, threads, smallest_chunk=1)
        launch(keyed_kernels()[2], task.width * task.height, [task], self.device, threads)
        return seen

    def _begin(self, width: int, height: int, cull: str, into: Raster | None) -> Raster:
        for name, size in (("width", width), ("height", height)):
            if size != int(size) or not 1 <= size <= LARGEST_SIDE:
                raise ValueError(f"{name} must be 1…{LARGEST_SIDE} pixels, not {size}")
        if cull not in _CULL:
            raise ValueError(f"cull {cull!r} is not one of {', '.join(_CULL)}")
        task = self._task
        task.width, task.height, task.cull = int(width), int(height), _CULL[cull]
        seen = into or _new_picture(task.width, task.height, self.device)
        task.face, task.u, task.v, task.depth = seen
        return seen

    def _prepare_keys(self) -> None:
        task, pixels = self._task, self._task.width * self._task.height
        if self._kept is None or len(self._kept[0]) != pixels:
            self._kept = tuple(wp.empty(n, t, device=self.device) for n, t in ((pixels, wp.uint64), (1, wp.int32)))
        task.keys, task.faults = self._kept
        task.keys.fill_(2**64 - 1)
        task.faults.fill_(-1)

    def _draw_in_bins(self, threads: int) -> None:
        task, chunks = self._task, self._task.chunks.shape[0]
        task.shift = _SMALLEST_SHIFT
        while _bins(task) > _MOST_BINS:
            task.shift += 1
        workers = min(threads, _bins(task))
        with _borrowed(chunks, chunks * (_bins(task) + 1), workers << 2 * task.shift) as scratch:
            task.entries, task.starts, task.large_counts, task.faults, task.keys = scratch
            task.taken = wp.zeros(2, wp.int32, device="cpu")
            # An item is a thread at work: it takes chunks, then bins, until none is left.
            launch(bin_kernel(), min(threads, chunks), [task], "cpu", threads, smallest_chunk=1)
            self._check_faults(task.faults.numpy()[:chunks])
            launch(fill_kernel(), workers, [task], "cpu", threads, smallest_chunk=1)

    def _draw_by_keys(self) -> None:
        task, pixels = self._task, self._task.width * self._task.height
        self._prepare_keys()
        first_picture = self._large is None
        if first_picture:
            sizes = 3 * self._face_count, 1
            self._large = tuple(wp.empty(size, wp.int32, device=self.device) for size in sizes)
        task.entries, task.taken = self._large
        task.taken.zero_()
        for kernel, count in zip(keyed_kernels(), (self._face_count, pixels, pixels), strict=True):
            launch(kernel, count, [task], self.device, threads=1)
        # Later pictures leave out what is out of range, and nobody waits for the device.
        if first_picture:
            self._check_faults(task.faults.numpy())

    def _check_faults(self, faults: np.ndarray) -> None:
        """Raise a ValueError for a face with an index out of range; -1 stands for none."""
        if not (faults >= 0).any():
            return
        face, first = int(faults[faults >= 0].min()), self.first_face.numpy()
        draw = int(np.searchsorted(first, face, "right")) - 1
        mesh = self._meshes[self._mesh[draw]]
        corners = mesh.indices.numpy().reshape(-1, 3)[face - first[draw]].tolist()
        vertices = len(mesh.points if mesh.clip is None else mesh.clip)
        raise ValueError(f"triangle {face} has the indices {corners}, but there are {vertices} vertices")


def _new_picture(width: int, height: int, device: wp.Device) -> Raster:
    # One block: the allocator keeps a block of this size for the next picture, while four smaller ones go back to the
    # system, and the first touch of a page costs as much as drawing a hundred triangles.
    needed, free = 16 * width * height, _free_memory(device)
    complaint = f"a picture of {width}x{height} pixels needs {needed >> 20} MiB of {device}'s memory"
    if needed > free:
        raise MemoryError(f"{complaint}; {free >> 20} MiB are free")
    try:
        planes = wp.empty((4, height, width), wp.float32, device=device)
    except (RuntimeError, MemoryError) as error:
        raise MemoryError(complaint) from error
    return Raster(planes[0].view(wp.int32), planes[1], planes[2], planes[3])


def _free_memory(device: wp.Device) -> int:
    """Bytes; where the system does not say, more than there can be."""
    if device.is_cuda:
        return device.free_memory
    try:
        rows = Path("/proc/meminfo").read_text().splitlines()
    except OSError:
        return 2**63
    return next((1024 * int(row.split()[1]) for row in rows if row.startswith("MemAvailable:")), 2**63)


def _bins(task: RasterTask) -> int:
    return (((task.width - 1) >> task.shift) + 1) * (((task.height - 1) >> task.shift) + 1)


#: Scratch memory of a picture drawn before, for the next one.
_idle: list[tuple[wp.array, ...]] = []


@contextmanager
def _borrowed(chunks: int, starts: int, keys: int) -> Iterator[tuple[wp.array, ...]]:
    """Entries, starts, large counts and faults for so many chunks, and keys."""
    scratch = _idle.pop() if _idle else None
    if scratch is None or len(scratch[2]) < chunks or len(scratch[1]) < starts or len(scratch[4]) < keys:
        scratch = (
            wp.empty(chunks * _ROOM, wp.int32, device="cpu"),
            wp.empty(starts, wp.int32, device="cpu"),
            wp.empty(chunks, wp.int32, device="cpu"),
            wp.empty(chunks, wp.int32, device="cpu"),
            wp.empty(keys, wp.uint64, device="cpu"),
        )
    try:
        yield scratch
    finally:
        if not _idle:
            _idle.append(scratch)


def _chunks(first_face: np.ndarray, faces: int) -> np.ndarray:
    """(C, 3) int32: the draw of the chunk's first face, that face, number of faces."""
    first = np.arange(0, faces, _CHUNK)
    draw = np.searchsorted(first_face, first, "right") - 1
    return np.stack([draw, first, np.minimum(faces - first, _CHUNK)], 1).astype(np.int32).reshape(-1, 3)
