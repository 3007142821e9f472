"""Lights on a device: their records, the tree that chooses among them, and the boxes by which rays meet them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import warp as wp

from .emitters import emits, triangle_areas
from .lights import DomeLight, IesProfile, Light, LightTexture, MeshLight
from .lights.dispatch import kind_of
from .lights.linking import LinkSets
from .lights.tree import LightBounds, build
from .records import (
    NOT_DRAWN,
    SHADOW_CHANGED,
    SHADOW_NONE,
    SHADOW_PLAIN,
    DeviceScene,
    ImageRecord,
    LightNode,
    LightRecord,
    ProfileRecord,
)
from .scene import Placement, Scene
from .shapes import Mesh, Sphere
from .upload_shapes import Part
from .visibility.world_tree import WorldTree


@dataclass
class Placed:
    """What has been uploaded of the scene's geometry.

    Attributes:
        instances: the instance records; `light` is filled in here.
        parts: the shapes by geometry number.
        world: where the instances are.
        origin: (3,) world position that positions on the device are relative to.
    """

    instances: np.ndarray
    parts: list[Part]
    world: WorldTree
    origin: np.ndarray

    @cached_property
    def boxes(self) -> np.ndarray:
        """(instances, 2, 3) float64 boxes relative to the origin; NaN for what is not drawn."""
        return self.world.boxes()

    @cached_property
    def places(self) -> np.ndarray:
        """(instances,) rows of `Instance`."""
        return self.world.instances.numpy()

    def radius(self) -> float:
        """Half the diagonal of all that is drawn."""
        return scene_radius(self.boxes)


class Pictures:
    """Light pictures and profiles on a device, each once. Owns their arrays."""

    def __init__(self) -> None:
        """None yet."""
        self.images: list[ImageRecord] = []
        self.profiles: list[ProfileRecord] = []
        self._numbers: dict[int, int] = {}
        self._kept: list[object] = []

    def image(self, picture: LightTexture, device: str, of_dome: bool) -> tuple[int, bool]:
        """The number of a picture, and whether it was uploaded just now."""
        if id(picture) in self._numbers:
            return self._numbers[id(picture)], False
        record, kept = picture.upload(device, of_dome)
        return self._add(picture, self.images, record, kept), True

    def profile(self, profile: IesProfile, device: str) -> int:
        """The number of a profile."""
        if id(profile) in self._numbers:
            return self._numbers[id(profile)]
        return self._add(profile, self.profiles, *profile.upload(device))

    def _add(self, source: object, records: list, record: object, kept: list[object]) -> int:
        records.append(record)
        # The source, too: its id must not become another's.
        self._kept += [source, *kept]
        self._numbers[id(source)] = len(records) - 1
        return len(records) - 1


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
        self._glow_triangles: list[np.ndarray] = []
        self._glow_cdf: list[np.ndarray] = []
        self.radius = placed.radius()
        self._fill(lights, record)

    def _fill(self, lights: dict[str, Light], record: DeviceScene) -> None:
        members = self._members(lights)
        rows = np.zeros(len(members), LightRecord.numpy_dtype())
        power = np.array([self._row(rows[i], *member) for i, member in enumerate(members)])
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
        bounds = self._bounds(members, rows, power)
        record.finite_lights, record.infinite_lights = int(finite.sum()), int(infinite.sum())
        record.light_cdf = self._array(self._choices(rows, bounds, infinite, record), wp.float32)
        if finite.any():
            self._build_boxes(bounds, finite, record)
        record.lights = self._array(rows, LightRecord)
        record.images = self._array(self._pictures.images, ImageRecord)
        record.profiles = self._array(self._pictures.profiles, ProfileRecord)
        record.link_sets = self._keep(self._links.upload(self.device))
        record.glow_triangles = self._array(np.concatenate([[], *self._glow_triangles]).astype(np.int32), wp.int32)
        record.glow_cdf = self._array(np.concatenate([[], *self._glow_cdf]), wp.float64)

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

    def _row(self, row: np.void, path: str, light: Light, instance: int) -> float:
        """Fill what a light's record takes from the light alone; returns its power."""
        if isinstance(light, MeshLight):
            light = self._glow_row(row, light, instance)
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
        self._shaping_row(row, light)
        self._shadow_row(row, light)
        return max(light.power(self.radius), 0.0)

    def _glow_row(self, row: np.void, light: MeshLight, instance: int) -> MeshLight:
        """Fill the part of geometry that glows; returns the light with its area."""
        place = self._placed.places["to_world"][instance]
        row["instance"] = instance
        row["linear"], row["position"] = place[:, :3], place[:, 3]
        alone = light.materialSyncMode != "materialGlowTintsLight"
        part = self._placed.parts[int(self._placed.instances["geometry"][instance])]
        shape, linear = part.shape, place[:, :3].astype(np.float64)
        if isinstance(shape, Sphere):
            size = shape.radius
            area = 4 * np.pi * size**2 * abs(np.linalg.det(linear)) ** (2 / 3)
        else:
            size = area = self._glow_triangles_of(row, light, part, linear)
        row["size"] = (size, alone, light.bothSides)
        return replace(light, area=area)

    def _glow_triangles_of(self, row: np.void, light: MeshLight, part: Part, linear: np.ndarray) -> float:
        """Table of the triangles of an instance that emit, by their world areas; returns the area of all."""
        mesh, kept = part.shape, part.drawn
        areas = triangle_areas(mesh.host_points().astype(np.float64) @ linear.T, mesh.triangles[kept])
        if light.materialSyncMode == "materialGlowTintsLight":
            areas = np.where(self._emitting(self._scene.placements[light.prim], mesh)[mesh.faces[kept]], areas, 0.0)
        chosen = np.flatnonzero((areas > 0) & np.isfinite(areas))
        row["first_triangle"] = sum(map(len, self._glow_triangles))
        row["triangles"] = len(chosen)
        if not len(chosen):
            return 0.0
        total = areas[chosen].sum()
        cdf = np.cumsum(areas[chosen]) / total
        cdf[-1] = 1.0
        self._glow_triangles.append(chosen)
        self._glow_cdf.append(cdf)
        return float(total)

    def _emitting(self, placement: Placement, mesh: Mesh) -> np.ndarray:
        """(F,) bool: the authored faces whose material emits."""
        glows = {key: material.largest_emission() > 0 for key, material in self._scene.materials.items()}
        faces = np.full(int(mesh.faces.max()) + 1, glows[placement.material])
        for key, subset in mesh.face_materials.items():
            faces[subset[subset < len(faces)]] = glows[key]
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

    def _bounds(self, members: list[tuple[str, Light, int]], rows: np.ndarray, power: np.ndarray) -> LightBounds:
        """Where each light is and where it emits to, relative to the origin."""
        linear, middle = rows["linear"].astype(np.float64), rows["position"].astype(np.float64)
        half = np.array([light.half_extent() for _, light, _ in members]).reshape(-1, 3)
        reach = np.einsum("kij,kj->ki", np.abs(linear), half)
        lower, upper = middle - reach, middle + reach
        for i, (_, _, instance) in enumerate(members):
            if instance >= 0:
                lower[i], upper[i] = self._placed.boxes[instance]
        cones = [light.emission_cone() for _, light, _ in members]
        axis = np.einsum("kij,kj->ki", linear, np.array([cone[0] for cone in cones]).reshape(-1, 3))
        axis = axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-300)
        spread, fade = np.array([cone[1:] for cone in cones]).reshape(-1, 2).T
        return LightBounds(lower, upper, axis, spread, fade, power)

    def _choices(self, rows: np.ndarray, bounds: LightBounds, infinite: np.ndarray, record: DeviceScene) -> np.ndarray:
        """Build the tree and set the probabilities; returns the distribution over infinite lights and the tree."""
        placed = np.flatnonzero(~infinite & (bounds.power > 0))
        powers = np.append(bounds.power[infinite], bounds.power[placed].sum())
        chosen = powers > 0
        share = np.zeros(len(powers))
        if chosen.any():
            # Half by power, half alike: no light in the scene is left to starve beside a strong one.
            share = np.where(chosen, 0.5 * powers / powers.sum() + 0.5 / chosen.sum(), 0.0)
        rows["choice"][infinite] = share[:-1]
        nodes = np.zeros(0, LightNode.numpy_dtype())
        if len(placed):
            rows["choice"][placed] = share[-1]
            nodes, rows["trail"][placed] = build(bounds.of(placed), placed)
        record.light_nodes = self._array(nodes, LightNode)
        cdf = np.cumsum(share)
        if chosen.any():
            cdf[np.flatnonzero(chosen)[-1] :] = 1.0
        return cdf.astype(np.float32)

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


def scene_radius(boxes: np.ndarray) -> float:
    """Half the diagonal of what boxes (I, 2, 3) hold together, NaN ones left out; not below 1e-6."""
    if not np.isfinite(boxes).any():
        return 1e-6
    return max(float(np.linalg.norm(np.nanmax(boxes[:, 1], 0) - np.nanmin(boxes[:, 0], 0))) / 2, 1e-6)
