"""Connectivity of a polygon mesh as half-edges, with the sharpness that subdivision needs.

A corner of a face is also the half-edge from its vertex to the next one; all arrays over corners are in the
order of `faceVertexIndices`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

#: Sharpness from which a crease stays sharp for ever (OpenSubdiv's).
INFINITE = 10.0


@dataclass
class Topology:
    """A mesh without its points.

    Attributes:
        vertices: number of vertices.
        corner_vertex: (C,) int64 vertex of each corner.
        corner_face: (C,) int64 face of each corner.
        next: (C,) int64 the following corner of the same face.
        prev: (C,) int64 the preceding corner of the same face.
        twin: (C,) int64 the half-edge on the other side of the edge, -1 at boundaries and where more than two
            faces meet.
        corner_edge: (C,) int64 edge of each half-edge.
        edge_vertices: (E, 2) int64.
        edge_sharpness: (E,) float64; `INFINITE` where there is no twin.
        vertex_sharpness: (N,) float64.
    """

    vertices: int
    corner_vertex: np.ndarray
    corner_face: np.ndarray
    next: np.ndarray
    prev: np.ndarray
    twin: np.ndarray
    corner_edge: np.ndarray
    edge_vertices: np.ndarray
    edge_sharpness: np.ndarray
    vertex_sharpness: np.ndarray

    @classmethod
    def build(cls, counts: np.ndarray, indices: np.ndarray, vertices: int) -> Topology:
        """Connect faces of `counts` corners each; edges without a twin are sharp, nothing else is yet."""
        counts, indices = np.asarray(counts, np.int64), np.asarray(indices, np.int64)
        face, following, previous = face_rings(counts)
        start, end = indices, indices[following]
        low, high = np.minimum(start, end), np.maximum(start, end)
        keys, corner_edge, uses = np.unique(low * vertices + high, return_inverse=True, return_counts=True)
        edge_vertices = np.stack([keys // vertices, keys % vertices], 1) if vertices else np.zeros((0, 2), int)
        twin = _twins(corner_edge, uses, start)
        edge_sharpness = np.zeros(len(keys))
        edge_sharpness[corner_edge[twin < 0]] = INFINITE
        return cls(
            vertices,
            indices,
            face,
            following,
            previous,
            twin,
            corner_edge,
            edge_vertices,
            edge_sharpness,
            np.zeros(vertices),
        )

    @cached_property
    def faces(self) -> int:
        """Number of faces."""
        return int(self.corner_face[-1]) + 1 if len(self.corner_face) else 0

    @cached_property
    def face_sizes(self) -> np.ndarray:
        """(F,) corners of each face."""
        return np.bincount(self.corner_face, minlength=self.faces)

    @cached_property
    def valence(self) -> np.ndarray:
        """(N,) faces at each vertex; its edges too, where the vertex is inside the surface."""
        return np.bincount(self.corner_vertex, minlength=self.vertices)

    @cached_property
    def edge_corner(self) -> np.ndarray:
        """(E,) one half-edge of each edge."""
        corner = np.zeros(len(self.edge_vertices), np.int64)
        corner[self.corner_edge] = np.arange(len(self.corner_edge))
        return corner

    @cached_property
    def on_boundary(self) -> np.ndarray:
        """(N,) bool, whether a vertex is at an edge without a twin."""
        marked = np.zeros(self.vertices, bool)
        marked[self.edge_vertices[self.twin[self.edge_corner] < 0]] = True
        return marked

    def sharpen_edges(self, pairs: np.ndarray, sharpness: np.ndarray) -> None:
        """Crease the edges between pairs (K, 2) of vertices; pairs that are no edge are left out."""
        keys = self.edge_vertices[:, 0] * self.vertices + self.edge_vertices[:, 1]
        wanted = pairs.min(1) * self.vertices + pairs.max(1)
        place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        found = keys[place] == wanted
        np.maximum.at(self.edge_sharpness, place[found], np.clip(sharpness[found], 0, INFINITE))

    def sharpen_corners(self) -> None:
        """Keep the corners of boundaries: vertices that only one face uses."""
        self.vertex_sharpness[(self.valence == 1) & self.on_boundary] = INFINITE


def face_rings(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Face, following corner and preceding corner of each corner, for faces of `counts` corners."""
    ends = np.cumsum(counts)
    face = np.repeat(np.arange(len(counts)), counts)
    here = np.arange(len(face))
    following, previous = here + 1, here - 1
    drawn = counts > 0
    first, last = (ends - counts)[drawn], ends[drawn] - 1
    following[last], previous[first] = first, last
    return face, following, previous


def _twins(corner_edge: np.ndarray, uses: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Half-edges on the other side: only where two faces meet, and agree on which side is outside."""
    order = np.argsort(corner_edge, kind="stable")
    first = np.cumsum(uses) - uses
    pairs = first[uses == 2]
    a, b = order[pairs], order[pairs + 1]
    opposed = start[a] != start[b]
    twin = np.full(len(corner_edge), -1, np.int64)
    twin[a[opposed]], twin[b[opposed]] = b[opposed], a[opposed]
    return twin
