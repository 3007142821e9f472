"""Newton's shapes and their looks as this package has them. Newton itself is not imported: its objects are read."""

from __future__ import annotations

import os

import numpy as np

from .color import srgb_decode
from .materials import DisplayColor, Material, PreviewSurface
from .shapes import Mesh, Primvar, Sphere
from .shapes.flat import cube
from .shapes.revolved import barrel, capsule, cone, cylinder
from .textures import Texture

#: `newton.GeoType` by number.
PLANE, HEIGHTFIELD, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH, CONE, CONVEX = range(1, 11)
#: Where planes that have no end do end, from their middle, in scene units: as Newton's cameras have it.
ENDLESS = 1000.0


def shape_of(kind: int, scale: np.ndarray, source: object) -> tuple[tuple, np.ndarray, object] | None:
    """A shape of Newton's, so that those that differ in scale alone are stored once.

    Args:
        kind: number of its `newton.GeoType`.
        scale: (3,) as of `Model.shape_scale`: radii and half heights of round shapes, half edges of boxes, edges of
            planes, factors for meshes and heightfields.
        source: what `Model.shape_source` holds.

    Returns:
        A key that shapes have in common when one mesh serves both, the scale (3,) at which they are placed, and a
        function that makes the shape; None for a kind that is not drawn, and for shapes without an extent.
    """
    x, y, z = (float(size) for size in scale)
    scale = np.array([x, y, z])
    one = np.ones(3)
    if kind in (MESH, CONVEX) and not len(getattr(source, "indices", ())):
        return None
    if kind in (MESH, CONVEX, HEIGHTFIELD):
        # A pose replaces the rotation of what it moves, and no rotation mirrors: signs go into the points.
        signs = np.where(scale < 0, -1.0, 1.0)
        make = {MESH: _mesh, CONVEX: _hull, HEIGHTFIELD: _heightfield}[kind]
        return (kind, id(source), *signs), np.abs(scale), lambda: make(source, signs)
    if kind == PLANE:
        return (kind, x, y), one, lambda: _plane(x, y)
    if kind == SPHERE and x > 0:
        return (kind, x), one, lambda: Sphere(x)
    if kind == ELLIPSOID and min(scale) > 0:
        return (kind,), scale, lambda: Sphere(1.0)
    if kind == BOX and min(scale) > 0:
        return (kind,), scale, lambda: cube(2.0)
    if kind == CAPSULE and x > 0:
        return (kind, y / x), x * one, lambda: capsule(2 * y / x, 1.0, 1.0)
    if kind == CYLINDER and x > 0 and y > 0 and z > 0:
        return (kind, y / x, z / x), x * one, lambda: barrel(2 * y / x, 1.0, z / x)
    if kind == CYLINDER and x > 0:
        return (kind,), np.array([x, x, y]), lambda: cylinder(2.0, 1.0, 1.0)
    if kind == CONE and x > 0:
        return (kind,), np.array([x, x, y]), lambda: cone(2.0, 1.0)
    return None


def look_of(color: np.ndarray | None, opacity: float, source: object) -> tuple[tuple, Material]:
    """What a shape looks like, with a key that shapes of the same look have in common.

    Args:
        color: (3,) on the sRGB curve, as Newton's cameras take it, or None.
        opacity: from 0 to 1.
        source: what `Model.shape_source` holds: a mesh may have roughness, metallic and a texture, which multiplies
            the colour.
    """
    rough, metal, picture = (getattr(source, name, None) for name in ("roughness", "metallic", "texture"))
    coordinates = getattr(source, "uvs", None)
    base = (0.18,) * 3 if color is None else tuple(float(c) for c in srgb_decode(np.clip(color, 0.0, 1.0)))
    with_picture = picture is not None and coordinates is not None and len(coordinates) > 0
    key = (base, opacity, rough, metal, id(picture) if with_picture else None)
    if rough is None and metal is None and not with_picture:
        return key, DisplayColor(base, opacity)
    look = PreviewSurface(
        diffuseColor=base,
        roughness=0.5 if rough is None else float(rough),
        metallic=0.0 if metal is None else float(metal),
        opacity=opacity,
        opacityMode="presence",
    )
    if with_picture:
        file = picture if isinstance(picture, (str, os.PathLike)) else np.asarray(picture)
        transform = np.asarray(getattr(source, "texture_transform", np.eye(2, 3)), np.float64)
        wraps = {"wrapS": "repeat", "wrapT": "repeat", "sourceColorSpace": "sRGB"}
        look.diffuseColor = Texture(file, scale=(*base, 1.0), fallback=(*base, 1.0), transform=transform, **wraps)
    return key, look


def _hull(source: object, signs: np.ndarray) -> Mesh:
    """The flat facets of a convex hull."""
    indices = np.asarray(source.indices).reshape(-1)
    points = (np.asarray(source.vertices, np.float32).reshape(-1, 3) * signs).astype(np.float32)
    return Mesh.from_polygons(points, np.full(len(indices) // 3, 3), indices)


def _mesh(source: object, signs: np.ndarray) -> Mesh:
    """Triangles, with normals and texture coordinates where the mesh has them."""
    mesh, count = _hull(source, signs), len(source.vertices)
    normals, coordinates = getattr(source, "normals", None), getattr(source, "uvs", None)
    if normals is not None and len(normals) == count:
        mesh.normals = Primvar(np.asarray(normals, np.float32).reshape(-1, 3) * signs, "vertex")
    if coordinates is not None and len(coordinates) == count:
        mesh.primvars["st"] = Primvar(np.asarray(coordinates, np.float32).reshape(-1, 2), "vertex")
    return mesh


def _heightfield(source: object, signs: np.ndarray) -> Mesh:
    """A grid of heights over a flat bottom, closed at the sides, cut into triangles as Newton cuts it."""
    low, high = source.min_z, source.max_z
    heights = np.asarray(source.data, np.float64) * (high - low) + low
    rows, columns = heights.shape
    x, y = np.meshgrid(np.linspace(-source.hx, source.hx, columns), np.linspace(-source.hy, source.hy, rows))
    floor = min(low, high) - 1e-3 * max(1.0, source.hx, source.hy, abs(high - low))
    top = np.stack([x, y, heights], -1).reshape(-1, 3)
    points = np.concatenate([top, top * (1, 1, 0) + (0, 0, floor)]) * signs
    number = np.arange(rows * columns).reshape(rows, columns)
    here, right = number[:-1, :-1].reshape(-1), number[:-1, 1:].reshape(-1)
    up, across = number[1:, :-1].reshape(-1), number[1:, 1:].reshape(-1)
    upper = np.concatenate([np.stack([here, right, up], 1), np.stack([up, right, across], 1)])
    ring = np.concatenate([number[0, :-1], number[:-1, -1], number[-1, :0:-1], number[:0:-1, 0]])
    after, below = np.roll(ring, -1), rows * columns
    walls = [np.stack([ring, ring + below, after], 1), np.stack([after, ring + below, after + below], 1)]
    triangles = np.concatenate([upper, upper[:, ::-1] + below, *walls])
    return Mesh.from_polygons(points.astype(np.float32), np.full(len(triangles), 3), triangles.reshape(-1))


def _plane(width: float, length: float) -> Mesh:
    """A rectangle about the origin with its normal along Z. One without an end is cut finer towards the origin.

    Positions on a triangle are as exact as its corners are near: rings at 1, 10, 100 and `ENDLESS` keep that in
    proportion to how far they are from the origin.
    """
    ends = ENDLESS * 0.1 ** np.arange(4)
    lines = [np.array([size / 2]) if size > 0 else ends for size in (width, length)]
    x, y = (np.concatenate([-ticks, ticks[::-1]]) for ticks in lines)
    points = np.stack([*np.meshgrid(x, y), np.zeros((len(y), len(x)))], -1).reshape(-1, 3)
    number = np.arange(len(points)).reshape(len(y), len(x))
    quads = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], -1).reshape(-1, 4)
    return Mesh.from_polygons(points.astype(np.float32), np.full(len(quads), 4), quads.reshape(-1))
