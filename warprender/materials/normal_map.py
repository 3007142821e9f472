"""Normals in tangent space, and the surface as materials see it: with its footprint and its mapped normal."""

from __future__ import annotations

from functools import cache

import warp as wp

from ..numerics import from_frame, linear_of, safe_normalize
from ..records import DeviceScene, Hit, Ray, Surface
from ..shapes.primvar import primvar_at
from ..shapes.surface import face_viewer, surface_function
from .inputs import input_function


@cache
def shading_function(
    shapes: tuple[str, ...], features: tuple[str, ...], sdfs: tuple[wp.Function, ...], bounded: bool = True
) -> wp.Function:
    """`shading_at(scene, ray, hit, footprint) -> Surface` for these shapes, features of materials and distances.

    `footprint` is the width across the ray of what the hit stands for, in scene units. `bounded`: whether rays will
    leave the surface, which asks for its error.
    """
    surface_at = surface_function(shapes, sdfs, bounded)
    input_at = input_function(features)
    mapped = "normal map" in features

    @wp.func
    def mapped_normal(scene: DeviceScene, surface: Surface, node: int) -> wp.vec3:
        # The frame of MikkTSpace: the bitangent is the cross product, turned round where the picture is mirrored.
        tangent = primvar_at(scene, surface, scene.inputs[node].tangents, wp.vec4(0.0, 0.0, 0.0, 0.0))
        linear = linear_of(scene.world.instances[surface.hit.instance].to_world)
        n = surface.normal
        if surface.front == 0:
            n = -n
        t = linear * wp.vec3(tangent[0], tangent[1], tangent[2])
        t = safe_normalize(t - n * wp.dot(n, t))
        if wp.dot(t, t) == 0.0:
            return surface.normal
        local = input_at(scene, surface, node)
        local[1] = local[1] * tangent[3] * wp.sign(wp.determinant(linear))
        world = from_frame(t, n, local)
        if surface.front == 0:
            world = -world
        return face_viewer(world, surface.geometric_normal, surface.outgoing)

    @wp.func
    def shading_at(scene: DeviceScene, ray: Ray, hit: Hit, footprint: float) -> Surface:
        surface = surface_at(scene, ray, hit)
        surface.footprint = footprint
        if wp.static(mapped):
            node = scene.materials[surface.material].normal
            if node >= 0:
                surface.normal = mapped_normal(scene, surface, node)
        return surface

    return shading_at
