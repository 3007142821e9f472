"""Meshes that are lights: UsdLux MeshLightAPI, and meshes whose material emits.

Rays hit them as the geometry that they are. Next-event estimation draws points uniform over the area of the
triangles that emit; the material at the point, or the light alone, says what it emits.
"""

from __future__ import annotations

from dataclasses import dataclass

import warp as wp

from ..numerics import linear_of, safe_normalize, translation_of
from ..records import DeviceScene, LightRecord, LightSample, Surface
from ..shapes.mesh import triangle_normal
from .light import Light, no_light

SYNC_MODES = ("materialGlowTintsLight", "independent", "noMaterialResponse")

#: Places in `LightRecord.size`: world area; 1 where the light's colour stands alone; 1 where both sides emit.
AREA = wp.constant(wp.int32(0))
ALONE = wp.constant(wp.int32(1))
BOTH_SIDES = wp.constant(wp.int32(2))


@dataclass
class MeshLight(Light):
    """A placed prim that emits, from the side of its normals or from both.

    Every ray, from the camera and by reflection, sees what lights the scene: the material's emission times the
    light's radiance where `materialSyncMode` is "materialGlowTintsLight" and the material emits anything, the light's
    radiance otherwise. "noMaterialResponse" also makes the surface black; whoever adds the light does that.

    Attributes:
        prim: path of the placement; each of its copies is a light.
        materialSyncMode: "materialGlowTintsLight", "independent" or "noMaterialResponse".
        bothSides: whether it emits on both sides.
        area: world area of what emits, known when it is uploaded; `normalize` divides by it.
    """

    prim: str = ""
    materialSyncMode: str = "materialGlowTintsLight"
    bothSides: bool = False
    area: float = 1.0

    def size_factor(self) -> float:
        """World area of the triangles."""
        return self.area

    def power(self, scene_radius: float) -> float:
        """Of a material that emits 1 and of the sides that emit."""
        return super().power(scene_radius) * (2.0 if self.bothSides else 1.0)


@wp.func
def sample(scene: DeviceScene, light: LightRecord, p: wp.vec3, u: wp.vec2) -> LightSample:
    """A point uniform over the light's area; its emission is left to the material."""
    result = no_light()
    geometry = scene.geometries[scene.instances[light.instance].geometry]
    placed = scene.world.instances[light.instance]
    place = wp.float64(u[0])
    low = light.first_triangle
    high = light.first_triangle + light.triangles - 1
    while low < high:
        middle = (low + high) // 2
        if place < scene.glow_cdf[middle]:
            high = middle
        else:
            low = middle + 1
    before = wp.float64(0.0)
    if low > light.first_triangle:
        before = scene.glow_cdf[low - 1]
    rest = wp.clamp(wp.float32((place - before) / (scene.glow_cdf[low] - before)), 0.0, 1.0)

    # Uniform over the triangle (Turk 1990).
    root = wp.sqrt(rest)
    face = scene.glow_triangles[low]
    p0 = geometry.points[geometry.indices[3 * face]]
    p1 = geometry.points[geometry.indices[3 * face + 1]]
    p2 = geometry.points[geometry.indices[3 * face + 2]]
    v = root * u[1]
    local = p0 * (1.0 - root) + p1 * (root - v) + p2 * v
    to_place = linear_of(placed.to_world) * local + translation_of(placed.to_world) - p
    distance = wp.length(to_place)
    normal = safe_normalize(wp.transpose(linear_of(placed.to_object)) * triangle_normal(p0, p1, p2))
    if distance <= 0.0:
        return result
    result.direction = to_place / distance
    cosine = -wp.dot(normal, result.direction)
    if cosine == 0.0 or (cosine < 0.0 and light.size[BOTH_SIDES] == 0.0):
        return result
    result.distance = distance
    result.radiance = light.radiance
    result.pdf = distance * distance / (wp.abs(cosine) * light.size[AREA])
    result.hit.t = distance
    result.hit.instance = light.instance
    result.hit.face = face
    result.hit.u = root - v
    result.hit.v = v
    return result


@wp.func
def meet(scene: DeviceScene, light: LightRecord, origin: wp.vec3, direction: wp.vec3) -> LightSample:
    """Nothing: rays hit the geometry."""
    return no_light()


@wp.func
def density_at(light: LightRecord, origin: wp.vec3, surface: Surface) -> float:
    """Density per solid angle with which `sample` at `origin` draws the point of a surface that was hit."""
    to_place = surface.position - origin
    cosine = wp.abs(wp.dot(surface.geometric_normal, surface.outgoing))
    return wp.dot(to_place, to_place) / wp.max(cosine * light.size[AREA], 1.0e-30)


@wp.func
def emitted(light: LightRecord, surface: Surface, material: wp.vec3) -> wp.vec3:
    """Radiance towards the viewer of a surface that is a light and whose material emits `material`."""
    if surface.front == 0 and light.size[BOTH_SIDES] == 0.0:
        return wp.vec3(0.0, 0.0, 0.0)
    if light.size[ALONE] != 0.0:
        return light.radiance
    return wp.cw_mul(light.radiance, material)
