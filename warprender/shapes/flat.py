"""Cubes and planes as meshes; flat shading gives them the normals of the true surface."""

from __future__ import annotations

import numpy as np

from .mesh import Mesh

#: Corners and faces of a cube in Hydra's order, which primvars by vertex and by face follow.
CUBE_CORNERS = ((1, 1, 1), (-1, 1, 1), (-1, -1, 1), (1, -1, 1), (-1, -1, -1), (-1, 1, -1), (1, 1, -1), (1, -1, -1))
CUBE_FACES = ((0, 1, 2, 3), (4, 5, 6, 7), (0, 6, 5, 1), (4, 7, 3, 2), (0, 3, 7, 6), (4, 2, 1, 5))


def cube(size: float) -> Mesh:
    """UsdGeomCube: edges of length `size`, centred."""
    points = (np.array(CUBE_CORNERS) * (size / 2)).astype(np.float32)
    return Mesh.from_polygons(points, np.full(6, 4), np.reshape(CUBE_FACES, -1))


def plane(width: float, length: float, axis: str = "Z", double_sided: bool = True) -> Mesh:
    """UsdGeomPlane: a centred rectangle with the normal `axis`. The width runs along x, or z for axis X."""
    corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]) * (width, length)
    points = np.zeros((4, 3), np.float32)
    points[:, {"X": (2, 1), "Y": (0, 2), "Z": (0, 1)}[axis]] = corners
    order = (0, 1, 2, 3) if axis == "Z" else (0, 3, 2, 1)
    return Mesh.from_polygons(points, np.array([4]), np.array(order), double_sided=double_sided)
