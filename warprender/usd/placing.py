"""Putting what the walk finds into the scene: shapes with their materials, and lights."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from ..lights import MeshLight
from ..materials import PreviewSurface
from ..materials.displacement import displaced
from ..materials.inputs import Number
from ..scene import Placement
from ..shapes import Mesh, Sphere
from .binding import Bindings
from .curves import read_curves, read_hermite_curves
from .draw_modes import read_stand_in
from .geometry import read_mesh, read_tet_mesh
from .gprims import KINDS, read_gprim
from .lights import geometry_light_targets, read_light, read_mesh_light
from .nurbs import read_nurbs_curves, read_nurbs_patch
from .points import points_frame, read_point
from .primvars import inherited_from
from .reading import Reading, shared_prim
from .semantics import read_semantic
from .skeletons import to_skeleton
from .volumes import read_volume
from .walk import Visit

#: Key of the material of geometry that is nothing but a light.
BLACK = "no material response"

#: Prim type to the reader of its shape; what is not here is not drawn yet, and says so.
SHAPES: dict[str, Callable[[Reading, Usd.Prim], Mesh | Sphere | None]] = {
    "Mesh": read_mesh,
    "TetMesh": read_tet_mesh,
    "Points": read_point,
    "BasisCurves": read_curves,
    "NurbsPatch": read_nurbs_patch,
    "NurbsCurves": read_nurbs_curves,
    "HermiteCurves": read_hermite_curves,
    "Volume": read_volume,
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
    skin = reading.skins.get(str(prim.GetPath()))
    if skin and skin.has_joints:
        visit = replace(visit, local=to_skeleton(skin, prim, visit.local, reading.time), is_sound=False)
    if prim.IsA(UsdGeom.Points):
        frame = points_frame(reading, UsdGeom.Points(prim), visit)
        visit = replace(visit, local=np.eye(4), frame=frame, is_sound=False)
    transforms, ids = _drawable_copies(reading, visit)
    shape = _shared_shape(reading, visit, bindings, read) if len(transforms) else None
    if shape is None:
        return
    path = _unique(reading.scene.placements, visit)
    semantic = read_semantic(reading, prim)
    reading.scene.placements[path] = Placement(path, shape, transforms, bindings.key(prim), ids, semantic=semantic)
    reading.placed[path] = (prim.GetPath(), *map(Sdf.Path, visit.frame.instancers))


def place_mesh_light(reading: Reading, prim: Usd.Prim) -> None:
    """Make the placements of a prim with MeshLightAPI shine, or remark on why not."""
    for path, source in reading.placed.items():
        if source[0] != prim.GetPath():
            continue
        placement = reading.scene.placements[path]
        if not isinstance(placement.shape, Mesh):
            reading.remark(prim, "only meshes shine by MeshLightAPI")
            continue
        light = read_mesh_light(reading, prim, path, placement.shape.double_sided)
        if light is None:
            continue
        reading.scene.lights[path] = light
        if light.materialSyncMode == "noMaterialResponse":
            reading.scene.materials.setdefault(BLACK, PreviewSurface(diffuseColor=(0.0, 0.0, 0.0), metallic=1.0))
            placement.shape = replace(placement.shape, face_materials={})
            placement.material = BLACK


def _place_stand_in(reading: Reading, visit: Visit) -> None:
    """Place what a draw mode shows of a model."""
    transforms, ids = _drawable_copies(reading, visit)
    shape = read_stand_in(reading, visit.prim, visit.draw_mode) if len(transforms) else None
    if shape is not None:
        path = _unique(reading.scene.placements, visit)
        reading.scene.placements[path] = Placement(
            path, shape, transforms, "", ids, semantic=read_semantic(reading, visit.prim)
        )


def _shared_shape(reading: Reading, visit: Visit, bindings: Bindings, read: Callable) -> Mesh | Sphere | None:
    """The shape of a prim, read once for all instances that look alike."""
    prim, given = visit.prim, visit.frame.primvars
    subsets = bindings.subset_keys(prim)
    # Values by instance are told apart by themselves: they may change in time.
    owner = tuple((name, primvar.values.tobytes()) for name, primvar in given.items())
    skin = reading.skins.get(str(prim.GetPath()))
    pose = skin.identity() if skin else ()
    displacements = bindings.displacements({bindings.key(prim), *subsets})
    look = tuple((name, repr(value)) for name, value in displacements.items())
    key = (shared_prim(prim).GetPath(), inherited_from(reading, prim), subsets, owner, pose, look)
    if key not in reading.shapes:
        shape = read(reading, prim)
        if shape is not None and given:
            shape = replace(shape, primvars={**shape.primvars, **given})
        if isinstance(shape, Mesh) and subsets:
            faces = len(reading.get(UsdGeom.Mesh(prim).GetFaceVertexCountsAttr()))
            shape.face_materials = bindings.face_materials(prim, faces)
        if shape is not None and displacements:
            shape = _displaced(reading, prim, shape, bindings.key(prim), displacements)
        reading.shapes[key] = shape
    reading.sources[key] = (prim, skin)
    return reading.shapes[key]


def _displaced(
    reading: Reading, prim: Usd.Prim, shape: Mesh | Sphere, own: str, by_material: Mapping[str, Number]
) -> Mesh | Sphere:
    """The shape with its points moved as its materials say; unmoved, with a remark, where they cannot be."""
    by_faces = {key: by_material.get(key, 0.0) for key in getattr(shape, "face_materials", {})}
    if prim.IsA(UsdGeom.Points):
        reading.remark(prim, "points are not displaced")
        return shape
    try:
        return displaced(shape, by_material.get(own, 0.0), by_faces)
    except ValueError as error:
        reading.remark(prim, f"it is drawn without its displacement: {error}")
        return shape


def place_lights(reading: Reading, visit: Visit) -> None:
    """Place a light once for each copy, or remark on why not."""
    light = read_light(reading, visit.prim)
    if light is None:
        return
    path = _unique(reading.scene.lights, visit)
    if isinstance(light, MeshLight):
        for target in geometry_light_targets(reading, visit.prim):
            double_sided = getattr(reading.scene.placements[target].shape, "double_sided", False)
            shining = replace(light, prim=target, materialSyncMode="independent", bothSides=double_sided)
            reading.scene.lights[f"{path}[{target}]"] = shining
        return
    # A flat light may have no height: what a light's own size does not need is left to the upload.
    finite = np.isfinite(visit.transforms()).all((1, 2))
    if not finite.all():
        reading.remark(visit.prim, f"{np.sum(~finite)} of {len(finite)} transforms are not finite")
    transforms, ids = visit.transforms()[finite], visit.frame.ids[finite]
    for number, transform in zip(ids, transforms, strict=True):
        name = path if number < 0 else f"{path}[{number}]"
        reading.scene.lights[name] = replace(light, transform=transform)


def mark_sound(visits: list[Visit]) -> None:
    """Find the prims that stand once in the world with a good transform: all at once, one by one takes long."""
    single = [visit for visit in visits if not visit.frame.instancers]
    if single:
        transforms = np.stack([visit.local for visit in single])
        sound = _is_drawable(transforms) & (transforms[:, :, 3] == (0, 0, 0, 1)).all(1)
        for visit, is_sound in zip(single, sound, strict=True):
            visit.is_sound = bool(is_sound)


def _is_drawable(transforms: np.ndarray) -> np.ndarray:
    """(K,) bool, whether transforms (K, 4, 4) are finite and do not flatten space."""
    scales = np.linalg.norm(transforms[:, :3, :3], axis=2)
    with np.errstate(all="ignore"):
        volume = np.abs(np.linalg.det(transforms[:, :3, :3])) / scales.prod(1)
    return np.isfinite(transforms).all((1, 2)) & (scales > 0).all(1) & (volume > 1e-15)


def _drawable_copies(reading: Reading, visit: Visit) -> tuple[np.ndarray, np.ndarray]:
    """Transforms (K, 4, 4) and instance ids (K,) without those that are not finite or flatten space."""
    if visit.is_sound:
        return visit.local[None].copy(), visit.frame.ids
    transforms = visit.transforms()
    if (transforms[:, :, 3] != (0, 0, 0, 1)).any() and np.isfinite(transforms[:, :, 3]).all():
        reading.remark(visit.prim, "its transform is not affine; the last column is ignored")
        transforms[:, :, 3] = (0, 0, 0, 1)
    good = _is_drawable(transforms)
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
