"""UsdGeomSphere: an exact quadric about the origin of its object space."""

from __future__ import annotations

from dataclasses import dataclass, field

import warp as wp

from ..numerics import sphere_point
from ..records import Hit
from ..watched import Watched
from .local_surface import LocalSurface
from .primvar import Primvar


@dataclass
class Sphere(Watched):
    """A sphere about the origin of object space.

    Attributes:
        radius: in scene units; 0 and below draw nothing.
        primvars: name to `Primvar`; only the first value is used, a quadric has no faces or points.
    """

    radius: float = 1.0
    primvars: dict[str, Primvar] = field(default_factory=dict)


@wp.func
def sphere_surface(radius: float, hit: Hit, origin: wp.vec3, direction: wp.vec3) -> LocalSurface:
    """The hit point, moved onto the sphere, which leaves an error of γ(5) (pbrt-v4 §6.8.5)."""
    position, error = sphere_point(radius, origin + direction * hit.t)
    local = LocalSurface()
    local.position = position
    local.error = error
    local.geometric_normal = position
    local.normal = position
    return local
