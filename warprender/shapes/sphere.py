"""UsdGeomSphere: an exact quadric about the origin of its object space."""

from __future__ import annotations

from dataclasses import dataclass, field

import warp as wp

from ..numerics import GAMMA_5
from ..records import GeometryRecord, Hit
from .local_surface import LocalSurface
from .primvar import Primvar


@dataclass
class Sphere:
    """A sphere about the origin of object space.

    Attributes:
        radius: in scene units; 0 and below draw nothing.
        primvars: name to `Primvar`; only the first value is used, a quadric has no faces or points.
    """

    radius: float = 1.0
    primvars: dict[str, Primvar] = field(default_factory=dict)


@wp.func
def intersect_sphere(radius: float, origin: wp.vec3, direction: wp.vec3) -> wp.vec2:
    """Both distances along a direction of any length, near first; both negative on a miss.

    The discriminant comes from the perpendicular vector, which does not cancel far away (Haines et al., Ray Tracing
    Gems, chapter 7).
    """
    a = wp.dot(direction, direction)
    b = -wp.dot(origin, direction)
    perpendicular = origin + direction * (b / a)
    discriminant = radius * radius - wp.dot(perpendicular, perpendicular)
    if not discriminant >= 0.0:
        return wp.vec2(-1.0, -1.0)
    c = wp.dot(origin, origin) - radius * radius
    q = b + wp.where(b >= 0.0, 1.0, -1.0) * wp.sqrt(a * discriminant)
    near = wp.where(q == 0.0, 0.0, c / wp.where(q == 0.0, 1.0, q))
    far = q / a
    return wp.vec2(wp.min(near, far), wp.max(near, far))


@wp.func
def sphere_surface(geometry: GeometryRecord, hit: Hit, origin: wp.vec3, direction: wp.vec3) -> LocalSurface:
    """The hit point, moved onto the sphere, which leaves an error of γ(5) (pbrt-v4 §6.8.5)."""
    local = LocalSurface()
    p = origin + direction * hit.t
    p = p * (geometry.radius / wp.length(p))
    local.position = p
    local.error = wp.abs(p) * GAMMA_5
    local.geometric_normal = p
    local.normal = p
    return local
