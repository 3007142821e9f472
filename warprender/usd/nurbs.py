"""UsdGeomNurbsPatch as a mesh, without its trims."""

from __future__ import annotations

import numpy as np
from pxr import Usd, UsdGeom

from ..shapes import Mesh, Primvar
from ..shapes.nurbs import patch
from .geometry import read_points
from .primvars import read_primvars
from .reading import Reading


def read_nurbs_patch(reading: Reading, prim: Usd.Prim) -> Mesh | None:
    """A patch prim, or None where there is nothing to draw."""
    schema = UsdGeom.NurbsPatch(prim)
    points = read_points(reading, schema)
    if points is None or not len(points):
        return None
    counts = [int(reading.get(a)) for a in (schema.GetUVertexCountAttr(), schema.GetVVertexCountAttr())]
    orders = [int(reading.get(a)) for a in (schema.GetUOrderAttr(), schema.GetVOrderAttr())]
    knots = [np.array(reading.get(a) or [], np.float64) for a in (schema.GetUKnotsAttr(), schema.GetVKnotsAttr())]
    weights = np.array(reading.get(schema.GetPointWeightsAttr()) or np.ones(len(points)), np.float64)
    if not _fits(points, weights, counts, orders, knots):
        reading.remark(prim, f"it is not drawn: {counts} points of orders {orders} do not fit its points and knots")
        return None
    if reading.get(schema.GetTrimCurveCountsAttr()):
        reading.remark(prim, "its trim curves are not drawn")
    grid = points.astype(np.float64).reshape(counts[1], counts[0], 3)
    mesh, share = patch(grid, weights.reshape(counts[1], counts[0]), tuple(knots), tuple(orders))
    if reading.get(schema.GetOrientationAttr()) == UsdGeom.Tokens.leftHanded:
        mesh.triangles = mesh.triangles[:, ::-1].copy()
        mesh.normals = Primvar(-mesh.normals.values, "vertex")
    for name, primvar in read_primvars(reading, prim, {"constant": 1, "uniform": 1, "vertex": len(points)}).items():
        if primvar.interpolation == "vertex":
            primvar = Primvar(share @ primvar.expanded(), "vertex")
        mesh.primvars[name] = primvar
    return mesh


def _fits(
    points: np.ndarray, weights: np.ndarray, counts: list[int], orders: list[int], knots: list[np.ndarray]
) -> bool:
    """Whether the patch can be evaluated."""
    sizes = all(2 <= order <= count for order, count in zip(orders, counts, strict=True))
    if not sizes or counts[0] * counts[1] != len(points) or len(weights) != len(points):
        return False
    if any(len(k) != count + order for k, count, order in zip(knots, counts, orders, strict=True)):
        return False
    if any(not (np.diff(k) >= 0).all() or not k[order - 1] < k[-order] for k, order in zip(knots, orders, strict=True)):
        return False
    return bool(np.isfinite(points).all() and (weights > 0).all() and np.isfinite(weights).all())
