"""Putting what the walk finds into the scene: shapes with their materials, and lights."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from pxr import Usd, UsdGeom

from ..scene import Placement
from ..shapes import Mesh, Sphere
from .binding import Bindings
from .curves import read_curves, read_hermite_curves
from .draw_modes import read_stand_in
from .geometry import read_mesh, read_tet_mesh
from .gprims import KINDS, read_gprim
from .lights import read_light
from .points import points_frame, read_point
from .primvars import inherited_from
from .reading import Reading, shared_prim
from .skeletons import to_skeleton
from .walk import Visit

#: Prim type to the reader of its shape; what is not here is not drawn yet, and says so.
SHAPES: dict[str, Callable[[Reading, Usd.Prim], Mesh | Sphere | None]] = {
    "Mesh": read_mesh,
    "TetMesh": read_tet_mesh,
    "Points": read_point,
    "BasisCurves": read_curves,
    "HermiteCurves": read_hermite_curves,
    **dict.fromkeys(KINDS, read_gprim),
}


def place_shape(reading: Reading, visit: Visit, bindings: Bindings) -> None:
    """Place a shape in all its copies, or remark on why not."""
    prim = visit.prim
    if visit.draw_mode != "default":
        _place_stand_in(reading, visit)
        return
    read = SHAPES.get(prim.GetTypeName())
    if read is None:
        reading.remark(prim, f"{prim.GetTypeName() or 'a prim without a type'} is not drawn yet")
        return
    if prim.HasAPI("MeshLightAPI"):
        reading.remark(prim, "it does not shine yet as MeshLightAPI asks")
    skin = reading.skins.get(str(prim.GetPath()))
    if skin and skin.has_joints:
        visit = replace(visit, local=to_skeleton(skin, prim, visit.local, reading.time))
    if prim.IsA(UsdGeom.Points):
        visit = replace(visit, local=np.eye(4), frame=points_frame(reading, UsdGeom.Points(prim), visit))
    transforms, ids = _drawable_copies(reading, visit)
    shape = _shared_shape(reading, visit, bindings, read) if len(transforms) else None
    if shape is None:
        return
    path = _unique(reading.scene.placements, visit)
    reading.scene.placements[path] = Placement(path, shape, transforms, bindings.key(prim), ids)


def _place_stand_in(reading: Reading, visit: Visit) -> None:
    """Place what a draw mode shows of a model."""
    transforms, ids = _drawable_copies(reading, visit)
    shape = read_stand_in(reading, visit.prim, visit.draw_mode) if len(transforms) else None
    if shape is not None:
        path = _unique(reading.scene.placements, visit)
        reading.scene.placements[path] = Placement(path, shape, transforms, "", ids)


def _shared_shape(reading: Reading, visit: Visit, bindings: Bindings, read: Callable) -> Mesh | Sphere | None:
    """The shape of a prim, read once for all instances that look alike."""
    prim, given = visit.prim, visit.frame.primvars
    subsets = bindings.subset_keys(prim)
    owner = visit.frame.instancers[-1:] if given else ()
    skin = reading.skins.get(str(prim.GetPath()))
    pose = skin.identity() if skin else ()
    key = (shared_prim(prim).GetPath(), inherited_from(prim), subsets, owner, pose)
    if key not in reading.shapes:
        shape = read(reading, prim)
        if shape is not None and given:
            shape = replace(shape, primvars={**shape.primvars, **given})
        if isinstance(shape, Mesh) and subsets:
            faces = len(reading.get(UsdGeom.Mesh(prim).GetFaceVertexCountsAttr()))
            shape.face_materials = bindings.face_materials(prim, faces)
        reading.shapes[key] = shape
    return reading.shapes[key]


def place_lights(reading: Reading, visit: Visit) -> None:
    """Place a light once for each copy, or remark on why not."""
    transforms, ids = _drawable_copies(reading, visit)
    light = read_light(reading, visit.prim) if len(transforms) else None
    if light is None:
        return
    path = _unique(reading.scene.lights, visit)
    for number, transform in zip(ids, transforms, strict=True):
        name = path if number < 0 else f"{path}[{number}]"
        reading.scene.lights[name] = replace(light, transform=transform)


def _drawable_copies(reading: Reading, visit: Visit) -> tuple[np.ndarray, np.ndarray]:
    """Transforms (K, 4, 4) and instance ids (K,) without those that are not finite or flatten space."""
    transforms = visit.transforms()
    if (transforms[:, :, 3] != (0, 0, 0, 1)).any() and np.isfinite(transforms[:, :, 3]).all():
        reading.remark(visit.prim, "its transform is not affine; the last column is ignored")
        transforms[:, :, 3] = (0, 0, 0, 1)
    scales = np.linalg.norm(transforms[:, :3, :3], axis=2)
    with np.errstate(all="ignore"):
        volume = np.abs(np.linalg.det(transforms[:, :3, :3])) / scales.prod(1)
    good = np.isfinite(transforms).all((1, 2)) & (scales > 0).all(1) & (volume > 1e-15)
    if good.all():
        return transforms, visit.frame.ids
    reading.remark(visit.prim, f"{np.sum(~good)} of {len(good)} transforms are singular or not finite")
    return transforms[good], visit.frame.ids[good]


def _unique(taken: Mapping[str, object], visit: Visit) -> str:
    """The prim's path; with the instancer before it where another instancer draws the same prototype."""
    path = str(visit.prim.GetPath())
    if path not in taken and not any(f"{path}[{n}]" in taken for n in visit.frame.ids[:1]):
        return path
    return f"{visit.frame.instancers[-1]}[{path}]"
