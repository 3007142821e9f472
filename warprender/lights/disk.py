"""UsdLuxDiskLight: uniform over its area."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..numerics import PI
from ..records import DeviceScene, LightRecord, LightSample
from ..sampling import unit_disk
from .light import Light, flat_to_world, forwards, local_sample, no_light, point_to_light


@dataclass
class DiskLight(Light):
    """A disk in the local XY plane, centred, that emits towards local -Z.

    What all lights have, as `intensity` and `color`, is in `Light`.

    Attributes:
        radius: in light space: scene units unless `transform` scales.
    """

    radius: float = 0.5

    def size(self) -> tuple[float, float, float]:
        """Radius."""
        return (self.radius, 0.0, 0.0)

    def size_factor(self) -> float:
        """World area of the ellipse."""
        x, y, _ = self.local_to_world() * self.radius
        return float(np.pi * np.linalg.norm(np.cross(x, y)))

    def half_extent(self) -> tuple[float, float, float]:
        """Flat."""
        return (self.radius, self.radius, 0.0)

    def emission_cone(self) -> tuple[np.ndarray, float, float]:
        """To one side."""
        return forwards(self)

    def local_to_world(self) -> np.ndarray:
        """(3, 3) for row vectors."""
        return flat_to_world(self.transform)


@wp.func
def disk_pdf(radius: float, direction: wp.vec3, distance: float) -> float:
    """Density per solid angle of light space of a point uniform over the disk's area."""
    return distance * distance / (PI * radius * radius * wp.max(direction[2], 1.0e-20))


@wp.func
def sample(scene: DeviceScene, light: LightRecord, p: wp.vec3, u: wp.vec2) -> LightSample:
    """A direction from p to the light."""
    q = point_to_light(light, p)
    if q[2] >= 0.0:
        return no_light()
    place = unit_disk(u) * light.size[0]
    to_place = wp.vec3(place[0] - q[0], place[1] - q[1], -q[2])
    distance = wp.length(to_place)
    direction = to_place / distance
    return local_sample(light, direction, distance, disk_pdf(light.size[0], direction, distance))


@wp.func
def meet(scene: DeviceScene, light: LightRecord, origin: wp.vec3, direction: wp.vec3) -> LightSample:
    """What a ray meets of the light."""
    q = point_to_light(light, origin)
    local = wp.normalize(light.inverse * direction)
    if q[2] >= 0.0 or local[2] <= 0.0:
        return no_light()
    t = -q[2] / local[2]
    x = q[0] + t * local[0]
    y = q[1] + t * local[1]
    if x * x + y * y > light.size[0] * light.size[0]:
        return no_light()
    return local_sample(light, local, t, disk_pdf(light.size[0], local, t))
