"""Analytic spheres whose material emits: hit as geometry, aimed at as a sphere light of the same place."""

from __future__ import annotations

from dataclasses import dataclass

import warp as wp

from ..records import DeviceScene, LightRecord, LightSample
from . import sphere
from .light import no_light
from .mesh import MeshLight

_meet_sphere = sphere.meet
_sample_sphere = sphere.sample


@dataclass
class GlowingSphere(MeshLight):
    """A placed sphere that emits. From within it is only met: next-event estimation does not aim at the inside."""


@wp.func
def sample(scene: DeviceScene, light: LightRecord, p: wp.vec3, u: wp.vec2) -> LightSample:
    """A direction in the cone that the sphere fills; its emission is left to the material."""
    result = _sample_sphere(scene, light, p, u)
    if result.pdf > 0.0:
        result.hit.t = result.distance
        result.hit.instance = light.instance
        result.hit.face = 0
    return result


@wp.func
def meet(scene: DeviceScene, light: LightRecord, origin: wp.vec3, direction: wp.vec3) -> LightSample:
    """Nothing: rays hit the geometry."""
    return no_light()


@wp.func
def density_along(scene: DeviceScene, light: LightRecord, origin: wp.vec3, direction: wp.vec3) -> float:
    """Density per solid angle with which `sample` at `origin` draws a direction that hits the sphere; 0 within."""
    return _meet_sphere(scene, light, origin, direction).pdf
