"""UsdGeomMesh and UsdGeomTetMesh as shapes."""

from __future__ import annotations

import numpy as np
from pxr import Usd, UsdGeom

from ..shapes import Mesh, Primvar
from ..shapes.normals import vertex_normals
from ..shapes.subdivision.cage import SCHEMES
from .primvars import read_builtin, read_primvars
from .reading import Reading
from .skeletons import posed
from .subdivided import is_left_handed, subdivide
from .topology import Topology, checked_topology, read_topology

#: Schemes whose authored normals USD ignores and whose cage shades smoothly.
SMOOTH_SCHEMES = ("catmullClark", "loop")


def read_mesh(reading: Reading, prim: Usd.Prim) -> Mesh | None:
    """A mesh prim, or None where there is nothing to draw."""
    schema = UsdGeom.Mesh(prim)
    points = read_points(reading, schema)
    if points is None:
        return None
    topology = read_topology(reading, schema, points)
    if not len(topology.counts):
        return None
    if not len(points):
        reading.remark(prim, "it has faces but no points")
        return None
    points = np.nan_to_num(points, nan=0.0, posinf=0.0, neginf=0.0)
    skin = reading.skins.get(str(prim.GetPath()))
    pose = posed(reading, skin, points) if skin else None
    if pose:
        points = pose.points
    primvars = read_primvars(reading, prim, topology.sizes(len(points)))
    mesh = None
    if reading.level > 0 and reading.get(schema.GetSubdivisionSchemeAttr()) in SCHEMES:
        mesh = subdivide(reading, schema, topology, points, primvars)
    if mesh is None:
        mesh = _read_cage(reading, schema, topology, points.astype(np.float32), primvars)
        if mesh.normals and pose and not is_smooth(reading, schema):
            mesh.normals = pose.normals(mesh.normals, topology.indices)
    mesh.double_sided = bool(reading.get(schema.GetDoubleSidedAttr()))
    return mesh if len(mesh.triangles) else None


def read_tet_mesh(reading: Reading, prim: Usd.Prim) -> Mesh | None:
    """The surface of a tetrahedral mesh, as authored or computed, or None where there is nothing to draw."""
    schema = UsdGeom.TetMesh(prim)
    points = read_points(reading, schema)
    surface = reading.get(schema.GetSurfaceFaceVertexIndicesAttr())
    if not surface and reading.get(schema.GetTetVertexIndicesAttr()):
        surface = UsdGeom.TetMesh.ComputeSurfaceFaces(schema, reading.time)
    if points is None or not len(points) or not surface:
        return None
    triangles = np.array(surface, np.int64).reshape(-1, 3)
    none = np.zeros(0, np.int64)
    counts = np.full(len(triangles), 3)
    topology = checked_topology(reading, prim, points, counts, triangles.reshape(-1), none)
    sizes = topology.sizes(len(points))
    mesh = Mesh.from_polygons(
        np.nan_to_num(points, nan=0.0, posinf=0.0, neginf=0.0),
        topology.counts,
        topology.indices,
        left_handed=reading.get(schema.GetOrientationAttr()) == UsdGeom.Tokens.leftHanded,
        hole_faces=topology.broken,
        normals=read_builtin(reading, prim, "normals", sizes, 3),
        primvars=read_primvars(reading, prim, sizes),
    )
    return mesh if len(mesh.triangles) else None


def _read_cage(
    reading: Reading,
    schema: UsdGeom.Mesh,
    topology: Topology,
    points: np.ndarray,
    primvars: dict[str, Primvar],
) -> Mesh:
    """The polygons as they are, smoothly shaded where they are a cage."""
    mesh = Mesh.from_polygons(
        points,
        topology.counts,
        topology.indices,
        left_handed=is_left_handed(reading, schema),
        hole_faces=np.concatenate([topology.holes, topology.broken]),
        primvars=primvars,
    )
    if is_smooth(reading, schema):
        mesh.normals = Primvar(vertex_normals(mesh.host_points(), mesh.triangles), "vertex")
    else:
        mesh.normals = read_builtin(reading, schema.GetPrim(), "normals", topology.sizes(len(points)), 3)
    return mesh


def is_smooth(reading: Reading, schema: UsdGeom.Mesh) -> bool:
    """Whether the cage stands for a smooth surface."""
    return reading.get(schema.GetSubdivisionSchemeAttr()) in SMOOTH_SCHEMES


def read_points(reading: Reading, schema: UsdGeom.PointBased) -> np.ndarray | None:
    """(N, 3) float32; None, with a remark, where the attribute holds something that is no list of points."""
    value = reading.get(schema.GetPointsAttr())
    points = np.asarray(value) if value is not None else np.zeros((0, 3))
    if points.ndim == 2 and points.shape[1] == 3 and points.dtype.kind in "fiu":
        return points.astype(np.float32)
    reading.remark(schema.GetPrim(), f"points holds no list of points but a {type(value).__name__}")
    return None
