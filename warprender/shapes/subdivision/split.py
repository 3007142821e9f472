"""One level of subdivision of a topology: faces into quads (Catmull-Clark, bilinear) or triangles (Loop).

Child vertices are the parent's vertices, then one for each edge, then, for quads, one for each face. Twins
and edges of the children follow from the parent's: nothing is searched or sorted.
"""

from __future__ import annotations

import numpy as np

from .topology import INFINITE, Topology


def split_quads(parent: Topology) -> Topology:
    """A quad for each corner: its vertex, the edge after it, the face, the edge before it."""
    corners = np.arange(len(parent.corner_vertex))
    edges = len(parent.edge_vertices)
    edge, before = parent.corner_edge, parent.corner_edge[parent.prev]
    edge_vertex, face_vertex = parent.vertices, parent.vertices + edges
    vertex = np.stack(
        [parent.corner_vertex, edge_vertex + edge, face_vertex + parent.corner_face, edge_vertex + before], 1
    )
    across, back = parent.twin, parent.twin[parent.prev]
    twin = np.stack(
        [
            np.where(across >= 0, 4 * parent.next[across] + 3, -1),
            4 * parent.next + 2,
            4 * parent.prev + 1,
            np.where(back >= 0, 4 * back, -1),
        ],
        1,
    )
    child_edge = np.stack(
        [
            _half(parent, edge),
            2 * edges + corners,
            2 * edges + parent.prev,
            _half(parent, before),
        ],
        1,
    )
    inner = np.stack([edge_vertex + edge, face_vertex + parent.corner_face], 1)
    return _child(parent, vertex, twin, child_edge, inner, face_vertex + parent.faces)


def split_triangles(parent: Topology) -> Topology:
    """Four triangles for each triangle: one at each corner, then the one between the edges."""
    edges = len(parent.edge_vertices)
    edge, before = parent.corner_edge, parent.corner_edge[parent.prev]
    edge_vertex = parent.vertices
    corners = np.arange(len(parent.corner_vertex))
    # Corner j of face f is number 3 f + j; its triangle is number 4 f + j, the one in the middle 4 f + 3.
    at_corner = 3 * parent.corner_face + 3 * corners
    middle = 9 * parent.corner_face + 9 + corners
    outer_vertex = np.stack([parent.corner_vertex, edge_vertex + edge, edge_vertex + before], 1)
    across, back = parent.twin, parent.twin[parent.prev]
    outer_twin = np.stack(
        [
            np.where(across >= 0, at_corner[parent.next[across]] + 2, -1),
            middle[parent.prev],
            np.where(back >= 0, at_corner[back], -1),
        ],
        1,
    )
    outer_edge = np.stack([_half(parent, edge), 2 * edges + parent.prev, _half(parent, before)], 1)

    def with_middle(outer: np.ndarray, inner: np.ndarray) -> np.ndarray:
        """Triangles at the corners and between the edges, in the order of the children."""
        return np.concatenate([outer.reshape(-1, 3, 3), inner.reshape(-1, 1, 3)], 1).reshape(-1, 3)

    inner = np.stack([edge_vertex + edge, edge_vertex + edge[parent.next]], 1)
    return _child(
        parent,
        with_middle(outer_vertex, edge_vertex + edge),
        with_middle(outer_twin, at_corner[parent.next] + 1),
        with_middle(outer_edge, 2 * edges + corners),
        inner,
        parent.vertices + edges,
    )


def softened(sharpness: np.ndarray) -> np.ndarray:
    """Sharpness one level further down."""
    return np.where(sharpness >= INFINITE, INFINITE, np.maximum(sharpness - 1.0, 0.0))


def _half(parent: Topology, edge: np.ndarray) -> np.ndarray:
    """The child of an edge that lies at the vertex of each corner."""
    return 2 * edge + (parent.edge_vertices[edge, 1] == parent.corner_vertex)


def _child(
    parent: Topology,
    vertex: np.ndarray,
    twin: np.ndarray,
    edge: np.ndarray,
    inner: np.ndarray,
    vertices: int,
) -> Topology:
    """Topology of faces (F, k) given by vertex, twin and edge of each half-edge, and the inner edges."""
    faces, size = vertex.shape
    corner = np.arange(faces * size)
    start = corner - corner % size
    middles = parent.vertices + np.arange(len(parent.edge_vertices))
    outer = np.stack([parent.edge_vertices, np.stack([middles, middles], 1)], 2).reshape(-1, 2)
    edge_sharpness = np.concatenate([np.repeat(softened(parent.edge_sharpness), 2), np.zeros(len(inner))])
    vertex_sharpness = np.zeros(vertices)
    vertex_sharpness[: parent.vertices] = softened(parent.vertex_sharpness)
    return Topology(
        vertices,
        vertex.reshape(-1),
        corner // size,
        start + (corner + 1) % size,
        start + (corner + size - 1) % size,
        twin.reshape(-1),
        edge.reshape(-1),
        np.concatenate([outer, inner]),
        edge_sharpness,
        vertex_sharpness,
    )
