"""The camera light: what usdrecord adds to a stage without lights."""

from __future__ import annotations

from dataclasses import dataclass

import warp as wp

from ..numerics import PI
from ..records import DeviceScene, LightRecord, LightSample
from .light import Light, no_light


@dataclass
class CameraLight(Light):
    """A point at the camera without falloff: a facing white Lambert surface reads 1 at any distance.

    What all lights have, as `intensity` and `color`, is in `Light`.
    """

    infinite = True

    def is_delta(self) -> bool:
        """A point."""
        return True

    def power(self, scene_radius: float) -> float:
        """Power through a disk as large as the scene."""
        return self.brightness() * (3.14159 * scene_radius) ** 2


@wp.func
def sample(scene: DeviceScene, light: LightRecord, p: wp.vec3, u: wp.vec2) -> LightSample:
    """The direction to the camera; an irradiance of π makes a white Lambert surface read 1."""
    result = no_light()
    towards = scene.eye - p
    distance = wp.length(towards)
    if distance > 0.0:
        result.direction = towards / distance
        result.distance = distance
        result.radiance = light.radiance * PI
        result.pdf = 1.0
        result.delta = 1
    return result


@wp.func
def meet(scene: DeviceScene, light: LightRecord, origin: wp.vec3, direction: wp.vec3) -> LightSample:
    """Nothing: a point."""
    return no_light()
