"""The shapes that a scene's `add_…` methods make of what they are given; the messages name the prim."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import warp as wp

from .errors import SceneError
from .given import face_corners, is_number, shared_rows, shown
from .materials import Material
from .materials.displacement import displaced
from .materials.inputs import Varying
from .scene_arguments import array_argument, colors_primvar, host_points, naming, vectors_primvar
from .shapes import Mesh, Primvar, Sdf, Sphere
from .shapes.volume import dense

#: Takes a one-line warning.
Warn = Callable[[str], None]


def mesh_of(
    path: str,
    points: np.ndarray | wp.array,
    faces: np.ndarray | Sequence,
    normals: np.ndarray | wp.array | str | None,
    color: np.ndarray | Sequence | None,
    st: np.ndarray | None,
    warn: Warn,
) -> Mesh:
    """A mesh; arguments and errors as of `Scene.add_mesh`."""
    with naming(path):
        points, normals = shared_rows(points, wp.vec3), shared_rows(normals, wp.vec3)
    host = host_points(path, points)
    with naming(path):
        counts, indices = face_corners(faces)
    if len(indices) and (indices.min() < 0 or indices.max() >= len(points)):
        raise SceneError(f"{path}: a face index is outside 0…{len(points) - 1}")
    if few := int((counts < 3).sum()):
        warn(f"{path}: {few} faces have fewer than three corners and are not drawn")
    mesh = Mesh.from_polygons(host, counts, indices)
    if isinstance(points, wp.array):
        mesh.points = points
    if isinstance(normals, (str, wp.array)):
        mesh.normals = normals
    elif normals is not None:
        mesh.normals = vectors_primvar(path, "normals", normals, len(host))
    if color is not None:
        mesh.primvars["displayColor"] = colors_primvar(path, color, len(host))
    if st is not None:
        st = array_argument(path, "st", st)
        if st.shape != (len(host), 2):
            raise SceneError(f"{path}: st has shape {st.shape}, not {(len(host), 2)}")
        mesh.primvars["st"] = Primvar(st, "vertex")
    return mesh


def sphere_of(path: str, radius: float, color: Sequence | None, warn: Warn) -> Sphere:
    """A sphere; arguments and errors as of `Scene.add_sphere`."""
    if not is_number(radius) or not np.isfinite(radius):
        raise SceneError(f"{path}: radius is {shown(radius)}, not a number")
    if radius <= 0:
        warn(f"{path}: its radius is {radius:g}; nothing is drawn")
    sphere = Sphere(float(radius))
    if color is not None:
        sphere.primvars["displayColor"] = colors_primvar(path, color, 1)
    return sphere


def sdf_of(path: str, distance: wp.Function | np.ndarray | wp.Volume, color: Sequence | None, **fields: object) -> Sdf:
    """A signed distance function; arguments and errors as of `Scene.add_sdf`."""
    try:
        if isinstance(distance, wp.Volume):
            distance, fields["bounds"] = dense(distance)
        given = {"function": distance} if isinstance(distance, wp.Function) else {"values": distance}
        fields["parameters"] = tuple(fields["parameters"])
        sdf = Sdf(**fields, **given)
    except (TypeError, ValueError) as error:
        raise SceneError(f"{path}: {error}") from None
    if fault := sdf.fault():
        raise SceneError(f"{path}: {fault}")
    if color is not None:
        sdf.primvars["displayColor"] = colors_primvar(path, color, 1)
    return sdf


def displaced_as(path: str, shape: Mesh | Sphere | Sdf, material: Material | None, warn: Warn) -> Mesh | Sphere | Sdf:
    """The shape with its points moved as its material says; unmoved, with a warning, where they cannot be."""
    displacement = getattr(material, "displacement", 0.0)
    if not isinstance(displacement, Varying) and displacement == 0.0:
        return shape
    if isinstance(getattr(shape, "stored", None), wp.array):
        warn(f"{path}: it is not displaced: its points are used in place")
        return shape
    try:
        return displaced(shape, displacement)
    except ValueError as error:
        warn(f"{path}: it is drawn without its displacement: {error}")
        return shape
