"""What all transports of colour share: the loop over a pixel's samples, and what it asks of a transport.

A transport is a function `radiance(scene, request, ray, hit, cone, sample) -> PathResult`: one estimate of what a
camera ray sees, whose first hit is known. `cone` is the width of what the ray stands for at its origin, and how fast
it grows.
"""

from __future__ import annotations

from functools import cache

import warp as wp

from ..camera import camera_ray_function, pixel_cone
from ..color import luminance
from ..film import FilmRecord, Terms, end_sample
from ..filters import filter_offset
from ..launch import launch
from ..numerics import is_finite
from ..plan import RenderPlan, Request
from ..records import CameraRecord, DeviceScene, Hit
from ..sampling import DIMENSION_LENS, DIMENSION_PIXEL, REPLICATES, random_pair, sample_stream
from ..visibility.sdf import ray_functions
from .lighting import Visible

#: Share of a pixel's width that one sample stands for. The samples average the rest themselves: look-ups this wide
#: leave a distant texture without aliasing from 16 samples on, and add 1/16 to the variance of the pixel filter.
FOOTPRINT = wp.constant(wp.float32(0.25))


@wp.struct
class PathRequest:
    """Runtime values of a pass: which samples, how many bounces, which lights the camera sees.

    `met` is 0 where nothing gives light that rays meet by chance: the last bounce is for aiming alone then.

    Where `adaptive` is 1, pixels take the samples after those that they have, as many as `counts` (H, W) says.

    `unfiltered` is 1 where texture look-ups take the finest level at one point.

    Where the first hits are rasterized, `hits` (H, W) has them, of rays at `offset` pixels from the pixels' centres.
    A transport brings what it adds to radiance to `terms` as well.
    """

    seed: wp.uint32
    first_sample: wp.int32
    samples: wp.int32
    adaptive: wp.int32
    counts: wp.array2d(dtype=wp.int32)
    sobol: wp.int32
    bounces: wp.int32
    met: wp.int32
    unfiltered: wp.int32
    visible: Visible
    hits: wp.array2d(dtype=Hit)
    offset: wp.vec2
    terms: Terms


def path_request(request: Request, plan: RenderPlan, seed: int, sobol: bool) -> PathRequest:
    """What is asked of a transport, but for the samples of a pass. `sobol`: from points that are well spread."""
    asked = PathRequest()
    asked.seed = int(seed) & 0xFFFFFFFF
    asked.sobol = int(sobol)
    asked.unfiltered = int(not request.filter_textures)
    asked.visible.lights = int(request.lights_visible)
    asked.visible.domes = int(request.dome_light_visible or request.lights_visible)
    follow_bounds(asked, plan)
    return asked


def follow_bounds(asked: PathRequest, plan: RenderPlan) -> None:
    """What the plan's bounds say to the kernel, as they are now."""
    asked.bounces = int(plan.bounds.get("bounces", 0))
    asked.met = int(plan.bounds.get("lights can be hit", True))


@wp.struct
class PathResult:
    """Radiance of one camera ray, its alpha, and the rays traced after its first hit: (0, bounce, shadow).

    `unfollowed` counts rays that the transport had no room for.
    """

    radiance: wp.vec3
    alpha: wp.float32
    rays: wp.vec3i
    unfollowed: wp.int32


@cache
def samples_kernel(
    camera_effects: tuple[str, ...],
    sdfs: tuple[wp.Function, ...],
    radiance: wp.Function,
    rasterized: bool = False,
    terms: bool = False,
    ray_accuracy: str = "watertight",
) -> wp.Kernel:
    """The kernel of a transport; item i is pixel i in rows from the top, which no other item writes.

    Args:
        camera_effects: by name.
        sdfs: the signed distance functions that occur.
        radiance: from a factory that is cached on its key: the same function gives the same kernel.
        rasterized: whether the first hits are known; such a pass has one sample.
        terms: whether single terms are kept, as `radiance` was made for.
        ray_accuracy: of `PathKey`.
    """
    camera_ray = camera_ray_function(camera_effects)
    closest, _, _ = ray_functions(sdfs, ray_accuracy)

    @wp.kernel(module="unique", enable_backward=False)
    def samples(first: wp.int32, scene: DeviceScene, camera: CameraRecord, request: PathRequest, film: FilmRecord):
        pixel = first + wp.tid()
        x = pixel % camera.width
        y = pixel // camera.width
        total = film.sums[y, x]
        squares = film.squares[y, x]
        parts = film.parts[y, x]
        rays = film.rays[y, x]
        kept = wp.int32(0)
        unfollowed = film.unfollowed[y, x]
        begin = request.first_sample
        number = request.samples
        if request.adaptive != 0:
            begin = film.samples[y, x] + film.dropped[y, x]
            number = request.counts[y, x]
        for s in range(number):
            sample = sample_stream(request.seed, pixel, begin + s, request.sobol)
            part = (begin + s) % REPLICATES
            of_sequence = (begin + s) / REPLICATES
            if of_sequence > 0:
                if (of_sequence & (of_sequence - 1)) == 0:
                    # The two parts are as many samples as both are to have now.
                    parts[part] += parts[part + REPLICATES]
                    parts[part + REPLICATES] = wp.float64(0.0)
                part += REPLICATES
            u = random_pair(sample, -1, DIMENSION_PIXEL)
            px = wp.float32(x) + 0.5
            py = wp.float32(y) + 0.5
            if wp.static(rasterized):
                px += request.offset[0]
                py += request.offset[1]
            else:
                px += filter_offset(film.filter_table, u[0])
                py += filter_offset(film.filter_table, u[1])
            ray = camera_ray(camera, px, py, random_pair(sample, -1, DIMENSION_LENS))
            hit = Hit()
            if wp.static(rasterized):
                hit = request.hits[y, x]
            else:
                hit = closest(scene, ray)
                rays += wp.vec3i(1, 0, 0)
            cone = pixel_cone(camera) * FOOTPRINT
            if request.unfiltered != 0:
                cone = wp.vec2(0.0, 0.0)
            result = radiance(scene, request, ray, hit, cone, sample)
            rays += result.rays
            unfollowed += result.unfollowed
            if wp.static(terms):
                end_sample(request.terms, pixel, is_finite(result.radiance))
            if is_finite(result.radiance):
                value = wp.vec3d(result.radiance)
                total += wp.vec4d(value[0], value[1], value[2], wp.float64(result.alpha))
                squares += wp.cw_mul(value, value)
                parts[part] += wp.float64(luminance(result.radiance))
                kept += 1
        film.sums[y, x] = total
        film.squares[y, x] = squares
        film.parts[y, x] = parts
        film.rays[y, x] = rays
        film.unfollowed[y, x] = unfollowed
        film.samples[y, x] = film.samples[y, x] + kept
        film.dropped[y, x] = film.dropped[y, x] + number - kept

    return samples


def launch_samples(
    kernel: wp.Kernel,
    scene: DeviceScene,
    camera: CameraRecord,
    request: PathRequest,
    film: FilmRecord,
    device: str,
    threads: int | None,
    pixels: int | None = None,
) -> None:
    """Add `request.samples` samples to the first `pixels`, None for all, by a kernel of `samples_kernel`."""
    count = camera.width * camera.height if pixels is None else pixels
    launch(kernel, count, [scene, camera, request, film], device, threads)
