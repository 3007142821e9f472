"""Displacement: points moved along the normal, once, before a picture is taken.

What is joined stays joined. Points at one place move together, as exporters split points where texture
coordinates or normals have a seam: by the mean of what the displacement says at all face corners that meet there,
along the mean of the normals of the triangles there, weighted by their angles.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..shapes import Mesh, Primvar, Sdf, Sphere
from ..shapes.tangents import corner_angles, corner_normals
from ..texture_lookup import sampled
from ..textures import CHANNELS, PrimvarReader, Texture
from .inputs import Number


def displaced(
    shape: Mesh | Sphere | Sdf, material: Number, by_faces: Mapping[str, Number] | None = None
) -> Mesh | Sphere:
    """A copy of a shape whose points are moved; normals turn as the surface does.

    Args:
        shape: its points on the host.
        material: displacement in object units where no other material covers the face.
        by_faces: displacement of the materials in `shape.face_materials`.

    Raises:
        ValueError: the shape cannot be displaced so, or a texture cannot be read.
    """
    if isinstance(shape, Sdf):
        raise ValueError("a signed distance function has no points that a displacement could move")
    if isinstance(shape, Sphere):
        if isinstance(material, Texture | PrimvarReader):
            raise ValueError("a sphere has no points that a displacement which varies could move")
        return replace(shape, radius=max(0.0, shape.radius + float(material)))
    points = shape.host_points().astype(np.float64)
    corners = points[shape.triangles]
    place = _places(shape.host_points())
    direction, stands_alone = _directions(shape, corners, place)
    amounts = _corner_amounts(shape, material, by_faces or {})
    amount = _place_means(shape, amounts, place, stands_alone)
    moved = (points + direction * amount[:, None]).astype(np.float32)
    return replace(shape, points=moved, normals=_turned_normals(shape, corners, moved.astype(np.float64)))


def _places(points: np.ndarray) -> np.ndarray:
    """(N,) number of the place of each point (N, 3); points nearer than a millionth of the whole share one."""
    size = max(np.abs(points).max(initial=0.0), 1e-30)
    cells = np.rint(points.astype(np.float64) * (2.0**20 / size)).astype(np.int32)
    return np.unique(cells.view(np.dtype((np.void, 12))).reshape(-1), return_inverse=True)[1].reshape(-1)


def _directions(mesh: Mesh, corners: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) unit direction of each point, and (N,) whether it moves by itself.

    Two sheets back to back have no common direction: their points move apart.
    """
    normals = corner_normals(mesh, corners) * corner_angles(corners)[..., None]
    vertices = mesh.triangles.reshape(-1)
    own = _sums(vertices, normals.reshape(-1, 3), len(place))
    common = _sums(place, own, int(place.max(initial=-1)) + 1)[place]
    whole = _sums(place, np.linalg.norm(own, axis=1)[:, None], int(place.max(initial=-1)) + 1)[place, 0]
    length = np.linalg.norm(common, axis=1)
    alone = length <= 1e-3 * whole
    chosen = np.where(alone[:, None], own, common)
    size = np.linalg.norm(chosen, axis=1, keepdims=True)
    return np.divide(chosen, size, out=np.zeros_like(chosen), where=size > 0), alone


def _corner_amounts(mesh: Mesh, material: Number, by_faces: Mapping[str, Number]) -> np.ndarray:
    """(T, 3) displacement at the corners of the triangles."""
    amounts = _amounts(mesh, material)
    for key, displacement in by_faces.items():
        covered = np.isin(mesh.faces, mesh.face_materials[key])
        amounts[covered] = _amounts(mesh, displacement)[covered]
    return amounts


def _amounts(mesh: Mesh, displacement: Number) -> np.ndarray:
    """(T, 3) of one displacement all over a mesh."""
    if isinstance(displacement, PrimvarReader):
        return _primvar_at_corners(mesh, displacement, 1)[..., 0]
    if not isinstance(displacement, Texture):
        return np.full(mesh.triangles.shape, float(displacement))
    if isinstance(displacement.st, PrimvarReader):
        st = _primvar_at_corners(mesh, displacement.st, 2).reshape(-1, 2)
    else:
        st = np.tile(displacement.st, (mesh.triangles.size, 1))
    channel = CHANNELS.index(displacement.channel) % 4
    return sampled(displacement, st)[:, channel].reshape(-1, 3)


def _primvar_at_corners(mesh: Mesh, reader: PrimvarReader, width: int) -> np.ndarray:
    """(T, 3, width) of a primvar at the corners of the triangles, the reader's fallback where it is missing."""
    primvar = mesh.primvars.get(reader.varname)
    if primvar is not None and reader.matrix:
        primvar = primvar.mapped(reader.matrix)
    values = np.zeros((*mesh.triangles.shape, width))
    if primvar is None:
        values[:] = np.resize(np.append(reader.fallback, np.zeros(width)), width)
        return values
    elements = {
        "uniform": mesh.faces[:, None],
        "vertex": mesh.triangles,
        "varying": mesh.triangles,
        "faceVarying": mesh.corners,
    }.get(primvar.interpolation, np.zeros((1, 1), int))
    found = primvar.expanded()[elements][..., :width]
    values[..., : found.shape[-1]] = found
    return values


def _place_means(mesh: Mesh, amounts: np.ndarray, place: np.ndarray, alone: np.ndarray) -> np.ndarray:
    """(N,) mean displacement of each point's place, every authored face corner there counted once."""
    vertices, corners = mesh.triangles.reshape(-1).astype(np.int64), mesh.corners.reshape(-1)
    _, first = np.unique(np.stack([vertices, corners.astype(np.int64)], 1), axis=0, return_index=True)
    vertices, amounts = vertices[first], amounts.reshape(-1)[first]
    count = len(place)
    # Points that move by themselves are places of their own, numbered after the others.
    group = np.where(alone, count + np.arange(count), place)
    sums = np.bincount(group[vertices], amounts, 2 * count)
    numbers = np.bincount(group[vertices], minlength=2 * count)
    return (sums / np.maximum(numbers, 1))[group]


def _turned_normals(mesh: Mesh, corners: np.ndarray, moved: np.ndarray) -> Primvar | None:
    """Normals of the moved mesh: each turned as the mean normal of the triangles that share it turns.

    So authored normals, and the exact ones of a limit surface, keep what the triangles alone do not know.
    """
    normals = mesh.normals
    if not isinstance(normals, Primvar) or normals.interpolation not in ("vertex", "faceVarying"):
        return normals
    elements = mesh.triangles if normals.interpolation == "vertex" else mesh.corners
    if normals.indices is not None:
        elements = normals.indices[elements]
    values = normals.values.astype(np.float64)
    # A value may serve several places; those of one place that look alike belong together.
    vertices = mesh.triangles.reshape(-1)
    keys = np.stack([_places(mesh.host_points())[vertices], _places(normals.values)[elements.reshape(-1)]], 1)
    _, first, group = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    group = group.reshape(-1)
    count = len(first)
    before = _sums(group, _weighted_faces(corners), count)
    after = _sums(group, _weighted_faces(moved[mesh.triangles]), count)
    turned = _rotated(values[elements.reshape(-1)[first]], before, after)
    by_corner = np.zeros((int(mesh.corners.max(initial=-1)) + 1,), np.int32)
    by_corner[mesh.corners.reshape(-1)] = group
    return Primvar(turned.astype(np.float32), "faceVarying", by_corner)


def _weighted_faces(corners: np.ndarray) -> np.ndarray:
    """(3 T, 3) unit face normals weighted by the angle of each corner."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    return (normals[:, None] * corner_angles(corners)[..., None]).reshape(-1, 3)


def _rotated(vectors: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Vectors (G, 3) turned by the shortest rotation from one direction to another; left where there is none."""
    lengths = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    axis = np.cross(before, after)
    cosine = np.einsum("gk,gk->g", before, after)
    denominator = lengths * (lengths + cosine)
    good = (lengths > 0) & (lengths + cosine > 1e-9 * lengths)
    lengths, denominator = np.where(good, lengths, 1.0), np.where(good, denominator, 1.0)
    along = np.einsum("gk,gk->g", axis, vectors)
    # Rodrigues' formula with sine and cosine from the cross and the dot product.
    turned = (
        vectors * (cosine / lengths)[:, None]
        + np.cross(axis, vectors) / lengths[:, None]
        + axis * (along / denominator)[:, None]
    )
    return np.where(good[:, None], turned, vectors)


def _sums(groups: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """(count, C) sums of the rows of each group."""
    return np.stack([np.bincount(groups, column, count) for column in values.T], 1)
