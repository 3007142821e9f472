"""Face-varying channels: the cage's faces over the channel's own vertices, cut open where values differ."""

from __future__ import annotations

import numpy as np

from .cage import Cage
from .topology import INFINITE, Topology


def face_varying_topology(cage: Cage, base: Topology, indices: np.ndarray) -> tuple[Topology, np.ndarray]:
    """Connectivity of a face-varying channel, sharpened as faceVaryingLinearInterpolation says.

    Args:
        cage: the cage.
        base: its connectivity, with creases.
        indices: (C,) value of each corner.

    Returns:
        The channel's topology and, for each of its vertices, the value that it has.
    """
    # The same value at two vertices is two places: only corners at one vertex are joined.
    _, first, vertex = np.unique(
        base.corner_vertex * (int(np.max(indices, initial=0)) + 1) + indices,
        return_index=True,
        return_inverse=True,
    )
    channel = Topology.build(cage.faceVertexCounts, vertex, len(first))
    cage_edge = base.corner_edge[channel.edge_corner]
    channel.edge_sharpness = np.maximum(channel.edge_sharpness, base.edge_sharpness[cage_edge])
    of_vertex = base.corner_vertex[first]
    channel.vertex_sharpness = base.vertex_sharpness[of_vertex].copy()
    _sharpen(channel, of_vertex, cage.faceVaryingLinearInterpolation)
    return channel, indices[first]


def _sharpen(channel: Topology, of_vertex: np.ndarray, rule: str) -> None:
    """Which values of the channel's boundary stay where they are."""
    if rule in ("none", "all"):
        return
    if rule == "boundaries":
        channel.vertex_sharpness[channel.on_boundary] = INFINITE
        return
    corners = (channel.valence == 1) & channel.on_boundary
    channel.vertex_sharpness[corners] = INFINITE
    values = np.bincount(of_vertex)
    if rule in ("cornersPlus1", "cornersPlus2"):
        channel.vertex_sharpness[(values > 2)[of_vertex]] = INFINITE
    if rule == "cornersPlus2":
        # The value across from a corner is a concave corner; a seam that ends at a vertex is a dart.
        concave = np.bincount(of_vertex, corners) > 0
        darts = (values == 1)[of_vertex] & channel.on_boundary
        channel.vertex_sharpness[concave[of_vertex] | darts] = INFINITE
