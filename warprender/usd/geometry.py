"""UsdGeomMesh and UsdGeomSphere as shapes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom

from ..shapes import Mesh, Primvar, Sphere
from ..shapes.normals import vertex_normals
from .primvars import SINGLE, checked, read_primvar, read_primvars
from .reading import Reading

#: Schemes whose authored normals USD ignores and whose cage shades smoothly.
SMOOTH_SCHEMES = ("catmullClark", "loop")


@dataclass
class Topology:
    """Faces of a mesh that are safe to index with.

    Attributes:
        counts: (F,) int64 corners of each face.
        indices: (sum of counts,) int64 points of the corners, all in range.
        holes: faces that are not drawn, authored or broken.
    """

    counts: np.ndarray
    indices: np.ndarray
    holes: np.ndarray

    def sizes(self, points: int) -> dict[str, int]:
        """Number of primvar elements by interpolation."""
        return {
            "constant": 1,
            "uniform": len(self.counts),
            "vertex": points,
            "varying": points,
            "faceVarying": len(self.indices),
        }


def read_sphere(reading: Reading, prim: Usd.Prim) -> Sphere | None:
    """A sphere prim, or None where there is nothing to draw."""
    radius = float(reading.get(UsdGeom.Sphere(prim).GetRadiusAttr()))
    if not np.isfinite(radius):
        reading.remark(prim, f"radius is {radius}; it is not drawn")
        return None
    return Sphere(radius, read_primvars(reading, prim, SINGLE)) if radius > 0 else None


def read_mesh(reading: Reading, prim: Usd.Prim) -> Mesh | None:
    """A mesh prim, or None where there is nothing to draw."""
    schema = UsdGeom.Mesh(prim)
    points = _read_points(reading, schema)
    if points is None:
        return None
    topology = read_topology(reading, schema, points)
    if not len(topology.counts):
        return None
    if not len(points):
        reading.remark(prim, "it has faces but no points")
        return None
    mesh = Mesh.from_polygons(
        np.nan_to_num(points, nan=0.0, posinf=0.0, neginf=0.0),
        topology.counts,
        topology.indices,
        left_handed=reading.get(schema.GetOrientationAttr()) == UsdGeom.Tokens.leftHanded,
        hole_faces=topology.holes,
        primvars=read_primvars(reading, prim, topology.sizes(len(points))),
        double_sided=bool(reading.get(schema.GetDoubleSidedAttr())),
    )
    if not len(mesh.triangles):
        return None
    if reading.get(schema.GetSubdivisionSchemeAttr()) in SMOOTH_SCHEMES:
        mesh.normals = Primvar(vertex_normals(mesh.points, mesh.triangles), "vertex")
    else:
        mesh.normals = _authored_normals(reading, schema, topology.sizes(len(points)))
    return mesh


def _read_points(reading: Reading, schema: UsdGeom.PointBased) -> np.ndarray | None:
    """(N, 3) float32; None, with a remark, where the attribute holds something that is no list of points."""
    value = reading.get(schema.GetPointsAttr())
    points = np.asarray(value) if value is not None else np.zeros((0, 3))
    if points.ndim == 2 and points.shape[1] == 3 and points.dtype.kind in "fiu":
        return points.astype(np.float32)
    reading.remark(schema.GetPrim(), f"points holds no list of points but a {type(value).__name__}")
    return None


def read_topology(reading: Reading, schema: UsdGeom.Mesh, points: np.ndarray) -> Topology:
    """The faces of a mesh, with the broken ones among its holes so that primvars keep their places."""
    prim = schema.GetPrim()
    counts = np.array(reading.get(schema.GetFaceVertexCountsAttr()) or [], np.int64)
    indices = np.array(reading.get(schema.GetFaceVertexIndicesAttr()) or [], np.int64)
    holes = np.array(reading.get(schema.GetHoleIndicesAttr()) or [], np.int64)
    if (counts < 0).any():
        reading.remark(prim, f"{np.sum(counts < 0)} faceVertexCounts are negative")
        counts = np.maximum(counts, 0)
    ends = np.cumsum(counts)
    if len(counts) and ends[-1] != len(indices):
        reading.remark(prim, f"faceVertexCounts add up to {ends[-1]}, faceVertexIndices are {len(indices)}")
        counts = np.where(ends <= len(indices), counts, 0)
        indices = indices[: counts.sum()]

    outside = (indices < 0) | (indices >= len(points))
    safe = np.where(outside, 0, indices)
    broken_points = ~np.isfinite(points).all(1) if len(points) else np.zeros(1, bool)
    face_of_corner = np.repeat(np.arange(len(counts)), counts)
    missing = np.unique(face_of_corner[outside])
    if len(missing) and len(points):
        reading.remark(prim, f"{len(missing)} faces have indices outside 0…{len(points) - 1}")
    infinite = np.unique(face_of_corner[broken_points[safe]])
    if len(infinite):
        reading.remark(prim, f"{len(infinite)} faces have points that are not finite")
    return Topology(counts, safe, np.concatenate([holes, missing, infinite]))


def _authored_normals(reading: Reading, schema: UsdGeom.Mesh, sizes: dict[str, int]) -> Primvar | None:
    """`primvars:normals`, else `normals`; None shades flat."""
    prim = schema.GetPrim()
    primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("normals")
    if primvar and primvar.HasValue():
        return read_primvar(reading, prim, primvar, sizes, 3)
    values = reading.get(schema.GetNormalsAttr())
    if values is None or not len(values):
        return None
    interpolation = str(schema.GetNormalsInterpolation())
    return checked(reading, prim, "normals", values, interpolation, None, sizes, 3)
