"""What integrators know of light on its way: where a ray comes from, which medium it is in, how much of it arrives.

Light reaches a surface aimed at (`aiming.py`), met by chance, or from geometry that glows (both `meeting.py`). Each way
weighs itself against the others (multiple importance sampling, Veach 1997, power heuristic).
"""

from __future__ import annotations

import warp as wp

from ..numerics import GAMMA_7, INFINITY, max_component
from ..records import Bsdf, LightRecord, Surface


@wp.struct
class Departure:
    """Where a ray comes from, as the lights that it meets must know.

    `pdf` is the density of its direction: 0 after a delta event and at the camera, where no light was aimed at.
    `prim` is -1 at the camera. The throughput is split as the lights' `diffuse` and `specular` need it. `normal` is
    zero where light arrives from both sides. `absorption` is that of the medium that lies ahead, per scene unit.
    """

    position: wp.vec3
    normal: wp.vec3
    prim: wp.int32
    pdf: wp.float32
    diffuse: wp.vec3
    specular: wp.vec3
    absorption: wp.vec3


@wp.struct
class Visible:
    """Which lights the camera sees."""

    domes: wp.int32
    lights: wp.int32


@wp.struct
class Met:
    """Radiance from lights that a ray met, and how many there were."""

    radiance: wp.vec3
    count: wp.int32


@wp.func
def end_margin(origin: wp.vec3, distance: float) -> float:
    """How far rounding may put a point at this distance before or behind its place."""
    margin = wp.float32(0.0)
    if distance < INFINITY:
        margin = (max_component(wp.abs(origin)) + distance) * GAMMA_7
    return margin


@wp.func
def transmittance(absorption: wp.vec3, distance: float) -> wp.vec3:
    """What is left of light after a way through a medium (Beer's law); the distance may be infinite."""
    left = wp.vec3(1.0, 1.0, 1.0)
    for c in range(3):
        if absorption[c] > 0.0:
            left[c] = wp.exp(-absorption[c] * distance)
    return left


@wp.func
def medium_towards(surface: Surface, bsdf: Bsdf, around: wp.vec3, direction: wp.vec3) -> wp.vec3:
    """Absorption of what lies beside a surface in this direction, where the medium on the viewer's side is `around`.

    Outside of what refracts is vacuum, inside its own medium.
    """
    if bsdf.eta <= 0.0 or bsdf.thin != 0:
        return around
    if (wp.dot(surface.geometric_normal, direction) > 0.0) == (surface.front != 0):
        return wp.vec3(0.0, 0.0, 0.0)
    return bsdf.absorption


@wp.func
def light_normal(surface: Surface, bsdf: Bsdf) -> wp.vec3:
    """Normal by which lights are chosen; zero where light from below is scattered too."""
    if bsdf.eta > 0.0:
        return wp.vec3(0.0, 0.0, 0.0)
    return surface.geometric_normal


@wp.func
def is_across(surface: Surface, local: wp.vec3, direction: wp.vec3) -> bool:
    """Whether a direction lies on another side of the true surface than of the shading frame, where it is `local`."""
    cosine = wp.dot(surface.geometric_normal, direction)
    if local[2] < 0.0:
        return cosine >= 0.0
    return cosine <= 0.0


@wp.func
def share_of(light: LightRecord, departure: Departure) -> wp.vec3:
    """Throughput that a light's radiance arrives with; the camera sees the light itself."""
    if departure.prim < 0:
        return departure.diffuse + departure.specular
    return departure.diffuse * light.diffuse + departure.specular * light.specular
