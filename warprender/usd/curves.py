"""UsdGeomBasisCurves and UsdGeomHermiteCurves as tubes, or as ribbons where they have normals."""

from __future__ import annotations

import numpy as np
from pxr import Usd, UsdGeom

from ..shapes import Mesh, Primvar
from ..shapes.curves import Curves
from ..shapes.nurbs import SplineCurves
from ..shapes.tubes import ribbons, tubes
from .geometry import read_points
from .primvars import read_builtin, read_primvars
from .reading import Reading

#: Width of curves without one, as a part of the prim's diagonal: thin enough to be seen as lines.
DEFAULT_WIDTH = 1 / 500


def read_curves(reading: Reading, prim: Usd.Prim) -> Mesh | None:
    """A curves prim, or None where there is nothing to draw."""
    schema = UsdGeom.BasisCurves(prim)
    points = read_points(reading, schema)
    counts = np.array(reading.get(schema.GetCurveVertexCountsAttr()) or [], np.int64)
    if points is None or not len(counts) or not is_sound(reading, prim, points, counts):
        return None
    curves = Curves(
        counts,
        *(str(reading.get(a)) for a in (schema.GetTypeAttr(), schema.GetBasisAttr(), schema.GetWrapAttr())),
    )
    if not len(curves.curve):
        return None
    sizes = {
        "constant": 1,
        "uniform": len(counts),
        "varying": int(curves.varying_counts.sum()),
        "vertex": len(points),
    }
    return tubes_or_ribbons(reading, prim, curves, points.astype(np.float64), sizes)


def read_hermite_curves(reading: Reading, prim: Usd.Prim) -> Mesh | None:
    """A prim of curves through points with tangents, as the Bézier curves that they are."""
    schema = UsdGeom.HermiteCurves(prim)
    points = read_points(reading, schema)
    counts = np.array(reading.get(schema.GetCurveVertexCountsAttr()) or [], np.int64)
    if points is None or not len(counts) or not is_sound(reading, prim, points, counts):
        return None
    tangents = np.array(reading.get(schema.GetTangentsAttr()) or [], np.float64).reshape(-1, 3)
    if len(tangents) != len(points) or (counts < 2).any() or not np.isfinite(tangents).all():
        reading.remark(prim, f"it is not drawn: {len(tangents)} tangents at {len(points)} points")
        return None
    thirds = tangents / 3
    control = np.stack([points - thirds, points, points + thirds], 1).reshape(-1, 3)
    ends = np.cumsum(counts)
    inner = np.ones(len(control), bool)
    inner[3 * (ends - counts)] = inner[3 * ends - 1] = False
    curves = Curves(3 * counts - 2, "cubic", "bezier")
    sizes = {"constant": 1, "uniform": len(counts), "varying": len(points), "vertex": len(points)}
    return tubes_or_ribbons(reading, prim, curves, control[inner], sizes)


def tubes_or_ribbons(
    reading: Reading, prim: Usd.Prim, curves: Curves | SplineCurves, points: np.ndarray, sizes: dict[str, int]
) -> Mesh:
    """Tubes or ribbons with the prim's widths, normals and primvars."""
    thin = Primvar([[np.linalg.norm(np.ptp(points, axis=0)) * DEFAULT_WIDTH]])
    widths = _sampled(curves, read_builtin(reading, prim, "widths", sizes, 1) or thin)[:, 0]
    normals = read_builtin(reading, prim, "normals", sizes, 3)
    if normals is None:
        mesh, samples = tubes(curves, points, widths)
    else:
        mesh, samples = ribbons(curves, points, widths, _sampled(curves, normals))
    for name, primvar in read_primvars(reading, prim, sizes).items():
        if primvar.interpolation in ("vertex", "varying"):
            primvar = Primvar(_sampled(curves, primvar)[samples], "vertex")
        mesh.primvars[name] = primvar
    return mesh


def _sampled(curves: Curves | SplineCurves, primvar: Primvar) -> np.ndarray:
    """Values (S, K) at the samples."""
    values = primvar.expanded().astype(np.float64)
    if primvar.interpolation == "constant":
        return np.broadcast_to(values, (len(curves.curve), values.shape[1]))
    if primvar.interpolation == "uniform":
        return values[curves.curve]
    if primvar.interpolation == "varying" or len(values) != curves.curveVertexCounts.sum():
        # Hermite curves have no vertex values beside those at their points, where spans end.
        return curves.varying(values)
    return curves.positions(values)


def is_sound(reading: Reading, prim: Usd.Prim, points: np.ndarray, counts: np.ndarray) -> bool:
    """Whether the points are finite and the curves use all of them; a remark where not."""
    if (counts < 0).any() or counts.sum() != len(points):
        reading.remark(prim, f"curveVertexCounts add up to {counts.sum()}, there are {len(points)} points")
        return False
    if not np.isfinite(points).all():
        reading.remark(prim, "it has points that are not finite and is not drawn")
        return False
    return True
