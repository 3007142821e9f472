"""Where the vertices of the next level lie: the masks of Catmull-Clark, Loop and bilinear subdivision.

Creases are semi-sharp as in OpenSubdiv (uniform method): a vertex follows the rule of its sharpness on this
level, blended with the rule of the next where the two differ (DeRose, Kass, Truong 1998).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .split import softened
from .topology import Topology

#: Weight of the faces in an edge point between triangles, with triangleSubdivisionRule "smooth".
SMOOTH_TRIANGLE = 0.470


@dataclass
class Rules:
    """Masks of one level, to be applied to any values at its vertices.

    Attributes:
        topology: the level.
        has_faces: whether faces make vertices (quads).
        edge_sides: (E,) weight of either thing beside an edge: faces, or opposite vertices.
        vertex: (N, 4) weights of the vertex itself, and of the sums of its neighbours, of its face points and
            of its neighbours along creases.
        creases: (K, 2) pairs of a vertex and its neighbour along a crease.
    """

    topology: Topology
    has_faces: bool
    edge_sides: np.ndarray
    vertex: np.ndarray
    creases: np.ndarray

    def refine(self, values: np.ndarray) -> np.ndarray:
        """Values (N, K) at the vertices of this level as values at those of the next."""
        level = self.topology
        parts = [values, values[level.edge_vertices].mean(1)]
        if self.has_faces:
            corners = values[level.corner_vertex]
            parts.append(sums(level.corner_face, corners, level.faces) / level.face_sizes[:, None])
        parts[1] = self._edges(parts)
        parts[0] = self._vertices(parts)
        return np.concatenate(parts)

    def _edges(self, parts: list[np.ndarray]) -> np.ndarray:
        """Edge points: what lies beside the edge weighs `edge_sides` on each side, its ends the rest."""
        level, sides, middles = self.topology, self.edge_sides[:, None], parts[1]
        smooth = np.flatnonzero(self.edge_sides)
        corner = level.edge_corner[smooth]
        twin = level.twin[corner]
        if self.has_faces:
            beside = parts[2][level.corner_face[corner]] + parts[2][level.corner_face[twin]]
        else:
            beside = sum(parts[0][level.corner_vertex[level.prev[c]]] for c in (corner, twin))
        result = (1.0 - 2.0 * sides) * middles
        result[smooth] += sides[smooth] * beside
        return result

    def _vertices(self, parts: list[np.ndarray]) -> np.ndarray:
        level, values, weights = self.topology, parts[0], self.vertex[:, :, None]
        result = weights[:, 0] * values
        if self.vertex[:, 1].any():
            result += weights[:, 1] * sums(level.corner_vertex, values[level.corner_vertex[level.next]], level.vertices)
        if self.has_faces and self.vertex[:, 2].any():
            result += weights[:, 2] * sums(level.corner_vertex, parts[2][level.corner_face], level.vertices)
        if len(self.creases):
            result += weights[:, 3] * sums(self.creases[:, 0], values[self.creases[:, 1]], level.vertices)
        return result


def linear_rules(level: Topology, has_faces: bool) -> Rules:
    """Linear interpolation: bilinear subdivision, and varying primvars under any scheme."""
    weights = np.tile([1.0, 0.0, 0.0, 0.0], (level.vertices, 1))
    return Rules(level, has_faces, np.zeros(len(level.edge_vertices)), weights, np.zeros((0, 2), np.int64))


def catmull_clark_rules(level: Topology, smooth_triangles: bool = False) -> Rules:
    """Catmull-Clark; `smooth_triangles` is triangleSubdivisionRule "smooth"."""
    n = np.maximum(level.valence, 1).astype(np.float64)
    smooth = np.stack([(n - 2) / n, 1 / n**2, 1 / n**2, np.zeros_like(n)], 1)
    sides = np.full(len(level.edge_vertices), 0.25)
    if smooth_triangles:
        weight = np.where(level.face_sizes == 3, SMOOTH_TRIANGLE, 0.25)[level.corner_face]
        twin = level.twin[level.edge_corner]
        sides = (weight[level.edge_corner] + np.where(twin >= 0, weight[twin], 0.25)) / 2
    return _sharpened(level, True, sides, smooth)


def loop_rules(level: Topology) -> Rules:
    """Loop."""
    n = np.maximum(level.valence, 1).astype(np.float64)
    beta = (0.625 - (0.375 + 0.25 * np.cos(2 * np.pi / n)) ** 2) / n
    smooth = np.stack([1 - n * beta, beta, np.zeros_like(n), np.zeros_like(n)], 1)
    return _sharpened(level, False, np.full(len(level.edge_vertices), 0.125), smooth)


def sums(groups: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Sum of the values (K, C) of each of `count` groups (K,): (count, C) float64."""
    columns = [np.bincount(groups, values[:, k], count) for k in range(values.shape[1])]
    return np.stack(columns, 1).astype(np.float64)


def _sharpened(level: Topology, has_faces: bool, sides: np.ndarray, smooth: np.ndarray) -> Rules:
    """The smooth masks with creases and corners put in where the level is sharp; unused vertices stay."""
    smooth[level.valence == 0] = (1.0, 0.0, 0.0, 0.0)
    sharp, soon = level.edge_sharpness, softened(level.edge_sharpness)
    now_count, soon_count = _sharp_edges(level, sharp), _sharp_edges(level, soon)
    now = _masks(smooth, level.vertex_sharpness, now_count)
    later = _masks(smooth, softened(level.vertex_sharpness), soon_count)
    share = _transition(level, sharp, soon)[:, None]
    creased = (now_count == 2) & (level.vertex_sharpness <= 0)
    # A vertex that is a corner now and on a crease on the next level follows the edges that stay sharp.
    ends = level.edge_vertices
    pairs = np.concatenate([ends, ends[:, ::-1]])
    along = np.where(creased[pairs[:, 0]], np.tile(sharp, 2), np.tile(soon, 2)) > 0
    return Rules(
        level,
        has_faces,
        sides * (1.0 - np.clip(sharp, 0.0, 1.0)),
        np.where((now == later).all(1, keepdims=True), now, share * now + (1.0 - share) * later),
        pairs[along],
    )


def _sharp_edges(level: Topology, sharpness: np.ndarray) -> np.ndarray:
    """(N,) number of sharp edges at each vertex."""
    return np.bincount(level.edge_vertices[sharpness > 0].reshape(-1), minlength=level.vertices)


def _masks(smooth: np.ndarray, vertex_sharpness: np.ndarray, sharp_edges: np.ndarray) -> np.ndarray:
    """(N, 4) masks: a corner stays, a vertex on a crease follows it, others (darts too) are smooth."""
    masks = smooth.copy()
    masks[sharp_edges == 2] = (0.75, 0.0, 0.0, 0.125)
    masks[(sharp_edges > 2) | (vertex_sharpness > 0)] = (1.0, 0.0, 0.0, 0.0)
    return masks


def _transition(level: Topology, sharp: np.ndarray, soon: np.ndarray) -> np.ndarray:
    """(N,) share of this level's rule where the next has another: mean sharpness of what becomes smooth."""
    ending = (sharp > 0) & (soon <= 0)
    ends = level.edge_vertices[ending].reshape(-1)
    total = np.bincount(ends, np.repeat(sharp[ending], 2), level.vertices)
    count = np.bincount(ends, minlength=level.vertices)
    vertex = (level.vertex_sharpness > 0) & (softened(level.vertex_sharpness) <= 0)
    total = total + np.where(vertex, level.vertex_sharpness, 0.0)
    count = count + vertex
    return np.clip(total / np.maximum(count, 1), 0.0, 1.0)
