"""Model draw modes (UsdGeomModelAPI): a box, axes or cards that stand for a whole model."""

from __future__ import annotations

import numpy as np
from pxr import Kind, Usd, UsdGeom

from ..shapes import Mesh, Primvar
from ..shapes.curves import Curves
from ..shapes.tubes import tubes
from .cards import read_cards
from .reading import Reading

#: Edges of a box whose corners are numbered by their bits x, y, z.
EDGES = [(a, a | 1 << axis) for a in range(8) for axis in range(3) if not a >> axis & 1]

#: Width of drawn lines as a part of the diagonal of what they show.
LINE_WIDTH = 1 / 300


def inherited_mode(prim: Usd.Prim, inherited: str) -> str:
    """The draw mode that holds at a prim below one of mode `inherited`."""
    attribute = prim.GetAttribute("model:drawMode")
    mode = attribute.Get() if attribute and attribute.HasAuthoredValue() else None
    return str(mode) if mode and mode != "inherited" else inherited


def applies(prim: Usd.Prim) -> bool:
    """Whether a draw mode replaces what is below this prim: on components, and where it is asked for."""
    if not (prim.IsModel() or prim.HasAPI("GeomModelAPI")):
        return False
    attribute = prim.GetAttribute("model:applyDrawMode")
    return bool(attribute and attribute.Get()) or Usd.ModelAPI(prim).IsKind(Kind.Tokens.component)


def read_stand_in(reading: Reading, prim: Usd.Prim, mode: str) -> Mesh | None:
    """What a draw mode shows of a model; None for a model without extent or a mode that is not drawn."""
    box = _box(reading, prim)
    color = tuple(reading.get(UsdGeom.ModelAPI(prim).GetModelDrawModeColorAttr()) or (0.18, 0.18, 0.18))
    if mode == "cards":
        mesh = read_cards(reading, prim, box, color)
    elif mode == "origin":
        mesh = _lines(np.concatenate([np.zeros((3, 3)), np.eye(3)]), [(0, 3), (1, 4), (2, 5)])
    elif box is None:
        return None
    elif mode == "bounds":
        mesh = _lines(_corners(box), EDGES)
    else:
        reading.remark(prim, f"model:drawMode {mode} is not drawn")
        return None
    if mesh is not None:
        mesh.primvars["displayColor"] = Primvar([color])
    return mesh


def _box(reading: Reading, prim: Usd.Prim) -> np.ndarray | None:
    """(2, 3) float64 extent of the model in its own space."""
    cache = UsdGeom.BBoxCache(reading.time, sorted(reading.purposes), useExtentsHint=True)
    extent = cache.ComputeUntransformedBound(prim).ComputeAlignedRange()
    box = np.array([extent.GetMin(), extent.GetMax()], np.float64)
    return box if not extent.IsEmpty() and np.isfinite(box).all() else None


def _corners(box: np.ndarray) -> np.ndarray:
    bits = (np.arange(8)[:, None] >> np.arange(3)) & 1
    return np.where(bits == 0, box[0], box[1])


def _lines(points: np.ndarray, pairs: list[tuple[int, int]]) -> Mesh:
    """Thin tubes between pairs of points."""
    width = np.linalg.norm(np.ptp(points, axis=0)) * LINE_WIDTH
    ends = points[np.array(pairs).reshape(-1)].astype(np.float64)
    curves = Curves(np.full(len(pairs), 2), "linear")
    return tubes(curves, ends, np.full(len(ends), width))[0]
