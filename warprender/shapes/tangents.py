"""Tangents along texture coordinates, shared by corners that look alike, as in MikkTSpace (Mikkelsen 2008)."""

from __future__ import annotations

import numpy as np

from .mesh import Mesh
from .normals import same_rows


def corner_tangents(mesh: Mesh, points: np.ndarray, coordinates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tangents at the corners of a mesh's triangles.

    A corner's tangent is the direction in which the first coordinate grows, in the plane of its normal, the mean
    over all corners of the same place, normal, coordinates and winding, weighted by their angles.

    Args:
        mesh: the mesh; its normals count.
        points: (N, 3) float, its points.
        coordinates: (T, 3, 2) float, texture coordinates of the corners of its triangles.

    Returns:
        (G, 4) float32: unit tangents in object space, and +1, or -1 where the picture is mirrored, which turns the
        bitangent normal × tangent round; zero where the coordinates do not span the triangle. And (T, 3) int32,
        the row of each corner.
    """
    corners = np.asarray(points, np.float64)[mesh.triangles]
    normals = corner_normals(mesh, corners)
    coordinates = np.asarray(coordinates, np.float64)
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    step1, step2 = coordinates[:, 1] - coordinates[:, 0], coordinates[:, 2] - coordinates[:, 0]
    area = step1[:, 0] * step2[:, 1] - step2[:, 0] * step1[:, 1]
    sign = np.where(area < 0, -1.0, 1.0)
    along = (edge1 * step2[:, 1:] - edge2 * step1[:, 1:]) * np.sign(area)[:, None]

    flat = along[:, None] - normals * np.einsum("tk,tck->tc", along, normals)[..., None]
    weighted = _unit(flat) * corner_angles(corners)[..., None]
    looks = np.concatenate([corners, normals, coordinates, np.broadcast_to(sign[:, None, None], (len(sign), 3, 1))], 2)
    first, group = same_rows(looks.reshape(-1, looks.shape[2]))
    sums = np.stack([np.bincount(group, weighted[..., k].reshape(-1), len(first)) for k in range(3)], 1)
    signs = np.repeat(sign, 3)[first]
    return np.concatenate([_unit(sums), signs[:, None]], 1).astype(np.float32), group.reshape(-1, 3).astype(np.int32)


def corner_normals(mesh: Mesh, corners: np.ndarray) -> np.ndarray:
    """(T, 3, 3) unit normals at the corners (T, 3, 3) of the triangles: the mesh's own, else those of the faces."""
    normals = mesh.host_normals()
    if normals is None or normals.interpolation not in ("vertex", "faceVarying"):
        flat = _unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        return np.repeat(flat[:, None], 3, 1)
    elements = mesh.triangles if normals.interpolation == "vertex" else mesh.corners
    return _unit(normals.expanded()[elements].astype(np.float64))


def corner_angles(corners: np.ndarray) -> np.ndarray:
    """(T, 3) angles in radians at the corners (T, 3, 3) of triangles."""
    to_next = _unit(np.roll(corners, -1, 1) - corners)
    to_last = _unit(np.roll(corners, 1, 1) - corners)
    return np.arccos(np.clip(np.einsum("tck,tck->tc", to_next, to_last), -1.0, 1.0))


def _unit(vectors: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors, dtype=np.float64), where=length > 0)
