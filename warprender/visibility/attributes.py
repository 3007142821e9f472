"""What vertices carry, at every pixel of a `Raster`: perspective-correct, for its weights are."""

from __future__ import annotations

from functools import cache

import numpy as np
import warp as wp

from ..launch import launch_pixels
from .raster import Raster
from .raster_input import index_array

_DTYPES = {1: wp.float32, 2: wp.vec2, 3: wp.vec3, 4: wp.vec4}

# `pixel` and the `columns` - 1 after it. Runs of pixels that see nothing are passed over eight at a time.
_RUN = """
const int channels = CHANNELS;
const unsigned count = (unsigned)(values.shape[0] / channels);
const long long corners = indices.shape[0];
int fault = -1;
for (int x = 0; x < columns; ++x) {
    const int* seen = face.data + pixel + x;
    float* to = out.data + (pixel + x) * channels;
    if (seen[0] < 0 && x + 8 <= columns) {
        int all = seen[0];
        for (int lane = 1; lane < 8; ++lane)
            all &= seen[lane];
        if (all < 0) {
            for (int c = 0; c < 8 * channels; ++c)
                to[c] = 0.0f;
            x += 7;
            continue;
        }
    }
    float value[channels] = {};
    if (seen[0] >= 0) {
        const long long corner = 3 * (long long)(seen[0]);
        const int* index = indices.data + corner;
        if (corner + 2 < corners && (unsigned)(index[0]) < count && (unsigned)(index[1]) < count
            && (unsigned)(index[2]) < count) {
            const float* p = values.data + (long long)(index[0]) * channels;
            const float* q = values.data + (long long)(index[1]) * channels;
            const float* r = values.data + (long long)(index[2]) * channels;
            float a = u.data[pixel + x], b = v.data[pixel + x], length = 0.0f;
            for (int c = 0; c < channels; ++c) {
                value[c] = p[c] + (q[c] - p[c]) * a + (r[c] - p[c]) * b;
                length += value[c] * value[c];
            }
            float scale = NORMALIZE ? (length > 0.0f ? 1.0f / ::sqrtf(length) : 0.0f) : 1.0f;
            for (int c = 0; c < channels; ++c)
                value[c] *= scale;
        } else
            fault = seen[0];
    }
    for (int c = 0; c < channels; ++c)
        to[c] = value[c];
}
return fault;
"""


@cache
def _kernel(channels: int, normalize: bool) -> wp.Kernel:
    body = _RUN.replace("CHANNELS", str(channels)).replace("NORMALIZE", str(normalize).lower())

    @wp.func_native(body)
    def interpolate_run(
        pixel: wp.int64,
        columns: wp.int32,
        face: wp.array(dtype=wp.int32),
        u: wp.array(dtype=wp.float32),
        v: wp.array(dtype=wp.float32),
        indices: wp.array(dtype=wp.int32),
        values: wp.array(dtype=wp.float32),
        out: wp.array(dtype=wp.float32),
    ) -> wp.int32: ...

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": "-march=native"})
    def interpolate_pixels(
        first: wp.int32,
        columns: wp.int32,
        face: wp.array(dtype=wp.int32),
        u: wp.array(dtype=wp.float32),
        v: wp.array(dtype=wp.float32),
        indices: wp.array(dtype=wp.int32),
        values: wp.array(dtype=wp.float32),
        width: wp.int32,
        faults: wp.array(dtype=wp.int32),
        out: wp.array(dtype=wp.float32),
    ):
        pixel = wp.int64(first + wp.tid()) * wp.int64(columns)
        fault = interpolate_run(pixel, columns, face, u, v, indices, values, out)
        if fault >= 0:
            faults[wp.int32(pixel // wp.int64(width))] = fault

    return interpolate_pixels


def interpolate(
    seen: Raster,
    indices: np.ndarray | wp.array,
    values: np.ndarray | wp.array,
    normalize: bool = False,
    threads: int | None = None,
    into: wp.array | None = None,
) -> wp.array:
    """Values at vertices, as normals or texture coordinates, at every pixel.

    Args:
        seen: what `rasterize` found.
        indices: (F, 3) or (3 F,) int: those that were drawn, or others of as many faces for values with seams.
        values: (N,) or (N, C) float32 with C up to 4, numpy, or a `wp.array` of float32, vec2, vec3 or vec4.
        normalize: make the interpolated values unit vectors; what has no length stays 0.
        threads: CPU threads, None for all cores. The result does not depend on it.
        into: an earlier result of this shape to write over.

    Returns:
        (H, W) of float32 or of vectors of C; 0 where nothing is seen.

    Raises:
        ValueError: a shape or an index out of range.
    """
    device = seen.face.device
    indices, values, channels = index_array(indices, device), *_flat(values, device)
    height, width = seen.face.shape
    dtype = _DTYPES[channels]
    if into is not None and (into.shape != (height, width) or into.dtype != dtype or not into.is_contiguous):
        raise ValueError(f"into must be a contiguous ({height}, {width}) array of {dtype.__name__}")
    out = wp.empty((height, width), dtype, device=device) if into is None else into
    faults = wp.full(height, -1, wp.int32, device=device)
    planes = [plane.flatten() for plane in (seen.face, seen.u, seen.v)]
    arguments = [*planes, indices, values, width, faults, _as_floats(out)]
    launch_pixels(_kernel(channels, bool(normalize)), width, height, arguments, device, threads)
    if (fault := int(faults.numpy().max())) >= 0:
        raise ValueError(f"triangle {fault} has no three indices of {len(values) // channels} values")
    return out


def _flat(values: np.ndarray | wp.array, device: wp.Device) -> tuple[wp.array, int]:
    """The values as float32 one after the other, and how many belong together."""
    if not isinstance(values, wp.array):
        values = wp.array(np.asarray(values, np.float32), dtype=wp.float32, device=device)
    shape = (*values.shape, *getattr(values.dtype, "_shape_", ()))
    floats = getattr(values.dtype, "_wp_scalar_type_", values.dtype) is wp.float32
    channels = shape[1] if len(shape) == 2 else 1
    if not floats or len(shape) not in (1, 2) or channels not in _DTYPES:
        raise ValueError(f"values must be (N,) or (N, 1…4) of float32, not {shape} of {values.dtype.__name__}")
    return _as_floats(values.contiguous().to(device)), channels


def _as_floats(values: wp.array) -> wp.array:
    """The same memory, as numbers one after the other."""
    return values.view(wp.float32).flatten() if values.size else wp.empty(0, wp.float32, device=values.device)
