"""The camera as kernels see it."""

from __future__ import annotations

import warp as wp


@wp.struct
class CameraRecord:
    """A camera: `rotation` has right, up and backward as columns; the window is at distance 1 (or in scene units).

    `window` is left, bottom, right, top. `near` and `far` are along -Z. `lens_radius` 0 is a pinhole. `planes`
    (a, b, c, d) are in camera space; where a x + b y + c z + d < 0 nothing is seen.
    """

    position: wp.vec3
    rotation: wp.mat33
    window: wp.vec4
    width: wp.int32
    height: wp.int32
    near: wp.float32
    far: wp.float32
    lens_radius: wp.float32
    focus_distance: wp.float32
    orthographic: wp.int32
    origin: wp.vec3
    planes: wp.array(dtype=wp.vec4)
