"""Meshes and spheres read from a stage keep their faces, normals and primvars, and survive broken ones."""

import numpy as np
import pytest
from usd_stage import scene_of

from warprender.renderer import Renderer

SQUARE = """
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    uniform token subdivisionScheme = "none"
"""


def mesh_of(body: str):
    scene = scene_of(f'def Mesh "m" {{ {body} }}')
    return scene.meshes.get("/m"), scene.warnings


def area(mesh) -> float:
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def facing(mesh) -> np.ndarray:
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)[:, 2]


def test_concave_polygon_covers_its_area_once():
    mesh, warnings = mesh_of(
        """int[] faceVertexCounts = [6]
        int[] faceVertexIndices = [0, 1, 2, 3, 4, 5]
        point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0)]
        uniform token subdivisionScheme = "none" """
    )
    assert area(mesh) == pytest.approx(3.0, abs=1e-6)
    assert not warnings


def test_left_handed_turns_the_geometric_normal():
    right, _ = mesh_of(SQUARE)
    left, _ = mesh_of(SQUARE + 'uniform token orientation = "leftHanded"')
    assert (facing(right) > 0).all() and (facing(left) < 0).all()


def test_hole_faces_are_not_drawn():
    body = """int[] faceVertexCounts = [3, 3]
        int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        int[] holeIndices = [0]"""
    assert mesh_of(body)[0].faces.tolist() == [1]


def test_scheme_none_without_normals_is_flat_and_a_cage_is_smooth():
    flat, _ = mesh_of(SQUARE)
    smooth, _ = mesh_of(SQUARE.replace('"none"', '"catmullClark"'))
    assert flat.normals is None
    np.testing.assert_allclose(smooth.normals.values, [[0, 0, 1]] * 4, atol=1e-6)


def test_primvars_normals_beats_normals():
    mesh, _ = mesh_of(
        SQUARE
        + """normal3f[] normals = [(1, 0, 0), (1, 0, 0), (1, 0, 0), (1, 0, 0)]
        normal3f[] primvars:normals = [(0, 1, 0)] ( interpolation = "uniform" )"""
    )
    assert mesh.normals.interpolation == "uniform"
    assert mesh.normals.values.tolist() == [[0, 1, 0]]


@pytest.mark.parametrize(
    ("interpolation", "count"),
    [("constant", 1), ("uniform", 1), ("varying", 4), ("vertex", 4), ("faceVarying", 4)],
)
def test_display_color_has_every_interpolation_with_indices(interpolation, count):
    mesh, warnings = mesh_of(
        SQUARE
        + f"""color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] ( interpolation = "{interpolation}" )
        int[] primvars:displayColor:indices = {[k % 2 for k in range(count)]}"""
    )
    color = mesh.primvars["displayColor"]
    assert color.expanded()[:, 1].tolist() == [k % 2 for k in range(count)]
    assert not warnings


def test_constant_primvars_are_inherited():
    scene = scene_of(
        f"""def Xform "a" {{
            color3f[] primvars:displayColor = [(0, 0, 1)]
            def Mesh "m" {{ {SQUARE} }}
            def Sphere "s" {{ }}
        }}"""
    )
    for placement in scene.placements.values():
        assert placement.shape.primvars["displayColor"].values.tolist() == [[0, 0, 1]]


def test_sphere_keeps_its_radius():
    assert scene_of('def Sphere "s" { double radius = 2.5 }').placements["/s"].shape.radius == 2.5


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (("[0, 1, 2, 3]", "[0, 1, 2, 9]"), "indices outside"),
        (("[0, 1, 2, 3]", "[0, 1, 2, -1]"), "indices outside"),
        (("[0, 1, 2, 3]", "[0, 1, 2]"), "add up to"),
        (("[4]", "[-4]"), "negative"),
        (("(1, 1, 0)", "(nan, 1, 0)"), "not finite"),
        (("[4]", "[4, 3]"), "add up to"),
    ],
)
def test_broken_faces_cost_one_warning_and_nothing_else(change, word):
    broken = SQUARE.replace(*change)
    scene = scene_of(f'def Mesh "bad" {{ {broken} }} def Mesh "good" {{ {SQUARE} }}')
    assert "/good" in scene.placements
    assert sum("/bad" in line and word in line for line in scene.warnings) == 1


def test_broken_face_leaves_the_others_their_colours():
    mesh, _ = mesh_of(
        """int[] faceVertexCounts = [3, 3]
        int[] faceVertexIndices = [0, 1, 7, 0, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] ( interpolation = "uniform" )"""
    )
    assert mesh.faces.tolist() == [1]
    assert mesh.primvars["displayColor"].values[1].tolist() == [0, 1, 0]


def test_primvar_of_the_wrong_length_is_ignored_with_a_warning():
    mesh, warnings = mesh_of(
        SQUARE + 'color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] ( interpolation = "vertex" )'
    )
    assert "displayColor" not in mesh.primvars
    assert len(warnings) == 1 and "/m" in warnings[0]


def test_subsets_give_faces_their_materials():
    scene = scene_of(
        """def Material "A" { token outputs:surface.connect = </A/s.outputs:surface>
            def Shader "s" { uniform token info:id = "UsdPreviewSurface"
                token outputs:surface } }
        def Mesh "m" {
            int[] faceVertexCounts = [3, 3]
            int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
            point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
            def GeomSubset "part" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
                uniform token elementType = "face"
                uniform token familyName = "materialBind"
                int[] indices = [1, 5]
                rel material:binding = </A>
            }
        }"""
    )
    assert {k: v.tolist() for k, v in scene.meshes["/m"].face_materials.items()} == {"/A": [1]}
    assert scene.placements["/m"].material == ""
    assert any("/m/part" in line for line in scene.warnings)


def test_complexity_subdivides_and_keeps_faces_and_orientation():
    body = SQUARE.replace('"none"', '"catmullClark"')
    for orientation, sign in (("rightHanded", 1), ("leftHanded", -1)):
        text = f'def Mesh "m" {{ {body} uniform token orientation = "{orientation}" }}'
        mesh = scene_of(text, complexity="high").meshes["/m"]
        assert len(mesh.triangles) == 2 * 4**2 and set(mesh.faces.tolist()) == {0}
        assert (sign * facing(mesh) > 0).all() and (sign * mesh.normals.values[:, 2] > 0.99).all()


def test_broken_faces_do_not_shape_a_subdivision_surface():
    body = SQUARE.replace('"none"', '"catmullClark"')
    spoilt = body.replace("[4]", "[4, 3, 2]").replace("[0, 1, 2, 3]", "[0, 1, 2, 99, 0, 1, 2, 0, 1]")
    scene = scene_of(f'def Mesh "m" {{ {spoilt} }}', complexity=1.1)
    assert set(scene.meshes["/m"].faces.tolist()) == {1} and len(scene.warnings) == 1


def test_loop_on_quads_draws_the_cage_with_a_warning():
    scene = scene_of('def Mesh "m" {' + SQUARE.replace('"none"', '"loop"') + "}", complexity=1.1)
    assert len(scene.meshes["/m"].triangles) == 2
    assert "triangles only" in scene.warnings[0]


SURFACE = "int3[] surfaceFaceVertexIndices = [(0, 1, 3), (0, 2, 1), (0, 3, 2), (1, 2, 3)]"


@pytest.mark.parametrize("surface", ["", SURFACE])
def test_tetrahedra_show_their_surface_from_outside(surface):
    scene = scene_of(
        f"""def TetMesh "t" {{ point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1)]
            int4[] tetVertexIndices = [(0, 1, 2, 3)]
            {surface} }}"""
    )
    a, b, c = np.moveaxis(scene.meshes["/t"].points[scene.meshes["/t"].triangles].astype(float), 1, 0)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(1 / 6)


def test_kinds_that_are_not_drawn_yet_are_named_once():
    prims = "\n".join(f'def Volume "v{k}" {{ }}' for k in range(9))
    assert scene_of(prims).warnings == ["/v0 and 8 more prims: Volume is not drawn yet: it has no field"]


def test_concave_quads_are_cut_along_the_diagonal_inside():
    corners = [(0, 0, 0), (2, 0, 0), (0.5, 0.5, 0), (0, 2, 0)]
    for turn in range(4):
        points = corners[turn:] + corners[:turn]
        mesh, _ = mesh_of(SQUARE.replace("[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]", str(points)))
        assert area(mesh) == pytest.approx(1.0) and (facing(mesh) > 0).all()


def test_a_sphere_is_round_in_the_picture():
    prims = Renderer(scene_of('def Sphere "s" { }'), None, (64, 64), outputs=("primId",)).render().numpy("primId")
    rows, columns = np.nonzero(prims == 0)
    box = (np.ptp(rows) + 1) * (np.ptp(columns) + 1)
    assert len(rows) / box == pytest.approx(np.pi / 4, abs=0.03), "rays through the corners of its box miss"
