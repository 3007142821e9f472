"""From a light's kind to its functions, for the kinds that a plan names. Closure chains, as for materials."""

from __future__ import annotations

from functools import cache

import warp as wp

from ..records import DeviceScene, LightRecord, LightSample
from . import camera, cylinder, disk, distant, dome, glowing_sphere, mesh, portal, rect, sphere
from .shaping import focus_and_cone, photometric

#: `sample` and `meet` of each kind, in the order of the kinds' ids on the device.
FUNCTIONS: dict[str, tuple[wp.Function, wp.Function]] = {
    "SphereLight": (sphere.sample, sphere.meet),
    "RectLight": (rect.sample, rect.meet),
    "RectLight.texture": (rect.sample_textured, rect.meet_textured),
    "DiskLight": (disk.sample, disk.meet),
    "CylinderLight": (cylinder.sample, cylinder.meet),
    "DistantLight": (distant.sample, distant.meet),
    "DomeLight": (dome.sample, dome.meet),
    "DomeLight.texture": (dome.sample_textured, dome.meet_textured),
    "DomeLight.portals": (portal.sample, portal.meet),
    "CameraLight": (camera.sample, camera.meet),
    "MeshLight": (mesh.sample, mesh.meet),
    "GlowingSphere": (glowing_sphere.sample, glowing_sphere.meet),
}

#: Kinds that are geometry: rays hit them, and their materials say what they emit.
GLOWING = ("MeshLight", "GlowingSphere")


def kind_of(name: str) -> int:
    """Id of the light kind with this name."""
    return list(FUNCTIONS).index(name)


@cache
def light_functions(names: tuple[str, ...]) -> tuple[wp.Function, wp.Function]:
    """`sample(scene, light, p, u)` and `meet(scene, light, origin, direction)` over these kinds."""
    first, *others = names or ("DomeLight",)
    sample, meet = FUNCTIONS[first]
    for name in others:
        sample, meet = _link(name, sample, meet)
    return sample, meet


def _link(name: str, rest_sample: wp.Function, rest_meet: wp.Function) -> tuple[wp.Function, wp.Function]:
    kind = kind_of(name)
    this_sample, this_meet = FUNCTIONS[name]

    @wp.func
    def sample(scene: DeviceScene, light: LightRecord, p: wp.vec3, u: wp.vec2) -> LightSample:
        if light.kind == wp.static(kind):
            return this_sample(scene, light, p, u)
        return rest_sample(scene, light, p, u)

    @wp.func
    def meet(scene: DeviceScene, light: LightRecord, origin: wp.vec3, direction: wp.vec3) -> LightSample:
        if light.kind == wp.static(kind):
            return this_meet(scene, light, origin, direction)
        return rest_meet(scene, light, origin, direction)

    return sample, meet


@cache
def shaping_function(effects: tuple[str, ...]) -> wp.Function:
    """`shape(scene, light, direction)`: factor on the radiance that arrives from a world direction to the light."""
    shaped, profiled = "shaping" in effects, "ies" in effects

    @wp.func
    def shape(scene: DeviceScene, light: LightRecord, direction: wp.vec3) -> wp.vec3:
        factor = wp.vec3(1.0, 1.0, 1.0)
        if wp.static(shaped or profiled):
            emission = -wp.normalize(light.inverse * direction)
            if wp.static(shaped):
                factor = focus_and_cone(light, emission)
            if wp.static(profiled):
                if light.profile >= 0:
                    factor = factor * photometric(scene, light, emission)
        return factor

    return shape
