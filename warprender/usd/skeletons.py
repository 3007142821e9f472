"""UsdSkel: meshes posed by their skeletons, blend shapes before skinning."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pxr import Tf, Usd, UsdGeom, UsdSkel

from ..shapes import Primvar
from ..shapes.skinning import (
    Influences,
    blended,
    dual_quaternion_blended,
    normal_matrices,
    transformed_points,
    turned_normals,
)
from .reading import Reading, one_line, shared_prim

#: Where UsdSkel looks for skeletons: everywhere under a SkelRoot, prototypes included.
UNDER_ROOT = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)


@dataclass
class Skin:
    """A mesh bound to a skeleton."""

    query: UsdSkel.SkinningQuery
    skeleton: UsdSkel.SkeletonQuery

    @property
    def has_joints(self) -> bool:
        """Whether joints place the mesh, which then stands in skeleton space."""
        return bool(self.query.HasJointInfluences())

    def identity(self) -> tuple[str, str]:
        """Paths of skeleton and animation: what two instances must share to look alike."""
        animation = self.skeleton.GetAnimQuery()
        return str(self.skeleton.GetPrim().GetPath()), str(animation.GetPrim().GetPath()) if animation else ""


def find_skins(reading: Reading) -> dict[str, Skin]:
    """Path to skin of every prim under a SkelRoot that a skeleton poses."""
    skins, cache = {}, UsdSkel.Cache()
    for prim in Usd.PrimRange.Stage(reading.stage, UNDER_ROOT):
        if not prim.IsA(UsdSkel.Root):
            continue
        root = UsdSkel.Root(prim)
        try:
            cache.Populate(root, UNDER_ROOT)
            for binding in cache.ComputeSkelBindings(root, UNDER_ROOT):
                skeleton = cache.GetSkelQuery(binding.GetSkeleton())
                for query in binding.GetSkinningTargets():
                    skins[str(query.GetPrim().GetPath())] = Skin(query, skeleton)
        except Tf.ErrorException as error:
            reading.remark(prim, f"its skeletons are ignored: {one_line(error)}")
    return skins


def to_skeleton(skin: Skin, prim: Usd.Prim, local: np.ndarray, time: Usd.TimeCode) -> np.ndarray:
    """(4, 4) from skeleton space, which skinning ends in, to the frame that `local` (4, 4) takes the prim to.

    Of a prim without points, which one joint moves as a whole, from the prim.
    """
    cache = UsdGeom.XformCache(time)
    posed_by = skin.skeleton.GetPrim()
    # Instances share a skeleton, which then stands in the space of their prototype; so must the prim.
    beside = shared_prim(prim) if posed_by.IsInPrototype() else prim
    skeleton = np.array(cache.GetLocalToWorldTransform(posed_by), np.float64)
    own = np.array(cache.GetLocalToWorldTransform(beside), np.float64)
    matrix = skeleton @ np.linalg.solve(own, local)
    if prim.IsA(UsdGeom.PointBased):
        return matrix
    moved = skin.query.ComputeSkinnedTransform(skin.skeleton.ComputeSkinningTransforms(time), time)
    return np.array(moved, np.float64) @ matrix


@dataclass
class Pose:
    """What a skeleton does to the points of a mesh.

    Attributes:
        points: (N, 3) float64, posed.
        turns: (N, 4, 4) what each point's normal is multiplied by, None where joints move none.
        normal_offsets: (N, 3) what blend shapes add to the normals before the joints, None where they do not.
    """

    points: np.ndarray
    turns: np.ndarray | None = None
    normal_offsets: np.ndarray | None = None

    def normals(self, normals: Primvar, indices: np.ndarray) -> Primvar:
        """Authored normals turned with the points; constant and uniform ones stay.

        Args:
            normals: of the mesh at rest.
            indices: (C,) point of each corner.
        """
        if normals.interpolation not in ("vertex", "varying", "faceVarying"):
            return normals
        by_corner = normals.interpolation == "faceVarying"
        values = normals.expanded().astype(np.float64)
        if self.normal_offsets is not None:
            values = values + (self.normal_offsets[indices] if by_corner else self.normal_offsets)
        if self.turns is not None:
            values = turned_normals(values, self.turns[indices] if by_corner else self.turns)
        return Primvar(values, normals.interpolation)


def posed(reading: Reading, skin: Skin, points: np.ndarray) -> Pose:
    """The pose of a mesh with the points (N, 3) at rest."""
    points, normal_offsets = _shaped(reading, skin, points.astype(np.float64))
    if not skin.has_joints:
        return Pose(points, None, normal_offsets)
    bind = np.array(skin.query.GetGeomBindTransform(reading.time), np.float64)
    moves, turns = _blended(reading, skin, len(points))
    return Pose(transformed_points(points, bind @ moves), normal_matrices(bind[None]) @ turns, normal_offsets)


def _blended(reading: Reading, skin: Skin, points: int) -> tuple[np.ndarray, np.ndarray]:
    """(N, 4, 4) movement of each point by its joints, and of its normal; none, with a remark, where they do not fit.

    The joints' matrices for normals are mixed as those for points are, as in UsdSkel.
    """
    influences = _influences(reading, skin, points)
    joints = skin.skeleton.ComputeSkinningTransforms(reading.time)
    mapper = skin.query.GetJointMapper()
    if joints and mapper and not mapper.IsIdentity():
        joints = mapper.RemapTransforms(joints)
    matrices = np.array(joints or [], np.float64).reshape(-1, 4, 4)
    fits = influences is not None and influences.joints.min(initial=0) >= 0
    if not fits or influences.joints.max(initial=-1) >= len(matrices) or not np.isfinite(matrices).all():
        reading.remark(skin.query.GetPrim(), "its skeleton does not move it: joints, indices and weights do not fit")
        still = np.tile(np.eye(4), (points, 1, 1))
        return still, still
    if skin.query.GetSkinningMethod() == UsdSkel.Tokens.dualQuaternion:
        return dual_quaternion_blended(matrices, influences), dual_quaternion_blended(matrices, influences, True)
    return blended(matrices, influences), blended(normal_matrices(matrices), influences)


def _influences(reading: Reading, skin: Skin, points: int) -> Influences | None:
    found = skin.query.ComputeVaryingJointInfluences(points, reading.time)
    if not found:
        return None
    joints, weights = (np.array(values) for values in found)
    size = max(len(joints) // max(points, 1), 1)
    if joints.size != points * size or weights.size != points * size:
        return None
    weights = weights.reshape(points, size).astype(np.float64)
    total = weights.sum(1, keepdims=True)
    weights = np.divide(weights, total, out=np.zeros_like(weights), where=total != 0)
    return Influences(joints.reshape(points, size).astype(np.int64), weights)


def _shaped(reading: Reading, skin: Skin, points: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Points with the offsets of the active blend shapes added, and what these add to normals, None for nothing."""
    animation = skin.skeleton.GetAnimQuery()
    if not (skin.query.HasBlendShapes() and animation):
        return points, None
    weights = animation.ComputeBlendShapeWeights(reading.time)
    mapper = skin.query.GetBlendShapeMapper()
    if mapper and weights is not None:
        weights = mapper.Remap(weights)
    if not weights:
        return points, None
    shapes = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(skin.query.GetPrim()))
    amounts, numbers, which = shapes.ComputeSubShapeWeights(weights)
    offsets, indices = shapes.ComputeSubShapePointOffsets(), shapes.ComputeBlendShapePointIndices()
    moves, bends, bent = np.zeros_like(points), np.zeros_like(points), False
    for amount, number, sub in zip(amounts, numbers, which, strict=True):
        chosen = np.array(indices[number], np.int64)
        chosen = chosen if len(chosen) else np.arange(len(points))
        turns = _normal_offsets(shapes, number, sub)
        if not _add(moves, chosen, amount, offsets[sub]):
            reading.remark(skin.query.GetPrim(), f"blend shape {number} does not fit its points")
        elif len(turns) and not _add(bends, chosen, amount, turns):
            reading.remark(skin.query.GetPrim(), f"blend shape {number} does not fit its normals")
        bent = bent or len(turns) > 0
    return points + moves, bends if bent else None


def _normal_offsets(shapes: UsdSkel.BlendShapeQuery, number: int, sub: int) -> Sequence:
    """Normal offsets of a blend shape, or of the shape in between that `sub` is; empty where it has none."""
    between = shapes.GetInbetween(sub)
    if between:
        return between.GetNormalOffsets() or ()
    return shapes.GetBlendShape(number).GetNormalOffsetsAttr().Get() or ()


def _add(sums: np.ndarray, chosen: np.ndarray, amount: float, offsets: Sequence) -> bool:
    """Add `amount` times the offsets to the rows `chosen`; False where they do not fit."""
    values = np.array(offsets, np.float64).reshape(-1, 3)
    if len(values) != len(chosen) or chosen.max(initial=-1) >= len(sums) or chosen.min(initial=0) < 0:
        return False
    np.add.at(sums, chosen, amount * values)
    return True
