"""Light that rays meet: lights on their way, and surfaces that glow, weighed against being aimed at."""

from __future__ import annotations

from functools import cache

import warp as wp

from ..lights.choice import probability_of
from ..lights.dispatch import GLOWING, kind_of, light_functions, shaping_function
from ..lights.glowing_sphere import density_along
from ..lights.linking import is_linked
from ..lights.mesh import density_at, emitted, leaf_of, narrowed
from ..numerics import INFINITY, max_component
from ..plan import PathKey
from ..records import BY_CHANCE, SHADOW_PLAIN, DeviceScene, LightRecord, Ray, Surface
from ..sampling import power_heuristic
from .lighting import Departure, Met, Visible, end_margin, share_of, transmittance
from .shadows import shadow_function

#: Up to this many lights are met one by one; a tree over their boxes costs more than that.
FEW_LIGHTS = wp.constant(wp.int32(4))

_GLOWING_SPHERE = wp.constant(wp.int32(kind_of("GlowingSphere")))


@wp.func
def hit_density(scene: DeviceScene, light: LightRecord, origin: wp.vec3, direction: wp.vec3, surface: Surface) -> float:
    """Density per solid angle with which next-event estimation at `origin` aims at a glowing surface that was hit."""
    if light.kind == _GLOWING_SPHERE:
        return density_along(scene, light, origin, direction)
    return density_at(scene, light, origin, surface.hit, surface.position - origin)


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
