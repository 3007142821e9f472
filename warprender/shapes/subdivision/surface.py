"""A cage subdivided: connectivity once, then points and primvars as often as they change."""

from __future__ import annotations

import numpy as np

from ..mesh import Mesh
from ..primvar import Primvar
from .cage import Cage
from .facevarying import face_varying_topology
from .limit import Limit
from .rules import Rules, catmull_clark_rules, linear_rules, loop_rules
from .split import split_quads, split_triangles
from .topology import Topology


class Subdivision:
    """The refinement of a cage, independent of its points.

    Attributes:
        cage: the cage.
        level: number of refinements, at least 1.
        topology: connectivity of the last level.
    """

    def __init__(self, cage: Cage, level: int) -> None:
        """Refine the connectivity; raises ValueError for Loop on faces that are no triangles."""
        if level < 1:
            raise ValueError("a surface is subdivided at least once; level 0 is the cage itself")
        if cage.subdivisionScheme == "loop" and (np.asarray(cage.faceVertexCounts) != 3).any():
            raise ValueError("Loop subdivision takes triangles only")
        self.cage, self.level = cage, level
        self._quads = cage.subdivisionScheme != "loop"
        base = cage.topology()
        self._levels = self._refined(base)
        self.topology = self._levels[-1]
        self._rules = [self._rules_of(t, first=t is base) for t in self._levels[:-1]]
        self._linear = [linear_rules(t, self._quads) for t in self._levels[:-1]]
        self._limit = None if cage.subdivisionScheme == "bilinear" else Limit(self.topology)
        self._faces = self._cage_faces()
        self._drawn = ~cage.undrawn_faces(base)[self._faces]

    def mesh(self, points: np.ndarray, primvars: dict[str, Primvar] | None = None, **fields) -> Mesh:
        """Triangles of the surface.

        Args:
            points: (N, 3) points of the cage.
            primvars: primvars of the cage.
            fields: further fields of `Mesh`.

        Returns:
            A mesh whose `faces` are the cage's, and whose points and corners are the surface's.
        """
        refined = _apply(self._rules, np.asarray(points, np.float64))
        normals, placed = None, refined
        if self._limit is not None:
            placed = self._limit.positions(refined)
            sectors = self._limit.sectors.of_corner
            normals = Primvar(self._limit.normals(refined), "faceVarying", sectors)
        triangles, faces, corners = self._triangles()
        carried = {name: self._primvar(value) for name, value in (primvars or {}).items()}
        return Mesh(placed.astype(np.float32), triangles, faces, corners, normals, carried, **fields)

    def _primvar(self, primvar: Primvar) -> Primvar:
        """A primvar of the cage on the surface; constant and uniform ones are as they were."""
        if primvar.interpolation in ("vertex", "varying"):
            rules = self._rules if primvar.interpolation == "vertex" else self._linear
            return Primvar(_apply(rules, primvar.expanded()), "vertex")
        if primvar.interpolation == "faceVarying":
            return self._face_varying(primvar)
        return primvar

    def _face_varying(self, primvar: Primvar) -> Primvar:
        count = len(self.cage.faceVertexIndices)
        indices = np.arange(count) if primvar.indices is None else primvar.indices
        topology, source = face_varying_topology(self.cage, self._levels[0], indices)
        levels = self._refined(topology)
        linear = self.cage.faceVaryingLinearInterpolation == "all" or self._limit is None
        rules = [linear_rules(t, self._quads) if linear else self._rules_of(t, t is topology) for t in levels[:-1]]
        values = _apply(rules, primvar.values[source])
        return Primvar(values, "faceVarying", levels[-1].corner_vertex)

    def _refined(self, base: Topology) -> list[Topology]:
        levels = [base]
        for _ in range(self.level):
            levels.append(split_quads(levels[-1]) if self._quads else split_triangles(levels[-1]))
        return levels

    def _rules_of(self, level: Topology, first: bool) -> Rules:
        scheme = self.cage.subdivisionScheme
        if scheme == "bilinear":
            return linear_rules(level, True)
        if scheme == "loop":
            return loop_rules(level)
        return catmull_clark_rules(level, first and self.cage.triangleSubdivisionRule == "smooth")

    def _cage_faces(self) -> np.ndarray:
        """(faces of the last level,) face of the cage that each lies in."""
        base = self._levels[0]
        if not self._quads:
            return np.repeat(np.arange(base.faces), 4**self.level)
        return np.repeat(base.corner_face, 4 ** (self.level - 1))

    def _triangles(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Triangles, their cage faces and their corners, int32, of the faces that are drawn."""
        size = 4 if self._quads else 3
        drawn = np.flatnonzero(self._drawn)
        corners = drawn[:, None] * size + np.arange(size)
        if size == 4:
            corners = corners[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
        faces = np.repeat(self._faces[drawn], size - 2)
        return (
            self.topology.corner_vertex[corners].astype(np.int32),
            faces.astype(np.int32),
            corners.astype(np.int32),
        )


def _apply(rules: list[Rules], values: np.ndarray) -> np.ndarray:
    values = np.asarray(values, np.float64)
    for rule in rules:
        values = rule.refine(values)
    return values
