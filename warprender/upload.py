"""From the host's scene to a device: records, trees, and the arrays that they point to."""

from __future__ import annotations

import numpy as np
import warp as wp

from .lights import CameraLight, Light
from .material_tables import MaterialTables, Tangents
from .materials.albedo import albedo_table
from .records import (
    DeviceScene,
    GeometryRecord,
    InstanceRecord,
    PrimvarRecord,
    SdfRecord,
)
from .scene import Placement, Scene, materials_of
from .shapes import SHAPES, Mesh, Sdf, Sphere
from .shapes.primvar import INTERPOLATIONS, absent_primvar
from .texels import TEXTURE_BYTES
from .upload_lights import LightUpload, Placed
from .visibility.trees import MeshTree, SdfShape, SphereShape, WorldTree


class Upload:
    """A scene on a device. Owns every array and tree that `record` points to.

    Attributes:
        record: what kernels read.
        geometries: the host's copies of `record.geometries`.
        origin: (3,) float64 world position that positions on the device are relative to; a float32 value.
        bounds: (2, 3) float64 world box of everything placed; zero size at the origin when nothing is.
        texture_bytes: bytes that the pictures take.
        warnings: one line for each thing that could not be drawn.
    """

    def __init__(
        self,
        scene: Scene,
        lights: dict[str, Light],
        origin: np.ndarray,
        device: str,
        texture_bytes: int = TEXTURE_BYTES,
        sdfs: tuple[wp.Function, ...] = (),
    ) -> None:
        """Upload everything; `lights` are those that emit, `origin` (3,) is rounded to float32.

        `sdfs` are the plan's signed distance functions, in its order.

        Pictures are made smaller until all of them take `texture_bytes` at most.
        """
        self.device = device
        self.origin = np.asarray(origin, np.float32).astype(np.float64)
        self.warnings: list[str] = []
        self._kept: list[object] = []
        self._materials = {key: i for i, key in enumerate(scene.materials)}
        used = {key for placement in scene.placements.values() for key in materials_of(placement)}
        self._tables = MaterialTables(scene.materials, used, texture_bytes)
        self.texture_bytes = self._tables.pool.words.nbytes
        self.warnings += self._tables.warnings
        self.geometries: list[GeometryRecord] = []
        self._primvars: list[PrimvarRecord] = []
        self._boxes: list[np.ndarray] = []
        self._trees: list[MeshTree | SphereShape | SdfShape] = []
        self._sdfs: list[SdfRecord] = []
        self._sdf_functions = sdfs
        self.record = DeviceScene()
        self._shapes: dict[int, Mesh | Sphere | Sdf] = {}
        self._drawn: dict[int, np.ndarray] = {}
        placed = self._place(scene)
        self._upload_materials()
        self._lights = LightUpload(scene, lights, placed, self.record, device)
        self.warnings += self._lights.warnings
        self.record.instances = self._array(placed.instances, InstanceRecord)
        self.record.sdfs = self._array(self._sdfs, SdfRecord)
        kinds = np.array([g.kind for g in self.geometries], np.int32)[placed.instances["geometry"]]
        self.record.sdf_instances = self._array(np.nonzero(kinds == SHAPES.index(Sdf))[0], wp.int32)

    def _place(self, scene: Scene) -> Placed:
        """Upload the shapes and the tree of their instances; the records of the instances are still to be uploaded."""
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
        self.record.geometries = self._array(self.geometries, GeometryRecord)
        self.record.primvars = self._array(self._primvars, PrimvarRecord)
        slots = len(self._tables.slots)
        self.record.primvar_count = slots
        used = [any(p.interpolation >= 0 for p in self._primvars[k::slots]) for k in range(2)]
        self.record.display_color, self.record.display_opacity = (k if used[k] else -1 for k in range(2))
        self._build_world(table)
        return Placed(table, self._shapes, self._drawn, box, self.bounds, self.origin)

    def _build_world(self, table: np.ndarray) -> None:
        """The trees that rays walk, over instances in the order of their records."""
        if not len(table):
            return
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
        rows["light"] = -1
        rows["instance_id"] = placement.instance_ids[good]
        rows["linear"] = linear
        rows["inverse"] = inverse[good]
        rows["translation"] = translation - self.origin
        low, high = self._boxes[geometry]
        middle = np.einsum("kij,j->ki", linear, (low + high) / 2) + translation
        reach = np.einsum("kij,j->ki", np.abs(linear), (high - low) / 2)
        # What rounding may do to a transformed vertex: its parts may be large and cancel.
        parts = np.einsum("kij,j->ki", np.abs(linear), np.maximum(np.abs(low), np.abs(high)))
        reach += (parts + np.abs(translation - self.origin)) * 2.0**-20
        return rows, np.stack([middle - reach, middle + reach], 1)

    def _geometry(self, path: str, placement: Placement, known: dict[tuple, int]) -> int:
        """Index of the shape's record, uploaded on first sight; -1 where there is nothing to draw."""
        shape = placement.shape
        key = (id(shape), placement.material if getattr(shape, "face_materials", None) else "")
        if key not in known:
            if isinstance(shape, Mesh):
                record = self._upload_mesh(path, shape, placement.material)
            else:
                record = self._upload_sphere(shape) if isinstance(shape, Sphere) else self._upload_sdf(shape)
            known[key] = -1
            if record is not None:
                known[key] = len(self.geometries)
                self._shapes[known[key]] = shape
                record.kind = SHAPES.index(type(shape))
                self.geometries.append(record)
                keep = self._drawn.get(known[key], np.zeros(0, bool))
                self._primvars += [self._primvar(shape, keep, slot) for slot in self._tables.slots]
        return known[key]

    def _primvar(self, shape: Mesh | Sphere | Sdf, keep: np.ndarray, slot: str | Tangents) -> PrimvarRecord:
        """What a shape has in a slot; `keep` (T,) bool are the triangles of a mesh that are drawn."""
        if isinstance(slot, str):
            primvar = shape.primvars.get(slot)
            if primvar is None:
                return absent_primvar()
            corners = shape.corners[keep] if isinstance(shape, Mesh) else np.zeros((0, 3), np.int32)
            return primvar.upload(corners, self.device)
        found = slot.of(shape, shape.host_points()) if isinstance(shape, Mesh) else None
        if found is None:
            return absent_primvar()
        tangents, rows = found
        record = PrimvarRecord()
        record.interpolation, record.width = INTERPOLATIONS.index("faceVarying"), tangents.shape[1]
        record.values = self._array(tangents.reshape(-1), wp.float32)
        record.indices = self._array(rows[keep].reshape(-1), wp.int32)
        return record

    def _upload_sphere(self, sphere: Sphere) -> GeometryRecord | None:
        if not sphere.radius > 0 or not np.isfinite(sphere.radius):
            return None
        record = GeometryRecord()
        record.radius = sphere.radius
        self._trees.append(SphereShape(sphere.radius))
        record.normals = absent_primvar()
        self._boxes.append(np.array([[-sphere.radius] * 3, [sphere.radius] * 3]))
        return record

    def _upload_sdf(self, sdf: Sdf) -> GeometryRecord:
        record = GeometryRecord()
        record.sdf = len(self._sdfs)
        record.normals = absent_primvar()
        self._sdfs.append(sdf.record(self.device))
        self._sdfs[-1].function = self._sdf_functions.index(sdf.kernel_function())
        self._trees.append(SdfShape())
        # What has no end says nothing of how large the scene is.
        self._boxes.append(sdf.bounds if np.isfinite(sdf.bounds).all() else np.zeros((2, 3)))
        return record

    def _upload_mesh(self, path: str, mesh: Mesh, material: str) -> GeometryRecord | None:
        points, keep = mesh.host_points(), _drawable_triangles(mesh)
        if not keep.all():
            self.warnings.append(f"{path}: {int((~keep).sum())} triangles with non-finite points are not drawn")
        if not keep.any():
            return None
        self._drawn[len(self.geometries)] = keep
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

    def _upload_materials(self) -> None:
        self._kept += self._tables.fill(self.record, self.device)
        self.record.albedo = self._array(albedo_table(), wp.vec4)

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


def _drawable_triangles(mesh: Mesh) -> np.ndarray:
    """(T,) bool: triangles whose indices are in range and whose points are finite."""
    points, triangles = mesh.host_points(), mesh.triangles
    in_range = ((triangles >= 0) & (triangles < len(points))).all(1)
    finite = np.isfinite(points).all(1)
    keep = in_range.copy()
    keep[in_range] = finite[triangles[in_range]].all(1)
    return keep
