"""UsdGeomNurbsPatch as a mesh, without its trims, and UsdGeomNurbsCurves as tubes or ribbons."""

from __future__ import annotations

import numpy as np
from pxr import Usd, UsdGeom

from ..shapes import Mesh, Primvar
from ..shapes.nurbs import SplineCurves, patch
from .curves import is_sound, tubes_or_ribbons
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


def read_nurbs_curves(reading: Reading, prim: Usd.Prim) -> Mesh | None:
    """A curves prim, or None where there is nothing to draw."""
    schema = UsdGeom.NurbsCurves(prim)
    points = read_points(reading, schema)
    counts = np.array(reading.get(schema.GetCurveVertexCountsAttr()) or [], np.int64)
    if points is None or not len(counts) or not is_sound(reading, prim, points, counts):
        return None
    orders = np.array(reading.get(schema.GetOrderAttr()) or [], np.int64)
    orders = np.repeat(orders, len(counts)) if len(orders) == 1 else orders
    knots = np.array(reading.get(schema.GetKnotsAttr()) or [], np.float64)
    weights = np.array(reading.get(schema.GetPointWeightsAttr()) or np.ones(len(points)), np.float64)
    if len(orders) != len(counts) or len(knots) != (counts + orders).sum():
        reading.remark(prim, f"it is not drawn: {len(orders)} orders and {len(knots)} knots do not fit its points")
        return None
    knots = np.split(knots, np.cumsum(counts + orders)[:-1])
    if len(weights) != len(points) or not (weights > 0).all() or not all(map(_is_spline, counts, orders, knots)):
        reading.remark(prim, "it is not drawn: orders, knots or weights make no splines")
        return None
    curves = SplineCurves(counts, orders, knots, weights)
    sizes = {"constant": 1, "uniform": len(counts), "vertex": len(points)}
    return tubes_or_ribbons(reading, prim, curves, points.astype(np.float64), sizes)


def _is_spline(count: int, order: int, knots: np.ndarray) -> bool:
    """Whether knots make a spline of `count` points with a domain."""
    if not 2 <= order <= count or len(knots) != count + order or not np.isfinite(knots).all():
        return False
    return bool((np.diff(knots) >= 0).all() and knots[order - 1] < knots[-order])


def _fits(
    points: np.ndarray, weights: np.ndarray, counts: list[int], orders: list[int], knots: list[np.ndarray]
) -> bool:
    """Whether the patch can be evaluated."""
    if counts[0] * counts[1] != len(points) or len(weights) != len(points):
        return False
    if not all(map(_is_spline, counts, orders, knots)):
        return False
    return bool(np.isfinite(points).all() and (weights > 0).all() and np.isfinite(weights).all())
