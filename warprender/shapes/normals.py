"""Smooth vertex normals of a triangle mesh."""

from __future__ import annotations

import numpy as np


def vertex_normals(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Unit normals at the points: the normals of the adjacent triangles, weighted by their areas.

    Args:
        points: (N, 3) float.
        triangles: (T, 3) int indices into `points`.

    Returns:
        (N, 3) float32; zero at points that no triangle with an area touches.
    """
    points = np.asarray(points, np.float64)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    weighted = np.cross(b - a, c - a)
    corners = triangles.reshape(-1)
    spread = np.repeat(weighted, 3, axis=0)
    total = np.stack([np.bincount(corners, spread[:, k], len(points)) for k in range(3)], 1).astype(float)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, length, out=np.zeros_like(total), where=length > 0).astype(np.float32)
