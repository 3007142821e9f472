"""Meshes that are lights: UsdLux MeshLightAPI, and meshes whose material emits.

Rays hit them as the geometry that they are. Next-event estimation chooses among their triangles by the tree of lights
and draws points of one uniform in solid angle (`triangle`); the material at the point, or the light alone, says what it
emits. Of what emits on both sides and is closed only the outside is aimed at: chance finds it from within. Where there
are very many, a leaf of the tree holds several, one of which is chosen by area.
"""

from __future__ import annotations

from dataclasses import dataclass

import warp as wp

from ..records import DeviceScene, Hit, LightRecord, LightSample, Surface
from .light import Light, no_light
from .triangle import density_of, draw_point, seen_triangle, side_of

SYNC_MODES = ("materialGlowTintsLight", "independent", "noMaterialResponse")

#: Places in `LightRecord.size`: world area of what is aimed at; 1 where the light's colour stands alone; which sides.
AREA = wp.constant(wp.int32(0))
ALONE = wp.constant(wp.int32(1))
SIDES = wp.constant(wp.int32(2))

#: Sides that emit, and are aimed at: that of the normals; both; both, but only the outside of a closed surface is aimed
#: at, which lies on the side of the normals or opposite.
FRONT, BOTH, OUTSIDE, OUTSIDE_BEHIND = 0, 1, 2, 3
_FRONT = wp.constant(wp.float32(FRONT))
_BOTH = wp.constant(wp.float32(BOTH))
_OUTSIDE_BEHIND = wp.constant(wp.float32(OUTSIDE_BEHIND))


@dataclass
class MeshLight(Light):
    """A placed prim that emits, from the side of its normals or from both.

    Every ray, from the camera and by reflection, sees what lights the scene: the material's emission times the
    light's radiance where `materialSyncMode` is "materialGlowTintsLight" and the material emits anything, the light's
    radiance otherwise. "noMaterialResponse" also makes the surface black; whoever adds the light does that.

    What all lights have, as `intensity` and `color`, is in `Light`.

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
def is_aimed_at(light: LightRecord, side: float) -> bool:
    """Whether a triangle is aimed at from a side, above 0 that of its normal."""
    if light.size[SIDES] == _BOTH:
        return True
    return wp.where(light.size[SIDES] == _OUTSIDE_BEHIND, -side, side) > 0.0


@wp.func
def sample(scene: DeviceScene, light: LightRecord, p: wp.vec3, u: wp.vec2) -> LightSample:
    """A point of the light's triangles; its emission is left to the material."""
    result = no_light()
    placed = scene.world.instances[light.instance]
    geometry = scene.geometries[placed.geometry]
    place = wp.float64(u[0])
    low = light.first
    high = light.first + light.count - 1
    while low < high:
        middle = (low + high) // 2
        if place < scene.glow_cdf[middle]:
            high = middle
        else:
            low = middle + 1
    before = wp.float64(0.0)
    if low > light.first:
        before = scene.glow_cdf[low - 1]
    rest = wp.clamp(wp.float32((place - before) / (scene.glow_cdf[low] - before)), 0.0, 1.0)

    face = scene.glow_triangles[low]
    p0 = geometry.points[geometry.indices[3 * face]]
    p1 = geometry.points[geometry.indices[3 * face + 1]]
    p2 = geometry.points[geometry.indices[3 * face + 2]]
    seen = seen_triangle(placed, p0, p1, p2, p)
    point = draw_point(seen, wp.vec2(rest, u[1]))
    distance = wp.length(point.way)
    if point.pdf <= 0.0 or distance <= 0.0:
        return result
    if not is_aimed_at(light, side_of(placed, p0, p1, p2, point.way)):
        return result
    result.direction = point.way / distance
    result.distance = distance
    result.radiance = light.radiance
    result.pdf = point.pdf * wp.float32(scene.glow_cdf[low] - before)
    result.hit.t = distance
    result.hit.instance = light.instance
    result.hit.face = face
    result.hit.u = point.u
    result.hit.v = point.v
    return result


@wp.func
def meet(scene: DeviceScene, light: LightRecord, origin: wp.vec3, direction: wp.vec3) -> LightSample:
    """Nothing: rays hit the geometry."""
    return no_light()


@wp.func
def leaf_of(scene: DeviceScene, light: LightRecord, face: int) -> int:
    """Leaf of the tree by which a face of the light is aimed at; -1 where it is not."""
    if light.first_face < 0:
        return light.leaf
    return scene.glow_leaves[light.first_face + face]


@wp.func
def narrowed(scene: DeviceScene, light: LightRecord, leaf: int) -> LightRecord:
    """The light with the triangles of one leaf alone, as `sample` and `density_at` need it; others as they are."""
    part = light
    if leaf >= 0 and scene.light_leaves[leaf].count > 0:
        part.first = scene.light_leaves[leaf].first
        part.count = scene.light_leaves[leaf].count
        part.size[AREA] = scene.light_leaves[leaf].area
    return part


@wp.func
def density_at(scene: DeviceScene, light: LightRecord, origin: wp.vec3, hit: Hit, way: wp.vec3) -> float:
    """Density per solid angle with which `sample` at `origin` draws the point that was hit, this way away."""
    placed = scene.world.instances[light.instance]
    geometry = scene.geometries[placed.geometry]
    p0 = geometry.points[geometry.indices[3 * hit.face]]
    p1 = geometry.points[geometry.indices[3 * hit.face + 1]]
    p2 = geometry.points[geometry.indices[3 * hit.face + 2]]
    if not is_aimed_at(light, side_of(placed, p0, p1, p2, way)):
        return 0.0
    seen = seen_triangle(placed, p0, p1, p2, origin)
    return density_of(seen, way) * wp.min(0.5 * seen.area2 / light.size[AREA], 1.0)


@wp.func
def emitted(light: LightRecord, surface: Surface, material: wp.vec3) -> wp.vec3:
    """Radiance towards the viewer of a surface that is a light and whose material emits `material`."""
    if surface.front == 0 and light.size[SIDES] == _FRONT:
        return wp.vec3(0.0, 0.0, 0.0)
    if light.size[ALONE] != 0.0:
        return light.radiance
    return wp.cw_mul(light.radiance, material)
