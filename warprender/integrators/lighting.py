"""Light that reaches a surface, for integrators: aimed at one light, met by chance, or from geometry that glows.

Every way weighs itself against the others (multiple importance sampling, Veach 1997, power heuristic).
"""

from __future__ import annotations

from functools import cache

import warp as wp

from ..lights.choice import choose_light, only_light, probability_of
from ..lights.dispatch import GLOWING, kind_of, light_functions, shaping_function
from ..lights.glowing_sphere import density_along
from ..lights.linking import is_linked
from ..lights.mesh import density_at, emitted, leaf_of, narrowed
from ..lights.shadow import shadow_strength
from ..materials.dispatch import material_functions
from ..materials.normal_map import shading_function
from ..numerics import GAMMA_7, INFINITY, max_component, offset_origin, spawn_between, to_frame
from ..plan import PathKey
from ..records import (
    BY_CHANCE,
    SHADOW_NONE,
    SHADOW_PLAIN,
    Bsdf,
    DeviceScene,
    LightRecord,
    LightSample,
    Ray,
    Surface,
)
from ..sampling import DIMENSION_LIGHT, DIMENSION_LIGHT_CHOICE, SampleStream, power_heuristic, random_pair
from ..visibility.sdf import ray_functions

#: Surfaces that a ray goes straight through, at most.
MOST_PASSES = wp.constant(wp.int32(1024))
#: Up to this many lights are met one by one; a tree over their boxes costs more than that.
FEW_LIGHTS = wp.constant(wp.int32(4))

_GLOWING_SPHERE = wp.constant(wp.int32(kind_of("GlowingSphere")))


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
def shadow_ray(surface: Surface, light: LightSample) -> Ray:
    """From the surface to the light, clear of both ends by the error bounds of each."""
    ray = Ray()
    ray.origin = offset_origin(surface.position, surface.error, surface.geometric_normal, light.direction)
    ray.direction = light.direction
    ray.t_max = INFINITY
    if light.distance < INFINITY:
        # The light is as far from the surface as it was: what the offset took is not left to go.
        gone = wp.dot(ray.origin - surface.position, ray.direction)
        ray.t_max = light.distance - gone - end_margin(surface.position, light.distance)
    return ray


@wp.func
def ray_between(surface: Surface, other: Surface) -> Ray:
    """From one surface to another, clear of both by their error bounds; of zero length where they touch."""
    origin, way = spawn_between(
        surface.position,
        surface.error,
        surface.geometric_normal,
        other.position,
        other.error,
        other.geometric_normal,
    )
    ray = Ray()
    ray.origin = origin
    distance = wp.length(way)
    if distance > 0.0:
        ray.direction = way / distance
        ray.t_max = distance * (1.0 - GAMMA_7)
    return ray


@wp.func
def share_of(light: LightRecord, departure: Departure) -> wp.vec3:
    """Throughput that a light's radiance arrives with; the camera sees the light itself."""
    if departure.prim < 0:
        return departure.diffuse + departure.specular
    return departure.diffuse * light.diffuse + departure.specular * light.specular


@wp.func
def hit_density(scene: DeviceScene, light: LightRecord, origin: wp.vec3, direction: wp.vec3, surface: Surface) -> float:
    """Density per solid angle with which next-event estimation at `origin` aims at a glowing surface that was hit."""
    if light.kind == _GLOWING_SPHERE:
        return density_along(scene, light, origin, direction)
    return density_at(scene, light, origin, surface.hit, surface.position - origin)


@cache
def shadow_function(key: PathKey) -> wp.Function:
    """`shadow(scene, light, ray, footprint)`: the share of a light that arrives along a ray from the receiver to it.

    `footprint` is the width that the ray stands for.
    """
    shading_at = shading_function(key.shapes, key.features, key.sdfs)
    prepare, _, _ = material_functions(key.materials, key.features)
    closest, closest_after, occluded = ray_functions(key.sdfs, key.ray_accuracy)
    straight_through = key.straight_through
    changed = "shadows" in key.light_effects

    @wp.func
    def shadow(scene: DeviceScene, light: LightRecord, ray: Ray, footprint: float) -> wp.vec3:
        ones = wp.vec3(1.0, 1.0, 1.0)
        if wp.static(changed):
            if light.shadow == SHADOW_NONE:
                return ones
        if wp.static(changed or straight_through):
            # With plain shadows of opaque things only, any hit will do.
            stepwise = wp.bool(wp.static(straight_through))
            if wp.static(changed):
                stepwise = stepwise or light.shadow != SHADOW_PLAIN
            if stepwise:
                passed = wp.float32(1.0)
                hit = closest(scene, ray)
                count = wp.int32(0)
                while hit.instance >= 0 and passed > 0.0 and count < MOST_PASSES:
                    through = wp.float32(0.0)
                    if wp.static(straight_through):
                        through = prepare(scene, shading_at(scene, ray, hit, footprint)).pass_through
                    if wp.static(changed):
                        strength = shadow_strength(light, hit.t)
                        if not is_linked(scene, light.shadow_links, scene.instances[hit.instance].prim):
                            strength = 0.0
                        if strength < 1.0:
                            through = 1.0 - strength * (1.0 - through)
                    passed = passed * through
                    hit = closest_after(scene, ray, hit)
                    count += 1
                if wp.static(changed):
                    if light.shadow != SHADOW_PLAIN:
                        return light.shadow_color * (1.0 - passed) + ones * passed
                return ones * passed
        if occluded(scene, ray):
            return wp.vec3(0.0, 0.0, 0.0)
        return ones

    return shadow


@cache
def met_function(key: PathKey) -> wp.Function:
    """`met(scene, visible, departure, ray, near, far) -> Met`: lights between two distances of a ray.

    Lights occlude nothing, so all of them count. `near` is 0 on the first stretch of a ray.
    """
    _, meet_light = light_functions(key.lights)
    shape = shaping_function(key.light_effects)
    shadow = shadow_function(key)
    effects = key.light_effects
    transmission = "transmission" in key.features

    @wp.func
    def met_one(
        scene: DeviceScene,
        visible: Visible,
        departure: Departure,
        ray: Ray,
        near: float,
        far: float,
        index: int,
        total: Met,
    ) -> Met:
        if departure.prim < 0:
            if visible.lights == 0 and (scene.lights[index].is_dome == 0 or visible.domes == 0):
                return total
        if wp.static("linking" in effects):
            if departure.prim >= 0:
                if not is_linked(scene, scene.lights[index].links, departure.prim):
                    return total
        found = meet_light(scene, scene.lights[index], ray.origin, ray.direction)
        if found.distance <= 0.0:
            return total
        light = scene.lights[index]
        arriving = found.radiance
        changed = wp.bool(False)
        if wp.static("shadows" in effects):
            # Shadows that are not light's own are looked up, or the two ways to the light would not agree.
            if light.shadow != SHADOW_PLAIN and departure.pdf > 0.0:
                changed = wp.bool(True)
                if near > 0.0:
                    return total
                way = Ray()
                way.origin = ray.origin
                way.direction = ray.direction
                way.t_max = found.distance - end_margin(ray.origin, found.distance)
                arriving = wp.cw_mul(arriving, shadow(scene, light, way, 0.0))
        # Ties go to the light, as they do for shadow rays: a lamp may lie on a ceiling.
        if not changed:
            place = found.distance - end_margin(ray.origin, found.distance)
            if place <= near or place > far:
                return total
        weight = wp.float32(1.0)
        if departure.pdf > 0.0 and scene.light_sampling != BY_CHANCE:
            chosen = probability_of(scene, departure.position, departure.normal, light, light.leaf)
            weight = power_heuristic(departure.pdf, found.pdf * chosen)
        arriving = wp.cw_mul(arriving, shape(scene, light, ray.direction))
        if wp.static(transmission):
            arriving = wp.cw_mul(arriving, transmittance(departure.absorption, found.distance - wp.max(near, 0.0)))
        result = Met()
        result.radiance = total.radiance + wp.cw_mul(share_of(light, departure), arriving) * weight
        result.count = total.count + 1
        return result

    @wp.func
    def met(scene: DeviceScene, visible: Visible, departure: Departure, ray: Ray, near: float, far: float) -> Met:
        total = Met()
        for i in range(scene.infinite_lights):
            index = scene.finite_lights + i
            total = met_one(scene, visible, departure, ray, near, far, index, total)
        if departure.prim < 0 and visible.lights == 0:
            return total
        if scene.finite_lights <= FEW_LIGHTS:
            for index in range(scene.finite_lights):
                total = met_one(scene, visible, departure, ray, near, far, index, total)
            return total
        reach = far
        if wp.static("shadows" in effects):
            reach = INFINITY
        query = wp.bvh_query_ray(scene.light_boxes, ray.origin, ray.direction)
        found = wp.int32(0)
        while wp.bvh_query_next(query, found, reach):
            total = met_one(scene, visible, departure, ray, near, far, found, total)
        return total

    return met


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


@cache
def glow_function(key: PathKey) -> wp.Function:
    """`glow(scene, departure, direction, surface, emission)`: what arrives from a surface that was hit."""
    shape = shaping_function(key.light_effects)
    glowing = bool(set(GLOWING) & set(key.lights))
    linking = "linking" in key.light_effects

    @wp.func
    def glow(
        scene: DeviceScene, departure: Departure, direction: wp.vec3, surface: Surface, emission: wp.vec3
    ) -> wp.vec3:
        if wp.static(glowing):
            index = scene.instances[surface.hit.instance].light
            if index >= 0:
                light = scene.lights[index]
                if wp.static(linking):
                    if departure.prim >= 0 and not is_linked(scene, light.links, departure.prim):
                        return wp.vec3(0.0, 0.0, 0.0)
                radiance = emitted(light, surface, emission)
                if max_component(radiance) <= 0.0:
                    return radiance
                if light.shadow != SHADOW_PLAIN and departure.pdf > 0.0:
                    return wp.vec3(0.0, 0.0, 0.0)
                weight = wp.float32(1.0)
                if departure.pdf > 0.0 and scene.light_sampling != BY_CHANCE:
                    leaf = leaf_of(scene, light, surface.hit.face)
                    if leaf >= 0:
                        light = narrowed(scene, light, leaf)
                        density = hit_density(scene, light, departure.position, direction, surface)
                        chosen = probability_of(scene, departure.position, departure.normal, light, leaf)
                        weight = power_heuristic(departure.pdf, density * chosen)
                radiance = wp.cw_mul(radiance, shape(scene, light, direction))
                return wp.cw_mul(share_of(light, departure), radiance) * weight
        return wp.cw_mul(departure.diffuse + departure.specular, emission)

    return glow
