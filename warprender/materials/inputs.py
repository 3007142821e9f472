"""Inputs of materials: constants, textures and primvars, behind one function, `material_values`.

A material's row holds a value for each input, and refers to a node for each that varies over the surface.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import warp as wp

from ..numerics import linear_of, max_component, tangent_of
from ..records import MATERIAL_INPUTS, DeviceScene, MaterialValues, Surface
from ..shapes.primvar import INTERPOLATIONS, corner_values, primvar_at, triangle_vertices, value_at
from ..textures import Footprint, PrimvarReader, Texture, texture_at

#: What a number or a colour that varies is read from.
Varying = Texture | PrimvarReader
Number = float | Varying
Color = tuple[float, float, float] | Varying

#: Input number of the tangent-space normal, in every kind of material that has one.
NORMAL = MATERIAL_INPUTS - 1

#: What the code of materials is specialised on; "transmission" is light that goes on beyond a surface, refracted.
FEATURES = ("energy compensation", "normal map", "primvar", "texture", "transmission")

_VERTEX = wp.constant(wp.int32(INTERPOLATIONS.index("vertex")))
_FACE_VARYING = wp.constant(wp.int32(INTERPOLATIONS.index("faceVarying")))
#: Cosine below which a footprint grows no longer.
_GRAZING = wp.constant(wp.float32(0.01))


def constant(value: object, width: int = 3) -> list[float]:
    """`width` numbers of a constant, zeros where the input varies."""
    if isinstance(value, Varying):
        return [0.0] * width
    numbers = [float(v) for v in np.reshape(value, -1)]
    return (numbers + [0.0] * width)[:width]


def least(value: Number) -> float:
    """The least that a number may be; a primvar may be anything from 0 on."""
    if isinstance(value, Texture):
        return value.least()
    return 0.0 if isinstance(value, PrimvarReader) else float(value)


@wp.func
def row_of(values: MaterialValues, number: int) -> wp.vec3:
    """A colour among the values."""
    return wp.vec3(values[number, 0], values[number, 1], values[number, 2])


@wp.func
def clamped(color: wp.vec3) -> wp.vec3:
    """A reflectance within what a surface can reflect."""
    return wp.vec3(wp.clamp(color[0], 0.0, 1.0), wp.clamp(color[1], 0.0, 1.0), wp.clamp(color[2], 0.0, 1.0))


@wp.func
def footprint_at(scene: DeviceScene, surface: Surface, slot: int, absent: wp.vec4, width: float) -> Footprint:
    """Texture coordinates at a surface, and how far they reach over a footprint of this width.

    A cone that wide meets the tangent plane in an ellipse; its axes are carried over by the triangle's own
    linear map from places to coordinates (Akenine-Möller et al. 2021, JCGT 10(1)).
    """
    place = Footprint()
    place.st = wp.vec2(absent[0], absent[1])
    if slot < 0:
        return place
    value = primvar_at(scene, surface, slot, absent)
    place.st = wp.vec2(value[0], value[1])
    index = surface.geometry * scene.primvar_count + slot
    interpolation = scene.primvars[index].interpolation
    if width <= 0.0 or interpolation < _VERTEX or interpolation > _FACE_VARYING:
        return place

    vertices = triangle_vertices(scene, surface)
    linear = linear_of(scene.world.instances[surface.hit.instance].to_world)
    p0 = scene.geometries[surface.geometry].points[vertices[0]]
    edge1 = linear * (scene.geometries[surface.geometry].points[vertices[1]] - p0)
    edge2 = linear * (scene.geometries[surface.geometry].points[vertices[2]] - p0)
    # At the triangle's own scale its area neither under- nor overflows.
    size = wp.max(max_component(wp.abs(edge1)), max_component(wp.abs(edge2)))
    if not size > 0.0:
        return place
    edge1 = edge1 / size
    edge2 = edge2 / size
    area = wp.cross(edge1, edge2)
    squared = wp.dot(area, area)
    if not squared > 0.0:
        return place

    corners = corner_values(scene.primvars[index], surface.hit.face, vertices)
    value0 = value_at(scene.primvars[index], corners[0])
    step1 = value_at(scene.primvars[index], corners[1]) - value0
    step2 = value_at(scene.primvars[index], corners[2]) - value0
    n = surface.geometric_normal
    sideways = wp.cross(n, surface.outgoing)
    if wp.dot(sideways, sideways) < 1.0e-8:
        sideways = tangent_of(n)
    sideways = wp.normalize(sideways) * (width / size)
    onwards = wp.cross(sideways, n) / wp.max(wp.dot(n, surface.outgoing), _GRAZING)
    u = wp.dot(wp.cross(onwards, edge2), area) / squared
    v = wp.dot(wp.cross(edge1, onwards), area) / squared
    place.along = wp.vec2(step1[0] * u + step2[0] * v, step1[1] * u + step2[1] * v)
    u = wp.dot(wp.cross(sideways, edge2), area) / squared
    v = wp.dot(wp.cross(edge1, sideways), area) / squared
    place.across = wp.vec2(step1[0] * u + step2[0] * v, step1[1] * u + step2[1] * v)
    return place


@cache
def input_function(features: tuple[str, ...]) -> wp.Function:
    """`input_at(scene, surface, node) -> vec3`: the value of a varying input; numbers stand in the first place."""
    with_textures = "texture" in features

    @wp.func
    def input_at(scene: DeviceScene, surface: Surface, node: int) -> wp.vec3:
        value = scene.inputs[node].absent
        slot = scene.inputs[node].primvar
        if wp.static(with_textures):
            if scene.inputs[node].picture >= 0 or scene.inputs[node].tiles >= 0:
                width = surface.footprint * scene.inputs[node].footprint
                value = texture_at(scene, node, footprint_at(scene, surface, slot, value, width))
                slot = -1
        if slot >= 0:
            value = primvar_at(scene, surface, slot, value)
        channel = scene.inputs[node].channel
        if channel < 4:
            return wp.vec3(value[channel], value[channel], value[channel])
        return wp.vec3(value[0], value[1], value[2])

    return input_at


@cache
def values_function(features: tuple[str, ...]) -> wp.Function:
    """`material_values(scene, surface) -> MaterialValues`: all inputs, by the numbers that the kind's file names.

    One loop with one look-up in it: a call for each input would put the whole of the look-up into the kernel as often.
    """
    input_at = input_function(features)
    varies = "texture" in features or "primvar" in features

    @wp.func
    def material_values(scene: DeviceScene, surface: Surface) -> MaterialValues:
        values = scene.materials[surface.material].values
        if wp.static(varies):
            first = scene.materials[surface.material].first
            for k in range(scene.materials[surface.material].varying):
                value = input_at(scene, surface, first + k)
                number = scene.inputs[first + k].number
                values[number, 0] = value[0]
                values[number, 1] = value[1]
                values[number, 2] = value[2]
        return values

    return material_values
