"""UsdGeomPointInstancer: each prototype once, with the transforms of all its copies."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from pxr import Tf, Usd, UsdGeom

from ..shapes import Primvar
from .primvars import read_primvars
from .reading import Reading, one_line


@dataclass
class Frame:
    """A coordinate system that prims are drawn in, once or many times.

    Attributes:
        copies: (K, 4, 4) float64 frame-to-world, for row vectors.
        ids: (K,) int32 instance index of each copy, -1 in the world itself. Under nested instancers the index
            counts all copies, the inner instancer's fastest.
        instancers: paths of the point instancers above, the innermost last.
        primvars: primvars with a value for each copy, which win over those of the shapes drawn here.
    """

    copies: np.ndarray
    ids: np.ndarray
    instancers: tuple[str, ...] = ()
    primvars: dict[str, Primvar] = field(default_factory=dict)

    @classmethod
    def world(cls) -> Frame:
        """The world, once."""
        return cls(np.eye(4)[None], np.array([-1], np.int32))

    def nested(self, instancer: Usd.Prim, copies: np.ndarray, primvars: dict[str, Primvar]) -> Frame:
        """The frame of an instancer's copies of a thing, in every copy of the instancer.

        Args:
            instancer: the prim that makes copies.
            copies: (J, 4, 4) float64 transforms of all of them to this frame.
            primvars: primvars of `instance` interpolation with a value for each.
        """
        total = (copies[None] @ self.copies[:, None]).reshape(-1, 4, 4)
        outer = np.maximum(self.ids.astype(np.int64), 0)
        ids = (outer[:, None] * len(copies) + np.arange(len(copies))).reshape(-1)
        inherited = {
            name: Primvar(np.repeat(p.values, len(copies), 0), "instance") for name, p in self.primvars.items()
        }
        path = str(instancer.GetPath())
        return Frame(total, ids.astype(np.int32), (*self.instancers, path), {**inherited, **primvars})

    def chosen(self, keep: np.ndarray) -> Frame:
        """The copies (K,) bool to keep."""
        return replace(self, copies=self.copies[keep], ids=self.ids[keep])


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

    primvars = read_primvars(reading, prim, {"uniform": len(indices), "vertex": len(indices), "varying": len(indices)})
    everything = frame.nested(
        prim, matrices @ local, {n: Primvar(p.expanded(), "instance") for n, p in primvars.items()}
    )
    drawn = np.tile(drawn, len(frame.ids))
    indices = np.tile(indices, len(frame.ids))
    frames = []
    for target in dict.fromkeys(prototypes):
        prototype = reading.stage.GetPrimAtPath(target)
        if not prototype:
            reading.remark(prim, f"there is no prototype {target}")
            continue
        numbers = [k for k, path in enumerate(prototypes) if path == target]
        chosen = drawn & np.isin(indices, numbers)
        if chosen.any():
            frames.append((prototype, everything.chosen(chosen)))
    return frames


def _instance_matrices(reading: Reading, instancer: UsdGeom.PointInstancer, count: int) -> np.ndarray | None:
    """(J, 4, 4) float64 from each instance to the instancer, velocities and accelerations applied."""
    time = _finite_time(reading, instancer)
    try:
        matrices = instancer.ComputeInstanceTransformsAtTime(
            time,
            time,
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


def _finite_time(reading: Reading, instancer: UsdGeom.PointInstancer) -> Usd.TimeCode:
    """The time of the reading; the first sample's in place of the earliest of all, which velocities multiply."""
    if not reading.time.IsEarliestTime():
        return reading.time
    samples = instancer.GetPositionsAttr().GetTimeSamples()
    return Usd.TimeCode(samples[0]) if samples else Usd.TimeCode.Default()


def _mask(reading: Reading, instancer: UsdGeom.PointInstancer, count: int) -> np.ndarray:
    """(J,) bool, False for inactiveIds and invisibleIds."""
    mask = np.array(instancer.ComputeMaskAtTime(reading.time), bool)
    return mask if len(mask) == count else np.ones(count, bool)
