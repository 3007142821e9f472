"""Cubes and planes as meshes; flat shading gives them the normals of the true surface."""

from __future__ import annotations

import numpy as np

from .mesh import Mesh

#: Corners of a cube by their bits (x, y, z), and its faces, counter-clockwise seen from outside.
CUBE_FACES = ((0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6))


def cube(size: float) -> Mesh:
    """UsdGeomCube: edges of length `size`, centred."""
    corners = (np.arange(8)[:, None] >> np.arange(3)) & 1
    points = ((corners - 0.5) * size).astype(np.float32)
    return Mesh.from_polygons(points, np.full(6, 4), np.reshape(CUBE_FACES, -1))


def plane(width: float, length: float, axis: str = "Z", double_sided: bool = True) -> Mesh:
    """UsdGeomPlane: a centred rectangle with the normal `axis`. The width runs along x, or z for axis X."""
    corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]) * (width, length)
    points = np.zeros((4, 3), np.float32)
    points[:, {"X": (2, 1), "Y": (0, 2), "Z": (0, 1)}[axis]] = corners
    order = (0, 1, 2, 3) if axis == "Z" else (0, 3, 2, 1)
    return Mesh.from_polygons(points, np.array([4]), np.array(order), double_sided=double_sided)
