"""UsdLuxDomeLight without a texture."""

from __future__ import annotations

from dataclasses import dataclass

import warp as wp

from ..records import LightRecord, LightSample
from .light import Light, infinite_sample


@dataclass
class DomeLight(Light):
    """Light of one colour from every direction. `normalize` does not change it.

    Rays that leave a surface find it. Next-event estimation does not sample it: where radiance does not depend on
    the direction, no choice of directions is better than the material's own.
    """

    def power(self, scene_radius: float) -> float:
        """Zero: never chosen by next-event estimation."""
        return 0.0


@wp.func
def sample(light: LightRecord, p: wp.vec3, u: wp.vec2) -> LightSample:
    """Nothing."""
    return LightSample()


@wp.func
def meet(light: LightRecord, origin: wp.vec3, direction: wp.vec3) -> LightSample:
    """The dome's radiance."""
    return infinite_sample(direction, light.radiance, 0.0)
