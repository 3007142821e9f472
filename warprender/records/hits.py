"""Rays, what they find, and the surface point that shading sees."""

from __future__ import annotations

import warp as wp


@wp.struct
class Ray:
    """Points origin + t direction with 0 ≤ t < t_max; t counts in lengths of the direction."""

    origin: wp.vec3
    direction: wp.vec3
    t_max: wp.float32


@wp.struct
class Hit:
    """What a ray or a pixel sees first; a miss has t = inf and ids -1. u weights vertex 1, v vertex 2."""

    t: wp.float32
    instance: wp.int32
    face: wp.int32
    u: wp.float32
    v: wp.float32


@wp.struct
class Surface:
    """A hit point with all that shading needs; both normals are on the side of `outgoing`.

    `error` bounds |position - exact| per axis; `front` says whether the authored normal faces the viewer.
    `footprint` is the width across the ray of what one look-up at the point stands for; 0 is the point alone.
    """

    position: wp.vec3
    error: wp.vec3
    geometric_normal: wp.vec3
    normal: wp.vec3
    outgoing: wp.vec3
    front: wp.int32
    hit: Hit
    geometry: wp.int32
    material: wp.int32
    footprint: wp.float32
