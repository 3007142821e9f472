"""Transport "path": unbiased path tracing (Kajiya 1986) with next-event estimation, multiple importance sampling
(Veach 1997) and Russian roulette.
"""

from __future__ import annotations

from functools import cache

import warp as wp

from ..camera import camera_ray_function
from ..color import luminance
from ..film import FilmRecord, filter_offset
from ..launch import launch
from ..lights.dispatch import light_functions
from ..materials.dispatch import material_functions
from ..numerics import (
    GAMMA_7,
    INFINITY,
    from_frame,
    is_finite,
    max_component,
    offset_origin,
    tangent_of,
    to_frame,
)
from ..plan import PathKey
from ..records import (
    EVENT_ABSORB,
    EVENT_DELTA,
    EVENT_PASS,
    CameraRecord,
    DeviceScene,
    LightSample,
    Ray,
    Surface,
)
from ..sampling import (
    DIMENSION_BSDF,
    DIMENSION_LENS,
    DIMENSION_LIGHT,
    DIMENSION_LIGHT_CHOICE,
    DIMENSION_LOBE,
    DIMENSION_PIXEL,
    REPLICATES,
    SampleStream,
    power_heuristic,
    random_pair,
    sample_stream,
)
from ..shapes.surface import surface_function
from ..visibility.rays import closest_after_function, closest_function, occluded_function

#: Reflections before Russian roulette may end a path.
ROULETTE_AFTER = wp.constant(wp.int32(3))
#: Surfaces that a path goes straight through, at most.
MOST_PASSES = wp.constant(wp.int32(1024))


@wp.struct
class PathRequest:
    """Runtime values of a pass: which samples, how many bounces, which lights the camera sees."""

    seed: wp.uint32
    first_sample: wp.int32
    samples: wp.int32
    sobol: wp.int32
    bounces: wp.int32
    dome_light_visible: wp.int32
    lights_visible: wp.int32
    dome_kind: wp.int32


@wp.struct
class PathResult:
    """Radiance of one camera ray, its alpha, and the camera, bounce and shadow rays that it took."""

    radiance: wp.vec3
    alpha: wp.float32
    rays: wp.vec3i


@wp.func
def end_margin(origin: wp.vec3, distance: float) -> float:
    """How far rounding may put a point at this distance before or behind its place."""
    margin = wp.float32(0.0)
    if distance < INFINITY:
        margin = (max_component(wp.abs(origin)) + distance) * GAMMA_7
    return margin


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
def choose_light(scene: DeviceScene, u: float) -> int:
    """The light whose interval of the cumulative distribution holds u."""
    low = wp.int32(0)
    high = scene.light_count - 1
    while low < high:
        middle = (low + high) // 2
        if u < scene.light_cdf[middle]:
            high = middle
        else:
            low = middle + 1
    return low


@cache
def transmittance_function(key: PathKey) -> wp.Function:
    """`transmittance(scene, ray)`: 1 where nothing is in the way; what clear surfaces let through otherwise."""
    occluded = occluded_function(key.shapes)
    closest = closest_function(key.shapes)
    closest_after = closest_after_function(key.shapes)
    surface_at = surface_function(key.shapes)
    prepare, _, _ = material_functions(key.materials)
    straight_through = key.straight_through

    @wp.func
    def transmittance(scene: DeviceScene, ray: Ray) -> float:
        if wp.static(straight_through):
            passed = wp.float32(1.0)
            hit = closest(scene, ray)
            count = wp.int32(0)
            while hit.instance >= 0 and passed > 0.0 and count < MOST_PASSES:
                passed = passed * prepare(scene, surface_at(scene, ray, hit)).pass_through
                hit = closest_after(scene, ray, hit)
                count += 1
            return passed
        if occluded(scene, ray):
            return 0.0
        return 1.0

    return transmittance


@cache
def radiance_function(key: PathKey) -> wp.Function:
    """`radiance(scene, request, ray, sample) -> PathResult`: one estimate of what a camera ray sees."""
    closest = closest_function(key.shapes)
    closest_after = closest_after_function(key.shapes)
    surface_at = surface_function(key.shapes)
    prepare, evaluate, sample_bsdf = material_functions(key.materials)
    sample_light, meet_light = light_functions(key.lights)
    transmittance = transmittance_function(key)
    sampled_lights, straight_through = key.sampled_lights, key.straight_through
    with_lights = bool(key.lights)

    @wp.func
    def radiance(scene: DeviceScene, request: PathRequest, camera_ray: Ray, sample: SampleStream) -> PathResult:
        result = PathResult()
        ray = camera_ray
        # Throughput of the last event, split as the lights' `diffuse` and `specular` need it.
        diffuse_throughput = wp.vec3(1.0, 1.0, 1.0)
        specular_throughput = wp.vec3(0.0, 0.0, 0.0)
        # Density of the last direction; 0 after a delta event and at the camera, where no light was aimed at.
        pdf = wp.float32(0.0)
        from_camera = wp.bool(True)
        # What the camera ray has left of itself behind the clear surfaces that it passed; alpha is the rest.
        clear = wp.float32(1.0)
        depth = wp.int32(0)
        step = wp.int32(0)
        passed_t = wp.float32(0.0)
        hit = closest(scene, ray)
        result.rays = wp.vec3i(1, 0, 0)

        while step < request.bounces + MOST_PASSES:
            # 1. Lights that the ray meets on its way. They occlude nothing.
            if wp.static(with_lights):
                for i in range(scene.light_count):
                    seen = wp.bool(True)
                    if from_camera:
                        seen = request.lights_visible != 0
                        if scene.lights[i].kind == request.dome_kind:
                            seen = request.dome_light_visible != 0
                    if seen:
                        met = meet_light(scene.lights[i], ray.origin, ray.direction)
                        # Ties go to the light, as they do for shadow rays: a lamp may lie on a ceiling.
                        if met.distance > passed_t and met.distance - end_margin(ray.origin, met.distance) <= hit.t:
                            weight = wp.float32(1.0)
                            if pdf > 0.0:
                                weight = power_heuristic(pdf, met.pdf * scene.lights[i].choice)
                            share = (
                                diffuse_throughput * scene.lights[i].diffuse
                                + specular_throughput * scene.lights[i].specular
                            )
                            if from_camera:
                                share = diffuse_throughput + specular_throughput
                                clear = 0.0
                            result.radiance += wp.cw_mul(share, met.radiance) * weight
            if hit.instance < 0:
                break

            # 2. Light that the surface itself emits.
            surface = surface_at(scene, ray, hit)
            bsdf = prepare(scene, surface)
            throughput = diffuse_throughput + specular_throughput
            result.radiance += wp.cw_mul(throughput, bsdf.emission)

            # 3. Sample the material; clear parts let the ray go on as it is.
            tangent = tangent_of(surface.normal)
            wo = to_frame(tangent, surface.normal, surface.outgoing)
            lobe = random_pair(sample, step, DIMENSION_LOBE)
            scattered = sample_bsdf(scene, bsdf, wo, random_pair(sample, step, DIMENSION_BSDF), lobe[0])
            if wp.static(straight_through):
                if scattered.event == EVENT_PASS:
                    diffuse_throughput = wp.cw_mul(diffuse_throughput, scattered.specular)
                    specular_throughput = wp.cw_mul(specular_throughput, scattered.specular)
                    clear = wp.where(from_camera, clear * scattered.specular[0], clear)
                    passed_t = hit.t
                    hit = closest_after(scene, ray, hit)
                    step += 1
                    continue
            if from_camera:
                clear = 0.0
                from_camera = wp.bool(False)
            if depth >= request.bounces + 1:
                break

            # 4. Next-event estimation: aim at one light, weighted against meeting it by chance.
            if wp.static(sampled_lights):
                choice = random_pair(sample, step, DIMENSION_LIGHT_CHOICE)
                index = choose_light(scene, choice[0])
                light = scene.lights[index]
                aimed = sample_light(light, surface.position, random_pair(sample, step, DIMENSION_LIGHT))
                if aimed.pdf > 0.0 and wp.dot(surface.geometric_normal, aimed.direction) > 0.0:
                    value = evaluate(scene, bsdf, wo, to_frame(tangent, surface.normal, aimed.direction))
                    response = value.diffuse * light.diffuse + value.specular * light.specular
                    if max_component(response) > 0.0:
                        density = aimed.pdf * light.choice
                        chance = density
                        if wp.static(straight_through):
                            # Paths that went straight through did not aim: those that stayed stand for them.
                            chance = density * scattered.stay
                        weight = wp.float32(1.0)
                        if aimed.delta == 0:
                            weight = power_heuristic(density, value.pdf)
                        passed = transmittance(scene, shadow_ray(surface, aimed))
                        result.rays += wp.vec3i(0, 0, 1)
                        arriving = aimed.radiance * (weight * passed / chance)
                        result.radiance += wp.cw_mul(wp.cw_mul(throughput, response), arriving)

            # 5. Follow the sampled direction, unless it dips below the true surface.
            if scattered.event == EVENT_ABSORB:
                break
            direction = from_frame(tangent, surface.normal, scattered.direction)
            if wp.dot(surface.geometric_normal, direction) <= 0.0:
                break
            diffuse_throughput = wp.cw_mul(throughput, scattered.diffuse)
            specular_throughput = wp.cw_mul(throughput, scattered.specular)
            pdf = scattered.pdf
            if scattered.event == EVENT_DELTA:
                pdf = 0.0

            # 6. Russian roulette: faint paths end early, the survivors stand for them.
            if depth >= ROULETTE_AFTER:
                survival = wp.min(1.0, max_component(diffuse_throughput + specular_throughput))
                if lobe[1] >= survival:
                    break
                diffuse_throughput = diffuse_throughput / survival
                specular_throughput = specular_throughput / survival

            ray.origin = offset_origin(surface.position, surface.error, surface.geometric_normal, direction)
            ray.direction = direction
            ray.t_max = INFINITY
            passed_t = 0.0
            depth += 1
            step += 1
            hit = closest(scene, ray)
            result.rays += wp.vec3i(0, 1, 0)
        result.alpha = 1.0 - clear
        return result

    return radiance


@cache
def path_kernel(key: PathKey) -> wp.Kernel:
    """The kernel for a key; item i is pixel i in rows from the top, which no other item writes."""
    camera_ray = camera_ray_function(key.camera)
    radiance = radiance_function(key)

    @wp.kernel(module="unique", enable_backward=False)
    def path(first: wp.int32, scene: DeviceScene, camera: CameraRecord, request: PathRequest, film: FilmRecord):
        pixel = first + wp.tid()
        x = pixel % camera.width
        y = pixel // camera.width
        total = film.sums[y, x]
        squares = film.squares[y, x]
        replicates = film.replicates[y, x]
        rays = film.rays[y, x]
        kept = wp.int32(0)
        for s in range(request.samples):
            sample = sample_stream(request.seed, pixel, request.first_sample + s, request.sobol)
            u = random_pair(sample, -1, DIMENSION_PIXEL)
            px = wp.float32(x) + 0.5 + filter_offset(film.filter_table, u[0])
            py = wp.float32(y) + 0.5 + filter_offset(film.filter_table, u[1])
            ray = camera_ray(camera, px, py, random_pair(sample, -1, DIMENSION_LENS))
            result = radiance(scene, request, ray, sample)
            rays += result.rays
            if is_finite(result.radiance):
                value = wp.vec3d(
                    wp.float64(result.radiance[0]),
                    wp.float64(result.radiance[1]),
                    wp.float64(result.radiance[2]),
                )
                total += wp.vec4d(value[0], value[1], value[2], wp.float64(result.alpha))
                squares += wp.cw_mul(value, value)
                replicates[(request.first_sample + s) % REPLICATES] += wp.float64(luminance(result.radiance))
                kept += 1
        film.sums[y, x] = total
        film.squares[y, x] = squares
        film.replicates[y, x] = replicates
        film.rays[y, x] = rays
        film.samples[y, x] = film.samples[y, x] + kept
        film.dropped[y, x] = film.dropped[y, x] + request.samples - kept

    return path


def launch_path(
    key: PathKey,
    scene: DeviceScene,
    camera: CameraRecord,
    request: PathRequest,
    film: FilmRecord,
    device: str,
    threads: int | None,
) -> None:
    """Add `request.samples` samples to every pixel."""
    launch(path_kernel(key), camera.width * camera.height, [scene, camera, request, film], device, threads)
