"""Next-event estimation: light that a surface scatters of one light that is aimed at."""

from __future__ import annotations

from functools import cache

import warp as wp

from ..lights.choice import choose_light, only_light
from ..lights.dispatch import GLOWING, kind_of, light_functions, shaping_function
from ..lights.linking import is_linked
from ..lights.mesh import emitted, narrowed
from ..materials.dispatch import material_functions
from ..materials.normal_map import shading_function
from ..numerics import max_component, to_frame
from ..plan import PathKey
from ..records import BY_CHANCE, SHADOW_PLAIN, Bsdf, DeviceScene, LightRecord, Surface
from ..sampling import DIMENSION_LIGHT, DIMENSION_LIGHT_CHOICE, SampleStream, power_heuristic, random_pair
from .lighting import Met, is_across, light_normal, medium_towards, transmittance
from .shadows import ray_between, shadow_function, shadow_ray

_GLOWING_SPHERE = wp.constant(wp.int32(kind_of("GlowingSphere")))


@cache
def from_light_function(key: PathKey, weighted: bool, shadows: bool) -> wp.Function:
    """`from_light(scene, surface, bsdf, around, tangent, wo, light, probability, u) -> Met`: one light, scattered.

    One sample of the light (of one leaf, where it has many), chosen with a probability. `count` says whether a shadow
    ray was traced. `around` is the absorption of the medium on the viewer's side.

    Args:
        key: of the kernel.
        weighted: whether directions that are drawn from the material may meet the light as well.
        shadows: whether what is in the way keeps the light off; without them, lights count that are below the
            geometric horizon alone, and the ambient part of a material reflects every light.
    """
    sample_light, _ = light_functions(key.lights)
    prepare, evaluate, _ = material_functions(key.materials, key.features)
    shading_at = shading_function(key.shapes, key.features, key.sdfs)
    shape = shaping_function(key.light_effects)
    shadow = shadow_function(key)
    glow = bool(set(GLOWING) & set(key.lights))
    linking = "linking" in key.light_effects
    transmission = "transmission" in key.features

    @wp.func
    def from_light(
        scene: DeviceScene,
        surface: Surface,
        bsdf: Bsdf,
        around: wp.vec3,
        tangent: wp.vec3,
        wo: wp.vec3,
        light: LightRecord,
        probability: float,
        u: wp.vec2,
    ) -> Met:
        nothing = Met()
        if wp.static(linking):
            if not is_linked(scene, light.links, scene.instances[surface.hit.instance].prim):
                return nothing
        towards = sample_light(scene, light, surface.position, u)
        if towards.pdf <= 0.0:
            return nothing
        local = to_frame(tangent, surface.normal, towards.direction)
        if wp.static(shadows):
            if is_across(surface, local, towards.direction):
                return nothing
        value = evaluate(scene, bsdf, wo, local)
        response = value.diffuse * light.diffuse + value.specular * light.specular
        if wp.static(not weighted):
            if wp.static(not shadows) or local[2] > 0.0:
                response += bsdf.ambient * light.diffuse
        if max_component(response) <= 0.0:
            return nothing
        radiance = towards.radiance
        ray = shadow_ray(surface, towards)
        if wp.static(glow):
            if towards.hit.instance >= 0:
                own = towards.hit.instance == surface.hit.instance and towards.hit.face == surface.hit.face
                if own and light.kind != _GLOWING_SPHERE:
                    # A triangle does not light itself: rounding alone would say that it does.
                    return nothing
                source = shading_at(scene, ray, towards.hit, surface.footprint)
                radiance = emitted(light, source, prepare(scene, source).emission)
                ray = ray_between(surface, source)
        radiance = wp.cw_mul(radiance, shape(scene, light, towards.direction))
        if max_component(radiance) <= 0.0:
            return nothing
        density = towards.pdf * probability
        weight = wp.float32(1.0)
        if wp.static(weighted):
            # Rays that hit geometry see its light as light goes: where shadows are changed they leave it to this way.
            alone = towards.delta != 0 or (towards.hit.instance >= 0 and light.shadow != SHADOW_PLAIN)
            if not alone:
                if scene.light_sampling == BY_CHANCE:
                    return nothing
                weight = power_heuristic(density, value.pdf)
        if wp.static(transmission):
            medium = medium_towards(surface, bsdf, around, towards.direction)
            radiance = wp.cw_mul(radiance, transmittance(medium, towards.distance))
        result = Met()
        if wp.static(shadows):
            arriving = wp.cw_mul(radiance, shadow(scene, light, ray, surface.footprint)) * (weight / density)
            result.radiance = wp.cw_mul(response, arriving)
            result.count = 1
        else:
            result.radiance = wp.cw_mul(response, radiance) * (weight / density)
        return result

    return from_light


@cache
def aimed_function(key: PathKey) -> wp.Function:
    """`aimed(scene, surface, bsdf, around, tangent, wo, sample, step) -> Met`: scattered light of one, aimed at.

    `count` says whether a shadow ray was traced. `around` is the absorption of the medium on the viewer's side.
    """
    from_light = from_light_function(key, True, True)
    transmission, glow = "transmission" in key.features, bool(set(GLOWING) & set(key.lights))

    @wp.func
    def aimed(
        scene: DeviceScene,
        surface: Surface,
        bsdf: Bsdf,
        around: wp.vec3,
        tangent: wp.vec3,
        wo: wp.vec3,
        sample: SampleStream,
        step: int,
    ) -> Met:
        choice = only_light(scene)
        if choice.index < 0:
            normal = surface.geometric_normal
            if wp.static(transmission):
                normal = light_normal(surface, bsdf)
            u = random_pair(sample, step, DIMENSION_LIGHT_CHOICE)
            choice = choose_light(scene, surface.position, normal, u)
            if choice.index < 0:
                return Met()
        light = scene.lights[choice.index]
        if wp.static(glow):
            light = narrowed(scene, light, choice.leaf)
        u = random_pair(sample, step, DIMENSION_LIGHT)
        return from_light(scene, surface, bsdf, around, tangent, wo, light, choice.probability, u)

    return aimed
