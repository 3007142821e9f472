"""Curves follow their basis and wrap, and are drawn as tubes or ribbons of their widths."""

import numpy as np
import pytest
from usd_stage import scene_of

from warprender.shapes.curves import Curves
from warprender.shapes.tubes import tubes


def line(n: int) -> np.ndarray:
    return np.stack([np.arange(n), np.zeros(n), np.zeros(n)], 1).astype(float)


def ring(n: int) -> np.ndarray:
    angle = 2 * np.pi * np.arange(n) / n
    return np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)


@pytest.mark.parametrize(
    ("basis", "wrap", "count", "ends"),
    [
        ("bezier", "nonperiodic", 7, (0, 6)),
        ("bspline", "nonperiodic", 6, (1, 4)),
        ("catmullRom", "nonperiodic", 6, (1, 4)),
        ("bspline", "pinned", 5, (0, 4)),
        ("catmullRom", "pinned", 5, (0, 4)),
    ],
)
def test_control_points_on_a_line_give_that_line_between_the_right_ends(basis, wrap, count, ends):
    at = Curves(np.array([count]), "cubic", basis, wrap).positions(line(count))
    assert (at[0, 0], at[-1, 0]) == pytest.approx(ends)
    assert (np.diff(at[:, 0]) > 0).all() and not at[:, 1:].any()


@pytest.mark.parametrize(("basis", "count"), [("bezier", 12), ("bspline", 8), ("catmullRom", 8)])
def test_periodic_curves_close(basis, count):
    curves = Curves(np.array([count]), "cubic", basis, "periodic")
    at = curves.positions(ring(count))
    steps = np.linalg.norm(np.diff(at, axis=0, append=at[:1]), axis=1)
    assert steps.max() < 3 * np.median(steps)
    radii = np.linalg.norm(at, axis=1)
    assert 0.8 < radii.min() and radii.max() < 1.01


def test_a_periodic_bezier_of_four_points_stays_open():
    curves = Curves(np.array([4]), "cubic", "bezier", "periodic")
    assert curves.positions(line(4))[[0, -1], 0].tolist() == [0, 3]


def test_linear_curves_pass_through_their_points():
    curves = Curves(np.array([3, 2]), "linear")
    points = np.random.default_rng(1).random((5, 3))
    np.testing.assert_array_equal(curves.positions(points), points)
    assert curves.curve.tolist() == [0, 0, 0, 1, 1]


def test_varying_values_are_linear_along_each_span():
    curves = Curves(np.array([7]), "cubic", "bezier")
    assert curves.varying_counts.tolist() == [3]
    values = curves.varying(np.array([[0.0], [1.0], [3.0]]))[:, 0]
    np.testing.assert_allclose(values, np.concatenate([np.arange(8) / 8, 1 + np.arange(9) / 4]))


def test_curves_too_short_for_a_span_draw_nothing():
    curves = Curves(np.array([3, 4, 0, 1]), "cubic", "bspline")
    assert curves.lengths.tolist() == [0, 9, 0, 0]


def volume(mesh) -> float:
    a, b, c = np.moveaxis(mesh.points[mesh.triangles].astype(float), 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def test_a_straight_tube_is_a_closed_cylinder():
    curves = Curves(np.array([2]), "linear")
    mesh, _ = tubes(curves, line(2) * 4, np.full(2, 1.0))
    assert volume(mesh) == pytest.approx(4 * 12 * np.sin(np.pi / 12) * 0.25, rel=1e-5)


def test_a_closed_tube_is_a_torus_without_a_seam():
    curves = Curves(np.array([64]), "cubic", "catmullRom", "periodic")
    tilted = ring(64) @ np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    mesh, _ = tubes(curves, tilted, np.full(len(curves.curve), 0.2))
    assert abs(volume(mesh)) == pytest.approx(2 * np.pi**2 * 0.01, rel=0.02)
    edges = np.linalg.norm(np.diff(mesh.points[mesh.triangles[:, [0, 1, 2, 0]]], axis=1), axis=2)
    assert edges.max() < 0.05


CURVES = """def BasisCurves "c" {
    uniform token type = "linear"
    int[] curveVertexCounts = [2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
    %s }"""


def test_prims_become_meshes_whose_faces_are_curves():
    colors = 'color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] ( interpolation = "uniform" )'
    mesh = scene_of(CURVES % f"float[] widths = [0.2]\n{colors}").meshes["/c"]
    assert set(mesh.faces.tolist()) == {0, 1}
    assert np.ptp(mesh.points[:, 2]) == pytest.approx(0.2, rel=0.1)
    assert len(mesh.primvars["displayColor"].values) == 2


def test_vertex_colours_follow_the_samples():
    colors = "[(0, 0, 0), (1, 0, 0), (0, 0, 0), (0.5, 0, 0), (1, 0, 0)]"
    body = f'float[] widths = [0.2]\ncolor3f[] primvars:displayColor = {colors} ( interpolation = "vertex" )'
    mesh = scene_of(CURVES % body).meshes["/c"]
    red = mesh.primvars["displayColor"].values[:, 0]
    second = np.unique(mesh.triangles[mesh.faces == 1])
    np.testing.assert_allclose(red[second], mesh.points[second, 0] / 2, atol=0.02)


def test_normals_make_ribbons_that_face_them():
    body = 'float[] widths = [0.2]\nnormal3f[] normals = [(0, 0, 1)] ( interpolation = "constant" )'
    mesh = scene_of(CURVES % body).meshes["/c"]
    assert len(mesh.triangles) == 2 * 3
    np.testing.assert_allclose(mesh.points[:, 2], 0)
    np.testing.assert_allclose(np.abs(mesh.normals.values[:, 2]), 1)


def test_hermite_curves_pass_their_points_along_their_tangents():
    scene = scene_of(
        """def HermiteCurves "h" { int[] curveVertexCounts = [2, 3]
            point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 5, 0), (1, 5, 0), (2, 5, 0)]
            vector3f[] tangents = [(0, 2, 0), (0, -2, 0), (1, 0, 0), (1, 0, 0), (1, 0, 0)]
            float[] widths = [0.02]
            color3f[] primvars:displayColor = [(0, 0, 0), (1, 0, 0), (0, 0, 0), (1, 0, 0), (0, 0, 0)] (
                interpolation = "vertex" ) }"""
    )
    mesh = scene.meshes["/h"]
    first = mesh.points[np.unique(mesh.triangles[mesh.faces == 0])]
    # In the middle of a Hermite curve the tangents' difference counts an eighth.
    assert first[:, 1].max() == pytest.approx(0.5 + 0.01, abs=1e-3)
    second = np.unique(mesh.triangles[mesh.faces == 1])
    np.testing.assert_allclose(mesh.points[second, 1], 5, atol=0.011)
    red = mesh.primvars["displayColor"].values[second, 0]
    np.testing.assert_allclose(red, 1 - np.abs(mesh.points[second, 0] - 1), atol=1e-5)
    assert not scene.warnings


def test_curves_without_widths_are_thin():
    assert np.ptp(scene_of(CURVES % "").meshes["/c"].points[:, 2]) < 0.01


def test_broken_counts_are_named():
    scene = scene_of(CURVES.replace("[2, 3]", "[2, 4]") % "")
    assert not scene.placements and scene.warnings[0].startswith("/c: curveVertexCounts")
