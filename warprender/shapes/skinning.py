"""Skinning: points and normals that follow joints. Matrices are for row vectors, as in USD: p' = p M."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass
class Influences:
    """Which joints move each point.

    Attributes:
        joints: (N, K) int64.
        weights: (N, K) float64; rows add up to 1, or to 0 for points that stay.
    """

    joints: np.ndarray
    weights: np.ndarray


def blended(matrices: np.ndarray, influences: Influences) -> np.ndarray:
    """Linear blend skinning: the matrix (N, 4, 4) of each point from those of the joints (J, 4, 4)."""
    result = np.zeros((len(influences.joints), 4, 4))
    for k in range(influences.joints.shape[1]):
        result += influences.weights[:, k, None, None] * matrices[influences.joints[:, k]]
    still = influences.weights.sum(1) == 0
    result[still] = np.eye(4)
    return result


def dual_quaternion_blended(matrices: np.ndarray, influences: Influences, of_normals: bool = False) -> np.ndarray:
    """Dual quaternion skinning (Kavan et al. 2007), scale and shear blended linearly before the rotation.

    Args:
        matrices: (J, 4, 4) of the joints.
        influences: of N points.
        of_normals: answer what turns the points' normals, as `normal_matrices` does.

    Returns:
        (N, 4, 4) matrix of each point.
    """
    stretch, rotation = _polar(matrices[:, :3, :3])
    if of_normals:
        stretch = _inverse_transposed(stretch)
    real = _quaternions(rotation)
    moved = np.concatenate([matrices[:, 3, :3], np.zeros((len(matrices), 1))], 1)
    dual = 0.5 * _product(moved, real)

    pivot = real[influences.joints[np.arange(len(influences.joints)), influences.weights.argmax(1)]]
    total = np.zeros((2, len(influences.joints), 4))
    stretched = np.zeros((len(influences.joints), 3, 3))
    for k in range(influences.joints.shape[1]):
        joint, weight = influences.joints[:, k], influences.weights[:, k, None]
        # q and -q turn alike; blending takes the one on the pivot's side.
        same_side = np.where((real[joint] * pivot).sum(1, keepdims=True) < 0, -weight, weight)
        total += same_side * np.stack([real[joint], dual[joint]])
        stretched += weight[:, :, None] * stretch[joint]
    length = np.linalg.norm(total[0], axis=1, keepdims=True)
    total = np.divide(total, length, out=np.zeros_like(total), where=length > 0)

    result = np.zeros((len(influences.joints), 4, 4))
    result[:, :3, :3] = stretched @ _matrices(total[0])
    result[:, 3, :3] = 2.0 * _product(total[1], total[0] * (-1, -1, -1, 1))[:, :3]
    result[:, 3, 3] = 1.0
    result[influences.weights.sum(1) == 0] = np.eye(4)
    return result


def transformed_points(points: np.ndarray, matrices: np.ndarray) -> np.ndarray:
    """Points (N, 3) by a matrix each: (N, 3) float64."""
    return np.einsum("ni,nij->nj", points, matrices[:, :3, :3]) + matrices[:, 3, :3]


def normal_matrices(matrices: np.ndarray) -> np.ndarray:
    """What turns normals as matrices (N, 4, 4) turn surfaces: (N, 4, 4), inverse, transposed, without translation."""
    result = np.tile(np.eye(4), (len(matrices), 1, 1))
    result[:, :3, :3] = _inverse_transposed(matrices[:, :3, :3])
    return result


def turned_normals(normals: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Normals (N, 3) by a matrix of `normal_matrices` each. Unit, float64."""
    turned = np.einsum("ni,nij->nj", normals, turns[:, :3, :3])
    length = np.linalg.norm(turned, axis=1, keepdims=True)
    return np.divide(turned, length, out=np.zeros_like(turned), where=length > 0)


def _inverse_transposed(matrices: np.ndarray) -> np.ndarray:
    """(N, 3, 3) from cofactors, which are finite where a matrix flattens space: there they stand for the result."""
    a, b, c = (matrices[:, k] for k in range(3))
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], 1)
    volume = np.einsum("ni,ni->n", a, cofactors[:, 0])
    return cofactors / np.where(np.abs(volume) > 1e-200, volume, 1.0)[:, None, None]


def _polar(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stretch S and rotation R (J, 3, 3) with M = S R; mirrors go into the stretch."""
    u, sigma, vt = np.linalg.svd(matrices)
    mirror = np.sign(np.linalg.det(u @ vt))
    u[:, :, 2] *= mirror[:, None]
    sigma[:, 2] *= mirror
    return matrices @ np.swapaxes(u @ vt, 1, 2), u @ vt


def _quaternions(rotations: np.ndarray) -> np.ndarray:
    """Quaternions xyzw (J, 4) of rotations (J, 3, 3): the eigenvector that Bar-Itzhack's matrix keeps (2000)."""
    m = np.swapaxes(rotations, 1, 2)
    k = np.zeros((len(m), 4, 4))
    k[:, :3, :3] = m + rotations - np.trace(m, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    axis = np.stack([m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]], 1)
    k[:, :3, 3] = k[:, 3, :3] = axis
    k[:, 3, 3] = np.trace(m, axis1=1, axis2=2)
    return np.linalg.eigh(k)[1][:, :, -1]


def _matrices(quaternions: np.ndarray) -> np.ndarray:
    """Rotations (N, 3, 3) for row vectors of unit quaternions xyzw (N, 4)."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)],
        [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)],
        [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Hamilton products of quaternions xyzw (N, 4)."""
    vector = a[:, 3:] * b[:, :3] + b[:, 3:] * a[:, :3] + np.cross(a[:, :3], b[:, :3])
    return np.concatenate([vector, a[:, 3:] * b[:, 3:] - (a[:, :3] * b[:, :3]).sum(1, keepdims=True)], 1)
