"""Rays through a whole scene: the trees of triangles and quadrics, and signed distance functions beside them."""

from __future__ import annotations

from functools import cache

import warp as wp

from . import rays


@cache
def ray_functions(sdfs: tuple[wp.Function, ...] = ()) -> tuple[wp.Function, wp.Function, wp.Function]:
    """`closest(scene, ray)`, `closest_after(scene, ray, hit)` and `occluded(scene, ray)`.

    Args:
        sdfs: the signed distance functions that occur; without any these are the functions of `rays`.
    """
    return rays.closest, rays.closest_after, rays.occluded
