"""Many views of one scene in one launch: for each pixel its first hit, every output that is asked for, and colour.

Where colour is one sample of the first surface, outputs and colour share what was found out about that surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import warp as wp

from ..camera import camera_ray_function, pixel_cone
from ..color import srgb_byte
from ..materials.dispatch import material_functions
from ..materials.normal_map import shading_function
from ..numerics import is_finite, tangent_of, to_frame
from ..outputs import OUTPUTS, OutputBuffers, Seen
from ..plan import ONE_SURFACE, OutputsKey, PathKey
from ..records import CameraRecord, DeviceScene, Hit, Ray
from ..sampling import DIMENSION_LENS, DIMENSION_PIXEL, random_pair, sample_stream
from ..visibility.first_hits import draw_of, rastered
from ..visibility.rays import miss
from ..visibility.sdf import ray_functions
from ..visibility.worlds import Worlds, one_world
from .direct import reflected_function
from .lighting import Departure
from .meeting import glow_function
from .none import past_clear_function
from .samples import FOOTPRINT, PathRequest, PathResult


@dataclass(frozen=True)
class ViewKey:
    """What the kernel is compiled for.

    Attributes:
        path: of colour's transport, None without colour.
        outputs: of the AOVs, None without any.
        transport: of colour.
        found_by: "rays" through a window, rays of a "table", or "raster".
        worlds: whether a view sees one world of many.
        others: by raster, whether there are shapes that only rays find.
        colors: how colour is wanted: "color", as numbers, and "rgba8", as bytes.
        lights_seen: whether the camera sees lights.
        centred: whether colour is one sample at the pixel's centre.
    """

    path: PathKey | None
    outputs: OutputsKey | None
    transport: str
    found_by: str
    worlds: bool
    others: bool
    colors: tuple[str, ...]
    lights_seen: bool
    centred: bool

    @property
    def any_key(self) -> PathKey | OutputsKey:
        """What says which shapes and materials there are."""
        return self.path or self.outputs

    @property
    def shared(self) -> bool:
        """Whether colour and outputs are of the same surface."""
        alike = self.path is not None and self.transport in ONE_SURFACE
        return alike and self.centred and not self.path.straight_through and not self.lights_seen


@wp.struct
class ViewRequest:
    """What the views are: `cameras` (V,), pictures of `width` by `height`; `directions` (H, W) of a table's rays.

    View v sees world `worlds[v]` of `lists`. By raster `face`, `u` and `v` (V H, W) are what the rasterizer saw, where
    member m of a world has the faces from `first_face[m]` on, and where `marks` (V H, W) is 1, rays look for the
    instances of `others` too.
    """

    path: PathRequest
    cameras: wp.array(dtype=CameraRecord)
    width: wp.int32
    height: wp.int32
    directions: wp.array2d(dtype=wp.vec3)
    worlds: wp.array(dtype=wp.int32)
    lists: Worlds
    others: Worlds
    first_face: wp.array(dtype=wp.int32)
    face: wp.array2d(dtype=wp.int32)
    u: wp.array2d(dtype=wp.float32)
    v: wp.array2d(dtype=wp.float32)
    marks: wp.array2d(dtype=wp.uint8)
    color: wp.array2d(dtype=wp.vec4)
    rgba8: wp.array2d(dtype=wp.uint32)


@cache
def view_ray_function(key: ViewKey) -> wp.Function:
    """`view_ray(request, camera, x, y, px, py, lens) -> Ray` through raster position (px, py) of pixel (x, y)."""
    if key.found_by != "table":
        camera_ray = camera_ray_function(key.any_key.camera)

        @wp.func
        def view_ray(
            request: ViewRequest, camera: CameraRecord, x: int, y: int, px: float, py: float, lens: wp.vec2
        ) -> Ray:
            return camera_ray(camera, px, py, lens)

        return view_ray

    @wp.func
    def table_ray(
        request: ViewRequest, camera: CameraRecord, x: int, y: int, px: float, py: float, lens: wp.vec2
    ) -> Ray:
        ray = Ray()
        ray.direction = camera.rotation * request.directions[y, x]
        ray.origin = camera.position + ray.direction * camera.near
        ray.t_max = camera.far - camera.near
        return ray

    return table_ray


@cache
def view_hit_function(key: ViewKey) -> wp.Function:
    """`view_hit(scene, request, ray, world, row, x) -> Hit`: what the centre of a pixel sees first."""
    closest, _, _ = ray_functions(key.any_key.sdfs)
    if key.found_by != "raster":

        @wp.func
        def ray_hit(scene: DeviceScene, request: ViewRequest, ray: Ray, world: int, row: int, x: int) -> Hit:
            return closest(scene, ray)

        return ray_hit

    others = key.others

    @wp.func
    def raster_hit(scene: DeviceScene, request: ViewRequest, ray: Ray, world: int, row: int, x: int) -> Hit:
        hit = miss()
        face = request.face[row, x]
        if face >= 0:
            lists = request.lists
            member = draw_of(request.first_face, lists.starts[world], lists.starts[world + 1], face)
            triangle = face - request.first_face[member]
            hit = rastered(scene, ray, lists.members[member], triangle, request.u[row, x], request.v[row, x])
        if wp.static(others):
            if request.marks[row, x] != wp.uint8(0):
                # The rest, by rays among it alone, up to what the rasterizer saw.
                scene.world = one_world(scene.world, request.others, world)
                nearer = Ray()
                nearer.origin = ray.origin
                nearer.direction = ray.direction
                nearer.t_max = wp.min(ray.t_max, hit.t)
                found = closest(scene, nearer)
                if found.instance >= 0:
                    hit = found
        return hit

    return raster_hit


@cache
def first_surface_function(key: ViewKey) -> wp.Function:
    """`reflected(scene, request, ray, seen, pixel) -> vec3`: what the surface that a pixel sees sends to it."""
    glow = glow_function(key.path)
    reflected = reflected_function(key.path, key.transport == "direct")
    with_lights = bool(key.path.lights)

    @wp.func
    def first_surface(scene: DeviceScene, request: ViewRequest, ray: Ray, seen: Seen, pixel: int) -> wp.vec3:
        camera = Departure()
        camera.prim = -1
        camera.diffuse = wp.vec3(1.0, 1.0, 1.0)
        total = glow(scene, camera, ray.direction, seen.surface, seen.bsdf.emission)
        if wp.static(with_lights):
            sample = sample_stream(request.path.seed, pixel, 0, request.path.sobol)
            tangent = tangent_of(seen.surface.normal)
            wo = to_frame(tangent, seen.surface.normal, seen.surface.outgoing)
            light = reflected(scene, seen.surface, seen.bsdf, camera.absorption, tangent, wo, sample, 0)
            total += light.radiance
        return total

    return first_surface


@cache
def sampled_function(key: ViewKey, radiance: wp.Function) -> wp.Function:
    """`sampled(scene, request, camera, world, hit, x, y, pixel) -> vec4`: the mean of a pixel's samples, and alpha.

    Samples that are not finite are left out.
    """
    view_ray = view_ray_function(key)
    closest, _, _ = ray_functions(key.any_key.sdfs)
    # A table has no rays but those through the centres, and the rasterizer sees nothing else.
    centred = key.centred or key.found_by == "table"

    @wp.func
    def sampled(
        scene: DeviceScene,
        request: ViewRequest,
        camera: CameraRecord,
        world: int,
        first: Hit,
        x: int,
        y: int,
        pixel: int,
    ) -> wp.vec4:
        total = wp.vec4d()
        kept = wp.int32(0)
        for s in range(request.path.samples):
            sample = sample_stream(request.path.seed, pixel, s, request.path.sobol)
            px = wp.float32(x)
            py = wp.float32(y)
            hit = first
            if wp.static(centred):
                px += 0.5
                py += 0.5
            else:
                u = random_pair(sample, -1, DIMENSION_PIXEL)
                px += u[0]
                py += u[1]
            ray = view_ray(request, camera, x, y, px, py, random_pair(sample, -1, DIMENSION_LENS))
            if wp.static(not centred):
                hit = closest(scene, ray)
            result = PathResult()
            result = radiance(scene, request.path, ray, hit, pixel_cone(camera) * FOOTPRINT, sample)
            if is_finite(result.radiance):
                value = wp.vec3d(result.radiance)
                total += wp.vec4d(value[0], value[1], value[2], wp.float64(result.alpha))
                kept += 1
        return wp.vec4(total / wp.float64(wp.max(kept, 1)))

    return sampled


@cache
def views_kernel(key: ViewKey, radiance: wp.Function | None) -> wp.Kernel:
    """The kernel for `launch_pixels` over the rows of all views, one below the other.

    `radiance` is the transport's, None where colour is shared with the outputs or not wanted.
    """
    names = key.any_key
    view_ray, view_hit = view_ray_function(key), view_hit_function(key)
    # Rays leave the shared surface for shadows alone.
    shading_at = shading_function(names.shapes, names.features, names.sdfs, key.shared and key.transport == "direct")
    prepare, _, _ = material_functions(names.materials, names.features)
    past_clear = past_clear_function(names)
    writers = tuple(OUTPUTS[name].write for name in (key.outputs.outputs if key.outputs else ()))
    count, with_color, shared = len(writers), key.path is not None, key.shared
    straight_through = names.straight_through and count > 0
    of_material = key.outputs is not None and any(OUTPUTS[name].of_material for name in key.outputs.outputs)
    with_materials, with_surface = shared or of_material, shared or count > 0
    first_surface = first_surface_function(key) if shared else None
    sampled = sampled_function(key, radiance) if with_color and not shared else None
    worlds, by_number, by_bytes = key.worlds, "color" in key.colors, "rgba8" in key.colors
    orthographic = int("orthographic" in names.camera)

    @wp.kernel(module="unique", enable_backward=False)
    def views(first: wp.int32, columns: wp.int32, scene: DeviceScene, request: ViewRequest, buffers: OutputBuffers):
        begin = (first + wp.tid()) * columns
        row = begin // request.width
        view = row // request.height
        y = row - view * request.height
        camera = request.cameras[view]
        cone = pixel_cone(camera)
        scene.eye = camera.position
        world = wp.clamp(request.worlds[view], 0, request.lists.count - 1)
        if wp.static(worlds):
            scene.world = one_world(scene.world, request.lists, world)
        start = begin - row * request.width
        seen = Seen()
        seen.y = row
        seen.camera = camera
        seen.orthographic = wp.static(orthographic)
        for x in range(start, start + columns):
            px = wp.float32(x) + 0.5
            py = wp.float32(y) + 0.5
            ray = view_ray(request, camera, x, y, px, py, wp.vec2(0.5, 0.5))
            hit = view_hit(scene, request, ray, world, row, x)
            # Numbers, not a vector: that would go through memory.
            red = wp.float32(0.0)
            green = wp.float32(0.0)
            blue = wp.float32(0.0)
            alpha = wp.float32(0.0)
            if wp.static(with_color and not shared):
                color = sampled(scene, request, camera, world, hit, x, y, row * request.width + x)
                red = color[0]
                green = color[1]
                blue = color[2]
                alpha = color[3]
            if wp.static(with_surface):
                if wp.static(straight_through):
                    hit = past_clear(scene, ray, hit, cone)
                if hit.instance >= 0:
                    seen.x = x
                    seen.ray = ray
                    seen.surface = shading_at(scene, ray, hit, cone[0] + cone[1] * hit.t)
                    if wp.static(with_materials):
                        seen.bsdf = prepare(scene, seen.surface)
                    if wp.static(shared):
                        light = first_surface(scene, request, ray, seen, row * request.width + x)
                        if is_finite(light):
                            red = light[0]
                            green = light[1]
                            blue = light[2]
                            alpha = 1.0
                    seen.instance = scene.instances[hit.instance]
                    seen.face = 0
                    if scene.geometries[seen.instance.geometry].faces.shape[0] > 0:
                        seen.face = scene.geometries[seen.instance.geometry].faces[hit.face]
                    # Unrolled in the kernel's own body, where a table of functions is safe.
                    for k in range(wp.static(count)):
                        wp.static(writers[k])(buffers, seen)
            if wp.static(by_number):
                request.color[row, x] = wp.vec4(red, green, blue, alpha)
            if wp.static(by_bytes):
                request.rgba8[row, x] = (
                    srgb_byte(red)
                    | (srgb_byte(green) << wp.uint32(8))
                    | (srgb_byte(blue) << wp.uint32(16))
                    | (wp.uint32(wp.clamp(alpha, 0.0, 1.0) * 255.0 + 0.5) << wp.uint32(24))
                )

    return views
