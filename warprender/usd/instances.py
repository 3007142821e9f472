"""UsdGeomPointInstancer: each prototype once, with the transforms of all its copies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Tf, Usd, UsdGeom

from .reading import Reading, one_line


@dataclass
class Frame:
    """A coordinate system that prims are drawn in, once or many times.

    Attributes:
        copies: (K, 4, 4) float64 frame-to-world, for row vectors.
        ids: (K,) int32 instance index of each copy, -1 in the world itself. Under nested instancers the index
            counts all copies, the inner instancer's fastest.
        instancers: paths of the point instancers above, the innermost last.
    """

    copies: np.ndarray
    ids: np.ndarray
    instancers: tuple[str, ...] = ()

    @classmethod
    def world(cls) -> Frame:
        """The world, once."""
        return cls(np.eye(4)[None], np.array([-1], np.int32))


def expand(
    reading: Reading, instancer: UsdGeom.PointInstancer, local: np.ndarray, frame: Frame
) -> list[tuple[Usd.Prim, Frame]]:
    """The prototypes of a point instancer, each with the frame of its drawn copies.

    Args:
        reading: the reading in progress.
        instancer: the instancer.
        local: (4, 4) from the instancer to its frame.
        frame: where the instancer itself is drawn.

    Returns:
        Pairs of a prototype root and its frame; the root's own transform is still to be applied.
    """
    prim = instancer.GetPrim()
    if str(prim.GetPath()) in frame.instancers:
        reading.remark(prim, "it is among its own prototypes")
        reading.sound_instancers = False
        return []
    prototypes = instancer.GetPrototypesRel().GetForwardedTargets()
    indices = np.array(reading.get(instancer.GetProtoIndicesAttr()) or [], np.int64)
    if not len(indices) or not prototypes:
        return []
    matrices = _instance_matrices(reading, instancer, len(indices))
    if matrices is None:
        return []
    drawn = _mask(reading, instancer, len(indices))
    in_range = (indices >= 0) & (indices < len(prototypes))
    finite = np.isfinite(matrices).all((1, 2))
    if not in_range.all():
        reading.remark(prim, f"{np.sum(~in_range)} protoIndices are outside 0…{len(prototypes) - 1}")
        reading.sound_instancers = False
    if not finite.all():
        reading.remark(prim, f"{np.sum(~finite)} instances have transforms that are not finite")
    drawn &= in_range & finite

    frames = []
    for target in dict.fromkeys(prototypes):
        prototype = reading.stage.GetPrimAtPath(target)
        if not prototype:
            reading.remark(prim, f"there is no prototype {target}")
            continue
        numbers = [k for k, path in enumerate(prototypes) if path == target]
        chosen = np.flatnonzero(drawn & np.isin(indices, numbers))
        if len(chosen):
            frames.append((prototype, _nest(frame, local, matrices[chosen], chosen, len(indices), prim)))
    return frames


def _instance_matrices(reading: Reading, instancer: UsdGeom.PointInstancer, count: int) -> np.ndarray | None:
    """(J, 4, 4) float64 from each instance to the instancer, velocities and accelerations applied."""
    try:
        matrices = instancer.ComputeInstanceTransformsAtTime(
            reading.time,
            reading.time,
            UsdGeom.PointInstancer.ExcludeProtoXform,
            UsdGeom.PointInstancer.IgnoreMask,
        )
    except Tf.ErrorException as error:
        reading.remark(instancer.GetPrim(), f"its instances are not drawn: {one_line(error)}")
        return None
    matrices = np.array(matrices, np.float64).reshape(-1, 4, 4)
    if len(matrices) != count:
        reading.remark(instancer.GetPrim(), "its instances are not drawn: positions and protoIndices differ in length")
        return None
    return matrices


def _mask(reading: Reading, instancer: UsdGeom.PointInstancer, count: int) -> np.ndarray:
    """(J,) bool, False for inactiveIds and invisibleIds."""
    mask = np.array(instancer.ComputeMaskAtTime(reading.time), bool)
    return mask if len(mask) == count else np.ones(count, bool)


def _nest(
    frame: Frame, local: np.ndarray, matrices: np.ndarray, chosen: np.ndarray, count: int, prim: Usd.Prim
) -> Frame:
    """The frame of the chosen instances, `count` of them in all, in every copy of the instancer."""
    instancer_to_world = local @ frame.copies
    copies = (matrices[None] @ instancer_to_world[:, None]).reshape(-1, 4, 4)
    outer = np.maximum(frame.ids.astype(np.int64), 0)
    ids = (outer[:, None] * count + chosen).reshape(-1)
    return Frame(copies, ids.astype(np.int32), (*frame.instancers, str(prim.GetPath())))
