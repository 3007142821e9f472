"""Transport "direct": the light that comes straight from light sources, with shadow rays; and what it shares.

Lights are added up one by one, each by one sample: delta lights exactly, area lights at a random point, domes of one
colour in a direction that the material is sampled for. Perfectly specular lobes reflect nothing here.
"""

from __future__ import annotations

from functools import cache

import warp as wp

from ..film import keep_function
from ..lights.choice import choose_light
from ..lights.dispatch import GLOWING, light_functions, shaping_function
from ..lights.linking import is_linked
from ..lights.mesh import narrowed
from ..materials.dispatch import material_functions
from ..materials.normal_map import shading_function
from ..numerics import INFINITY, PI, from_frame, offset_origin, tangent_of, to_frame
from ..plan import PathKey
from ..records import EVENT_SCATTER, MESH, Bsdf, DeviceScene, Hit, LightRecord, Ray, Surface
from ..sampling import (
    DIMENSION_BSDF,
    DIMENSION_LIGHT,
    DIMENSION_LIGHT_CHOICE,
    DIMENSION_LOBE,
    SampleStream,
    branch,
    random_pair,
    uniform_cone,
)
from ..visibility.sdf import ray_functions
from .aiming import from_light_function
from .lighting import Departure, Met, is_across, light_normal, medium_towards, transmittance
from .meeting import glow_function, met_function
from .samples import PathRequest, PathResult
from .shadows import MOST_PASSES, shadow_function

#: Up to this many lights are added up; of more, the light tree chooses one a sample, and what it stands for is added.
MOST_LIGHTS = wp.constant(wp.int32(32))

_MESH = wp.constant(wp.int32(MESH))


@cache
def from_dome_function(key: PathKey, shadows: bool) -> wp.Function:
    """`from_dome(scene, surface, bsdf, around, tangent, wo, light, sample, step) -> Met`: one dome of one colour.

    The ambient part is a reflection of the whole dome; with shadows, of the half above the surface.
    """
    _, _, sample_bsdf = material_functions(key.materials, key.features)
    _, meet_light = light_functions(key.lights)
    shape = shaping_function(key.light_effects)
    shadow = shadow_function(key)
    linking, transmission = "linking" in key.light_effects, "transmission" in key.features

    @wp.func
    def along(scene: DeviceScene, surface: Surface, light: LightRecord, direction: wp.vec3) -> wp.vec3:
        found = meet_light(scene, light, surface.position, direction)
        radiance = wp.cw_mul(found.radiance, shape(scene, light, direction))
        if wp.static(shadows):
            ray = Ray()
            ray.origin = offset_origin(surface.position, surface.error, surface.geometric_normal, direction)
            ray.direction = direction
            ray.t_max = INFINITY
            radiance = wp.cw_mul(radiance, shadow(scene, light, ray, surface.footprint))
        return radiance

    @wp.func
    def from_dome(
        scene: DeviceScene,
        surface: Surface,
        bsdf: Bsdf,
        around: wp.vec3,
        tangent: wp.vec3,
        wo: wp.vec3,
        light: LightRecord,
        sample: SampleStream,
        step: int,
    ) -> Met:
        total = Met()
        if wp.static(linking):
            if not is_linked(scene, light.links, scene.instances[surface.hit.instance].prim):
                return total
        if wp.length_sq(bsdf.ambient) > 0.0:
            span = wp.static(1.0 if shadows else 2.0)
            local = uniform_cone(random_pair(sample, step, DIMENSION_LIGHT), span)
            towards = from_frame(tangent_of(surface.geometric_normal), surface.geometric_normal, local)
            arriving = along(scene, surface, light, towards) * (2.0 * PI * span)
            total.radiance += wp.cw_mul(bsdf.ambient, arriving) * light.diffuse
            total.count += wp.static(int(shadows))
        lobe = random_pair(sample, step, DIMENSION_LOBE)
        scattered = sample_bsdf(scene, bsdf, wo, random_pair(sample, step, DIMENSION_BSDF), lobe[0])
        direction = from_frame(tangent, surface.normal, scattered.direction)
        if scattered.event == EVENT_SCATTER and not is_across(surface, scattered.direction, direction):
            response = scattered.diffuse * light.diffuse + scattered.specular * light.specular
            if wp.static(transmission):
                medium = medium_towards(surface, bsdf, around, direction)
                response = wp.cw_mul(response, transmittance(medium, INFINITY))
            total.radiance += wp.cw_mul(response, along(scene, surface, light, direction))
            total.count += wp.static(int(shadows))
        return total

    return from_dome


@cache
def reflected_function(key: PathKey, shadows: bool) -> wp.Function:
    """`reflected(scene, surface, bsdf, around, tangent, wo, sample, step) -> Met`: light of all lights, once
    scattered.

    Args:
        key: of the kernel.
        shadows: whether what is in the way keeps light off; `count` says how many rays that took.
    """
    from_light = from_light_function(key, False, shadows)
    from_dome = from_dome_function(key, shadows)
    with_domes = bool({"DomeLight", "DomeLight.portals"} & set(key.lights))
    glow, transmission = bool(set(GLOWING) & set(key.lights)), "transmission" in key.features

    @wp.func
    def reflected(
        scene: DeviceScene,
        surface: Surface,
        bsdf: Bsdf,
        around: wp.vec3,
        tangent: wp.vec3,
        wo: wp.vec3,
        sample: SampleStream,
        step: int,
    ) -> Met:
        total = Met()
        met_by_rays = scene.finite_lights + scene.infinite_lights
        few = met_by_rays <= MOST_LIGHTS
        begin = wp.where(few, 0, scene.finite_lights)
        for number in range(begin - 1, met_by_rays):
            index = number
            leaf = wp.int32(-1)
            probability = wp.float32(0.0)
            if number == begin - 1:
                # Geometry that glows has as many parts as triangles, and lights may be too many: the tree takes one.
                index = -1
                if not few or met_by_rays < scene.lights.shape[0]:
                    normal = surface.geometric_normal
                    if wp.static(transmission):
                        normal = light_normal(surface, bsdf)
                    u = random_pair(branch(sample, number), step, DIMENSION_LIGHT_CHOICE)
                    choice = choose_light(scene, surface.position, normal, u)
                    if choice.index >= 0 and (not few or choice.index >= met_by_rays):
                        index = choice.index
                        leaf = choice.leaf
                        probability = choice.probability
            elif few and scene.lights[index].choice > 0.0:
                probability = 1.0
            if index >= 0:
                light = scene.lights[index]
                own = branch(sample, number)
                one = Met()
                if wp.static(with_domes):
                    if light.is_dome != 0 and light.image < 0:
                        # Summed on its own turn, with all of the sky, portals or not.
                        probability = 0.0
                        if number >= begin:
                            one = from_dome(scene, surface, bsdf, around, tangent, wo, light, own, step)
                if probability > 0.0:
                    if wp.static(glow):
                        light = narrowed(scene, light, leaf)
                    u = random_pair(own, step, DIMENSION_LIGHT)
                    one = from_light(scene, surface, bsdf, around, tangent, wo, light, probability, u)
                total.radiance += one.radiance
                total.count += one.count
        return total

    return reflected


@cache
def first_surfaces_function(key: PathKey, shadows: bool) -> wp.Function:
    """`radiance(…)` of `samples`: surfaces that the camera sees, each by its emission and the lights on it.

    What is not opaque is laid over what is behind it, without noise.

    Args:
        key: of the kernel.
        shadows: whether lights are kept off by what is in the way.
    """
    shading_at = shading_function(key.shapes, key.features, key.sdfs)
    prepare, _, _ = material_functions(key.materials, key.features)
    _, closest_after, _ = ray_functions(key.sdfs, key.ray_accuracy)
    met = met_function(key)
    glow = glow_function(key)
    reflected = reflected_function(key, shadows)
    with_lights, straight_through, keep = bool(key.lights), key.straight_through, keep_function(key.terms)

    @wp.func
    def behind(scene: DeviceScene, ray: Ray, hit: Hit) -> Hit:
        following = closest_after(scene, ray, hit)
        # A rasterized hit may lie a little before the ray's own with the same triangle, which is met once.
        if following.instance == hit.instance and following.face == hit.face and following.instance >= 0:
            geometry = scene.world.instances[hit.instance].geometry
            if scene.world.geometries[geometry].kind == _MESH:
                following = closest_after(scene, ray, following)
        return following

    @wp.func
    def radiance(
        scene: DeviceScene, request: PathRequest, ray: Ray, first_hit: Hit, cone: wp.vec2, sample: SampleStream
    ) -> PathResult:
        result = PathResult()
        camera = Departure()
        camera.prim = -1
        camera.diffuse = wp.vec3(1.0, 1.0, 1.0)
        clear = wp.float32(1.0)
        passed_t = -INFINITY
        hit = first_hit
        step = wp.int32(0)
        while step < MOST_PASSES:
            if wp.static(with_lights):
                lights = met(scene, request.visible, camera, ray, passed_t, hit.t)
                result.radiance += lights.radiance
                keep(request.terms, sample.pixel, 0, lights.radiance)
                if lights.count > 0:
                    clear = 0.0
            if hit.instance < 0:
                break
            surface = shading_at(scene, ray, hit, cone[0] + cone[1] * hit.t)
            bsdf = prepare(scene, surface)
            emission = glow(scene, camera, ray.direction, surface, bsdf.emission)
            result.radiance += emission
            keep(request.terms, sample.pixel, 0, emission)
            if wp.static(with_lights):
                tangent = tangent_of(surface.normal)
                wo = to_frame(tangent, surface.normal, surface.outgoing)
                light = reflected(scene, surface, bsdf, camera.absorption, tangent, wo, sample, step)
                scattered = wp.cw_mul(camera.diffuse, light.radiance)
                result.radiance += scattered
                keep(request.terms, sample.pixel, 1, scattered)
                result.rays += wp.vec3i(0, 0, light.count)
            if wp.static(not straight_through):
                clear = 0.0
                break
            clear = clear * bsdf.pass_through
            camera.diffuse = camera.diffuse * bsdf.pass_through
            if bsdf.pass_through <= 0.0:
                break
            passed_t = hit.t
            hit = behind(scene, ray, hit)
            step += 1
        result.alpha = 1.0 - clear
        return result

    return radiance


@cache
def radiance_function(key: PathKey) -> wp.Function:
    """`radiance(…)` of `samples`: the local reflection model with shadow rays, soft ones from area lights."""
    return first_surfaces_function(key, True)
