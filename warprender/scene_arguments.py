"""Poses, arrays and descriptions as users give them to a scene, checked; a SceneError names the prim they are for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import warp as wp

from .errors import SceneError
from .given import numbers, plain_array, shown
from .lights import Light
from .materials import Material
from .shapes import Primvar


def pose_matrix(pose: object, path: str) -> np.ndarray:
    """(4, 4) float64 matrix for row vectors from None, a (4, 4) matrix, or position and quaternion xyzw.

    Raises:
        SceneError: it is none of them; the message names `path`.
    """
    if pose is None:
        return np.eye(4)
    array = plain_array(pose)
    if array.dtype.kind not in "iuf" or array.shape not in ((4, 4), (7,)):
        given = f"an array of shape {array.shape}" if array.dtype.kind in "iuf" else shown(pose)
        raise SceneError(f"{path}: a pose is seven numbers or a 4×4 matrix, not {given}")
    pose = array.astype(np.float64)
    if not np.isfinite(pose).all():
        raise SceneError(f"{path}: its pose has numbers that are not finite")
    if pose.shape == (4, 4):
        if pose[:3, 3].any():
            raise SceneError(f"{path}: the last column of its pose is not 0, 0, 0, 1: a translation is in the last row")
        return pose
    if not pose[3:].any():
        raise SceneError(f"{path}: the quaternion of its pose is 0")
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
    host = array_argument(path, "points", points)
    if host.shape == (0,):
        return host.reshape(0, 3)
    if host.ndim != 2 or host.shape[1] != 3:
        raise SceneError(f"{path}: points have the shape {host.shape}, not (N, 3)")
    return host


@contextmanager
def naming(path: str) -> Iterator[None]:
    """Turn a ValueError into a SceneError about the prim `path`."""
    try:
        yield
    except ValueError as error:
        raise SceneError(f"{path}: {error}") from None


def array_argument(path: str, name: str, values: object) -> np.ndarray:
    """Real numbers as a float32 array of any shape."""
    with naming(path):
        return numbers(name, values)


def check_described(path: str, thing: Light | Material, kind: type) -> None:
    """Raise a SceneError unless it is of the kind and its fields are as described."""
    if not isinstance(thing, kind):
        raise SceneError(f"{path}: {shown(thing)} is not a {'Light' if kind is Light else 'material'}")
    if fault := thing.fault():
        raise SceneError(f"{path}: {fault}")


def vectors_primvar(path: str, name: str, values: np.ndarray | Sequence, points: int) -> Primvar:
    """One vector for the whole shape, or one for each of its points."""
    values = array_argument(path, name, values)
    if values.shape not in ((3,), (points, 3)):
        raise SceneError(f"{path}: {name} has the shape {values.shape}, not (3,) or ({points}, 3)")
    return Primvar(values.reshape(-1, 3), "constant" if values.ndim == 1 else "vertex")


def colors_primvar(path: str, values: np.ndarray | Sequence, points: int) -> Primvar:
    """Colours, as `vectors_primvar`, all of them finite."""
    primvar = vectors_primvar(path, "color", values, points)
    if not np.isfinite(primvar.values).all():
        raise SceneError(f"{path}: color has values that are not finite")
    return primvar
