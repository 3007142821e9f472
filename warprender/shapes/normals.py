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
    total = np.zeros((len(points), 3))
    for axis in range(3):
        weights = np.ascontiguousarray(weighted[:, axis])
        for corner in range(3):
            total[:, axis] += np.bincount(triangles[:, corner], weights, len(points))
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, length, out=np.zeros_like(total), where=length > 0).astype(np.float32)
