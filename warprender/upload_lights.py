"""Lights on a device: their records, and the boxes by which rays meet them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import warp as wp

from .emitters import emits
from .lights import DomeLight, Light, MeshLight
from .lights.dispatch import kind_of
from .lights.linking import LinkSets
from .lights.mesh import BOTH, OUTSIDE, OUTSIDE_BEHIND
from .lights.tree import LightBounds
from .records import (
    NOT_DRAWN,
    SHADOW_CHANGED,
    SHADOW_NONE,
    SHADOW_PLAIN,
    DeviceScene,
    ImageRecord,
    LightLeaf,
    LightNode,
    LightRecord,
    ProfileRecord,
)
from .scene import Placement, Scene
from .shapes import Mesh, Sphere
from .upload_glow import MOST_LEAVES, GlowLeaves, GlowTables, outside_of
from .upload_light_pictures import Pictures
from .upload_light_tree import bounds_of, light_tree
from .upload_placed import Placed


class LightUpload:
    """The lights of a scene on a device. Owns every array and tree that it hands to a `DeviceScene`.

    Attributes:
        warnings: one line for each light that gives none.
        count: lights, each copy of geometry that glows for itself.
        glowing: numbers of the geometries that glow.
        radius: of the scene, by which the power of lights at infinity was weighed.
        weighs_by_radius: whether it mattered.
    """

    def __init__(
        self,
        scene: Scene,
        lights: dict[str, Light],
        placed: Placed,
        record: DeviceScene,
        device: str,
        before: LightUpload | None = None,
    ) -> None:
        """Fill in the lights of `record`, and `light` of the placed instances.

        Pictures and profiles are taken over from the upload `before`.
        """
        self.device = device
        self.warnings: list[str] = []
        self._kept: list[object] = []
        self._placed, self._scene = placed, scene
        self._prims = {path: number for number, path in enumerate(scene.placements)}
        self._links = LinkSets(scene.placements)
        self._pictures = before._pictures if before else Pictures()
        self._glow = GlowTables()
        self._glow_leaves: dict[int, GlowLeaves] = {}
        self._portals: list[np.void] = []
        self.radius = placed.radius()
        self._fill(lights, record)

    def _fill(self, lights: dict[str, Light], record: DeviceScene) -> None:
        members = self._members(lights)
        self._glow.each = -(-self._count_glowing(members) // MOST_LEAVES) or 1
        rows = np.zeros(len(members), LightRecord.numpy_dtype())
        power = np.array([self._row(rows, i, *member) for i, member in enumerate(members)])
        self._invert(rows, members)
        power[rows["determinant"] <= 0.0] = 0.0
        for number, (_, _, instance) in enumerate(members):
            if instance >= 0 and power[number] > 0:
                self._placed.instances["light"][instance] = number
        infinite = np.array([light.infinite for _, light, _ in members], bool)
        self.weighs_by_radius = bool(infinite.any()) and len(members) > 1
        self.glowing = {int(self._placed.instances["geometry"][i]) for _, _, i in members if i >= 0}
        self.count = len(members)
        finite = rows["instance"] < 0
        finite &= ~infinite
        bounds = bounds_of(members, rows, power, self._placed.boxes)
        record.finite_lights, record.infinite_lights = int(finite.sum()), int(infinite.sum())
        leaves, nodes, cdf = light_tree(rows, bounds, infinite, self._glow_leaves, self._glow)
        record.light_cdf = self._array(cdf, wp.float32)
        record.light_nodes = self._array(nodes, LightNode)
        record.light_leaves = self._array(leaves, LightLeaf)
        if finite.any():
            self._build_boxes(bounds, finite, record)
        record.lights = self._array(rows, LightRecord)
        record.images = self._array(self._pictures.images, ImageRecord)
        record.profiles = self._array(self._pictures.profiles, ProfileRecord)
        record.link_sets = self._keep(self._links.upload(self.device))
        record.portals = self._array(np.array(self._portals, LightRecord.numpy_dtype()), LightRecord)
        record.glow_triangles = self._array(np.concatenate([[], *self._glow.triangles]).astype(np.int32), wp.int32)
        record.glow_cdf = self._array(np.concatenate([[], *self._glow.cdf]), wp.float64)
        record.glow_leaves = self._array(np.concatenate([[], *self._glow.leaf_of_face]).astype(np.int32), wp.int32)

    def _members(self, lights: dict[str, Light]) -> list[tuple[str, Light, int]]:
        """Path, light and instance (-1 for none) of each device light: finite ones, infinite ones, geometry."""
        shown = {path: light for path, light in lights.items() if light.visible}
        met = [(path, light, -1) for path, light in shown.items() if not isinstance(light, MeshLight)]
        members = sorted(met, key=lambda member: member[1].infinite)
        for path, light in shown.items():
            if isinstance(light, MeshLight):
                members += self._copies(path, light)
        return members

    def _copies(self, path: str, light: MeshLight) -> list[tuple[str, Light, int]]:
        """One light for each instance of the prim that it makes glow, with its area."""
        placement = self._scene.placements.get(light.prim)
        copies = np.flatnonzero(self._placed.instances["prim"] == self._prims.get(light.prim, -1))
        hidden = placement is not None and not np.any(placement.visible)
        if len(copies):
            copies = copies[self._placed.places["placed"][copies] != NOT_DRAWN]
        if not len(copies) and hidden:
            return []
        if placement is None or not len(copies):
            self.warnings.append(f"{path}: {light.prim} is not drawn and gives no light")
            return []
        if light.materialSyncMode == "materialGlowTintsLight" and not emits(self._scene, placement):
            light = replace(light, materialSyncMode="independent")
        return [(path, light, int(copy)) for copy in copies]

    def _count_glowing(self, members: list[tuple[str, Light, int]]) -> int:
        """Triangles of all geometry that glows."""
        shapes = [self._placed.instances["geometry"][instance] for _, _, instance in members if instance >= 0]
        return sum(int(self._placed.parts[int(g)].drawn.sum()) for g in shapes)

    def _row(self, rows: np.ndarray, number: int, path: str, light: Light, instance: int) -> float:
        """Fill what a light's record takes from the light alone; returns its power."""
        row = rows[number]
        row["leaf"] = row["first_face"] = -1
        emission = 1.0
        if isinstance(light, MeshLight):
            light, emission = self._glow_row(row, number, light, instance)
        else:
            row["linear"] = light.local_to_world().T
            row["position"] = light.transform[3, :3] - self._placed.origin
            row["size"] = light.size()
            row["instance"] = -1
        row["kind"] = kind_of(light.kind())
        row["radiance"] = light.radiance()
        row["diffuse"], row["specular"] = light.diffuse, light.specular
        row["is_dome"] = light.kind().startswith("DomeLight")
        row["image"] = self._image(path, light)
        if isinstance(light, DomeLight) and light.portals:
            row["first"], row["count"] = len(self._portals), len(light.portals)
            self._portals += [self._portal_row(path, portal.opening()) for portal in light.portals]
        self._shaping_row(row, light)
        self._shadow_row(row, light)
        return max(light.power(self.radius) * emission, 0.0)

    def _portal_row(self, path: str, opening: Light) -> np.void:
        """The record of a rectangle through which a dome is aimed at; of determinant 0 where it is not one."""
        rows = np.zeros(1, LightRecord.numpy_dtype())
        rows["linear"], rows["size"] = opening.local_to_world().T, opening.size()
        rows["position"], rows["radiance"] = opening.transform[3, :3] - self._placed.origin, 1.0
        self._invert(rows, [(f"{path}: portal", opening, -1)])
        if not opening.size_factor() > 0:
            rows["determinant"] = 0.0
        return rows[0]

    def _glow_row(self, row: np.void, number: int, light: MeshLight, instance: int) -> tuple[MeshLight, float]:
        """Fill the part of geometry that glows; returns the light with its area, and what its materials emit."""
        place = self._placed.places["to_world"][instance]
        row["instance"] = instance
        row["linear"], row["position"] = place[:, :3], place[:, 3]
        alone = light.materialSyncMode != "materialGlowTintsLight"
        part = self._placed.parts[int(self._placed.instances["geometry"][instance])]
        shape, placement, kept = part.shape, self._scene.placements[light.prim], part.drawn
        linear = place[:, :3].astype(np.float64)
        if isinstance(shape, Sphere):
            row["size"] = (shape.radius, alone, light.bothSides)
            area = 4 * np.pi * shape.radius**2 * abs(np.linalg.det(linear)) ** (2 / 3)
            return replace(light, area=area), 1.0 if alone else self._emission(placement.material)
        shines = np.ones(int(kept.sum())) if alone else self._emissions(placement, shape)[shape.faces[kept]]
        row["size"] = (0.0, alone, light.bothSides)
        area, emission = self._glow_triangles(row, number, shape, shape.triangles[kept], shines)
        return replace(light, area=area), emission

    def _glow_triangles(
        self, row: np.void, number: int, mesh: Mesh, triangles: np.ndarray, emission: np.ndarray
    ) -> tuple[float, float]:
        """Make leaves of an instance's triangles that emit; their area, and their mean emission."""
        linear, middle = row["linear"].astype(np.float64), row["position"].astype(np.float64)
        sides = int(row["size"][2])
        with np.errstate(all="ignore"):
            corners = mesh.host_points().astype(np.float64)[triangles]
            # What is not finite is not drawn, and gives no light.
            emission = np.where(np.isfinite(corners).all((1, 2)), emission, 0.0)
            corners = np.where(np.isfinite(corners), corners, 0.0)
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            normals = normals @ np.linalg.pinv(linear) if np.isfinite(linear).all() else normals
            outside = outside_of(corners[emission > 0], triangles[emission > 0]) if sides == BOTH else 0
            normals = normals * (outside or 1)
            leaves = self._glow.add(corners @ linear.T + middle, normals, emission, sides == BOTH and outside == 0)
        row["first_face"] = leaves.first_face
        if leaves.bounds is None:
            return 0.0, 0.0
        # The record by itself stands for the first leaf.
        row["first"], row["count"] = leaves.first[0], leaves.count[0]
        sides = (sides, OUTSIDE, OUTSIDE_BEHIND)[outside]
        row["size"] = (leaves.area[0], row["size"][1], sides)
        self._glow_leaves[number] = leaves
        return float(leaves.area.sum()), float(leaves.emitted / leaves.area.sum())

    def _emission(self, key: str) -> float:
        return self._scene.materials[key].largest_emission()

    def _emissions(self, placement: Placement, mesh: Mesh) -> np.ndarray:
        """(F,) what the material of each authored face emits, at most."""
        faces = np.full(int(mesh.faces.max()) + 1, self._emission(placement.material))
        for key, subset in mesh.face_materials.items():
            faces[subset[subset < len(faces)]] = self._emission(key)
        return faces

    def _image(self, path: str, light: Light) -> int:
        """Index of the light's picture, uploaded once; -1 without one."""
        picture = getattr(light, "texture", None)
        if picture is None:
            return -1
        number, is_new = self._pictures.image(picture, self.device, isinstance(light, DomeLight))
        if is_new:
            self.warnings += [f"{path}: {warning}" for warning in picture.warnings]
        return number

    def _shaping_row(self, row: np.void, light: Light) -> None:
        shaping = light.shaping
        row["focus"], row["focus_tint"], row["cone"] = shaping.focus, shaping.focusTint, shaping.cone()
        row["angle_scale"], row["profile"] = shaping.iesAngleScale, -1
        if shaping.iesProfile is not None:
            row["profile"] = self._pictures.profile(shaping.iesProfile, self.device)

    def _shadow_row(self, row: np.void, light: Light) -> None:
        shadow = light.shadow
        row["links"] = self._links.row(light.unlit)
        row["shadow_links"] = self._links.row(light.unshadowed)
        plain = shadow.is_plain() and row["shadow_links"] < 0
        row["shadow"] = int(SHADOW_PLAIN if plain else SHADOW_CHANGED if shadow.enable else SHADOW_NONE)
        row["shadow_color"], row["shadow_distance"] = shadow.color, shadow.distance
        row["shadow_falloff"], row["shadow_gamma"] = shadow.falloff, shadow.falloffGamma

    def _invert(self, rows: np.ndarray, members: list[tuple[str, Light, int]]) -> None:
        """Inverse and |determinant| of all rows at once; lights that have none give no light."""
        finite = np.isfinite(rows["linear"]).all((1, 2)) & np.isfinite(rows["position"]).all(1)
        rows["linear"][~finite], rows["position"][~finite] = 0.0, 0.0
        linear = rows["linear"].astype(np.float64)
        determinant = np.abs(np.linalg.det(linear))
        good = np.isfinite(determinant) & (determinant > 0)
        rows["radiance"][~good] = 0.0
        for number in np.flatnonzero(~good):
            path = members[number][0]
            self.warnings.append(f"{path}: the light's transform is singular or not finite; it gives no light")
        rows["inverse"][good] = np.linalg.inv(linear[good])
        rows["determinant"] = np.where(good, determinant, 0.0)

    def _build_boxes(self, bounds: LightBounds, finite: np.ndarray, record: DeviceScene) -> None:
        """The tree of boxes by which rays meet the finite lights; boxes grow by more than a rounded corner."""
        low, high = bounds.lower[finite], bounds.upper[finite]
        margin = np.maximum(np.abs(low), np.abs(high)).max(1, keepdims=True) * 2.0**-20 + np.finfo(np.float32).tiny
        lower = self._array((low - margin).astype(np.float32), wp.vec3)
        upper = self._array((high + margin).astype(np.float32), wp.vec3)
        record.light_boxes = self._keep(wp.Bvh(lower, upper)).id

    def _array(self, data: np.ndarray | list, dtype: type) -> wp.array:
        if not len(data):
            return self._keep(wp.empty(0, dtype=dtype, device=self.device))
        return self._keep(wp.array(data, dtype=dtype, device=self.device))

    def _keep(self, thing: object) -> object:
        self._kept.append(thing)
        return thing
