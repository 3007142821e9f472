"""Transport "none": AOVs of the surface that the centre of each pixel sees. No light, no secondary ray."""

from __future__ import annotations

from functools import cache

import warp as wp

from ..camera import camera_ray_function, pixel_cone
from ..launch import launch_pixels
from ..materials.dispatch import material_functions
from ..materials.normal_map import shading_function
from ..outputs import OUTPUTS, OutputBuffers, Seen
from ..plan import OutputsKey, PathKey
from ..records import CameraRecord, DeviceScene, Hit, Ray
from ..visibility.sdf import ray_functions

#: Surfaces that are wholly clear are looked through, this many at most.
MOST_CLEAR_SURFACES = wp.constant(wp.int32(256))


@cache
def past_clear_function(key: OutputsKey | PathKey) -> wp.Function:
    """`past_clear(scene, ray, hit, cone) -> Hit`: from a hit on, the first surface that is not wholly clear.

    `cone` is the width of what the ray stands for at its origin, and how fast it grows.
    """
    shading_at = shading_function(key.shapes, key.features, key.sdfs)
    prepare, _, _ = material_functions(key.materials, key.features)
    _, closest_after, _ = ray_functions(key.sdfs)

    @wp.func
    def past_clear(scene: DeviceScene, ray: Ray, hit: Hit, cone: wp.vec2) -> Hit:
        found = hit
        clear = wp.int32(0)
        while found.instance >= 0 and clear < MOST_CLEAR_SURFACES:
            surface = shading_at(scene, ray, found, cone[0] + cone[1] * found.t)
            if prepare(scene, surface).pass_through < 1.0:
                return found
            found = closest_after(scene, ray, found)
            clear += 1
        return found

    return past_clear


@cache
def outputs_kernel(key: OutputsKey) -> wp.Kernel:
    """The kernel for a key, for `launch_pixels`."""
    camera_ray = camera_ray_function(key.camera)
    shading_at = shading_function(key.shapes, key.features, key.sdfs)
    prepare, _, _ = material_functions(key.materials, key.features)
    past_clear = past_clear_function(key)
    writers = tuple(OUTPUTS[name].write for name in key.outputs)
    count = len(writers)
    straight_through = key.straight_through
    with_materials = any(OUTPUTS[name].of_material for name in key.outputs)
    orthographic = int("orthographic" in key.camera)

    @wp.kernel(module="unique", enable_backward=False)
    def outputs(
        first: wp.int32,
        columns: wp.int32,
        scene: DeviceScene,
        camera: CameraRecord,
        hits: wp.array2d(dtype=Hit),
        buffers: OutputBuffers,
    ):
        begin = (first + wp.tid()) * columns
        y = begin // camera.width
        cone = pixel_cone(camera)
        for x in range(begin - y * camera.width, begin - y * camera.width + columns):
            hit = hits[y, x]
            ray = camera_ray(camera, wp.float32(x) + 0.5, wp.float32(y) + 0.5, wp.vec2(0.5, 0.5))
            if wp.static(straight_through):
                hit = past_clear(scene, ray, hit, cone)
            if hit.instance >= 0:
                seen = Seen()
                seen.x = x
                seen.y = y
                seen.camera = camera
                seen.orthographic = wp.static(orthographic)
                seen.ray = ray
                seen.surface = shading_at(scene, ray, hit, cone[0] + cone[1] * hit.t)
                if wp.static(with_materials):
                    seen.bsdf = prepare(scene, seen.surface)
                seen.instance = scene.instances[hit.instance]
                if scene.geometries[seen.instance.geometry].faces.shape[0] > 0:
                    seen.face = scene.geometries[seen.instance.geometry].faces[hit.face]
                # Unrolled in the kernel's own body, where a table of functions is safe.
                for k in range(wp.static(count)):
                    wp.static(writers[k])(buffers, seen)

    return outputs


def launch_outputs(
    key: OutputsKey,
    scene: DeviceScene,
    camera: CameraRecord,
    hits: wp.array2d(dtype=Hit),
    buffers: OutputBuffers,
    device: str,
    threads: int,
) -> None:
    """Write the key's outputs for every pixel that sees something; the others keep their clear values.

    `hits` (H, W) are the first hits of `visibility.first_hits`.
    """
    arguments = [scene, camera, hits, buffers]
    launch_pixels(outputs_kernel(key), camera.width, camera.height, arguments, device, threads)
