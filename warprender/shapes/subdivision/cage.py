"""A subdivision cage: what UsdGeomMesh says about its faces, without its points."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np

from .topology import Topology

SCHEMES = ("catmullClark", "loop", "bilinear")


def _none() -> np.ndarray:
    return np.zeros(0, np.int64)


@dataclass(eq=False)
class Cage:
    """Names, meanings and defaults as in UsdGeomMesh.

    Attributes:
        points: number of points.
        faceVertexCounts: (F,) int.
        faceVertexIndices: (sum of counts,) int, in range.
        subdivisionScheme: one of `SCHEMES`.
        interpolateBoundary: "none", "edgeOnly" or "edgeAndCorner".
        faceVaryingLinearInterpolation: "none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries" or
            "all".
        triangleSubdivisionRule: "catmullClark" or "smooth".
        creaseIndices, creaseLengths, creaseSharpnesses: sharp edges; one sharpness a crease, or an edge.
        cornerIndices, cornerSharpnesses: sharp points.
        holes: (K,) faces that shape the surface and are not drawn.
    """

    points: int
    faceVertexCounts: np.ndarray
    faceVertexIndices: np.ndarray
    subdivisionScheme: str = "catmullClark"
    interpolateBoundary: str = "edgeAndCorner"
    faceVaryingLinearInterpolation: str = "cornersPlus1"
    triangleSubdivisionRule: str = "catmullClark"
    creaseIndices: np.ndarray = field(default_factory=_none)
    creaseLengths: np.ndarray = field(default_factory=_none)
    creaseSharpnesses: np.ndarray = field(default_factory=_none)
    cornerIndices: np.ndarray = field(default_factory=_none)
    cornerSharpnesses: np.ndarray = field(default_factory=_none)
    holes: np.ndarray = field(default_factory=_none)

    def __eq__(self, other: object) -> bool:
        """Whether every field is the same, arrays by their values."""
        if not isinstance(other, Cage):
            return NotImplemented
        return all(np.array_equal(getattr(self, f.name), getattr(other, f.name)) for f in fields(self))

    def topology(self) -> Topology:
        """The cage's connectivity with creases, corners and boundaries sharpened."""
        level = Topology.build(self.faceVertexCounts, self.faceVertexIndices, self.points)
        pairs, sharpness = self._creased_edges()
        if len(pairs) and len(level.edge_vertices):
            level.sharpen_edges(pairs, sharpness)
        if self.interpolateBoundary == "edgeAndCorner":
            level.sharpen_corners()
        count = min(len(self.cornerIndices), len(self.cornerSharpnesses))
        corners = np.asarray(self.cornerIndices[:count], np.int64)
        valid = (corners >= 0) & (corners < self.points)
        sharp = np.asarray(self.cornerSharpnesses[:count], np.float64)[valid]
        np.maximum.at(level.vertex_sharpness, corners[valid], sharp)
        return level

    def undrawn_faces(self, level: Topology) -> np.ndarray:
        """(F,) bool: holes, and faces at the boundary where it is not interpolated."""
        undrawn = np.zeros(len(self.faceVertexCounts), bool)
        holes = np.asarray(self.holes, np.int64)
        undrawn[holes[(holes >= 0) & (holes < len(undrawn))]] = True
        if self.interpolateBoundary == "none":
            undrawn[level.corner_face[level.on_boundary[level.corner_vertex]]] = True
        return undrawn

    def _creased_edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of points (K, 2) and their sharpness (K,); creases that do not add up are cut short."""
        lengths = np.maximum(np.asarray(self.creaseLengths, np.int64), 0)
        ends = np.cumsum(lengths)
        lengths = lengths[ends <= len(self.creaseIndices)]
        indices = np.asarray(self.creaseIndices[: lengths.sum()], np.int64)
        crease = np.repeat(np.arange(len(lengths)), lengths)
        joined = np.flatnonzero(crease[1:] == crease[:-1]) if len(crease) else _none()
        pairs = np.stack([indices[joined], indices[joined + 1]], 1) if len(joined) else np.zeros((0, 2), int)
        sharpness = np.asarray(self.creaseSharpnesses, np.float64)
        if len(sharpness) != len(joined):
            padded = np.zeros(len(lengths))
            count = min(len(sharpness), len(lengths))
            padded[:count] = sharpness[:count]
            sharpness = padded[crease[joined]] if len(joined) else np.zeros(0)
        valid = ((pairs >= 0) & (pairs < self.points)).all(1)
        return pairs[valid], sharpness[valid]
