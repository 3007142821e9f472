"""Smooth vertex normals of a triangle mesh, and which rows of an array are alike."""

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


def same_rows(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which rows hold the same numbers; 0 and -0 are one.

    Args:
        rows: (R, C) float, taken as float32.

    Returns:
        (G,) a row of each kind, and (R,) the kind of each row.
    """
    rows = np.ascontiguousarray(rows, np.float32) + np.float32(0.0)
    keys = rows.view(np.dtype((np.void, rows.dtype.itemsize * rows.shape[1]))).reshape(-1)
    _, first, kind = np.unique(keys, return_index=True, return_inverse=True)
    return first, kind.reshape(-1)
