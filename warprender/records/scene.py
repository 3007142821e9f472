"""The one struct that kernels of a whole scene take: it holds all others."""

from __future__ import annotations

import warp as wp

from .lights import ImageRecord, LightLeaf, LightNode, LightRecord, ProfileRecord
from .materials import BrdfRecord, InputRecord, LevelRecord, MaterialRecord, PictureRecord
from .shapes import GeometryRecord, InstanceRecord, PrimvarRecord, SdfRecord
from .world import World

#: `DeviceScene.light_sampling`: lights are chosen by power alone; or are not aimed at where a path may meet them.
BY_POWER, BY_CHANCE = wp.constant(wp.int32(1)), wp.constant(wp.int32(2))


@wp.struct
class DeviceScene:
    """Everything that a kernel reads of a scene. `primvars` has `primvar_count` entries a geometry.

    `local_reflection` is 1 where lights are added up one by one and rough lobes reflect nothing else.
    `light_sampling` is how paths aim at lights: 0, or `BY_POWER` or `BY_CHANCE`.

    `eye` is the camera's place, where the camera light is.

    `sdf_instances` are the numbers of the instances that are signed distance functions.

    `albedo` is `materials.albedo.albedo_table`. `tiles` has 100 picture numbers a UDIM set, -1 where there is none;
    `decode` is the sRGB curve for the 256 codes.

    `lights` has first `finite_lights` that rays may meet, whose boxes are
    in `light_boxes`, then `infinite_lights`, last the geometry that glows. `light_cdf` is over the infinite lights
    and, as its last entry, the tree of all others. `link_sets` has a bit for each prim. `glow_triangles` are faces
    in the order of leaves and `glow_cdf` is over the areas of each leaf's; `glow_leaves` has the leaf of each face, -1
    where it is not aimed at. `portals` are rectangles through which domes are aimed at.
    """

    instances: wp.array(dtype=InstanceRecord)
    geometries: wp.array(dtype=GeometryRecord)
    world: World
    sdfs: wp.array(dtype=SdfRecord)
    sdf_instances: wp.array(dtype=wp.int32)
    materials: wp.array(dtype=MaterialRecord)
    albedo: wp.array2d(dtype=wp.vec4)
    eye: wp.vec3
    energy_compensation: wp.int32
    local_reflection: wp.int32
    light_sampling: wp.int32
    inputs: wp.array(dtype=InputRecord)
    pictures: wp.array(dtype=PictureRecord)
    levels: wp.array(dtype=LevelRecord)
    texels: wp.array(dtype=wp.uint32)
    tiles: wp.array(dtype=wp.int32)
    decode: wp.array(dtype=wp.float32)
    brdfs: wp.array(dtype=BrdfRecord)
    primvars: wp.array(dtype=PrimvarRecord)
    primvar_count: wp.int32
    display_color: wp.int32
    display_opacity: wp.int32
    lights: wp.array(dtype=LightRecord)
    finite_lights: wp.int32
    infinite_lights: wp.int32
    light_boxes: wp.uint64
    light_cdf: wp.array(dtype=wp.float32)
    light_nodes: wp.array(dtype=LightNode)
    light_leaves: wp.array(dtype=LightLeaf)
    portals: wp.array(dtype=LightRecord)
    images: wp.array(dtype=ImageRecord)
    profiles: wp.array(dtype=ProfileRecord)
    link_sets: wp.array2d(dtype=wp.uint32)
    glow_triangles: wp.array(dtype=wp.int32)
    glow_cdf: wp.array(dtype=wp.float64)
    glow_leaves: wp.array(dtype=wp.int32)
