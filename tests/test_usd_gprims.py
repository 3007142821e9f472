"""Intrinsic shapes have the size, place and normals of the true surfaces."""

import numpy as np
import pytest
from usd_stage import scene_of

from warprender.shapes import Mesh

SHAPES = ("Cube", "Cylinder", "Cylinder_1", "Cone", "Capsule", "Capsule_1", "Plane")


def mesh_of(kind: str, body: str = "") -> Mesh:
    scene = scene_of(f'def {kind} "s" {{ {body} }}')
    assert not scene.warnings
    return scene.meshes["/s"]


def corners(mesh: Mesh) -> np.ndarray:
    return np.asarray(mesh.points, np.float64)[mesh.triangles]


def volume(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(corners(mesh), 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize("axis", "XYZ")
@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("Cylinder", 2 * np.pi),
        ("Cylinder_1", 2 * np.pi),
        ("Cone", 2 * np.pi / 3),
        ("Capsule", np.pi / 4 + np.pi / 6),
        ("Capsule_1", np.pi / 4 + np.pi / 6),
    ],
)
def test_defaults_enclose_the_volume_of_the_true_shape(kind, expected, axis):
    mesh = mesh_of(kind, f'uniform token axis = "{axis}"')
    assert volume(mesh) == pytest.approx(expected, rel=1.5e-3)
    size = np.ptp(mesh.points, axis=0)
    assert size["XYZ".index(axis)] == pytest.approx(2.0, abs=1e-5)


def test_cube_is_closed_and_faces_outwards():
    assert volume(mesh_of("Cube", "double size = 3")) == pytest.approx(27)


def test_frustum_has_both_radii():
    mesh = mesh_of("Cylinder_1", "double radiusTop = 0.5\ndouble radiusBottom = 2\ndouble height = 3")
    assert volume(mesh) == pytest.approx(np.pi * 3 / 3 * (4 + 1 + 0.25), rel=1.5e-3)
    assert mesh.points[:, 2].min() == -1.5
    assert np.hypot(*mesh.points[mesh.points[:, 2] == -1.5, :2].T).max() == pytest.approx(2)


@pytest.mark.parametrize("kind", ["Cylinder", "Cone", "Capsule"])
def test_normals_are_unit_and_face_as_their_triangles_do(kind):
    mesh = mesh_of(kind)
    normals = mesh.normals.values[mesh.triangles]
    np.testing.assert_allclose(np.linalg.norm(normals, axis=2), 1, atol=1e-6)
    a, b, c = np.moveaxis(corners(mesh), 1, 0)
    geometric = np.cross(b - a, c - a)
    geometric /= np.linalg.norm(geometric, axis=1, keepdims=True)
    assert np.einsum("tkj,tj->tk", normals, geometric).min() > 0.99


def test_capsule_normals_are_exact_on_the_caps():
    mesh = mesh_of("Capsule", "double height = 2")
    cap = mesh.points[:, 2] > 1.01
    np.testing.assert_allclose(mesh.normals.values[cap], (mesh.points[cap] - (0, 0, 1)) / 0.5, atol=1e-5)


@pytest.mark.parametrize(("axis", "extent"), [("X", (0, 5, 3)), ("Y", (3, 0, 5)), ("Z", (3, 5, 0))])
def test_plane_lies_across_its_axis_and_faces_along_it(axis, extent):
    mesh = mesh_of("Plane", f'double width = 3\ndouble length = 5\nuniform token axis = "{axis}"')
    np.testing.assert_allclose(np.ptp(mesh.points, axis=0), extent)
    a, b, c = corners(mesh)[0]
    assert np.cross(b - a, c - a)["XYZ".index(axis)] > 0
    assert mesh.double_sided


def test_equal_prims_share_a_shape_and_coloured_ones_do_not():
    scene = scene_of('def Cube "a" { } def Cube "b" { } def Cube "c" { color3f[] primvars:displayColor = [(1, 0, 0)] }')
    a, b, c = (p.shape for p in scene.placements.values())
    assert a is b and a is not c and c.primvars["displayColor"].values.tolist() == [[1, 0, 0]]


@pytest.mark.parametrize("kind", SHAPES)
def test_senseless_sizes_are_named_and_not_drawn(kind):
    name = {"Cube": "size", "Plane": "width"}.get(kind, "height")
    scene = scene_of(f'def {kind} "bad" {{ double {name} = nan }} def {kind} "negative" {{ double {name} = -1 }}')
    assert not scene.placements
    assert [line.split(":")[0] for line in scene.warnings] == ["/bad", "/negative"]


def test_colours_of_a_cube_go_to_hydras_faces_and_corners():
    text = """def Cube "{0}" {{ color3f[] primvars:displayColor = {1} ( interpolation = "{0}" ) }}"""
    faces = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (0, 1, 1), (1, 0, 1)]
    scene = scene_of(text.format("uniform", faces) + text.format("vertex", [*faces, (0, 0, 0), (1, 1, 1)]))
    uniform, vertex = (scene.meshes[path] for path in ("/uniform", "/vertex"))
    assert uniform.primvars["displayColor"].interpolation == "uniform"
    towards_viewer = uniform.points[uniform.triangles[uniform.faces == 3]]
    assert (towards_viewer[..., 1] == -1).all(), "yellow, the fourth, is the face towards -Y"
    assert tuple(vertex.points[4]) == (-1, -1, -1) and len(vertex.primvars["displayColor"].values) == 8
