"""Faces of a UsdGeomMesh, checked, so that nothing after this indexes outside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom

from .reading import Reading


@dataclass
class Topology:
    """Faces of a mesh that are safe to index with.

    Attributes:
        counts: (F,) int64 corners of each face.
        indices: (sum of counts,) int64 points of the corners, all in range.
        holes: authored holeIndices.
        broken: faces that cannot be drawn.
    """

    counts: np.ndarray
    indices: np.ndarray
    holes: np.ndarray
    broken: np.ndarray

    def sizes(self, points: int) -> dict[str, int]:
        """Number of primvar elements by interpolation."""
        return {
            "constant": 1,
            "uniform": len(self.counts),
            "vertex": points,
            "varying": points,
            "faceVarying": len(self.indices),
        }


def read_topology(reading: Reading, schema: UsdGeom.Mesh, points: np.ndarray) -> Topology:
    """The faces of a mesh prim, checked."""
    counts = np.array(reading.get(schema.GetFaceVertexCountsAttr()) or [], np.int64)
    indices = np.array(reading.get(schema.GetFaceVertexIndicesAttr()) or [], np.int64)
    holes = np.array(reading.get(schema.GetHoleIndicesAttr()) or [], np.int64)
    return checked_topology(reading, schema.GetPrim(), points, counts, indices, holes)


def checked_topology(
    reading: Reading,
    prim: Usd.Prim,
    points: np.ndarray,
    counts: np.ndarray,
    indices: np.ndarray,
    holes: np.ndarray,
) -> Topology:
    """Faces with the broken ones marked, and remarked on, so that primvars keep their places."""
    if (counts < 0).any():
        reading.remark(prim, f"{np.sum(counts < 0)} faceVertexCounts are negative")
        counts = np.maximum(counts, 0)
    ends = np.cumsum(counts)
    if len(counts) and ends[-1] != len(indices):
        reading.remark(prim, f"faceVertexCounts add up to {ends[-1]}, faceVertexIndices are {len(indices)}")
        counts = np.where(ends <= len(indices), counts, 0)
        indices = indices[: counts.sum()]

    outside = (indices < 0) | (indices >= len(points))
    safe = np.where(outside, 0, indices)
    broken_points = ~np.isfinite(points).all(1) if len(points) else np.zeros(1, bool)
    face_of_corner = np.repeat(np.arange(len(counts)), counts)
    missing = np.unique(face_of_corner[outside])
    if len(missing) and len(points):
        reading.remark(prim, f"{len(missing)} faces have indices outside 0…{len(points) - 1}")
    infinite = np.unique(face_of_corner[broken_points[safe]])
    if len(infinite):
        reading.remark(prim, f"{len(infinite)} faces have points that are not finite")
    return Topology(counts, safe, holes, np.union1d(missing, infinite))
