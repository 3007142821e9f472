"""Curves as meshes: round tubes, or ribbons where curves have normals."""

from __future__ import annotations

import numpy as np

from .curves import Curves, unit
from .mesh import Mesh
from .primvar import Primvar

#: Corners of a tube's section, the first that keeps the prim below `MOST_TRIANGLES`.
SIDES = (24, 12, 6, 3)
MOST_TRIANGLES = 2_000_000


def tubes(curves: Curves, points: np.ndarray, widths: np.ndarray) -> tuple[Mesh, np.ndarray]:
    """Round tubes with flat ends.

    Args:
        curves: the curves.
        points: (N, 3) float64 control points.
        widths: (S,) diameter at each sample.

    Returns:
        The mesh, whose faces are the curves, and the sample of each of its points.
    """
    at, tangent = curves.positions(points), unit(curves.tangents(points))
    normal = _transported(curves, tangent)
    side = np.cross(tangent, normal)
    count = next((n for n in SIDES if 2 * n * len(at) <= MOST_TRIANGLES), SIDES[-1])
    angle = 2 * np.pi * np.arange(count) / count
    around = np.cos(angle)[:, None] * normal[:, None] + np.sin(angle)[:, None] * side[:, None]
    rings = at[:, None] + around * (widths[:, None, None] / 2)
    sample, following = _steps(curves)
    here = np.arange(count)
    a, b = sample[:, None] * count + here, sample[:, None] * count + (here + 1) % count
    c, d = following[:, None] * count + (here + 1) % count, following[:, None] * count + here
    triangles = np.stack([a, b, c, a, c, d], 2).reshape(-1, 3)
    faces = np.repeat(curves.curve[sample], 2 * count)
    parts = [(rings.reshape(-1, 3), around.reshape(-1, 3), np.repeat(np.arange(len(at)), count), triangles, faces)]
    if not curves.periodic:
        parts += _caps(curves, rings, tangent)
    return _joined(parts)


def ribbons(curves: Curves, points: np.ndarray, widths: np.ndarray, normals: np.ndarray) -> tuple[Mesh, np.ndarray]:
    """Flat bands that face `normals` (S, 3); otherwise as `tubes`."""
    at, tangent = curves.positions(points), unit(curves.tangents(points))
    side = unit(np.cross(normals, tangent)) * (widths[:, None] / 2)
    facing = unit(np.cross(tangent, side))
    sample, following = _steps(curves)
    a, b = 2 * sample, 2 * sample + 1
    c, d = 2 * following + 1, 2 * following
    triangles = np.stack([a, b, c, a, c, d], 1).reshape(-1, 3)
    edges = np.stack([at + side, at - side], 1).reshape(-1, 3)
    source = np.repeat(np.arange(len(at)), 2)
    return _joined([(edges, facing[source], source, triangles, np.repeat(curves.curve[sample], 2))])


def _steps(curves: Curves) -> tuple[np.ndarray, np.ndarray]:
    """Samples that another one follows on the same curve, and those."""
    start = np.cumsum(curves.lengths) - curves.lengths
    here = np.arange(len(curves.curve))
    last = here == (start + curves.lengths - 1)[curves.curve]
    following = np.where(last, start[curves.curve], here + 1)
    goes_on = ~last | curves.periodic
    return here[goes_on], following[goes_on]


def _transported(curves: Curves, tangent: np.ndarray) -> np.ndarray:
    """A normal (S, 3) at each sample, carried along each curve without turning about it.

    All curves take their steps together. On closed curves what is missing at the end is spread over the curve.
    """
    start = (np.cumsum(curves.lengths) - curves.lengths)[curves.lengths > 0]
    lengths = curves.lengths[curves.lengths > 0]
    normal = np.zeros_like(tangent)
    first = tangent[start]
    axis = np.eye(3)[np.argmin(np.abs(first), 1)]
    normal[start] = unit(np.cross(first, axis))
    for step in range(1, int(lengths.max(initial=0))):
        here = (start + step)[lengths > step]
        normal[here] = _carried(normal[here - 1], tangent[here - 1], tangent[here])
    if curves.periodic:
        last = start + lengths - 1
        back = _carried(normal[last], tangent[last], first)
        side = np.cross(first, normal[start])
        gap = np.arctan2((back * side).sum(1), (back * normal[start]).sum(1))
        share = (np.arange(len(tangent)) - np.repeat(start, lengths)) / np.repeat(lengths, lengths)
        turn = -np.repeat(gap, lengths) * share
        normal = np.cos(turn)[:, None] * normal + np.sin(turn)[:, None] * np.cross(tangent, normal)
    return normal


def _carried(normal: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Normals turned as tangents turn from `before` to `after`, by the smallest rotation (Rodrigues)."""
    axis, cosine = np.cross(before, after), (before * after).sum(1, keepdims=True)
    along = (axis * normal).sum(1, keepdims=True)
    turned = normal * cosine + np.cross(axis, normal) + axis * along / np.maximum(1 + cosine, 1e-6)
    turned -= after * (turned * after).sum(1, keepdims=True)
    return np.where(np.linalg.norm(turned, axis=1, keepdims=True) > 1e-6, unit(turned), normal)


def _caps(curves: Curves, rings: np.ndarray, tangent: np.ndarray) -> list[tuple]:
    """Both ends of every curve, as fans."""
    drawn = np.flatnonzero(curves.lengths)
    start = (np.cumsum(curves.lengths) - curves.lengths)[drawn]
    count = rings.shape[1]
    fan = np.stack([np.zeros(count - 2, int), np.arange(1, count - 1), np.arange(2, count)], 1)
    parts = []
    for sample, way in ((start, -1), (start + curves.lengths[drawn] - 1, 1)):
        first = np.arange(len(sample))[:, None, None] * count
        triangles = (first + fan[:, ::way]).reshape(-1, 3)
        normals = np.repeat(way * tangent[sample], count, axis=0)
        faces = np.repeat(drawn, count - 2)
        parts.append((rings[sample].reshape(-1, 3), normals, np.repeat(sample, count), triangles, faces))
    return parts


def _joined(parts: list[tuple]) -> tuple[Mesh, np.ndarray]:
    """Pieces of points, normals, samples, triangles and faces as one mesh."""
    offsets = np.cumsum([0] + [len(part[0]) for part in parts[:-1]])
    points, normals, samples = (np.concatenate([part[k] for part in parts]) for k in range(3))
    triangles = np.concatenate([part[3] + offset for part, offset in zip(parts, offsets, strict=True)])
    faces = np.concatenate([part[4] for part in parts]).astype(np.int32)
    corners = np.arange(triangles.size, dtype=np.int32).reshape(-1, 3)
    mesh = Mesh(points.astype(np.float32), triangles.astype(np.int32), faces, corners)
    mesh.normals = Primvar(normals, "vertex")
    return mesh, samples
