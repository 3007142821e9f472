"""Transport "path": unbiased path tracing (Kajiya 1986) with next-event estimation, multiple importance sampling
(Veach 1997) and Russian roulette.
"""

from __future__ import annotations

from functools import cache

import warp as wp

from ..film import keep_function
from ..materials import DisplayColor
from ..materials.dispatch import material_functions
from ..materials.normal_map import shading_function
from ..numerics import INFINITY, from_frame, max_component, offset_origin, tangent_of, to_frame
from ..plan import PathKey
from ..records import EVENT_ABSORB, EVENT_DELTA, EVENT_PASS, DeviceScene, Hit, Ray
from ..sampling import DIMENSION_BSDF, DIMENSION_LOBE, SampleStream, random_pair
from ..visibility.sdf import ray_functions
from .aiming import aimed_function
from .lighting import Departure, is_across, light_normal, medium_towards, transmittance
from .meeting import glow_function, met_function
from .samples import FOOTPRINT, PathRequest, PathResult
from .shadows import MOST_PASSES

#: Reflections before Russian roulette may end a path.
ROULETTE_AFTER = wp.constant(wp.int32(3))


@wp.func
def scattered_cone(width: float, growth: float, pdf: float) -> wp.vec2:
    """The cone of a direction that was drawn with a density: it stands for the solid angle 1 / pdf, shared out among
    as many samples as the pixel is. Delta lobes (pdf 0) keep the growth.
    """
    if pdf <= 0.0:
        return wp.vec2(width, growth)
    return wp.vec2(width, wp.max(growth, FOOTPRINT / wp.sqrt(pdf)))


@cache
def radiance_function(key: PathKey) -> wp.Function:
    """`radiance(scene, request, ray, hit, cone, sample) -> PathResult`: see `samples`."""
    shading_at = shading_function(key.shapes, key.features, key.sdfs)
    prepare, _, sample_bsdf = material_functions(key.materials, key.features)
    closest, closest_after, _ = ray_functions(key.sdfs, key.ray_accuracy)
    met = met_function(key)
    aimed = aimed_function(key)
    glow = glow_function(key)
    sampled_lights, straight_through = key.sampled_lights, key.straight_through
    with_lights = bool(key.lights)
    transmission, keep = "transmission" in key.features, keep_function(key.terms)
    several_lobes = key.straight_through or key.materials != (DisplayColor.__name__,)

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
        cone = camera_cone
        ray = camera_ray
        last = Departure()
        last.prim = -1
        last.diffuse = wp.vec3(1.0, 1.0, 1.0)
        # What the camera ray has left of itself behind the clear surfaces that it passed; alpha is the rest.
        clear = wp.float32(1.0)
        # How often the throughput was divided by eta² where the path went into denser media: it is not faint for that.
        compression = wp.float32(1.0)
        depth = wp.int32(0)
        step = wp.int32(0)
        passed_t = -INFINITY
        hit = first_hit

        while step < request.bounces + MOST_PASSES:
            # 1. Lights that the ray meets on its way. They occlude nothing.
            if wp.static(with_lights):
                lights = met(scene, request.visible, last, ray, passed_t, hit.t)
                result.radiance += lights.radiance
                keep(request.terms, sample.pixel, depth, lights.radiance)
                if last.prim < 0 and lights.count > 0:
                    clear = 0.0
            if hit.instance < 0:
                break

            # 2. Light that the surface itself emits.
            surface = shading_at(scene, ray, hit, cone[0] + cone[1] * hit.t)
            bsdf = prepare(scene, surface)
            if wp.static(transmission):
                # A surface that is left knows its medium best: the camera may have started in it.
                if surface.front == 0:
                    last.absorption = medium_towards(surface, bsdf, last.absorption, surface.outgoing)
                left = transmittance(last.absorption, hit.t - wp.max(passed_t, 0.0))
                last.diffuse = wp.cw_mul(last.diffuse, left)
                last.specular = wp.cw_mul(last.specular, left)
            emission = glow(scene, last, ray.direction, surface, bsdf.emission)
            result.radiance += emission
            keep(request.terms, sample.pixel, depth, emission)
            throughput = last.diffuse + last.specular

            # 3. Sample the material; clear parts let the ray go on as it is.
            tangent = tangent_of(surface.normal)
            wo = to_frame(tangent, surface.normal, surface.outgoing)
            lobe = wp.vec2(0.0, 0.0)
            if wp.static(several_lobes) or depth >= ROULETTE_AFTER:
                lobe = random_pair(sample, step, DIMENSION_LOBE)
            scattered = sample_bsdf(scene, bsdf, wo, random_pair(sample, step, DIMENSION_BSDF), lobe[0])
            if wp.static(straight_through):
                if scattered.event == EVENT_PASS:
                    last.diffuse = wp.cw_mul(last.diffuse, scattered.specular)
                    last.specular = wp.cw_mul(last.specular, scattered.specular)
                    clear = wp.where(last.prim < 0, clear * scattered.specular[0], clear)
                    passed_t = hit.t
                    hit = closest_after(scene, ray, hit)
                    step += 1
                    continue
            if last.prim < 0:
                clear = 0.0
            if depth >= request.bounces + 1:
                break

            # 4. Next-event estimation: aim at one light, weighted against meeting it by chance.
            if wp.static(sampled_lights):
                reflected = aimed(scene, surface, bsdf, last.absorption, tangent, wo, sample, step)
                chance = wp.float32(1.0)
                if wp.static(straight_through):
                    # Paths that went straight through did not aim: those that stayed stand for them.
                    chance = scattered.stay
                scattered_once = wp.cw_mul(throughput, reflected.radiance) / chance
                result.radiance += scattered_once
                keep(request.terms, sample.pixel, depth + 1, scattered_once)
                result.rays += wp.vec3i(0, 0, reflected.count)

            if request.met == 0 and depth >= request.bounces:
                break

            # 5. Follow the sampled direction, unless the true surface lies between it and the side it was meant for.
            if scattered.event == EVENT_ABSORB:
                break
            direction = from_frame(tangent, surface.normal, scattered.direction)
            if is_across(surface, scattered.direction, direction):
                break
            last.position = surface.position
            last.normal = surface.geometric_normal
            last.prim = scene.instances[hit.instance].prim
            last.diffuse = wp.cw_mul(throughput, scattered.diffuse)
            last.specular = wp.cw_mul(throughput, scattered.specular)
            last.pdf = wp.where(scattered.event == EVENT_DELTA, 0.0, scattered.pdf)
            if request.unfiltered == 0:
                cone = scattered_cone(surface.footprint, cone[1], last.pdf)

            if wp.static(transmission):
                last.normal = light_normal(surface, bsdf)
                last.absorption = medium_towards(surface, bsdf, last.absorption, direction)
                if scattered.direction[2] < 0.0 and bsdf.thin == 0:
                    compression = compression * bsdf.eta * bsdf.eta

            # 6. Russian roulette: faint paths end early, the survivors stand for them.
            if depth >= ROULETTE_AFTER:
                survival = wp.min(1.0, max_component(last.diffuse + last.specular) * compression)
                if lobe[1] >= survival:
                    break
                last.diffuse = last.diffuse / survival
                last.specular = last.specular / survival

            ray.origin = offset_origin(surface.position, surface.error, surface.geometric_normal, direction)
            ray.direction = direction
            ray.t_max = INFINITY
            passed_t = -INFINITY
            depth += 1
            step += 1
            hit = closest(scene, ray)
            result.rays += wp.vec3i(0, 1, 0)
        result.alpha = 1.0 - clear
        return result

    return radiance
