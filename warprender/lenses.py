"""Lenses of sensors: windows of pinholes, and tables of rays for what no window describes.

Pixel centres lie at half integers: a point that projects to u = 0.5, v = 0.5 is in the middle of the top left pixel.
Calibrations in OpenCV's convention, where that point is (0, 0), have 0.5 added to cx and cy.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

#: A distortion is inverted by Newton's method, to this many radians or less.
_TOLERANCE = 1e-12
_STEPS = 100


def window_of_field(fov: float, width: int, height: int) -> tuple[float, float, float, float]:
    """Left, bottom, right, top at distance 1 for a vertical field of view in degrees.

    Raises:
        ValueError: it is not between 0 and 180.
    """
    if not 0 < fov < 180:
        raise ValueError(f"fov must be between 0 and 180 degrees, not {fov}")
    half = float(np.tan(np.radians(fov) / 2))
    return (-half * width / height, -half, half * width / height, half)


def window_of_intrinsics(matrix: np.ndarray, width: int, height: int) -> tuple[float, float, float, float]:
    """The same for intrinsics (3, 3): rows (fx, 0, cx), (0, fy, cy), (0, 0, 1) in pixels, v downwards."""
    fx, fy, cx, cy = checked_intrinsics(matrix)
    return (-cx / fx, (cy - height) / fy, (width - cx) / fx, cy / fy)


def checked_intrinsics(matrix: np.ndarray) -> tuple[float, float, float, float]:
    """fx, fy, cx, cy of an intrinsic matrix.

    Raises:
        ValueError: it is no matrix of a camera without skew.
    """
    matrix = np.asarray(matrix, np.float64)
    if matrix.shape != (3, 3):
        raise ValueError(f"intrinsics have the shape {matrix.shape}, not (3, 3)")
    (fx, skew, cx), (zero, fy, cy) = matrix[:2]
    if not np.isfinite(matrix).all() or fx <= 0 or fy <= 0 or skew or zero or tuple(matrix[2]) != (0, 0, 1):
        raise ValueError(f"intrinsics must have rows (fx, 0, cx), (0, fy, cy), (0, 0, 1), not {matrix.tolist()}")
    return fx, fy, cx, cy


def distorted_rays(matrix: np.ndarray, distortion: Sequence[float], width: int, height: int) -> np.ndarray:
    """(H, W, 3) float64 unit directions of OpenCV's lens with k1, k2, p1, p2 and k3; NaN where it shows nothing.

    x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²), and y' likewise, is inverted by Newton's method from
    x', without the folds that a polynomial has outside of the picture that it was fitted to.

    Raises:
        ValueError: intrinsics or coefficients are none.
    """
    k1, k2, p1, p2, k3 = _coefficients(distortion, 5)
    target = _normalised(matrix, width, height)
    x, y = target[..., 0].copy(), target[..., 1].copy()
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            r = x * x + y * y
            radial, slope = 1 + r * (k1 + r * (k2 + r * k3)), k1 + r * (2 * k2 + 3 * r * k3)
            ex = x * radial + 2 * p1 * x * y + p2 * (r + 2 * x * x) - target[..., 0]
            ey = y * radial + p1 * (r + 2 * y * y) + 2 * p2 * x * y - target[..., 1]
            xx = radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x
            xy = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y
            yy = radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x
            determinant = xx * yy - xy * xy
            x, y = x - (ex * yy - ey * xy) / determinant, y - (ey * xx - ex * xy) / determinant
            if np.nanmax(np.hypot(ex, ey), initial=0.0) < _TOLERANCE:
                break
    # Beyond a fold the lens turns back: there the answer is another point's.
    bad = ~(np.hypot(ex, ey) < 1e-9) | ~(determinant > 0) | ~(radial > 0)
    return _units(np.stack([x, -y, -np.ones_like(x)], -1), bad)


def fisheye_rays(matrix: np.ndarray, distortion: Sequence[float], width: int, height: int) -> np.ndarray:
    """(H, W, 3) float64 unit directions of OpenCV's fisheye with k1 to k4; NaN where it shows nothing.

    r = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸) for the angle θ from the axis, up to π.

    Raises:
        ValueError: intrinsics or coefficients are none.
    """
    k = np.array(_coefficients(distortion, 4))
    target = _normalised(matrix, width, height)
    radius = np.hypot(target[..., 0], target[..., 1])
    theta = np.minimum(radius, np.pi)
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            t = theta * theta
            error = theta * (1 + t * (k[0] + t * (k[1] + t * (k[2] + t * k[3])))) - radius
            slope = 1 + t * (3 * k[0] + t * (5 * k[1] + t * (7 * k[2] + t * 9 * k[3])))
            theta = theta - error / slope
            if np.nanmax(np.abs(error), initial=0.0) < _TOLERANCE:
                break
        direction = np.where(radius > 0, np.sin(theta) / radius, 0.0)
    bad = ~(np.abs(error) < 1e-9) | ~(slope > 0) | (theta > np.pi)
    x, y = target[..., 0] * direction, target[..., 1] * direction
    return _units(np.stack([x, -y, -np.cos(theta)], -1), bad)


def lidar_rays(azimuths: np.ndarray, elevations: np.ndarray) -> np.ndarray:
    """(E, A, 3) float64 unit directions for angles in degrees.

    Azimuth 0 looks down -Z and grows to the left, about +Y; elevation grows from the XZ plane towards +Y.

    Raises:
        ValueError: no angles, or some that are not finite.
    """
    azimuths, elevations = (np.asarray(angles, np.float64).reshape(-1) for angles in (azimuths, elevations))
    if not (len(azimuths) and len(elevations)):
        raise ValueError("a lidar has one azimuth and one elevation at least")
    if not (np.isfinite(azimuths).all() and np.isfinite(elevations).all()):
        raise ValueError("azimuths and elevations must be finite")
    a, e = np.radians(azimuths)[None, :], np.radians(elevations)[:, None]
    return np.stack(np.broadcast_arrays(-np.cos(e) * np.sin(a), np.sin(e), -np.cos(e) * np.cos(a)), -1)


def _coefficients(values: Sequence[float], most: int) -> list[float]:
    values = [float(value) for value in np.asarray(values, np.float64).reshape(-1)]
    if len(values) > most or not np.isfinite(values).all():
        raise ValueError(f"distortion must have up to {most} finite coefficients, not {values}")
    return values + [0.0] * (most - len(values))


def _normalised(matrix: np.ndarray, width: int, height: int) -> np.ndarray:
    """(H, W, 2) places of pixel centres on the plane at distance 1, y downwards."""
    fx, fy, cx, cy = checked_intrinsics(matrix)
    x, y = np.meshgrid((np.arange(width) + 0.5 - cx) / fx, (np.arange(height) + 0.5 - cy) / fy)
    return np.stack([x, y], -1)


def _units(directions: np.ndarray, bad: np.ndarray) -> np.ndarray:
    directions = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    directions[bad] = np.nan
    return directions
