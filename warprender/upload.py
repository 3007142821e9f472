"""From the host's scene to a device: records, trees, and the arrays that they point to."""

from __future__ import annotations

import numpy as np
import warp as wp

from .lights import LIGHTS, CameraLight, Light
from .materials import MATERIALS
from .materials.albedo import albedo_table
from .records import (
    MATERIAL_INPUTS,
    DeviceScene,
    GeometryRecord,
    InstanceRecord,
    LightRecord,
    MaterialRecord,
    PrimvarRecord,
)
from .scene import Placement, Scene
from .shapes import SHAPES, Mesh, Sphere
from .shapes.primvar import absent_primvar
from .visibility.trees import MeshTree, SphereShape, WorldTree

#: Primvars that materials read, in the order of their slots.
_PRIMVARS = ("displayColor", "displayOpacity")


class Upload:
    """A scene on a device. Owns every array and tree that `record` points to.

    Attributes:
        record: what kernels read.
        geometries: the host's copies of `record.geometries`.
        origin: (3,) float64 world position that positions on the device are relative to; a float32 value.
        bounds: (2, 3) float64 world box of everything placed; zero size at the origin when nothing is.
        warnings: one line for each thing that could not be drawn.
    """

    def __init__(self, scene: Scene, lights: dict[str, Light], origin: np.ndarray, device: str) -> None:
        """Upload everything; `lights` are those that emit, `origin` (3,) is rounded to float32."""
        self.device = device
        self.origin = np.asarray(origin, np.float32).astype(np.float64)
        self.warnings: list[str] = []
        self._kept: list[object] = []
        self._materials = {key: i for i, key in enumerate(scene.materials)}
        self.geometries: list[GeometryRecord] = []
        self._primvars: list[PrimvarRecord] = []
        self._boxes: list[np.ndarray] = []
        self._trees: list[MeshTree | SphereShape] = []
        self.record = DeviceScene()
        self._upload_instances(scene)
        self._upload_materials(scene)
        self._upload_lights(lights)

    def _upload_instances(self, scene: Scene) -> None:
        rows, boxes = [], []
        known: dict[tuple, int] = {}
        for prim, (path, placement) in enumerate(scene.placements.items()):
            geometry = self._geometry(path, placement, known)
            if geometry < 0:
                continue
            row, box = self._instance_rows(path, prim, placement, geometry)
            rows.append(row)
            boxes.append(box)
        table = np.concatenate(rows) if rows else np.zeros(0, InstanceRecord.numpy_dtype())
        box = np.concatenate(boxes) if boxes else np.zeros((0, 2, 3))
        self.bounds = np.stack([box[:, 0].min(0), box[:, 1].max(0)]) if len(box) else np.tile(self.origin, (2, 1))
        self.record.instances = self._array(table, InstanceRecord)
        self.record.geometries = self._array(self.geometries, GeometryRecord)
        self.record.primvars = self._array(self._primvars, PrimvarRecord)
        self.record.primvar_count = len(_PRIMVARS)
        used = [any(p.interpolation >= 0 for p in self._primvars[k :: len(_PRIMVARS)]) for k in range(2)]
        self.record.display_color, self.record.display_opacity = (k if used[k] else -1 for k in range(2))
        self._build_world(rows)

    def _build_world(self, rows: list[np.ndarray]) -> None:
        """The trees that rays walk, over instances in the order of their records."""
        if not rows:
            return
        table = np.concatenate(rows)
        placed = np.concatenate([table["linear"], table["translation"][:, :, None]], 2)
        world = WorldTree(self._trees, table["geometry"], placed, self.device)
        self._kept.append(world)
        self.record.world = world.world

    def _instance_rows(
        self, path: str, prim: int, placement: Placement, geometry: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Instance records of a placement and their world boxes (K, 2, 3), singular transforms left out."""
        linear = placement.transforms[:, :3, :3].swapaxes(1, 2)
        translation = placement.transforms[:, 3, :3]
        inverse, condition = _inverses(linear)
        good = np.isfinite(placement.transforms).all((1, 2)) & (condition < 1e12)
        if not good.all():
            self.warnings.append(f"{path}: {int((~good).sum())} singular or non-finite transforms are not drawn")
        linear, translation = linear[good], translation[good]
        rows = np.zeros(len(linear), InstanceRecord.numpy_dtype())
        rows["geometry"] = geometry
        has_face_materials = bool(getattr(placement.shape, "face_materials", None))
        rows["material"] = -1 if has_face_materials else self._materials[placement.material]
        rows["prim"] = prim
        rows["instance_id"] = placement.instance_ids[good]
        rows["linear"] = linear
        rows["inverse"] = inverse[good]
        rows["translation"] = translation - self.origin
        low, high = self._boxes[geometry]
        middle = np.einsum("kij,j->ki", linear, (low + high) / 2) + translation
        reach = np.einsum("kij,j->ki", np.abs(linear), (high - low) / 2)
        return rows, np.stack([middle - reach, middle + reach], 1)

    def _geometry(self, path: str, placement: Placement, known: dict[tuple, int]) -> int:
        """Index of the shape's record, uploaded on first sight; -1 where there is nothing to draw."""
        shape = placement.shape
        key = (id(shape), placement.material if getattr(shape, "face_materials", None) else "")
        if key not in known:
            record = (
                self._upload_mesh(path, shape, placement.material)
                if isinstance(shape, Mesh)
                else self._upload_sphere(shape)
            )
            known[key] = -1
            if record is not None:
                known[key] = len(self.geometries)
                record.kind = SHAPES.index(type(shape))
                self.geometries.append(record)
                corners = getattr(shape, "corners", np.zeros((0, 3), np.int32))
                for name in _PRIMVARS:
                    primvar = shape.primvars.get(name)
                    self._primvars.append(primvar.upload(corners, self.device) if primvar else absent_primvar())
        return known[key]

    def _upload_sphere(self, sphere: Sphere) -> GeometryRecord | None:
        if not sphere.radius > 0 or not np.isfinite(sphere.radius):
            return None
        record = GeometryRecord()
        record.radius = sphere.radius
        self._trees.append(SphereShape(sphere.radius))
        record.normals = absent_primvar()
        self._boxes.append(np.array([[-sphere.radius] * 3, [sphere.radius] * 3]))
        return record

    def _upload_mesh(self, path: str, mesh: Mesh, material: str) -> GeometryRecord | None:
        points = mesh.points.numpy() if isinstance(mesh.points, wp.array) else np.asarray(mesh.points, np.float32)
        keep = _drawable(points, mesh.triangles)
        if not keep.all():
            self.warnings.append(f"{path}: {int((~keep).sum())} triangles with non-finite points are not drawn")
        if not keep.any():
            return None
        triangles = mesh.triangles[keep]
        record = GeometryRecord()
        if isinstance(mesh.points, wp.array) and keep.all() and mesh.points.device == wp.get_device(self.device):
            record.points = mesh.points
        else:
            record.points = self._array(np.where(np.isfinite(points), points, 0.0), wp.vec3)
        record.indices = self._array(triangles.reshape(-1), wp.int32)
        record.faces = self._array(mesh.faces[keep], wp.int32)
        record.normals = absent_primvar()
        if mesh.normals is not None:
            record.normals = mesh.normals.upload(mesh.corners[keep], self.device)
        if mesh.face_materials:
            record.face_material = self._array(self._face_materials(mesh, material), wp.int32)
        self._trees.append(MeshTree(record.points, record.indices))
        used = points[np.unique(triangles)].astype(np.float64)
        self._boxes.append(np.stack([used.min(0), used.max(0)]))
        return record

    def _face_materials(self, mesh: Mesh, material: str) -> np.ndarray:
        """(F,) material number of each authored face."""
        faces = np.full(int(mesh.faces.max()) + 1, self._materials[material], np.int32)
        for key, subset in mesh.face_materials.items():
            faces[subset[subset < len(faces)]] = self._materials[key]
        return faces

    def _upload_materials(self, scene: Scene) -> None:
        rows = np.zeros(len(scene.materials), MaterialRecord.numpy_dtype())
        for row, material in zip(rows, scene.materials.values(), strict=True):
            values = material.pack()
            row["kind"] = MATERIALS.index(type(material))
            row["values"][: len(values)] = values
        assert MATERIAL_INPUTS == rows["values"].shape[1]
        self.record.materials = self._array(rows, MaterialRecord)
        self.record.albedo = self._array(albedo_table(), wp.vec3)

    def _upload_lights(self, lights: dict[str, Light]) -> None:
        radius = max(float(np.linalg.norm(self.bounds[1] - self.bounds[0])) / 2, 1e-6)
        # A dark row in a scene without lights: kernels that have lights compiled in may aim at number 0.
        rows = np.zeros(max(len(lights), 1), LightRecord.numpy_dtype())
        power = np.zeros(len(rows))
        for i, (path, light) in enumerate(lights.items()):
            power[i] = self._light_row(rows[i], path, light, radius)
        chosen = power > 0
        if chosen.any():
            # Half by power, half alike: no light in the scene is left to starve beside a strong one.
            rows["choice"] = np.where(chosen, 0.5 * power / power.sum() + 0.5 / chosen.sum(), 0.0)
        cdf = np.cumsum(rows["choice"].astype(np.float64))
        # From the last light that is chosen on: no number below 1 reaches one that is not.
        if chosen.any():
            cdf[np.flatnonzero(chosen)[-1] :] = 1.0
        self.record.lights = self._array(rows, LightRecord)
        self.record.light_count = len(lights)
        self.record.light_cdf = self._array(cdf.astype(np.float32), wp.float32)

    def _light_row(self, row: np.void, path: str, light: Light, scene_radius: float) -> float:
        """Fill a light's record; returns its power, 0 for one that nothing can be lit by."""
        linear = light.local_to_world().T
        determinant = abs(np.linalg.det(linear))
        row["kind"] = LIGHTS.index(type(light))
        if not np.isfinite(light.transform).all() or determinant <= 0.0:
            self.warnings.append(f"{path}: the light's transform is singular or not finite; it gives no light")
            return 0.0
        row["radiance"] = light.radiance()
        row["position"] = light.transform[3, :3] - self.origin
        row["linear"] = linear
        row["inverse"] = np.linalg.inv(linear)
        row["determinant"] = determinant
        row["size"] = light.size()
        row["diffuse"], row["specular"] = light.diffuse, light.specular
        return max(light.power(scene_radius), 0.0)

    def _array(self, data: np.ndarray | list, dtype: type) -> wp.array:
        array = wp.array(data, dtype=dtype, device=self.device) if len(data) else wp.empty(0, dtype=dtype)
        self._kept.append(array)
        return array


def camera_light_at(light: CameraLight, transform: np.ndarray) -> CameraLight:
    """The camera light moved to a camera's place."""
    light.transform = np.eye(4)
    light.transform[3] = transform[3]
    return light


def _inverses(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Inverses (K, 3, 3) and condition numbers (K,) by cofactors: LAPACK takes ten times as long for a million."""
    with np.errstate(all="ignore"):
        scale = np.abs(matrices).max((1, 2), initial=0.0)[:, None, None]
        a, b, c = np.moveaxis(matrices / scale, 1, 0)
        cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], -1)
        inverses = cofactors / np.einsum("ki,ki->k", a, cofactors[:, :, 0])[:, None, None] / scale
        condition = np.linalg.norm(matrices, axis=(1, 2)) * np.linalg.norm(inverses, axis=(1, 2))
    return inverses, condition


def _drawable(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(T,) bool: triangles whose indices are in range and whose points are finite."""
    in_range = ((triangles >= 0) & (triangles < len(points))).all(1)
    finite = np.isfinite(points).all(1)
    keep = in_range.copy()
    keep[in_range] = finite[triangles[in_range]].all(1)
    return keep
