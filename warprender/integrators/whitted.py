"""Transport "whitted": ray tracing as in Whitted, An Improved Illumination Model for Shaded Display, CACM 1980.

Rough lobes reflect the lights, with shadow rays, as in "direct". Perfect reflection and refraction are both followed,
each with its Fresnel weight, by an explicit stack, the fainter of the two first: those that wait meanwhile are the
heavier ones of pairs on the way to it, and every such turn at least halves the weight. Beyond `WHOLE_TREE` bounces
faint rays of glass are cut (Hall and Greenberg, A Testbed for Realistic Image Synthesis, 1983), so that the tree does
not grow without end and no more than `STACK` rays wait.
"""

from __future__ import annotations

from functools import cache

import warp as wp

from ..film import keep_function
from ..materials.dispatch import material_functions
from ..materials.normal_map import shading_function
from ..materials.perfect import perfect_function
from ..numerics import INFINITY, from_frame, max_component, offset_origin, tangent_of, to_frame
from ..plan import PathKey
from ..records import DeviceScene, Hit, Ray, Surface
from ..sampling import SampleStream
from ..visibility.sdf import ray_functions
from .direct import reflected_function
from .lighting import Departure, is_across, medium_towards, transmittance
from .meeting import glow_function, met_function
from .samples import PathRequest, PathResult

#: Rays that may wait; only layers of clear mirrors need more.
STACK = 16
#: Bounces up to which all rays are followed, and the weight below which none is behind them.
WHOLE_TREE = wp.constant(wp.int32(8))
FAINT = wp.constant(wp.float32(1.0e-4))
#: Surfaces that all rays of a sample meet together, at most.
MOST_SURFACES = wp.constant(wp.int32(4096))

_Vectors = wp.types.matrix(shape=(STACK, 3), dtype=wp.float32)
_Numbers = wp.types.matrix(shape=(STACK, 2), dtype=wp.float32)
_Integers = wp.types.vector(length=STACK, dtype=wp.int32)


@wp.struct
class Waiting:
    """Rays that wait, in rows: where from, where to, what they weigh, through what, their cones, prims and depths."""

    origin: _Vectors
    direction: _Vectors
    weight: _Vectors
    absorption: _Vectors
    cone: _Numbers
    prim: _Integers
    depth: _Integers
    count: wp.int32
    unfollowed: wp.int32


@wp.func
def with_ray(
    waiting: Waiting,
    surface: Surface,
    direction: wp.vec3,
    weight: wp.vec3,
    least: float,
    absorption: wp.vec3,
    cone: wp.vec2,
    prim: int,
    depth: int,
) -> Waiting:
    """The rays with one more that leaves a surface, unless it weighs nothing.

    It is counted where it weighs `least` or less, or where there is no room for it.
    """
    row = waiting.count
    if max_component(weight) <= 0.0:
        return waiting
    if max_component(weight) <= least:
        waiting.unfollowed += 1
        return waiting
    if row >= wp.static(STACK):
        waiting.unfollowed += 1
        return waiting
    waiting.origin[row] = offset_origin(surface.position, surface.error, surface.geometric_normal, direction)
    waiting.direction[row] = direction
    waiting.weight[row] = weight
    waiting.absorption[row] = absorption
    waiting.cone[row] = cone
    waiting.prim[row] = prim
    waiting.depth[row] = depth
    waiting.count = row + 1
    return waiting


@cache
def radiance_function(key: PathKey) -> wp.Function:
    """`radiance(…)` of `samples`; bounces are perfect reflections and refractions after the camera's hit."""
    shading_at = shading_function(key.shapes, key.features, key.sdfs)
    prepare, _, _ = material_functions(key.materials, key.features)
    perfect = perfect_function(key.materials)
    closest, closest_after, _ = ray_functions(key.sdfs, key.ray_accuracy)
    met = met_function(key)
    glow = glow_function(key)
    reflected = reflected_function(key, True)
    with_lights, straight_through = bool(key.lights), key.straight_through
    transmission, keep = "transmission" in key.features, keep_function(key.terms)

    @wp.func
    def radiance(
        scene: DeviceScene,
        request: PathRequest,
        camera_ray: Ray,
        first_hit: Hit,
        camera_cone: wp.vec2,
        sample: SampleStream,
    ) -> PathResult:
        result = PathResult()
        waiting = Waiting()
        ray = camera_ray
        cone = camera_cone
        last = Departure()
        last.prim = -1
        last.specular = wp.vec3(1.0, 1.0, 1.0)
        clear = wp.float32(1.0)
        depth = wp.int32(0)
        step = wp.int32(0)
        passed_t = -INFINITY
        hit = first_hit

        while step < MOST_SURFACES:
            goes_on = wp.bool(False)
            # 1. Lights that the ray meets on its way, and light that the surface emits.
            if wp.static(with_lights):
                lights = met(scene, request.visible, last, ray, passed_t, hit.t)
                result.radiance += lights.radiance
                keep(request.terms, sample.pixel, depth, lights.radiance)
                if last.prim < 0 and lights.count > 0:
                    clear = 0.0
            if hit.instance >= 0:
                surface = shading_at(scene, ray, hit, cone[0] + cone[1] * hit.t)
                bsdf = prepare(scene, surface)
                if wp.static(transmission):
                    if surface.front == 0:
                        last.absorption = medium_towards(surface, bsdf, last.absorption, surface.outgoing)
                    left = transmittance(last.absorption, hit.t - wp.max(passed_t, 0.0))
                    last.specular = wp.cw_mul(last.specular, left)
                emission = glow(scene, last, ray.direction, surface, bsdf.emission)
                result.radiance += emission
                keep(request.terms, sample.pixel, depth, emission)

                if depth <= request.bounces:
                    # 2. Its rough lobes under all lights.
                    tangent = tangent_of(surface.normal)
                    wo = to_frame(tangent, surface.normal, surface.outgoing)
                    if wp.static(with_lights):
                        light = reflected(scene, surface, bsdf, last.absorption, tangent, wo, sample, step)
                        scattered = wp.cw_mul(last.specular, light.radiance)
                        result.radiance += scattered
                        keep(request.terms, sample.pixel, depth + 1, scattered)
                        result.rays += wp.vec3i(0, 0, light.count)

                    # 3. Its perfect lobes wait, reflection and refraction.
                    lobes = perfect(scene, bsdf, wo)
                    prim = scene.instances[hit.instance].prim
                    width = wp.vec2(surface.footprint, cone[1])
                    least = wp.float32(0.0)
                    weight = wp.cw_mul(last.specular, lobes.reflected)
                    local = wp.vec3(-wo[0], -wo[1], wo[2])
                    direction = from_frame(tangent, surface.normal, local)
                    reflects = not is_across(surface, local, direction)
                    if wp.static(transmission):
                        if depth > WHOLE_TREE and lobes.bent != 0:
                            least = FAINT
                        through = wp.cw_mul(last.specular, lobes.transmitted)
                        beyond = from_frame(tangent, surface.normal, lobes.beyond)
                        crosses = lobes.bent != 0 and not is_across(surface, lobes.beyond, beyond)
                        medium = medium_towards(surface, bsdf, last.absorption, beyond)
                        fainter = max_component(through) <= max_component(weight)
                        if crosses and not fainter:
                            waiting = with_ray(waiting, surface, beyond, through, least, medium, width, prim, depth + 1)
                    if reflects:
                        medium_here = last.absorption
                        waiting = with_ray(
                            waiting, surface, direction, weight, least, medium_here, width, prim, depth + 1
                        )
                    if wp.static(transmission):
                        if crosses and fainter:
                            waiting = with_ray(waiting, surface, beyond, through, least, medium, width, prim, depth + 1)

                # 4. What is clear lets the ray go on as it is; that is no bounce.
                if wp.static(straight_through):
                    goes_on = bsdf.pass_through > 0.0
                if last.prim < 0:
                    clear = wp.where(goes_on, clear * bsdf.pass_through, 0.0)
            step += 1
            if goes_on:
                last.specular = last.specular * bsdf.pass_through
                passed_t = hit.t
                hit = closest_after(scene, ray, hit)
                continue

            # 5. The next ray that waits.
            if waiting.count == 0:
                break
            row = waiting.count - 1
            waiting.count = row
            ray.origin = waiting.origin[row]
            ray.direction = waiting.direction[row]
            ray.t_max = INFINITY
            last.specular = waiting.weight[row]
            last.absorption = waiting.absorption[row]
            last.prim = waiting.prim[row]
            cone = waiting.cone[row]
            depth = waiting.depth[row]
            passed_t = -INFINITY
            hit = closest(scene, ray)
            result.rays += wp.vec3i(0, 1, 0)
        result.unfollowed = waiting.unfollowed + waiting.count
        result.alpha = 1.0 - clear
        return result

    return radiance
