"""From the host's scene to a device: records, trees, and the arrays that they point to."""

from __future__ import annotations

import numpy as np
import warp as wp

from .attaching import Rig
from .errors import SceneError
from .lights import Light
from .material_tables import MaterialTables
from .materials.albedo import albedo_table
from .placement import Placement, copies_of, materials_of
from .records import DeviceScene, GeometryRecord, InstanceRecord, PrimvarRecord, SdfRecord
from .scene import Scene
from .shapes import Sdf, Sphere
from .texels import TEXTURE_BYTES
from .upload_lights import LightUpload
from .upload_placed import Placed
from .upload_shapes import Part, ShapeUpload
from .visibility.world_tree import WorldTree
from .watched import Watched


class Upload:
    """A scene on a device. Owns every array and tree that `record` points to.

    Attributes:
        record: what kernels read.
        parts: the shapes, in the order of `record.geometries`.
        rows: the host's copies of `record.instances`.
        world: the tree of the instances; its positions are relative to `origin`.
        rig: the bodies that instances hang on.
        lights: what was uploaded of the lights.
        places: how often instances were placed.
        origin: (3,) float64 world position that positions on the device are relative to; a float32 value.
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
        before: Upload | None = None,
        keep_meshes: bool = False,
    ) -> None:
        """Upload everything; `lights` are those that emit, `origin` (3,) is rounded to float32.

        `sdfs` are the plan's signed distance functions, in its order.

        Pictures are made smaller until all of them take `texture_bytes` at most. Shapes and pictures that are as they
        were in the upload `before` are taken over from it. `keep_meshes` keeps Warp's own trees of triangles on the CPU
        too, for fast rays.
        """
        self.device, self.origin = device, rounded_origin(origin)
        self._scene, self._kept, self.places = scene, [], 0
        self._keep_meshes = keep_meshes
        self._written: list[int] = []
        self._assignments = -1
        self._materials = {key: i for i, key in enumerate(scene.materials)}
        used = {key for placement in scene.placements.values() for key in materials_of(placement)}
        self._tables = None if before is None else before._tables.repacked(scene.materials, used)
        self.warnings: list[str] = []
        if self._tables is None:
            self._tables = MaterialTables(scene.materials, used, texture_bytes)
            self.warnings += self._tables.warnings
        self.texture_bytes = self._tables.pool.words.nbytes
        self.record = DeviceScene()
        self._kept += self._tables.fill(self.record, device)
        self.record.albedo = self._array(albedo_table(), wp.vec4)
        self._upload_shapes(self._reusable(before))
        self._upload_sdfs(sdfs)
        self._place()
        self.lights = before.lights if before else None
        self.light(lights)

    def refit_shapes(self) -> set[int]:
        """Refit the shapes whose points may have moved, and return their numbers.

        Raises:
            SceneError: a mesh's points are not the array that was uploaded.
        """
        if self._assignments != Watched.assignments:
            # Somebody may have been given the points of another mesh, or have replaced them.
            self._written = [number for number, part in enumerate(self.parts) if part.may_be_written()]
            if any([self.parts[number].begin_to_follow() for number in self._written]):
                self._store_geometries()
            self._assignments = Watched.assignments
        changed = set(self._written)
        for number in changed:
            self.parts[number].refit()
        for number in changed:
            self._warn_of_new_gaps(self.parts[number])
        return changed

    def place(self, origin: np.ndarray, changed: set[int]) -> None:
        """Place all instances anew, about another origin (3,), with the shapes `changed` refitted."""
        self.origin = rounded_origin(origin)
        if self._bodies != len(self._scene.bodies.numbers):
            self._hang()
        self.rig.follow()
        self.world.move_origin(self.origin)
        self.world.refit(sorted(changed))
        self.record.world = self.world.world
        self.places += 1

    def place_at_rest(self) -> None:
        """Take over transforms and visibility of placements that are otherwise as they were; `place` then."""
        self._rest, shown = self._at_rest()
        self.world.place_at_rest(self._rest.swapaxes(1, 2), shown)
        self._bodies = -1

    def light(self, lights: dict[str, Light]) -> None:
        """Upload the lights, those that emit, for instances where they are."""
        self.rows["light"] = -1
        placed = Placed(self.rows, self.parts, self.world, self.origin)
        self.lights = LightUpload(self._scene, lights, placed, self.record, self.device, self.lights)
        self.warnings += self.lights.warnings
        self._instances = self.record.instances = self._array(self.rows, InstanceRecord, keep=False)

    def _reusable(self, before: Upload | None) -> dict[tuple[int, str], Part]:
        """Parts of another upload whose records mean the same in this one."""
        if before is None or before._tables.slots != self._tables.slots:
            return {}
        if any(self._materials.get(key) != number for key, number in before._materials.items()):
            return {}
        return {key: part for key, part in before._by_shape.items() if part is not None and part.is_current()}

    def _upload_shapes(self, known: dict[tuple[int, str], Part]) -> None:
        """Upload each shape on first sight, and write the records of its instances."""
        shapes = ShapeUpload(self._tables.slots, self._materials, self.device, self._keep_meshes)
        self._by_shape: dict[tuple[int, str], Part | None] = {}
        numbers: dict[int, int] = {}
        self._drawn: list[Placement] = []
        rows = [np.zeros(0, InstanceRecord.numpy_dtype())]
        labels = {label: number for number, label in self._scene.semantics.items()}
        for prim, (path, placement) in enumerate(self._scene.placements.items()):
            with_faces = bool(getattr(placement.shape, "face_materials", None))
            key = id(placement.shape), placement.material if with_faces else ""
            if key not in self._by_shape:
                self._by_shape[key] = known.get(key) or shapes.part(path, placement)
            part = self._by_shape[key]
            if part is None:
                continue
            row = np.zeros(len(placement.transforms), InstanceRecord.numpy_dtype())
            row["geometry"] = numbers.setdefault(id(part), len(numbers))
            row["material"] = -1 if with_faces else self._materials[placement.material]
            row["prim"], row["instance_id"] = prim, placement.instance_ids
            row["semantic"] = labels.get(placement.semantic, -1)
            rows.append(row)
            self._drawn.append(placement)
        self.rows = np.concatenate(rows)
        self.parts = [part for part in self._by_shape.values() if part is not None]
        self.warnings += shapes.warnings
        self._point_to_shapes()

    def _point_to_shapes(self) -> None:
        record, slots = self.record, len(self._tables.slots)
        primvars = [primvar for part in self.parts for primvar in part.primvars]
        record.primvars = self._array(primvars, PrimvarRecord)
        record.primvar_count = slots
        used = [any(p.interpolation >= 0 for p in primvars[k::slots]) for k in range(2)]
        record.display_color, record.display_opacity = (k if used[k] else -1 for k in range(2))

    def _upload_sdfs(self, functions: tuple[wp.Function, ...]) -> None:
        """Number the signed distance functions among the shapes."""
        records = []
        for part in self.parts:
            if part.sdf is not None:
                part.record.sdf, part.sdf.function = len(records), functions.index(part.shape.kernel_function())
                records.append(part.sdf)
        self.record.sdfs = self._array(records, SdfRecord)
        self._store_geometries()
        those = [number for number, part in enumerate(self.parts) if part.sdf is not None]
        self.record.sdf_instances = self._array(np.flatnonzero(np.isin(self.rows["geometry"], those)), wp.int32)

    def _store_geometries(self) -> None:
        self.record.geometries = self._array([part.record for part in self.parts], GeometryRecord)

    def boxes_for_rays(self) -> np.ndarray:
        """(G, 2, 3) object boxes of the shapes that only rays find, empty ones of the others."""
        boxes = np.zeros((len(self.parts), 2, 3))
        for box, part in zip(boxes, self.parts, strict=True):
            if isinstance(part.shape, Sphere):
                box[:] = [[-part.shape.radius], [part.shape.radius]]
            elif isinstance(part.shape, Sdf):
                box[:] = part.shape.bounds
        return boxes

    def _place(self) -> None:
        """The tree that rays walk, over instances in the order of their records."""
        self._rest, shown = self._at_rest()
        trees = [part.tree for part in self.parts]
        self.world = WorldTree(trees, self.rows["geometry"], self._rest.swapaxes(1, 2), self.device, self.origin)
        self.world.place_at_rest(self._rest.swapaxes(1, 2), shown)
        self._hang()
        self.rig.follow()
        self.world.refit()
        self.record.world = self.world.world

    def _at_rest(self) -> tuple[np.ndarray, np.ndarray]:
        """Transforms at rest (I, 4, 4), read-only from now on, and which of them are shown (I,).

        Raises:
            SceneError: what says which are shown does not go with them.
        """
        if not self._drawn:
            return np.zeros((0, 4, 4)), np.zeros(0, bool)
        for placement in self._drawn:
            if fault := placement.fault():
                raise SceneError(f"{placement.path}: {fault}")
            placement.transforms.flags.writeable = False
        transforms = np.concatenate([placement.transforms for placement in self._drawn])
        shown = np.concatenate([np.broadcast_to(p.visible, len(p.transforms)) for p in self._drawn])
        good = np.isfinite(transforms).all((1, 2)) & (_conditions(transforms[:, :3, :3]) < 1e12)
        paths = list(self._scene.placements)
        for prim, count in zip(*np.unique(self.rows["prim"][~good], return_counts=True), strict=True):
            self.warnings.append(f"{paths[prim]}: {count} singular or non-finite transforms are not drawn")
        return transforms, shown & good

    def _hang(self) -> None:
        """Find the bodies that instances hang on."""
        self._bodies = len(self._scene.bodies.numbers)
        instances = []
        if self._bodies:
            instances = [(placement.path, int(copy)) for placement in self._drawn for copy in copies_of(placement)]
        self.rig = Rig(self._scene, instances, self._rest, self.device)
        self.world.attach(self.rig.attachments)

    def _warn_of_new_gaps(self, part: Part) -> None:
        """Warn once of triangles that are no longer finite; on CUDA nobody waits to count them."""
        if self.world.device.is_cpu and part.tree.dropped > part.missing:
            count, part.missing = part.tree.dropped - part.missing, len(part.record.indices)
            self.warnings.append(f"{part.path}: {count} triangles have come to points that are not finite")

    def _array(self, data: np.ndarray | list, dtype: type, keep: bool = True) -> wp.array:
        array = wp.array(data, dtype=dtype, device=self.device) if len(data) else wp.empty(0, dtype=dtype)
        if keep:
            self._kept.append(array)
        return array


def rounded_origin(place: np.ndarray) -> np.ndarray:
    """A world position (3,) that float32 holds, as float64."""
    return np.asarray(place, np.float32).astype(np.float64)


def _conditions(matrices: np.ndarray) -> np.ndarray:
    """(K,) condition numbers of (K, 3, 3), by cofactors: LAPACK takes ten times as long for a million."""
    with np.errstate(all="ignore"):
        scale = np.abs(matrices).max((1, 2), initial=0.0)[:, None, None]
        a, b, c = np.moveaxis(matrices / scale, 1, 0)
        cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], -1)
        inverses = cofactors / np.einsum("ki,ki->k", a, cofactors[:, :, 0])[:, None, None] / scale
        return np.linalg.norm(matrices, axis=(1, 2)) * np.linalg.norm(inverses, axis=(1, 2))
