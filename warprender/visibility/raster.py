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
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import warp as wp

from ..launch import launch

#: Pixels along a side of the picture, at most: the error bounds of raster.h count on it.
LARGEST_SIDE = 32768
#: Triangles in a chunk, entries that it may leave in bins, and bins at most: `Binner` in raster.h.
_CHUNK, _ROOM, _MOST_BINS = 2048, 16384, 1024
_SMALLEST_SHIFT = 6

_CULL = {"none": 0, "back": -1, "front": 1}
_OPTIONS = {"fuse_fp": False, "cpu_compiler_flags": "-march=native"}
_HEADER = (Path(__file__).parent / "raster.h").read_text()


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


@wp.struct
class Draw:
    """Triangles (F, 3): of clip positions, or of points that `RasterTask.matrices` takes to clip space."""

    clip: wp.array(dtype=wp.vec4)
    points: wp.array(dtype=wp.vec3)
    indices: wp.array(dtype=wp.int32)


@wp.struct
class RasterTask:
    """One picture. A face's number in the picture is `first_face` of its draw plus its index there.

    `chunks` (C, 3) has draw, first face and number of faces. A chunk leaves `_ROOM` `entries`, sorted by bin; bin b
    has those from `starts[b]` on, of (C, bins + 1); the last `_CHUNK` of them are its `large_counts` triangles that lie
    over many bins. `faults` is a face with an index out of range, or -1.
    """

    draws: wp.array(dtype=Draw)
    matrices: wp.array(dtype=wp.mat44d)
    first_face: wp.array(dtype=wp.int32)
    chunks: wp.array2d(dtype=wp.int32)
    width: wp.int32
    height: wp.int32
    cull: wp.int32
    shift: wp.int32
    entries: wp.array(dtype=wp.vec3i)
    starts: wp.array(dtype=wp.int32)
    large_counts: wp.array(dtype=wp.int32)
    faults: wp.array(dtype=wp.int32)
    face: wp.array2d(dtype=wp.int32)
    u: wp.array2d(dtype=wp.float32)
    v: wp.array2d(dtype=wp.float32)
    depth: wp.array2d(dtype=wp.float32)


@cache
def _bin_kernel() -> wp.Kernel:
    @wp.func_native(_HEADER + "Binner::run(task, chunk);")
    def bin_chunk(task: RasterTask, chunk: wp.int32): ...

    @wp.kernel(module="unique", enable_backward=False, module_options=_OPTIONS)
    def bin_triangles(first: wp.int32, task: RasterTask):
        bin_chunk(task, first + wp.tid())

    return bin_triangles


@cache
def _fill_kernel() -> wp.Kernel:
    @wp.func_native(_HEADER + "Tile::run(task, bin);")
    def fill_bin(task: RasterTask, bin: wp.int32): ...

    @wp.kernel(module="unique", enable_backward=False, module_options=_OPTIONS)
    def fill_bins(first: wp.int32, task: RasterTask):
        fill_bin(task, first + wp.tid())

    return fill_bins


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
    device = _device_of(clip_positions, indices, device)
    _check_size(width, height)
    if cull not in _CULL:
        raise ValueError(f"cull {cull!r} is not one of none, back, front")
    positions = _positions(clip_positions, device)
    triangles = _indices(indices, device)
    draw = Draw()
    draw.clip, draw.indices = positions, triangles
    task = draw_list([draw], [len(triangles) // 3], device)
    task.cull = _CULL[cull]
    seen = draw_picture(task, width, height, device, threads)
    return seen


def draw_list(draws: Sequence[Draw], faces: Sequence[int], device: wp.Device) -> RasterTask:
    """A task for these draws, of so many triangles each; its matrices are zero until they are set."""
    first = np.concatenate([[0], np.cumsum(faces)]).astype(np.int64)
    if first[-1] >= 2**31 - 1:
        raise ValueError(f"{first[-1]} triangles are more than one picture has face numbers for")
    chunks = _chunks(np.asarray(faces, np.int64))
    task = RasterTask()
    task.draws = wp.array(draws, dtype=Draw, device=device)
    task.matrices = wp.zeros(len(draws), wp.mat44d, device=device)
    task.first_face = wp.array(first[:-1].astype(np.int32), dtype=wp.int32, device=device)
    task.chunks = wp.array(chunks.reshape(-1), dtype=wp.int32, device=device).reshape((-1, 3))
    return task


def draw_picture(
    task: RasterTask, width: int, height: int, device: wp.Device, threads: int | None = None
) -> Raster:
    """Rasterize a draw list.

    Raises:
        ValueError: an index is out of range.
        MemoryError: the picture does not fit the device's memory.
    """
    task.width, task.height = width, height
    seen = _new_picture(width, height, device)
    task.face, task.u, task.v, task.depth = seen
    _draw_on_cpu(task, device, threads)
    return seen


def _new_picture(width: int, height: int, device: wp.Device) -> Raster:
    # One block: the allocator keeps blocks of this size for the next picture, while four smaller ones go back to the
    # system, and fresh pages cost more than the drawing.
    try:
        planes = wp.empty((4, height, width), wp.float32, device=device)
    except (RuntimeError, MemoryError) as error:
        raise MemoryError(f"a picture of {width}x{height} pixels does not fit the memory of {device}") from error
    return Raster(planes[0].view(wp.int32), planes[1], planes[2], planes[3])


def _draw_on_cpu(task: RasterTask, device: wp.Device, threads: int | None) -> None:
    chunks = task.chunks.shape[0]
    task.shift = _SMALLEST_SHIFT
    while _bins(task) > _MOST_BINS:
        task.shift += 1
    bins = _bins(task)
    with _borrowed(chunks, chunks * (bins + 1)) as scratch:
        task.entries, task.starts, task.large_counts, task.faults = scratch
        launch(_bin_kernel(), chunks, [task], device, threads, smallest_chunk=1)
        faults = task.faults.numpy()[:chunks]
        if (faults >= 0).any():
            _raise_fault(task, int(np.flatnonzero(faults >= 0)[0]))
        launch(_fill_kernel(), bins, [task], device, threads, smallest_chunk=1)


def _bins(task: RasterTask) -> int:
    return (((task.width - 1) >> task.shift) + 1) * (((task.height - 1) >> task.shift) + 1)


#: Scratch memory of pictures drawn before, for the next one: fresh pages cost more than the drawing.
_idle: list[tuple[wp.array, ...]] = []


@contextmanager
def _borrowed(chunks: int, starts: int) -> Iterator[tuple[wp.array, ...]]:
    """Entries, starts, large counts and faults for so many chunks."""
    scratch = _idle.pop() if _idle else None
    if scratch is None or scratch[0].shape[0] < chunks * _ROOM or scratch[1].shape[0] < starts:
        scratch = (
            wp.empty(chunks * _ROOM, wp.vec3i, device="cpu"),
            wp.empty(starts, wp.int32, device="cpu"),
            wp.empty(chunks, wp.int32, device="cpu"),
            wp.empty(chunks, wp.int32, device="cpu"),
        )
    try:
        yield scratch
    finally:
        if not _idle:
            _idle.append(scratch)


def _raise_fault(task: RasterTask, chunk: int) -> None:
    face = int(task.faults.numpy()[chunk])
    draw = task.draws.numpy()
    raise ValueError(f"triangle {face} has an index out of range")


def _chunks(faces: np.ndarray) -> np.ndarray:
    """(C, 3) int32: draw, first face in it, number of faces."""
    per_draw = -(-faces // _CHUNK)
    draw = np.repeat(np.arange(len(faces)), per_draw)
    nth = np.arange(len(draw)) - np.repeat(np.cumsum(per_draw) - per_draw, per_draw)
    first = nth * _CHUNK
    return np.stack([draw, first, np.minimum(faces[draw] - first, _CHUNK)], 1).astype(np.int32)


def _device_of(positions: np.ndarray | wp.array, indices: np.ndarray | wp.array, device: object) -> wp.Device:
    if device is None:
        device = next((a.device for a in (positions, indices) if isinstance(a, wp.array)), "cpu")
    return wp.get_device(device)


def _check_size(width: int, height: int) -> None:
    for name, size in (("width", width), ("height", height)):
        if size != int(size) or not 1 <= size <= LARGEST_SIDE:
            raise ValueError(f"{name} must be 1…{LARGEST_SIDE} pixels, not {size}")


def _positions(positions: np.ndarray | wp.array, device: wp.Device) -> wp.array:
    if not isinstance(positions, wp.array):
        positions = np.asarray(positions)
        if positions.ndim != 2 or positions.shape[1] != 4:
            raise ValueError(f"clip positions must have shape (N, 4), not {positions.shape}")
        return wp.array(np.ascontiguousarray(positions, np.float32), dtype=wp.vec4, device=device)
    if positions.dtype == wp.float32 and positions.ndim == 2 and positions.shape[1] == 4:
        positions = positions.contiguous().view(wp.vec4).flatten() if positions.size else wp.empty(0, wp.vec4)
    if positions.dtype != wp.vec4 or positions.ndim != 1:
        raise ValueError(f"clip positions must be (N,) vec4 or (N, 4) float32, not {positions.shape} {positions.dtype}")
    return positions.contiguous().to(device)


def _indices(indices: np.ndarray | wp.array, device: wp.Device) -> wp.array:
    shape = tuple(indices.shape if isinstance(indices, wp.array) else np.shape(indices))
    if len(shape) not in (1, 2) or (len(shape) == 2 and shape[1] != 3) or int(np.prod(shape)) % 3:
        raise ValueError(f"indices must have shape (F, 3) or (3 F,), not {shape}")
    if isinstance(indices, wp.array) and indices.dtype == wp.int32:
        return indices.contiguous().flatten().to(device)
    host = np.reshape(indices.numpy() if isinstance(indices, wp.array) else indices, -1)
    if not host.size:
        return wp.empty(0, wp.int32, device=device)
    if host.dtype.kind not in "iu":
        raise ValueError(f"indices must be integers, not {host.dtype}")
    if host.dtype != np.int32:
        # What int32 cannot hold is out of range as it is; -1 says so to the kernel.
        host = np.where((host < 0) | (host > 2**31 - 1), -1, host).astype(np.int32)
    return wp.array(host, dtype=wp.int32, device=device)
