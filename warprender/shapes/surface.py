"""From a hit to the surface that shading sees: position with its error, and normals, in the world."""

from __future__ import annotations

from functools import cache

import warp as wp

from ..numerics import is_finite, linear_of, move_point, place_point, placed_point, safe_normalize, translation_of
from ..records import MOVED, DeviceScene, Hit, Instance, Ray, Surface
from .local_surface import LocalSurface
from .mesh import mesh_surface
from .sdf import sdf_surface_function
from .sphere import sphere_surface

#: A shading normal that turns away more than the surface itself is bent back to this cosine.
_SMALLEST_COSINE = wp.constant(wp.float32(0.01))


@wp.func
def object_origin(placed: Instance, p: wp.vec3) -> wp.vec3:
    """World point in object space: subtracted before it is turned, so that distance from the origin cancels."""
    return linear_of(placed.to_object) * (p - translation_of(placed.to_world))


@wp.func
def face_viewer(normal: wp.vec3, geometric: wp.vec3, outgoing: wp.vec3) -> wp.vec3:
    """Shading normal on the side of the geometric one; the geometric one where it is degenerate."""
    n = safe_normalize(normal)
    if not is_finite(n) or wp.dot(n, n) == 0.0:
        return geometric
    if wp.dot(n, geometric) < 0.0:
        n = -n
    cosine = wp.dot(n, outgoing)
    if cosine < _SMALLEST_COSINE and cosine < wp.dot(geometric, outgoing):
        n = wp.normalize(n + outgoing * (_SMALLEST_COSINE - cosine))
    return n


@cache
def place_function(bounded: bool) -> wp.Function:
    """`place(scene, ray, hit, local) -> Surface`; `bounded`: with the bound of the position's error."""

    @wp.func
    def place(scene: DeviceScene, ray: Ray, hit: Hit, local: LocalSurface) -> Surface:
        """The local surface in the world; normals by the cotangent (inverse transposed) transform."""
        instance = scene.instances[hit.instance]
        surface = Surface()
        surface.hit = hit
        surface.geometry = instance.geometry
        placed = scene.world.instances[hit.instance]
        turned = placed.placed != 0 and placed.placed != wp.static(MOVED)
        if wp.static(bounded):
            there = translation_of(placed.to_world)
            back = translation_of(placed.to_object)
            position, error = move_point(there, back, local.position, local.error)
            if turned:
                position, error = place_point(placed.to_world, placed.to_object, local.position, local.error)
            surface.position = position
            surface.error = error
        else:
            surface.position = placed_point(placed.to_world, local.position)
        surface.outgoing = -safe_normalize(ray.direction)
        cotangent = wp.transpose(linear_of(placed.to_object))
        n = local.geometric_normal
        if turned:
            n = cotangent * n
        n = safe_normalize(n)
        surface.front = 1
        if wp.dot(n, surface.outgoing) < 0.0:
            n = -n
            surface.front = 0
        surface.geometric_normal = n
        surface.normal = n
        if not (local.normal == local.geometric_normal):
            shading = cotangent * local.normal
            surface.normal = face_viewer(wp.where(surface.front == 0, -shading, shading), n, surface.outgoing)
        surface.material = instance.material
        if instance.material < 0:
            surface.material = scene.geometries[instance.geometry].face_material[local.face]
        return surface

    return place


@cache
def surface_function(shapes: tuple[str, ...], sdfs: tuple[wp.Function, ...] = (), bounded: bool = True) -> wp.Function:
    """`surface_at(scene, ray, hit)` for hits on these kinds of shapes, by class name, and these distance functions.

    `bounded`: whether rays will leave the surface, which asks for its error.
    """
    place = place_function(bounded)
    with_spheres = "Sphere" in shapes
    with_sdfs = bool(sdfs)
    sdf_surface = sdf_surface_function(sdfs) if sdfs else None

    @wp.func
    def surface_at(scene: DeviceScene, ray: Ray, hit: Hit) -> Surface:
        geometry = scene.instances[hit.instance].geometry
        kind = scene.geometries[geometry].kind
        if wp.static(with_spheres):
            if kind == 1:
                placed = scene.world.instances[hit.instance]
                origin = object_origin(placed, ray.origin)
                direction = linear_of(placed.to_object) * ray.direction
                sphere = sphere_surface(scene.geometries[geometry].radius, hit, origin, direction)
                return place(scene, ray, hit, sphere)
        if wp.static(with_sdfs):
            if kind == 2:
                placed = scene.world.instances[hit.instance]
                origin = object_origin(placed, ray.origin)
                direction = linear_of(placed.to_object) * ray.direction
                solid = sdf_surface(scene, scene.geometries[geometry].sdf, origin, direction, hit.t)
                return place(scene, ray, hit, solid)
        return place(scene, ray, hit, mesh_surface(scene, geometry, hit))

    return surface_at
