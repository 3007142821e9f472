"""UsdGeomPoints: every point an exact sphere, one quadric placed many times."""

from __future__ import annotations

import numpy as np
from pxr import Usd, UsdGeom

from ..shapes import Primvar, Sphere
from .geometry import read_points
from .instances import Frame
from .primvars import read_builtin, read_primvars
from .reading import Reading
from .walk import Visit

#: Diameter of points without widths (Hydra's).
DEFAULT_WIDTH = 1.0


def read_point(reading: Reading, prim: Usd.Prim) -> Sphere:
    """The sphere of diameter 1 that `points_frame` places, with the primvars that the points share."""
    return Sphere(0.5, read_primvars(reading, prim, {"constant": 1}))


def points_frame(reading: Reading, schema: UsdGeom.Points, visit: Visit) -> Frame:
    """The frame in which a sphere of diameter 1 is every point of the prim.

    Copies are numbered as the points are; points that are not finite or have no width are left out.
    """
    prim = schema.GetPrim()
    points = read_points(reading, schema)
    points = np.zeros((0, 3)) if points is None else points.astype(np.float64)
    sizes = {"constant": 1, **dict.fromkeys(("uniform", "vertex", "varying"), len(points))}
    found = read_builtin(reading, prim, "widths", sizes, 1)
    widths = np.broadcast_to(DEFAULT_WIDTH if found is None else found.expanded()[:, 0], len(points))
    copies = np.zeros((len(points), 4, 4))
    copies[:, [0, 1, 2], [0, 1, 2]] = widths[:, None]
    copies[:, 3, :3] = points
    copies[:, 3, 3] = 1.0
    primvars = read_primvars(reading, prim, sizes)
    rated = {n: Primvar(p.expanded(), "instance") for n, p in primvars.items() if p.interpolation != "constant"}
    good = np.isfinite(copies).all((1, 2))
    if not good.all():
        reading.remark(prim, f"{np.sum(~good)} points or widths are not finite")
    good &= widths > 0
    frame = visit.frame.nested(prim, np.where(good[:, None, None], copies, np.eye(4)) @ visit.local, rated)
    return frame.chosen(np.tile(good, len(visit.frame.ids)))
