"""What a shape says of a hit point, in its object space."""

from __future__ import annotations

import warp as wp


@wp.struct
class LocalSurface:
    """A hit point in object space: position with its error bound, geometric and shading normal, not unit."""

    position: wp.vec3
    error: wp.vec3
    geometric_normal: wp.vec3
    normal: wp.vec3
    face: wp.int32
