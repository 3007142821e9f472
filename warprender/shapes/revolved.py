"""Cylinders, cones and capsules: profiles turned about an axis, as meshes with the true surface's normals."""

from __future__ import annotations

import numpy as np

from .mesh import Mesh
from .primvar import Primvar

#: Corners of a full turn. The chord of a circle leaves it by 3e-4 of its radius: a tenth of a pixel on a
#: circle of 600 pixels.
SEGMENTS = 128

#: Rings between pole and equator of a capsule's cap.
CAP_RINGS = 32


def cylinder(height: float, radius_bottom: float, radius_top: float, axis: str = "Z") -> Mesh:
    """UsdGeomCylinder and UsdGeomCylinder_1: a frustum with both caps, centred."""
    low, high = -height / 2, height / 2
    return _revolve(
        [
            _line((0, low), (radius_bottom, low)),
            _line((radius_bottom, low), (radius_top, high)),
            _line((radius_top, high), (0, high)),
        ],
        axis,
    )


def cone(height: float, radius: float, axis: str = "Z") -> Mesh:
    """UsdGeomCone: its base at minus half the height, its tip at plus half."""
    return cylinder(height, radius, 0.0, axis)


def capsule(height: float, radius_bottom: float, radius_top: float, axis: str = "Z") -> Mesh:
    """UsdGeomCapsule and UsdGeomCapsule_1: half spheres at the ends of a spine of the given height."""
    low, high = -height / 2, height / 2
    turn = np.linspace(0, np.pi / 2, CAP_RINGS + 1)
    normals = np.stack([np.sin(turn), -np.cos(turn)], 1)
    upper = normals[::-1] * (1, -1)
    return _revolve(
        [
            (normals * radius_bottom + (0, low), normals),
            _line((radius_bottom, low), (radius_top, high)),
            (upper * radius_top + (0, high), upper),
        ],
        axis,
    )


def barrel(height: float, radius: float, arc: float, axis: str = "Z") -> Mesh:
    """A cylinder whose side bulges: caps of the given radius, and between them an arc of a circle of radius `arc`."""
    low, high = -height / 2, height / 2
    widest = np.arcsin(min(high / arc, 1.0))
    turn = np.linspace(-widest, widest, CAP_RINGS + 1)
    normals = np.stack([np.cos(turn), np.sin(turn)], 1)
    return _revolve(
        [
            _line((0, low), (radius, low)),
            (normals * arc + (radius - arc * np.cos(widest), 0), normals),
            _line((radius, high), (0, high)),
        ],
        axis,
    )


def _line(start: tuple, end: tuple) -> tuple[np.ndarray, np.ndarray]:
    """Profile of two points (radius, height) and their normal, to the right of the way from start to end."""
    points = np.array([start, end], np.float64)
    along = points[1] - points[0]
    length = np.hypot(*along)
    normal = np.array([along[1], -along[0]]) / (length if length > 0 else 1.0)
    return points, np.stack([normal, normal])


def _revolve(profiles: list[tuple[np.ndarray, np.ndarray]], axis: str) -> Mesh:
    """Turn profiles about an axis; between profiles the surface has an edge.

    Args:
        profiles: pairs of (P, 2) points (radius, height along the axis) and (P, 2) unit normals, from the
            bottom up on the outside.
        axis: "X", "Y" or "Z".
    """
    points, normals, faces, first = [], [], [], 0
    for profile, normal in profiles:
        points.append(_turn(profile, profile[:, 0]))
        normals.append(_turn(normal, profile[:, 0]))
        faces.append(first + _strip(profile[:, 0]))
        first += len(profile) * SEGMENTS
    triangles = np.concatenate(faces)
    turned = _about(axis, np.concatenate(points)), _about(axis, np.concatenate(normals))
    counts = np.full(len(triangles), 3)
    return Mesh.from_polygons(turned[0], counts, triangles.reshape(-1), normals=Primvar(turned[1], "vertex"))


def _turn(vectors: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """(P, 2) → (P · SEGMENTS, 3). On the axis the angle is the middle of the triangle that ends there."""
    angle = 2 * np.pi * (np.arange(SEGMENTS) + np.where(radii == 0, 0.5, 0.0)[:, None]) / SEGMENTS
    height = np.broadcast_to(vectors[:, 1:], angle.shape)
    return np.stack([vectors[:, :1] * np.cos(angle), vectors[:, :1] * np.sin(angle), height], 2).reshape(-1, 3)


def _strip(radii: np.ndarray) -> np.ndarray:
    """(T, 3) triangles between consecutive rings, without those that a pole leaves no area."""
    ring = np.arange(len(radii) - 1)[:, None] * SEGMENTS
    here = np.broadcast_to(np.arange(SEGMENTS), (len(ring), SEGMENTS))
    following = (here + 1) % SEGMENTS
    a, b, c, d = ring + here, ring + following, ring + SEGMENTS + following, ring + SEGMENTS + here
    # A pole keeps the corner of the segment that its triangle stands on.
    below = np.stack([a, b, np.where(radii[1:, None] == 0, d, c)], 2)[radii[:-1] != 0]
    above = np.stack([a, c, d], 2)[radii[1:] != 0]
    return np.concatenate([below.reshape(-1, 3), above.reshape(-1, 3)])


def _about(axis: str, vectors: np.ndarray) -> np.ndarray:
    """Vectors about Z as vectors about `axis`, by the cyclic permutation that keeps orientation: float32."""
    return np.roll(vectors, {"X": 1, "Y": 2, "Z": 0}[axis], axis=1).astype(np.float32)
