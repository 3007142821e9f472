"""Shadow rays, and the share of a light that arrives along one."""

from __future__ import annotations

from functools import cache

import warp as wp

from ..lights.linking import is_linked
from ..lights.shadow import shadow_strength
from ..materials.dispatch import material_functions
from ..materials.normal_map import shading_function
from ..numerics import GAMMA_7, INFINITY, offset_origin, spawn_between
from ..plan import PathKey
from ..records import SHADOW_NONE, SHADOW_PLAIN, DeviceScene, LightRecord, LightSample, Ray, Surface
from ..visibility.sdf import ray_functions
from .lighting import end_margin

#: Surfaces that a ray goes straight through, at most.
MOST_PASSES = wp.constant(wp.int32(1024))


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
