"""Shapes, primvars, and what each placed shape is."""

from __future__ import annotations

import warp as wp


@wp.struct
class PrimvarRecord:
    """A primvar: `width` floats a value; `interpolation` indexes INTERPOLATIONS, -1 where the shape has none.

    `indices` has three entries a triangle for faceVarying values.
    """

    interpolation: wp.int32
    width: wp.int32
    values: wp.array(dtype=wp.float32)
    indices: wp.array(dtype=wp.int32)


@wp.struct
class SdfRecord:
    """A signed distance function in object space: number `function` of the plan's, asked between two corners.

    `values` (X, Y, Z) are samples on a grid over the box, empty for functions that have none.
    """

    function: wp.int32
    lower: wp.vec3
    upper: wp.vec3
    lipschitz: wp.float32
    precision: wp.float32
    parameters: wp.vec4
    values: wp.array3d(dtype=wp.float32)


@wp.struct
class GeometryRecord:
    """A shape in object space, stored once. `kind` indexes SHAPES; its tree is in `DeviceScene.world`.

    `sdf` is its number in `DeviceScene.sdfs`, if it is one.
    """

    kind: wp.int32
    points: wp.array(dtype=wp.vec3)
    indices: wp.array(dtype=wp.int32)
    faces: wp.array(dtype=wp.int32)
    face_material: wp.array(dtype=wp.int32)
    normals: PrimvarRecord
    radius: wp.float32
    sdf: wp.int32


@wp.struct
class InstanceRecord:
    """What a placed shape is; where it is stands in `World.instances`. `material` -1 asks the geometry's
    `face_material`. `semantic` is the number of its label, or -1. `light` is the light that it is, where
    it glows and next-event estimation aims at it; else -1.
    """

    geometry: wp.int32
    material: wp.int32
    prim: wp.int32
    instance_id: wp.int32
    semantic: wp.int32
    light: wp.int32
