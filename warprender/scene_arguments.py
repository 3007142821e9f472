"""Poses and arrays as users give them to a scene, checked; a SceneError names the prim that they are for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from .errors import SceneError
from .shapes import Primvar


def pose_matrix(pose: object, path: str) -> np.ndarray:
    """(4, 4) float64 matrix for row vectors from None, a (4, 4) matrix, or position and quaternion xyzw.

    Raises:
        SceneError: it is none of them; the message names `path`.
    """
    if pose is None:
        return np.eye(4)
    pose = np.asarray(pose, np.float64)
    if pose.shape == (4, 4):
        return pose
    if pose.shape != (7,):
        raise SceneError(f"{path}: a pose is seven numbers or a 4×4 matrix, not an array of shape {pose.shape}")
    x, y, z, w = pose[3:] / np.linalg.norm(pose[3:])
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)],
        [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)],
        [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[3, :3] = pose[:3]
    return matrix


def host_points(path: str, points: np.ndarray | wp.array) -> np.ndarray:
    """(N, 3) float32 on the host; a wrong type would end the process once it is on a device."""
    if isinstance(points, wp.array):
        if points.dtype != wp.vec3 or points.ndim != 1:
            raise SceneError(f"{path}: points are not a one-dimensional wp.array of wp.vec3")
        return points.numpy()
    host = np.asarray(points, np.float32)
    if host.ndim != 2 or host.shape[1] != 3:
        raise SceneError(f"{path}: points have the shape {host.shape}, not (N, 3)")
    return host


def vectors_primvar(path: str, name: str, values: np.ndarray | Sequence, points: int) -> Primvar:
    """One vector for the whole shape, or one for each of its points."""
    values = np.asarray(values, np.float32)
    if values.shape not in ((3,), (points, 3)):
        raise SceneError(f"{path}: {name} has the shape {values.shape}, not (3,) or ({points}, 3)")
    return Primvar(values.reshape(-1, 3), "constant" if values.ndim == 1 else "vertex")
