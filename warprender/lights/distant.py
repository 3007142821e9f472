"""UsdLuxDistantLight: uniform over a cone of directions, or one direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..numerics import PI, from_frame, tangent_of
from ..records import DeviceScene, LightRecord, LightSample
from ..sampling import uniform_cone
from .light import Light, infinite_sample, linear_part, no_light


@dataclass
class DistantLight(Light):
    """Light from infinitely far away, of one radiance within a cone; its intensity defaults to 50000.

    What all lights have, as `intensity` and `color`, is in `Light`.

    Attributes:
        intensity: radiance; illuminance on a facing surface when normalised or when `angle` is 0.
        angle: full angle of the cone in degrees; 0 is a delta light.
        direction: where the light travels, in light space.
    """

    intensity: float = 50000.0
    angle: float = 0.53
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)

    infinite = True

    def half_angle(self) -> float:
        """Half the cone's angle in radians, clamped to 0…π."""
        return float(np.clip(np.radians(self.angle) / 2.0, 0.0, np.pi))

    def is_delta(self) -> bool:
        """Parallel light, where the angle is 0."""
        return self.half_angle() == 0.0

    def size(self) -> tuple[float, float, float]:
        """1 - cos of the half angle."""
        return (2.0 * np.sin(self.half_angle() / 2.0) ** 2, 0.0, 0.0)

    def size_factor(self) -> float:
        """Illuminance of a facing surface under radiance 1 (UsdLux: sizeFactor of a distant light)."""
        theta = self.half_angle()
        if theta == 0.0:
            return 1.0
        sin2 = np.sin(theta) ** 2
        return float(np.pi * (sin2 if theta <= np.pi / 2 else 2.0 - sin2))

    def power(self, scene_radius: float) -> float:
        """Power through a disk as large as the scene."""
        return self.brightness() * self.size_factor() * np.pi * scene_radius**2

    def local_to_world(self) -> np.ndarray:
        """(3, 3) whose last row is the unit direction towards the light; scale and shear drop out."""
        towards = -np.asarray(self.direction, np.float64) @ linear_part(self.transform)
        length = np.linalg.norm(towards)
        if not 0.0 < length < np.inf:
            return np.zeros((3, 3))
        towards = towards / length
        # Local X where it can be, so that a photometric profile keeps its azimuth.
        side = linear_part(self.transform)[0]
        side = side - (side @ towards) * towards
        if np.linalg.norm(side) < 1e-6 * np.linalg.norm(linear_part(self.transform)[0]):
            side = np.cross(np.eye(3)[np.argmin(np.abs(towards))], towards)
        side = side / np.linalg.norm(side)
        return np.stack([side, np.cross(towards, side), towards])


@wp.func
def axis_of(light: LightRecord) -> wp.vec3:
    """Unit direction towards the middle of the light, as the host has made it."""
    return wp.vec3(light.linear[0, 2], light.linear[1, 2], light.linear[2, 2])


@wp.func
def sample(scene: DeviceScene, light: LightRecord, p: wp.vec3, u: wp.vec2) -> LightSample:
    """A direction towards the light; a light of angle 0 is a delta light with pdf 1."""
    axis = axis_of(light)
    cone = light.size[0]
    if cone <= 0.0:
        result = infinite_sample(axis, light.radiance, 1.0)
        result.delta = 1
        return result
    direction = from_frame(tangent_of(axis), axis, uniform_cone(u, cone))
    return infinite_sample(direction, light.radiance, 1.0 / (2.0 * PI * cone))


@wp.func
def meet(scene: DeviceScene, light: LightRecord, origin: wp.vec3, direction: wp.vec3) -> LightSample:
    """What a ray meets of the light."""
    cone = light.size[0]
    # |a - b|² / 2 = 1 - cos, without cancellation for narrow cones.
    away = direction - axis_of(light)
    if cone <= 0.0 or 0.5 * wp.dot(away, away) > cone:
        return no_light()
    return infinite_sample(direction, light.radiance, 1.0 / (2.0 * PI * cone))
