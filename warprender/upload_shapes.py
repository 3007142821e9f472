"""Shapes on a device: each stored once however often it is placed, with its tree and its primvars."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import warp as wp

from .material_tables import Slot, Tangents
from .records import GeometryRecord, PrimvarRecord, SdfRecord
from .scene import Placement, SceneError
from .shapes import SHAPES, Mesh, Sdf, Sphere
from .shapes.live_normals import LiveNormals, WrittenNormals, can_follow
from .shapes.mesh import POINTS, SMOOTH
from .shapes.primvar import INTERPOLATIONS, Primvar, absent_primvar
from .textures import PrimvarReader
from .visibility.trees import MeshTree, SdfShape, SphereShape
from .watched import contents, same


@dataclass
class Part:
    """One shape on a device. Owns every array and tree that its records point to.

    Attributes:
        path: prim that it was first seen on.
        shape: the host's.
        contents: what it was made from.
        record: the device's.
        tree: for rays.
        primvars: by slot.
        drawn: (T,) bool, the triangles of a mesh that are on the device.
        source: the points that the simulation writes; `record.points`, or what these are copied from.
        normals: what keeps the normals in step with the points, where anything does.
        missing: faces of the tree that were left out at the upload.
        sdf: the device's record of a signed distance function.
    """

    path: str
    shape: Mesh | Sphere | Sdf
    contents: list[object]
    record: GeometryRecord
    tree: MeshTree | SphereShape | SdfShape
    primvars: list[PrimvarRecord] = field(default_factory=list)
    drawn: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    source: wp.array | None = None
    normals: LiveNormals | WrittenNormals | None = None
    missing: int = 0
    sdf: SdfRecord | None = None

    def is_current(self) -> bool:
        """Whether the shape is still what it was made from, but for the values of its points."""
        return same(self.contents, contents(self.shape, POINTS))

    def may_be_written(self) -> bool:
        """Whether somebody was given the points to write into them.

        Raises:
            SceneError: the mesh's points are another array by now.
        """
        if not isinstance(self.shape, Mesh):
            return False
        if self.shape.stored is not self.source:
            raise SceneError(
                f"{self.path}: its points were replaced by another array; write into the one that was there, "
                "or remove the prim and add it anew"
            )
        return self.shape.handed_out or getattr(self.normals, "copied", False)

    def begin_to_follow(self) -> bool:
        """Have the normals follow the points from now on; whether the device's record became another one by that."""
        if self.normals is not None or not can_follow(self.shape):
            return False
        self.normals = LiveNormals(self.shape, self.drawn, self.record.indices.device)
        self.record.normals = self.normals.record
        return True

    def refit(self) -> None:
        """Follow the points as they are now."""
        if self.record.points is not self.source:
            wp.copy(self.record.points, self.source)
        self.tree.refit()
        if self.normals is not None:
            self.normals.follow(self.record.points)


class ShapeUpload:
    """Puts shapes on a device.

    Attributes:
        warnings: one line for each shape with something bad about it.
    """

    def __init__(self, slots: list[Slot], materials: dict[str, int], device: str, keep_meshes: bool = False) -> None:
        """`slots` are those of the primvars; `materials` has the numbers of materials by key.

        `keep_meshes`: keep each `wp.Mesh` on the CPU too.
        """
        self._keep_meshes = keep_meshes
        self._slots, self._materials, self.device = slots, materials, device
        self.warnings: list[str] = []

    def part(self, path: str, placement: Placement) -> Part | None:
        """The placement's shape, None where there is nothing to draw."""
        shape = placement.shape
        if isinstance(shape, Mesh):
            part = self._mesh(path, shape, placement.material)
        else:
            part = self._sphere(path, shape) if isinstance(shape, Sphere) else self._sdf(path, shape)
        if part is not None:
            part.record.kind = SHAPES.index(type(shape))
            part.primvars = [self._primvar(shape, part.drawn, slot) for slot in self._slots]
        return part

    def _primvar(self, shape: Mesh | Sphere | Sdf, keep: np.ndarray, slot: Slot) -> PrimvarRecord:
        """What a shape has in a slot; `keep` (T,) bool are the triangles of a mesh that are drawn."""
        if not isinstance(slot, Tangents):
            computed = isinstance(slot, PrimvarReader)
            primvar = shape.primvars.get(slot.varname if computed else slot)
            if primvar is None:
                return absent_primvar()
            if computed:
                primvar = primvar.mapped(slot.matrix)
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

    def _sphere(self, path: str, sphere: Sphere) -> Part | None:
        if not sphere.radius > 0 or not np.isfinite(sphere.radius):
            return None
        record = GeometryRecord()
        record.radius = sphere.radius
        record.normals = absent_primvar()
        return Part(path, sphere, contents(sphere), record, SphereShape(sphere.radius))

    def _sdf(self, path: str, sdf: Sdf) -> Part:
        record = GeometryRecord()
        record.normals = absent_primvar()
        return Part(path, sdf, contents(sdf), record, SdfShape(sdf.bounds), sdf=sdf.record(self.device))

    def _mesh(self, path: str, mesh: Mesh, material: str) -> Part | None:
        keep, finite = drawable_triangles(mesh)
        bad = int((~(keep & finite)).sum())
        if bad:
            self.warnings.append(f"{path}: {bad} triangles with non-finite points are not drawn")
        if not keep.any():
            return None
        triangles = mesh.triangles[keep]
        record = GeometryRecord()
        record.points = self._points(mesh)
        record.indices = self._array(triangles.reshape(-1), wp.int32)
        record.faces = self._array(mesh.faces[keep], wp.int32)
        normals = self._normals(path, mesh, keep, record)
        if mesh.face_materials:
            record.face_material = self._array(self._face_materials(mesh, material), wp.int32)
        tree = MeshTree(record.points, record.indices, keep_mesh=self._keep_meshes)
        made_from = contents(mesh, POINTS)
        part = Part(path, mesh, made_from, record, tree, [], keep, mesh.stored, normals, tree.dropped)
        part.begin_to_follow()
        if part.normals is not None:
            part.normals.follow(record.points)
        return part

    def _normals(self, path: str, mesh: Mesh, keep: np.ndarray, record: GeometryRecord) -> WrittenNormals | None:
        """Put the normals into the record; None but for those that the simulation writes."""
        record.normals = absent_primvar()
        if isinstance(mesh.normals, Primvar):
            record.normals = mesh.normals.upload(mesh.corners[keep], self.device)
        elif isinstance(mesh.normals, wp.array):
            try:
                written = WrittenNormals(mesh.normals, len(mesh.stored), self.device)
            except ValueError as error:
                raise SceneError(f"{path}: {error}") from None
            record.normals = written.record
            return written
        elif mesh.normals is not None and mesh.normals != SMOOTH:
            raise SceneError(f"{path}: its normals are {mesh.normals!r}: not a Primvar, a wp.array, {SMOOTH!r} or None")
        return None

    def _points(self, mesh: Mesh) -> wp.array:
        """The mesh's points on the device: the simulation's own array where it can be read in place."""
        if not isinstance(mesh.stored, wp.array):
            points = np.ascontiguousarray(mesh.stored, np.float32)
            # Not by assignment: what the scene shows has not changed.
            mesh.__dict__["stored"] = wp.array(points, dtype=wp.vec3, device=self.device)
        if mesh.stored.device == wp.get_device(self.device) and mesh.stored.is_contiguous:
            return mesh.stored
        return wp.clone(mesh.stored.contiguous(), device=self.device)

    def _face_materials(self, mesh: Mesh, material: str) -> np.ndarray:
        """(F,) material number of each authored face."""
        faces = np.full(int(mesh.faces.max()) + 1, self._materials[material], np.int32)
        for key, subset in mesh.face_materials.items():
            faces[subset[subset < len(faces)]] = self._materials[key]
        return faces

    def _array(self, data: np.ndarray, dtype: type) -> wp.array:
        return wp.array(data, dtype=dtype, device=self.device) if len(data) else wp.empty(0, dtype, device=self.device)


def drawable_triangles(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """(T,) bool each: triangles whose indices are in range, and those of them whose points are finite."""
    points, triangles = mesh.host_points(), mesh.triangles
    in_range = ((triangles >= 0) & (triangles < len(points))).all(1)
    finite = in_range.copy()
    finite[in_range] = np.isfinite(points).all(1)[triangles[in_range]].all(1)
    return in_range, finite
