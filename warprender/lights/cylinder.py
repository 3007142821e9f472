"""UsdLuxCylinderLight: its side, seen from a point, in cylindrical coordinates about its axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..records import DeviceScene, LightRecord, LightSample
from .light import Light, linear_part, local_sample, no_light, point_to_light


@dataclass
class CylinderLight(Light):
    """A cylinder about local X that emits outwards from its side; its ends do not emit.

    Directions are drawn with a uniform azimuth about the axis over the arc that the cylinder fills, then uniformly in
    the sine of the elevation between its ends: near enough uniform in solid angle that nothing is singular.

    What all lights have, as `intensity` and `color`, is in `Light`.

    Attributes:
        length: along X, in light space.
        radius: in light space.
        treatAsLine: may be sampled as a line of the same power; drawn as the cylinder that it is.
    """

    length: float = 1.0
    radius: float = 0.5
    treatAsLine: bool = False

    def size(self) -> tuple[float, float, float]:
        """Half the length, radius."""
        return (self.length / 2, self.radius, 0.0)

    def size_factor(self) -> float:
        """World area of the side: length by the perimeter of the ellipse (Ramanujan)."""
        length, a, b = np.linalg.norm(linear_part(self.transform), axis=1) * (self.length, self.radius, self.radius)
        return float(length * np.pi * (3 * (a + b) - np.sqrt((3 * a + b) * (a + 3 * b))))

    def half_extent(self) -> tuple[float, float, float]:
        """Half the length along X, the radius across."""
        return (self.length / 2, self.radius, self.radius)


@wp.func
def arc_of(radius: float, away: float) -> float:
    """Half the azimuth that a circle fills, seen from outside."""
    return wp.asin(wp.min(radius / away, 1.0))


@wp.func
def reach(radius: float, away: float, azimuth: float) -> float:
    """Distance across the axis to the near side, for an azimuth from the direction to the axis."""
    across = away * wp.sin(azimuth)
    return away * wp.cos(azimuth) - wp.sqrt(wp.max((radius - across) * (radius + across), 0.0))


@wp.func
def sine_of(x: float, across: float) -> float:
    """Sine of the elevation of a point at x along and `across` away from the axis."""
    return x / wp.sqrt(x * x + across * across)


@wp.func
def sample(scene: DeviceScene, light: LightRecord, p: wp.vec3, u: wp.vec2) -> LightSample:
    """A direction from p to the light."""
    q = point_to_light(light, p)
    half = light.size[0]
    radius = light.size[1]
    away = wp.sqrt(q[1] * q[1] + q[2] * q[2])
    if away <= radius:
        return no_light()
    arc = arc_of(radius, away)
    azimuth = (2.0 * u[0] - 1.0) * arc
    across = wp.max(reach(radius, away, azimuth), away * 1.0e-7)
    low = sine_of(-half - q[0], across)
    high = sine_of(half - q[0], across)
    if high <= low:
        return no_light()
    sine = wp.clamp(low + u[1] * (high - low), low, high)
    cosine = wp.sqrt(wp.max((1.0 - sine) * (1.0 + sine), 1.0e-12))
    # From the direction to the axis, turned by the azimuth about X.
    y = -q[1] / away
    z = -q[2] / away
    c = wp.cos(azimuth) * cosine
    s = wp.sin(azimuth) * cosine
    direction = wp.vec3(sine, y * c - z * s, z * c + y * s)
    return local_sample(light, direction, across / cosine, 1.0 / (2.0 * arc * (high - low)))


@wp.func
def meet(scene: DeviceScene, light: LightRecord, origin: wp.vec3, direction: wp.vec3) -> LightSample:
    """What a ray meets of the light."""
    q = point_to_light(light, origin)
    local = wp.normalize(light.inverse * direction)
    half = light.size[0]
    radius = light.size[1]
    away = wp.sqrt(q[1] * q[1] + q[2] * q[2])
    flat = wp.sqrt(local[1] * local[1] + local[2] * local[2])
    if away <= radius or flat <= 0.0:
        return no_light()
    y = local[1] / flat
    z = local[2] / flat
    # How far the ray passes the axis by, from the cross product: it does not cancel far away.
    across = (q[1] * z - q[2] * y) / away
    toward = -(q[1] * y + q[2] * z) / away
    if toward <= 0.0 or wp.abs(across) * away > radius:
        return no_light()
    azimuth = wp.atan2(across, toward)
    distance = wp.max(reach(radius, away, azimuth), away * 1.0e-7)
    t = distance / flat
    if wp.abs(q[0] + t * local[0]) > half:
        return no_light()
    low = sine_of(-half - q[0], distance)
    high = sine_of(half - q[0], distance)
    if high <= low:
        return no_light()
    return local_sample(light, local, t, 1.0 / (2.0 * arc_of(radius, away) * (high - low)))
