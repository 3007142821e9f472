"""The rasterizer's kernels around the text of raster.h, and the struct that they take."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import warp as wp

OPTIONS = {"fuse_fp": False, "cpu_compiler_flags": "-march=native"}
HEADER = (Path(__file__).parent / "raster.h").read_text()


@wp.struct
class Triangles:
    """Indices (3 F,) of clip positions, or of points that `RasterTask.matrices` takes to clip space."""

    clip: wp.array(dtype=wp.vec4)
    points: wp.array(dtype=wp.vec3)
    indices: wp.array(dtype=wp.int32)


@wp.struct
class RasterTask:
    """One picture of a `DrawList`: draw d shows `meshes[mesh[d]]`, moved by `matrices[d]` where it has points.

    `chunks` (C, 3) has the draw of its first face, that face's number in the picture, and how many faces follow. A
    chunk has `raster._ROOM` integers of `entries`: face numbers sorted by bin, of which bin b has those from
    `starts[b]` on, of (C, bins + 1); then its `large_counts` triangles that lie over many bins. `faults` is a face with
    an index out of range, or -1. `taken` counts the chunks and the bins that threads have taken. `keys` has the
    nearest fragments of a bin for each thread.

    On CUDA `keys` has the nearest fragments of the picture, `entries` the large triangles, `taken` of them. `order` is
    the painter's.
    """

    meshes: wp.array(dtype=Triangles)
    mesh: wp.array(dtype=wp.int32)
    matrices: wp.array(dtype=wp.mat44d)
    first_face: wp.array(dtype=wp.int32)
    chunks: wp.array2d(dtype=wp.int32)
    width: wp.int32
    height: wp.int32
    cull: wp.int32
    shift: wp.int32
    entries: wp.array(dtype=wp.int32)
    starts: wp.array(dtype=wp.int32)
    large_counts: wp.array(dtype=wp.int32)
    faults: wp.array(dtype=wp.int32)
    taken: wp.array(dtype=wp.int32)
    keys: wp.array(dtype=wp.uint64)
    order: wp.array(dtype=wp.int32)
    face: wp.array2d(dtype=wp.int32)
    u: wp.array2d(dtype=wp.float32)
    v: wp.array2d(dtype=wp.float32)
    depth: wp.array2d(dtype=wp.float32)


@cache
def bin_kernel() -> wp.Kernel:
    """Chunks of triangles to bins; an item is a thread at work."""

    @wp.func_native(HEADER + "Binner::run_all(task);")
    def bin_chunks(task: RasterTask): ...

    @wp.kernel(module="unique", enable_backward=False, module_options=OPTIONS)
    def bin_triangles(first: wp.int32, task: RasterTask):
        bin_chunks(task)

    return bin_triangles


@cache
def fill_kernel() -> wp.Kernel:
    """What is in the bins to pixels; an item is a thread at work."""

    @wp.func_native(HEADER + "Tile::run_all(task, worker);")
    def fill_bins(task: RasterTask, worker: wp.int32): ...

    @wp.kernel(module="unique", enable_backward=False, module_options=OPTIONS)
    def draw_bins(first: wp.int32, task: RasterTask):
        fill_bins(task, first + wp.tid())

    return draw_bins


@cache
def keyed_kernels() -> tuple[wp.Kernel, wp.Kernel, wp.Kernel]:
    """One thread a triangle, then one a pixel for the large ones, then one a pixel for what users see."""

    @wp.func_native(HEADER + "Keyed::draw(task, face);")
    def draw_face(task: RasterTask, face: wp.int32): ...

    @wp.func_native(HEADER + "Keyed::draw_large(task, x, y);")
    def draw_large_faces(task: RasterTask, x: wp.int32, y: wp.int32): ...

    @wp.func_native(HEADER + "Keyed::finish(task, x, y);")
    def finish_pixel(task: RasterTask, x: wp.int32, y: wp.int32): ...

    @wp.kernel(module="unique", enable_backward=False, module_options=OPTIONS)
    def draw_faces(first: wp.int32, task: RasterTask):
        draw_face(task, first + wp.tid())

    @wp.kernel(module="unique", enable_backward=False, module_options=OPTIONS)
    def draw_large(first: wp.int32, task: RasterTask):
        pixel = first + wp.tid()
        draw_large_faces(task, pixel % task.width, pixel // task.width)

    @wp.kernel(module="unique", enable_backward=False, module_options=OPTIONS)
    def finish_pixels(first: wp.int32, task: RasterTask):
        pixel = first + wp.tid()
        finish_pixel(task, pixel % task.width, pixel // task.width)

    return draw_faces, draw_large, finish_pixels


@cache
def painter_kernels() -> tuple[wp.Kernel, wp.Kernel]:
    """By what triangles are sorted; and the painting, a band of rows an item."""

    @wp.func_native(HEADER + "return Painter::depth(task, face);")
    def sort_depth(task: RasterTask, face: wp.int32) -> wp.float32: ...

    @wp.func_native(HEADER + "Painter::band(task, number);")
    def paint_band(task: RasterTask, number: wp.int32): ...

    @wp.kernel(module="unique", enable_backward=False, module_options=OPTIONS)
    def measure(first: wp.int32, task: RasterTask, depth: wp.array(dtype=wp.float32)):
        face = first + wp.tid()
        depth[face] = sort_depth(task, face)

    @wp.kernel(module="unique", enable_backward=False, module_options=OPTIONS)
    def paint_bands(first: wp.int32, task: RasterTask):
        paint_band(task, first + wp.tid())

    return measure, paint_bands
