"""Draw modes replace models by boxes, axes and cards."""

import numpy as np
import pytest
from usd_stage import scene_of

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
