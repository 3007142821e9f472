"""Subdivision surfaces agree with closed forms: splines on regular cages, creases, boundaries, primvars."""

import numpy as np
import pytest

from warprender.shapes import Primvar
from warprender.shapes.flat import CUBE_FACES, cube
from warprender.shapes.subdivision import Cage, Subdivision

INFINITE = 10.0


def grid(n: int = 8, **options) -> tuple[Cage, np.ndarray]:
    """A flat grid of n × n quads over [0, n]², its points (x, y, 0)."""
    y, x = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
    number = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    quads = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], 2).reshape(-1, 4)
    points = np.stack([x, y, 0 * x], 2).reshape(-1, 3).astype(float)
    return Cage(len(points), np.full(len(quads), 4), quads.reshape(-1), **options), points


def triangle_grid(n: int = 10, **options) -> tuple[Cage, np.ndarray]:
    """The quads of `grid` cut along one diagonal: six triangles at each inner vertex."""
    cage, points = grid(n)
    quads = cage.faceVertexIndices.reshape(-1, 4)
    triangles = quads[:, [0, 1, 2, 0, 2, 3]]
    return Cage(len(points), np.full(2 * len(quads), 3), triangles.reshape(-1), "loop", **options), points


def cube_cage(**options) -> Cage:
    return Cage(8, np.full(6, 4), np.reshape(CUBE_FACES, -1), **options)


def inside(points: np.ndarray, n: int, margin: int = 2) -> np.ndarray:
    return ((points[:, :2] > margin) & (points[:, :2] < n - margin)).all(1)


def vertex_normals(mesh) -> np.ndarray:
    normals = np.zeros((len(mesh.points), 3))
    normals[mesh.triangles] = mesh.normals.expanded()[mesh.corners]
    return normals


@pytest.mark.parametrize("level", [1, 2])
def test_catmull_clark_on_a_grid_is_the_bicubic_spline(level):
    cage, points = grid()
    points[:, 2] = points[:, 0] ** 2 - 0.5 * points[:, 0] * points[:, 1]
    mesh = Subdivision(cage, level).mesh(points)
    x, y, z = mesh.points[inside(mesh.points, 8)].astype(float).T
    # A cubic B-spline with the coefficients i² is x² + 1/3; the bilinear part is reproduced.
    np.testing.assert_allclose(z, x**2 + 1 / 3 - 0.5 * x * y, atol=1e-5)
    expected = np.stack([-(2 * x - 0.5 * y), 0.5 * x, np.ones_like(x)], 1)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(vertex_normals(mesh)[inside(mesh.points, 8)], expected, atol=1e-5)


def test_loop_on_a_regular_lattice_reproduces_quadratics():
    cage, points = triangle_grid()
    points[:, 2] = points[:, 0] ** 2 + points[:, 1]
    mesh = Subdivision(cage, 2).mesh(points)
    chosen = inside(mesh.points, 10)
    x, y, z = mesh.points[chosen].astype(float).T
    offset = z - (x**2 + y)
    np.testing.assert_allclose(offset, offset[0], atol=1e-5)
    expected = np.stack([-2 * x, -np.ones_like(x), np.ones_like(x)], 1)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(vertex_normals(mesh)[chosen], expected, atol=1e-5)


@pytest.mark.parametrize("sharpness", [0.0, 0.5, 1.0, 1.7])
def test_the_limit_does_not_depend_on_the_level(sharpness):
    creases = dict(
        creaseIndices=np.array([0, 1, 2, 3, 0]),
        creaseLengths=np.array([5]),
        creaseSharpnesses=np.array([sharpness]),
    )
    points = np.asarray(cube(2.0).points)
    two, three = (Subdivision(cube_cage(**creases), level).mesh(points) for level in (2, 3))
    np.testing.assert_allclose(two.points, three.points[: len(two.points)], atol=1e-6)
    np.testing.assert_allclose(vertex_normals(two), vertex_normals(three)[: len(two.points)], atol=1e-5)


def test_regular_and_extraordinary_limit_positions_are_the_known_masks():
    mesh = Subdivision(cube_cage(), 1).mesh(np.asarray(cube(2.0).points))
    # Valence 3: (3·9 v + 4·3 Σe... ) / 24 gives 1/2 for the corners of the cube of half-edge 1.
    np.testing.assert_allclose(np.abs(mesh.points[:8]), 0.5, atol=1e-6)


def test_a_cube_with_sharp_edges_stays_a_cube_with_its_normals():
    pairs = np.unique(np.sort([(f[k], f[(k + 1) % 4]) for f in CUBE_FACES for k in range(4)], axis=1), axis=0)
    cage = cube_cage(
        creaseIndices=pairs.reshape(-1), creaseLengths=np.full(12, 2), creaseSharpnesses=np.full(12, INFINITE)
    )
    mesh = Subdivision(cage, 2).mesh(np.asarray(cube(2.0).points))
    np.testing.assert_allclose(np.abs(mesh.points).max(1), 1.0, atol=1e-6)
    a, b, c = np.moveaxis(mesh.points[mesh.triangles].astype(float), 1, 0)
    flat = np.cross(b - a, c - a)
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    np.testing.assert_allclose(mesh.normals.expanded()[mesh.corners], np.repeat(flat[:, None], 3, 1), atol=1e-6)


def test_sharpness_one_is_one_sharp_level_and_a_half_is_the_mean():
    def first_level(sharpness: float) -> np.ndarray:
        ring = dict(creaseIndices=np.array([0, 1, 2, 3, 0]), creaseLengths=np.array([5]))
        cage = cube_cage(creaseSharpnesses=np.array([sharpness]), **ring)
        surface = Subdivision(cage, 1)
        return surface._rules[0].refine(np.asarray(cube(2.0).points, float))

    np.testing.assert_allclose(first_level(1.0), first_level(INFINITE))
    np.testing.assert_allclose(first_level(0.5), (first_level(0.0) + first_level(INFINITE)) / 2)


def test_crease_sharpness_may_be_given_for_each_edge():
    creases = dict(creaseIndices=np.array([0, 1, 2]), creaseLengths=np.array([3]))
    level = cube_cage(creaseSharpnesses=np.array([2.0, 3.0]), **creases).topology()
    assert sorted(level.edge_sharpness[level.edge_sharpness > 0]) == [2, 3]


def test_boundaries_follow_their_rule():
    meshes = {}
    for rule in ("none", "edgeOnly", "edgeAndCorner"):
        cage, points = grid(4, interpolateBoundary=rule)
        meshes[rule] = Subdivision(cage, 1).mesh(points)
    assert meshes["edgeAndCorner"].points[0].tolist() == [0, 0, 0]
    assert meshes["edgeOnly"].points[0, 0] > 0
    used = np.unique(meshes["none"].triangles)
    assert meshes["none"].points[used, 0].min() == 1 and meshes["none"].points[used, 0].max() == 3


def test_normals_at_a_boundary_are_those_of_the_surface():
    for cage, points in (grid(5), triangle_grid(5)):
        points = points @ np.array([[1, 0, 0.5], [0, 1, -0.25], [0, 0, 1]])
        mesh = Subdivision(cage, 1).mesh(points)
        expected = np.array([-0.5, 0.25, 1]) / np.linalg.norm([-0.5, 0.25, 1])
        np.testing.assert_allclose(vertex_normals(mesh), np.tile(expected, (len(mesh.points), 1)), atol=1e-6)


def test_bilinear_keeps_the_cage():
    mesh = Subdivision(cube_cage(subdivisionScheme="bilinear"), 2).mesh(np.asarray(cube(2.0).points))
    np.testing.assert_allclose(np.abs(mesh.points).max(1), 1)
    assert mesh.normals is None and len(mesh.triangles) == 6 * 4**2 * 2


def test_holes_are_not_drawn_but_shape_the_surface():
    points = np.asarray(cube(2.0).points)
    whole, cut = (Subdivision(cube_cage(holes=h), 1).mesh(points) for h in (np.zeros(0, int), np.array([2])))
    np.testing.assert_array_equal(whole.points, cut.points)
    assert set(cut.faces.tolist()) == {0, 1, 3, 4, 5}


def test_loop_refuses_quads():
    with pytest.raises(ValueError, match="triangles"):
        Subdivision(cube_cage(subdivisionScheme="loop"), 1)


def test_vertex_primvars_follow_the_points_and_varying_ones_the_cage():
    cage = cube_cage()
    points = np.asarray(cube(2.0).points)
    same = {"vertex": Primvar(points, "vertex"), "linear": Primvar(points, "varying")}
    surface = Subdivision(cage, 1)
    mesh = surface.mesh(points, same)
    refined = surface._rules[0].refine(points)
    np.testing.assert_allclose(mesh.primvars["vertex"].values, refined, atol=1e-6)
    np.testing.assert_allclose(np.abs(mesh.primvars["linear"].values).max(1), 1)


@pytest.mark.parametrize("rule", ["none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries", "all"])
def test_face_varying_values_of_a_flat_map_lie_on_the_map(rule):
    cage, points = grid(4, faceVaryingLinearInterpolation=rule)
    st = Primvar(points[:, :2], "faceVarying", cage.faceVertexIndices)
    mesh = Subdivision(cage, 2).mesh(points, {"st": st})
    values = mesh.primvars["st"].expanded()[mesh.corners].reshape(-1, 2)
    at = mesh.points[mesh.triangles].reshape(-1, 3)[:, :2]
    chosen = inside(at, 4, margin=1)
    np.testing.assert_allclose(values[chosen], at[chosen], atol=1e-5)


def test_a_face_varying_seam_keeps_its_sides_apart():
    cage, points = grid(4)
    right = cage.faceVertexIndices.reshape(-1, 4) % 5
    island = (right.max(1) > 2).astype(float)
    values = Primvar(island[:, None].repeat(4, 1).reshape(-1, 1), "faceVarying")
    mesh = Subdivision(cage, 2).mesh(points, {"side": values})
    centre = mesh.points[mesh.triangles].mean(1)[:, 0]
    sides = mesh.primvars["side"].expanded()[mesh.corners]
    np.testing.assert_allclose(sides[:, :, 0], np.tile((centre > 2)[:, None], 3), atol=1e-6)


def test_non_manifold_cages_do_not_fail():
    points = np.array([(0, 0, 0), (0, 1, 0), (1, 0, 0), (1, 1, 0), (-1, 0, 0), (-1, 1, 0), (0, 0, 1), (0, 1, 1)])
    faces = np.array([(0, 2, 3, 1), (0, 1, 5, 4), (0, 1, 7, 6), (0, 2, 3, 1), (6, 6, 6, 6)])
    mesh = Subdivision(Cage(8, np.full(5, 4), faces.reshape(-1)), 2).mesh(points.astype(float))
    assert np.isfinite(mesh.points).all() and np.isfinite(mesh.normals.values).all()
