"""Rational B-spline patches are the surfaces that their knots, orders and weights make."""

import numpy as np
import pytest
from usd_stage import scene_of

from warprender.shapes.nurbs import basis, basis_slopes, parameters


@pytest.mark.parametrize("order", [2, 3, 4, 5])
def test_basis_functions_add_up_to_one_and_their_slopes_to_none(order):
    knots = np.sort(np.concatenate([np.zeros(order), np.ones(order), [0.2, 0.5, 0.5, 0.9]]))
    at = parameters(knots, order)
    np.testing.assert_allclose(basis(knots, order, at).sum(1), 1)
    np.testing.assert_allclose(basis_slopes(knots, order, at).sum(1), 0, atol=1e-9)


def test_slopes_are_derivatives():
    knots, order = np.array([0, 0, 0, 0, 1, 2.5, 3, 3, 3, 3]), 4
    at = np.linspace(0.05, 2.95, 40)
    difference = (basis(knots, order, at + 1e-6) - basis(knots, order, at - 1e-6)) / 2e-6
    np.testing.assert_allclose(basis_slopes(knots, order, at), difference, atol=1e-6)


QUARTER = """def NurbsPatch "n" {
    int uVertexCount = 3
    int vVertexCount = 2
    int uOrder = 3
    int vOrder = 2
    double[] uKnots = [0, 0, 0, 1, 1, 1]
    double[] vKnots = [0, 0, 1, 1]
    point3f[] points = [(1, 0, 0), (1, 1, 0), (0, 1, 0), (1, 0, 2), (1, 1, 2), (0, 1, 2)]
    double[] pointWeights = [1, 0.70710678118, 1, 1, 0.70710678118, 1]
    color3f[] primvars:displayColor = [(0, 0, 0), (0, 0, 0), (0, 0, 0), (1, 0, 0), (1, 0, 0), (1, 0, 0)] (
        interpolation = "vertex" )
    %s }"""


def test_a_rational_quadratic_patch_is_an_exact_cylinder():
    scene = scene_of(QUARTER % "")
    mesh = scene.meshes["/n"]
    radial = mesh.points[:, :2]
    np.testing.assert_allclose(np.linalg.norm(radial, axis=1), 1, atol=1e-6)
    normals = mesh.normals.values / np.linalg.norm(mesh.normals.values, axis=1, keepdims=True)
    np.testing.assert_allclose(normals[:, :2], radial, atol=1e-5)
    np.testing.assert_allclose(mesh.primvars["displayColor"].values[:, 0], mesh.points[:, 2] / 2, atol=1e-6)
    a, b, c = np.moveaxis(mesh.points[mesh.triangles], 1, 0)
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a)[:, :2], a[:, :2]) > 0).all()
    assert not scene.warnings


def test_a_trimmed_patch_is_drawn_whole_and_named():
    scene = scene_of(QUARTER % "int[] trimCurve:counts = [1]")
    assert scene.warnings == ["/n: its trim curves are not drawn"]
    assert len(scene.meshes["/n"].triangles) == len(scene_of(QUARTER % "").meshes["/n"].triangles)


def test_left_handed_patches_face_the_other_way():
    mesh = scene_of(QUARTER % 'uniform token orientation = "leftHanded"').meshes["/n"]
    assert (np.einsum("ij,ij->i", mesh.normals.values[:, :2], mesh.points[:, :2]) < 0).all()


@pytest.mark.parametrize(
    "change", [("uOrder = 3", "uOrder = 4"), ("[0, 0, 1, 1]", "[1, 1, 0, 0]"), ("uVertexCount = 3", "uVertexCount = 4")]
)
def test_patches_that_do_not_fit_are_named(change):
    scene = scene_of((QUARTER % "").replace(*change))
    assert not scene.placements and scene.warnings[0].startswith("/n: it is not drawn")


CIRCLE = """def NurbsCurves "c" {
    int[] curveVertexCounts = [3, 2]
    int[] order = [3, 2]
    double[] knots = [0, 0, 0, 1, 1, 1, 0, 0, 1, 1]
    point3f[] points = [(1, 0, 0), (1, 1, 0), (0, 1, 0), (5, 0, 0), (7, 0, 0)]
    double[] pointWeights = [1, 0.70710678118, 1, 1, 1]
    float[] widths = [0.02] ( interpolation = "constant" ) }"""


def test_a_rational_quadratic_curve_is_an_exact_arc():
    mesh = scene_of(CIRCLE).meshes["/c"]
    arc = mesh.points[np.unique(mesh.triangles[mesh.faces == 0])]
    distance = np.hypot(np.linalg.norm(arc[:, :2], axis=1) - 1, arc[:, 2])
    np.testing.assert_allclose(distance, 0.01, atol=1e-5)
    straight = mesh.points[np.unique(mesh.triangles[mesh.faces == 1])]
    assert (straight[:, 0].min(), straight[:, 0].max()) == (5, 7)


def test_curves_that_do_not_fit_are_named():
    scene = scene_of(CIRCLE.replace("[3, 2]\n    double", "[3, 4]\n    double"))
    assert not scene.placements and scene.warnings[0].startswith("/c: it is not drawn")
