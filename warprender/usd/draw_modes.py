"""Model draw modes (UsdGeomModelAPI): a box, axes or cards that stand for a whole model."""

from __future__ import annotations

import numpy as np
from pxr import Kind, Usd, UsdGeom

from ..shapes import Mesh, Primvar
from ..shapes.curves import Curves
from ..shapes.tubes import tubes
from .reading import Reading

#: Edges of a box whose corners are numbered by their bits x, y, z.
EDGES = [(a, a | 1 << axis) for a in range(8) for axis in range(3) if not a >> axis & 1]

#: Width of drawn lines as a part of the diagonal of what they show.
LINE_WIDTH = 1 / 300

CARD_SIDES = ("XPos", "XNeg", "YPos", "YNeg", "ZPos", "ZNeg")


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
    if mode == "origin":
        mesh = _lines(np.concatenate([np.zeros((3, 3)), np.eye(3)]), [(0, 3), (1, 4), (2, 5)])
    elif box is None:
        return None
    elif mode == "bounds":
        mesh = _lines(_corners(box), EDGES)
    elif mode == "cards":
        mesh = _cards(reading, prim, box)
    else:
        reading.remark(prim, f"model:drawMode {mode} is not drawn")
        return None
    if mesh is not None:
        color = UsdGeom.ModelAPI(prim).GetModelDrawModeColorAttr()
        mesh.primvars["displayColor"] = Primvar([tuple(reading.get(color) or (0.18, 0.18, 0.18))])
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


def _cards(reading: Reading, prim: Usd.Prim, box: np.ndarray) -> Mesh | None:
    """Rectangles across each axis: through the middle ("cross"), or at the sides ("box")."""
    model = UsdGeom.ModelAPI(prim)
    geometry = str(reading.get(model.GetModelCardGeometryAttr()))
    if geometry not in ("cross", "box"):
        reading.remark(prim, f"model:cardGeometry {geometry} is not drawn yet")
        return None
    textured = [side for side in CARD_SIDES if reading.get(prim.GetAttribute(f"model:cardTexture{side}"))]
    if textured:
        reading.remark(prim, "its cards are drawn without their textures")
    shown = [side for side in CARD_SIDES if not textured or side in textured]
    quads = [_card(box, "XYZ".index(side[0]), side.endswith("Pos"), geometry == "cross") for side in shown]
    points = np.concatenate(quads).astype(np.float32)
    return Mesh.from_polygons(points, np.full(len(quads), 4), np.arange(len(points)))


def _card(box: np.ndarray, axis: int, positive: bool, in_middle: bool) -> np.ndarray:
    """(4, 3) corners, counter-clockwise seen from the side that the card faces."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    corners = np.zeros((4, 3))
    corners[:, u] = box[[0, 1, 1, 0], u]
    corners[:, v] = box[[0, 0, 1, 1], v]
    corners[:, axis] = box[:, axis].mean() if in_middle else box[int(positive), axis]
    return corners if positive else corners[::-1]
