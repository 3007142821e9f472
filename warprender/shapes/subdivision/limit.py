"""The limit surface at the vertices of a level: positions, and normals on each side of a crease.

Masks as in OpenSubdiv: Halstead et al. 1993 and Biermann et al. 2000 for Catmull-Clark, Hoppe et al. 1994 for
Loop. The faces around a vertex are walked counter-clockwise; sharp edges cut the ring into sectors, each with
its own normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .rules import sums
from .topology import Topology

#: Remaining sharpness from which an edge of the last level is drawn as a crease.
SHARP = 0.5


@dataclass
class Sectors:
    """Runs of faces around each vertex between sharp edges.

    Attributes:
        start: (S,) first corner of each sector.
        size: (S,) number of its faces.
        closed: (S,) bool, whether it goes all the way round.
        of_corner: (C,) sector of each corner.
    """

    start: np.ndarray
    size: np.ndarray
    closed: np.ndarray
    of_corner: np.ndarray


class Limit:
    """Limit masks of one level."""

    def __init__(self, level: Topology) -> None:
        self.level = level
        sharp = level.edge_sharpness >= SHARP
        self._sharp_edges = sharp
        self._sharp_count = np.bincount(level.edge_vertices[sharp].reshape(-1), minlength=level.vertices)
        self._corner = (self._sharp_count > 2) | (level.vertex_sharpness >= SHARP)
        self._crease = (self._sharp_count == 2) & ~self._corner
        split = self._sharp_count >= 2
        self.sectors = _sectors(level, sharp, split)

    def positions(self, points: np.ndarray) -> np.ndarray:
        """Limits (N, 3) of the vertices at `points` (N, 3)."""
        level = self.level
        n = np.maximum(level.valence, 1)[:, None].astype(np.float64)
        neighbours = sums(level.corner_vertex, points[level.corner_vertex[level.next]], level.vertices)
        if _is_quads(level):
            opposite = level.corner_vertex[level.next[level.next]]
            beyond = sums(level.corner_vertex, points[opposite], level.vertices)
            result = (n * points + (4 * neighbours + beyond) / n) / (n + 5)
        else:
            gamma = (0.625 - (0.25 * np.cos(2 * np.pi / n) + 0.375) ** 2) / n
            weight = 1 / (n + 3 / (8 * gamma))
            result = (1 - n * weight) * points + weight * neighbours
        ends = level.edge_vertices[self._sharp_edges]
        pairs = np.concatenate([ends, ends[:, ::-1]])
        pairs = pairs[self._crease[pairs[:, 0]]]
        along = sums(pairs[:, 0], points[pairs[:, 1]], level.vertices)[self._crease]
        result[self._crease] = points[self._crease] * 2 / 3 + along / 6
        still = self._corner | (level.valence == 0)
        result[still] = points[still]
        return result

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Unit normals (S, 3) of the sectors; `points` (N, 3) are not yet moved to the limit."""
        level, sectors = self.level, self.sectors
        corner = self._corner[level.corner_vertex[sectors.start]]
        result = np.zeros((len(sectors.start), 3))
        kinds, kind_of = np.unique(sectors.size * 2 + sectors.closed, return_inverse=True)
        for kind, code in enumerate(kinds):
            size, closed = int(code) // 2, bool(code % 2)
            chosen = np.flatnonzero(kind_of == kind)
            result[chosen] = self._normals_alike(points, chosen, size, closed, corner[chosen])
        length = np.linalg.norm(result, axis=1, keepdims=True)
        return np.divide(result, length, out=result, where=length > 0)

    def _normals_alike(
        self, points: np.ndarray, sectors: np.ndarray, size: int, closed: bool, corner: np.ndarray
    ) -> np.ndarray:
        """Normals of sectors that all have `size` faces and are all closed or all open, of any length."""
        level = self.level
        ring = _ring(level, self.sectors.start[sectors], size)
        centre_weight, masks = tangent_masks(size, closed, _is_quads(level))
        centre = points[level.corner_vertex[ring[0]]]
        tangents = [np.zeros_like(centre), centre_weight * centre]
        for step, corners in enumerate(ring):
            neighbours = (level.next[corners], level.next[level.next[corners]], level.prev[corners])
            for which, neighbour in enumerate(neighbours):
                if masks[:, step, which].any():
                    there = points[level.corner_vertex[neighbour]]
                    for tangent, weight in zip(tangents, masks[:, step, which], strict=True):
                        tangent += weight * there
        normal = np.cross(*tangents)
        scale = np.linalg.norm(tangents[0], axis=1) * np.linalg.norm(tangents[1], axis=1)
        weak = np.flatnonzero(corner | ~(np.linalg.norm(normal, axis=1) > 1e-9 * scale))
        if len(weak):
            normal[weak] = _facets(level, points, [corners[weak] for corners in ring])
        return normal


def tangent_masks(size: int, closed: bool, quads: bool) -> tuple[float, np.ndarray]:
    """Weights of the two limit tangents, counter-clockwise, around a vertex of `size` faces.

    Args:
        size: number of faces in the sector.
        closed: whether they go all the way round (a smooth vertex) or between two creases.
        quads: Catmull-Clark, else Loop.

    Returns:
        The weight of the vertex itself in the second tangent, and (2, size, 3): for each tangent and face,
        the weights of the end of its first edge, of what lies beyond in a quad, and of its last edge's end.
    """
    masks = np.zeros((2, size, 3))
    step, angle = np.arange(size), (2 * np.pi if closed else np.pi) / size
    c, s = np.cos(angle), np.sin(angle)
    if closed:
        turn = np.stack([np.cos(step * angle), np.sin(step * angle)])
        masks[:, :, 0] = 4 * turn if quads else turn
        # Two faces that close on each other span no plane; their own normals serve there.
        if quads and size > 2:
            spread = (5 + c + np.cos(angle / 2) * np.sqrt(2 * (9 + c))) / 4 - 1
            masks[:, :, 1] = (turn + np.roll(turn, -1, 1)) / spread
        return 0.0, masks

    masks[0, 0, 0], masks[0, -1, 2] = 1.0, -1.0
    if size == 1:
        centre, ends = -6.0, 3.0
    elif quads:
        ratio = (c + 1) / s
        centre, ends = 4 * ratio * (c - 1), -ratio * (1 + 2 * c)
        masks[1, :, 0] = 4 * np.sin(step * angle)
        masks[1, :, 1] = np.sin(step * angle) + np.sin((step + 1) * angle)
    elif size == 2:
        centre, ends = -3.0, 0.0
        masks[1, 1, 0] = 3.0
    else:
        centre, ends = 0.0, -3 * s
        masks[1, :, 0] = 6 * (1 - c) * np.sin(step * angle)
    masks[1, 0, 0], masks[1, -1, 2] = ends, ends
    return centre, masks


def _ring(level: Topology, start: np.ndarray, size: int) -> list[np.ndarray]:
    """The corners of sectors of `size` faces, counter-clockwise: `size` arrays (A,)."""
    ring = [start]
    for _ in range(size - 1):
        ring.append(level.twin[level.prev[ring[-1]]])
    return ring


def _facets(level: Topology, points: np.ndarray, ring: list[np.ndarray]) -> np.ndarray:
    """Sum of the normals of the corners around a vertex: (A, 3)."""
    centre = points[level.corner_vertex[ring[0]]]
    after = (points[level.corner_vertex[level.next[corners]]] - centre for corners in ring)
    before = (points[level.corner_vertex[level.prev[corners]]] - centre for corners in ring)
    return sum(np.cross(a, b) for a, b in zip(after, before, strict=True))


def _sectors(level: Topology, sharp: np.ndarray, split: np.ndarray) -> Sectors:
    """Sectors of every vertex, cut at the sharp edges (E,) bool of the vertices (N,) bool that are split."""
    sharp_corner = sharp[level.corner_edge]
    cut = sharp_corner & split[level.corner_vertex]
    cut_behind = (sharp_corner & split[level.corner_vertex[level.next]])[level.prev]
    of_corner = np.full(len(level.corner_vertex), -1, np.int64)
    starts, sizes, closeds = [], [], []
    first = np.flatnonzero(cut)
    if not len(first):
        first = _one_each(level, of_corner)
    while len(first):
        sector = sum(map(len, starts)) + np.arange(len(first))
        size = np.zeros(len(first), np.int64)
        closed = np.zeros(len(first), bool)
        active, corner = np.arange(len(first)), first
        while len(active):
            of_corner[corner] = sector[active]
            size[active] += 1
            following = level.twin[level.prev[corner]]
            goes_on = ~cut_behind[corner] & (following >= 0)
            around = goes_on & (following == first[active])
            closed[active[around]] = True
            goes_on &= ~around & (of_corner[following] < 0)
            active, corner = active[goes_on], following[goes_on]
        starts.append(first)
        sizes.append(size)
        closeds.append(closed)
        first = _one_each(level, of_corner)
    if not starts:
        none = np.zeros(0, np.int64)
        return Sectors(none, none, none.astype(bool), of_corner)
    return Sectors(np.concatenate(starts), np.concatenate(sizes), np.concatenate(closeds), of_corner)


def _one_each(level: Topology, of_corner: np.ndarray) -> np.ndarray:
    """The first corner of each vertex that has corners in no sector."""
    rest = np.flatnonzero(of_corner < 0)[::-1]
    first = np.full(level.vertices, -1, np.int64)
    first[level.corner_vertex[rest]] = rest
    return first[first >= 0]


def _is_quads(level: Topology) -> bool:
    return len(level.corner_face) == 4 * level.faces
