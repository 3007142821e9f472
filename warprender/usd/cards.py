"""Cards: up to six rectangles with pictures of a model from its sides, drawn in its place (UsdGeomModelAPI)."""

from __future__ import annotations

import numpy as np
from pxr import Usd, UsdGeom

from .. import images
from ..materials import PreviewSurface
from ..shapes import Mesh, Primvar
from ..textures import PrimvarReader, Texture
from .light_apis import asset_path
from .reading import Reading

#: Sides of a box as pairs of opposites.
SIDES = ("XPos", "XNeg", "YPos", "YNeg", "ZPos", "ZNeg")

#: Names of the matrix that a picture may hold of how it was taken; files of OpenImageIO before 2.2 have the second.
MATRIX_NAMES = ("worldtoscreen", "worldtondc")

#: Below this alpha a card is clear.
OPACITY_THRESHOLD = 0.1

#: Cards that cross in the middle and have two pictures stand apart by this part of the box, to be seen one by one.
GAP = 2.0**-16

#: Texture coordinates of a card's corners.
CORNERS_ST = np.array([(1, 1), (0, 1), (0, 0), (1, 0)], np.float32)


def read_cards(reading: Reading, prim: Usd.Prim, box: np.ndarray | None, color: tuple[float, ...]) -> Mesh | None:
    """The cards of a model as one mesh, a face each; their materials go into the scene.

    Args:
        reading: the reading in progress.
        prim: the model.
        box: (2, 3) its extent, None where it has none.
        color: of cards without a picture.
    """
    geometry = str(reading.get(UsdGeom.ModelAPI(prim).GetModelCardGeometryAttr()))
    files = {side: asset_path(reading.get(prim.GetAttribute(f"model:cardTexture{side}"))) for side in SIDES}
    textured = [side for side in SIDES if files[side]]
    if geometry == "fromTexture":
        cards = _cards_from_pictures(reading, prim, {side: files[side] for side in textured})
    elif geometry in ("cross", "box"):
        cards = _cards_of_box(box, textured, geometry == "cross") if box is not None else []
    else:
        reading.remark(prim, f"model:cardGeometry {geometry} is not one of cross, box, fromTexture")
        return None
    if not cards:
        return None
    points = np.concatenate([corners for _, corners, _ in cards]).astype(np.float32)
    mesh = Mesh.from_polygons(points, np.full(len(cards), 4), np.arange(len(points)))
    mesh.primvars["cardsUv"] = Primvar(np.concatenate([st for _, _, st in cards]), "vertex")
    for side in textured:
        faces = [face for face, (shown, _, _) in enumerate(cards) if shown == side]
        if faces:
            key = f"{prim.GetPath()}.model:cardTexture{side}"
            reading.scene.materials[key] = _material(files[side], key, color)
            mesh.face_materials[key] = np.array(faces, np.int32)
    return mesh


def _material(file: str, attribute: str, color: tuple[float, ...]) -> PreviewSurface:
    def texture(channel: str) -> Texture:
        st = PrimvarReader("cardsUv", (0.0, 0.0))
        return Texture(file, channel, "clamp", "clamp", fallback=(*color, 1.0), st=st, prim=attribute)

    return PreviewSurface(diffuseColor=texture("rgb"), opacity=texture("a"), opacityThreshold=OPACITY_THRESHOLD)


def _cards_of_box(
    box: np.ndarray, textured: list[str], in_middle: bool
) -> list[tuple[str | None, np.ndarray, np.ndarray]]:
    """For each drawn side: the side whose picture it shows, corners (4, 3), texture coordinates (4, 2).

    A side without a picture shows the opposite one's from behind; sides of a pair without any are left out, unless
    there are no pictures at all.
    """
    cards = []
    for number, side in enumerate(SIDES):
        opposite = SIDES[number ^ 1]
        if textured and side not in textured and opposite not in textured:
            continue
        shown = side if side in textured else opposite if opposite in textured else None
        apart = GAP if in_middle and side in textured and opposite in textured else 0.0
        corners = _corners("XYZ".index(side[0]), side.endswith("Pos"), 0.5 + apart if in_middle else 1.0)
        cards.append((shown, box[0] + corners * (box[1] - box[0]), _side_st(side, shown == side or shown is None)))
    return cards


def _corners(axis: int, positive: bool, height: float) -> np.ndarray:
    """(4, 3) corners in the unit cube, as in usdImaging: counter-clockwise seen from the side that the card faces.

    Args:
        axis: across which the card stands.
        positive: whether it faces up the axis.
        height: where it stands, from the opposite side.
    """
    up = [(height, 1, 1), (height, 0, 1), (height, 0, 0), (height, 1, 0)]
    turned = np.array([((x, y, z), (1 - y, x, z), (y, z, x))[axis] for x, y, z in up])
    return turned if positive else 1.0 - turned[::-1]


def _side_st(side: str, own: bool) -> np.ndarray:
    """Texture coordinates of a side's corners; not its own picture is mirrored."""
    flip_s = not own if side[0] != "Z" else side == "ZNeg"
    flip_t = False if side[0] != "Z" else own == (side == "ZNeg")
    return np.where([flip_s, flip_t], 1 - CORNERS_ST, CORNERS_ST)


def _cards_from_pictures(
    reading: Reading, prim: Usd.Prim, files: dict[str, str]
) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """As `_cards_of_box`, each card where its picture's matrix says that it was taken."""
    screen = np.array([(1, -1, 0, 1), (-1, -1, 0, 1), (-1, 1, 0, 1), (1, 1, 0, 1)], np.float64)
    cards = []
    for side, file in files.items():
        try:
            matrix = _matrix(file)
        except ValueError as error:
            reading.remark(prim, f"its card {side} is not drawn: {error}")
            continue
        corners = screen @ np.linalg.inv(matrix)
        cards.append((side, corners[:, :3] / corners[:, 3:], CORNERS_ST))
    return cards


def _matrix(file: str) -> np.ndarray:
    """(4, 4) from the model to the picture's screen, for row vectors.

    Raises:
        ValueError: the picture cannot be read, or holds no matrix that can be inverted.
    """
    metadata = {name.lower(): value for name, value in images.picture_header(file).metadata.items()}
    value = next((metadata[name] for name in MATRIX_NAMES if name in metadata), None)
    matrix = np.array(value if value is not None else [], np.float64)
    if matrix.size != 16 or not np.isfinite(matrix).all() or np.linalg.matrix_rank(matrix.reshape(4, 4)) < 4:
        raise ValueError(f"{file} holds no worldtoscreen matrix")
    return matrix.reshape(4, 4)
