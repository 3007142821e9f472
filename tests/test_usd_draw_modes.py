"""Draw modes replace models by boxes, axes and cards."""

import numpy as np
import OpenImageIO as oiio
import pytest
from pictures import outputs
from usd_stage import scene_of

from warprender import images
from warprender.camera import Camera

MODEL = """def Xform "m" ( kind = "component"
    prepend apiSchemas = ["GeomModelAPI"] ) {
    uniform token model:drawMode = "%s"
    float3 model:drawModeColor = (1, 0.5, 0)
    %s
    def Cube "c" { double size = 4 } }"""


def stand_in(mode: str, more: str = ""):
    scene = scene_of(MODEL % (mode, more))
    assert list(scene.placements) == ["/m"]
    return scene.meshes["/m"]


def test_default_draws_the_model():
    assert list(scene_of(MODEL % ("default", "")).placements) == ["/m/c"]


def test_bounds_are_the_edges_of_the_box_in_the_given_colour():
    mesh = stand_in("bounds")
    np.testing.assert_allclose(np.ptp(mesh.points, axis=0), 4, rtol=0.02)
    assert (np.abs(mesh.points) > 1.9).sum(1).min() >= 2
    assert mesh.primvars["displayColor"].values.tolist() == [[1, 0.5, 0]]


def test_origin_is_the_unit_axes():
    np.testing.assert_allclose(stand_in("origin").points.max(0), 1, atol=0.01)


@pytest.mark.parametrize(("geometry", "reach"), [("cross", 0.0), ("box", 2.0)])
def test_cards_lie_across_the_axes(geometry, reach):
    mesh = stand_in("cards", f'uniform token model:cardGeometry = "{geometry}"')
    assert len(mesh.triangles) == 12
    a, b, c = np.moveaxis(mesh.points[mesh.triangles].astype(float), 1, 0)
    normal = np.cross(b - a, c - a)
    along = np.einsum("ij,ij->i", normal / np.linalg.norm(normal, axis=1, keepdims=True), a)
    np.testing.assert_allclose(along, reach)


def test_modes_are_inherited_and_apply_at_components():
    text = 'def Xform "g" ( kind = "group" ) { uniform token model:drawMode = "bounds" ' + MODEL + "}"
    scene = scene_of(text % ("inherited", ""))
    assert list(scene.placements) == ["/g/m"]


def test_draw_modes_can_be_turned_off():
    assert list(scene_of(MODEL % ("bounds", ""), draw_modes=False).placements) == ["/m/c"]


#: Four colours: where they are in the picture, a letter's worth of orientation.
PICTURE = np.array([[(1, 0, 0, 1), (0, 1, 0, 1)], [(0, 0, 1, 1), (1, 1, 0, 1)]], np.float32)

#: Which world axes are a viewer's right and up who looks at a side from outside, as usdImaging orients cards.
VIEWS = {
    "XPos": ((0, 1, 0), (0, 0, 1)),
    "XNeg": ((0, -1, 0), (0, 0, 1)),
    "YPos": ((-1, 0, 0), (0, 0, 1)),
    "YNeg": ((1, 0, 0), (0, 0, 1)),
    "ZPos": ((1, 0, 0), (0, 1, 0)),
    "ZNeg": ((1, 0, 0), (0, -1, 0)),
}


def seen_from(scene, right, up):
    """(2, 2, 3) albedo of the four quarters of a model of size 4 at the origin."""
    transform = np.eye(4)
    transform[:3, :3] = [right, up, np.cross(right, up)]
    transform[3, :3] = 20 * np.cross(right, up)
    camera = Camera("orthographic", horizontalAperture=40, verticalAperture=40, transform=transform)
    return outputs(scene, camera, ("albedo",), 16)["albedo"][4:16:8, 4:16:8]


@pytest.mark.parametrize("geometry", ["cross", "box"])
@pytest.mark.parametrize("side", VIEWS)
def test_a_card_shows_its_picture_upright_and_its_opposite_the_same_from_behind(tmp_path, geometry, side):
    images.write_png(tmp_path / "card.png", PICTURE.repeat(8, 0).repeat(8, 1))
    scene = scene_of(
        MODEL
        % (
            "cards",
            f"""uniform token model:cardGeometry = "{geometry}"
            asset model:cardTexture{side} = @{tmp_path}/card.png@""",
        )
    )
    assert len(scene.meshes["/m"].triangles) == 4 and not scene.warnings
    right, up = VIEWS[side]
    front = seen_from(scene, right, up) - 0.04
    np.testing.assert_allclose(front, PICTURE[..., :3], atol=1e-4)
    behind = seen_from(scene, tuple(-v for v in right), up) - 0.04
    np.testing.assert_allclose(behind, front[:, ::-1], atol=1e-5)


def test_two_pictures_in_the_middle_are_seen_from_their_own_sides(tmp_path):
    red, green = np.zeros((2, 4, 4, 4), np.float32)
    red[..., (0, 3)], green[..., (1, 3)] = 1, 1
    images.write_png(tmp_path / "red.png", red)
    images.write_png(tmp_path / "green.png", green)
    scene = scene_of(
        MODEL
        % (
            "cards",
            f"""uniform token model:cardGeometry = "cross"
            asset model:cardTextureXPos = @{tmp_path}/red.png@
            asset model:cardTextureXNeg = @{tmp_path}/green.png@""",
        )
    )
    assert (np.argmax(seen_from(scene, *VIEWS["XPos"]), -1) == 0).all()
    assert (np.argmax(seen_from(scene, *VIEWS["XNeg"]), -1) == 1).all()


def test_clear_parts_of_a_card_are_not_there(tmp_path):
    half = np.ones((8, 8, 4), np.float32)
    half[:, :4] = (1, 1, 1, 0.05)
    images.write_png(tmp_path / "half.png", half)
    scene = scene_of(MODEL % ("cards", f"asset model:cardTextureXPos = @{tmp_path}/half.png@"))
    seen = seen_from(scene, *VIEWS["XPos"])
    assert (seen[:, 0] == 0).all() and (seen[:, 1] > 0.5).all()


@pytest.mark.parametrize("name", ["worldtoscreen", "worldToNDC"])
def test_a_card_stands_where_its_picture_was_taken(tmp_path, name):
    matrix = np.diag([0.5, 0.25, 1, 1])
    matrix[3, :3] = -1, 0, -3
    spec = oiio.ImageSpec(8, 8, 4, oiio.FLOAT)
    spec.attribute(name, oiio.TypeDesc("matrix"), tuple(matrix.reshape(-1).tolist()))
    target = oiio.ImageOutput.create(f"{tmp_path}/card.exr")
    target.open(f"{tmp_path}/card.exr", spec)
    target.write_image(np.ones((8, 8, 4), np.float32))
    target.close()
    mesh = stand_in(
        "cards",
        f"""uniform token model:cardGeometry = "fromTexture"
        asset model:cardTextureZPos = @{tmp_path}/card.exr@""",
    )
    np.testing.assert_allclose(mesh.points.min(0), [0, -4, 3])
    np.testing.assert_allclose(mesh.points.max(0), [4, 4, 3])


def test_a_picture_without_its_matrix_is_named(tmp_path):
    images.write_png(tmp_path / "card.png", np.ones((4, 4, 4), np.float32))
    more = f"""uniform token model:cardGeometry = "fromTexture"
        asset model:cardTextureZPos = @{tmp_path}/card.png@
        asset model:cardTextureXPos = @{tmp_path}/none.png@"""
    scene = scene_of(MODEL % ("cards", more))
    assert not scene.placements and len(scene.warnings) == 2
    assert "its card ZPos is not drawn" in "".join(scene.warnings) and "none.png" in "".join(scene.warnings)
