"""Materials as rows of numbers, and the pictures and tables that their inputs come from."""

from __future__ import annotations

import warp as wp

#: Number of inputs that a material row has room for.
MATERIAL_INPUTS = 16

MaterialValues = wp.types.matrix(shape=(MATERIAL_INPUTS, 3), dtype=wp.float32)


@wp.struct
class MaterialRecord:
    """One material: its kind, and values by the input numbers that the kind's file names.

    What varies over the surface are the `varying` entries of `DeviceScene.inputs` from number `first` on; the entry
    of a tangent-space normal is number `normal`, `table` indexes `DeviceScene.brdfs`; -1 where there is none.
    """

    kind: wp.int32
    values: MaterialValues
    first: wp.int32
    varying: wp.int32
    normal: wp.int32
    table: wp.int32


@wp.struct
class InputRecord:
    """Where input `number` comes from: a picture, a set of tiles, or with neither (-1) a primvar as it is.

    `footprint` multiplies the surface's. `primvar` is the slot of the texture coordinates, or of the value itself,
    -1 for `absent`, which also stands in where a shape has no such primvar. A picture is seen at
    linear · coordinates + offset; `channel` is 0 … 3, or 4 for all. `tangents` is the slot of the tangents along
    those coordinates, -1 where nothing asks for them.
    """

    number: wp.int32
    footprint: wp.float32
    picture: wp.int32
    tiles: wp.int32
    primvar: wp.int32
    tangents: wp.int32
    absent: wp.vec4
    linear: wp.mat22
    offset: wp.vec2
    wrap_s: wp.int32
    wrap_t: wp.int32
    channel: wp.int32
    scale: wp.vec4
    bias: wp.vec4
    fallback: wp.vec4


@wp.struct
class PictureRecord:
    """A picture: its `levels`, finest first, from number `level` on; `format` is one of texels.FORMATS."""

    format: wp.int32
    level: wp.int32
    levels: wp.int32


@wp.struct
class LevelRecord:
    """One level of a picture: rows from the bottom, from word number `first` of `DeviceScene.texels` on."""

    first: wp.int32
    width: wp.int32
    height: wp.int32


@wp.struct
class BrdfRecord:
    """A measured BRDF: `values` in 1/sr over √θ_half, θ_diff and φ_diff, and tables that half-vectors are drawn from.

    `rows` (A, R + 1) and `columns` (A, R, C + 1) are cumulative distributions over √θ_half and over the angle between
    the azimuths of half-vector and viewer, for each of A angles of the viewer; rows of 0 have nothing to draw.
    """

    values: wp.array3d(dtype=wp.vec3)
    rows: wp.array2d(dtype=wp.float32)
    columns: wp.array3d(dtype=wp.float32)
