"""Normals of meshes whose points are written: closed forms, and the bits of a renderer that is made anew."""

import numpy as np
import pytest
import scenes
import warp as wp
from usd_stage import stage_of

import warprender as wr
from warprender.shapes import Primvar

OUTPUTS = ("cameraDepth", "normal", "position", "primId", "instanceId", "elementId")
STRETCH = np.array([[1.5, 0.2, 0.0], [0.0, 0.7, 0.0], [0.1, 0.0, 1.1]])


def seen(scene, renderer=None, size=48):
    if renderer is None:
        renderer = wr.Renderer(scene, scenes.camera((0.3, -2, 7)), (size, size), outputs=OUTPUTS, transport="none")
    frame = renderer.render()
    return {name: frame.numpy(name).copy() for name in OUTPUTS}, renderer


def assert_same(one, other):
    for name in OUTPUTS:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)


def sphere(level=3):
    points, faces = scenes.icosphere(level)
    return points.astype(np.float32), faces


def mesh_of(points, faces, normals):
    scene = wr.Scene()
    mesh = scene.add_mesh("/m", wp.array(np.asarray(points, np.float32), dtype=wp.vec3), faces, normals=normals)
    return scene, mesh


def corner_normals(renderer):
    """(T, 3, 3) normals at the corners of the triangles, as they are on the device."""
    record = renderer._live.upload.parts[0].record
    normals = record.normals.values.numpy().reshape(-1, 3)
    corners = record.normals.indices if record.normals.interpolation == 3 else record.indices
    return normals[corners.numpy()].reshape(-1, 3, 3)


def degrees(a, b):
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(-1)))


# ---------------------------------------------------------------- closed forms


@pytest.mark.parametrize(("authored", "bounds"), [(True, (0.45, 0.12)), (False, (1.0, 0.4))])
def test_a_sphere_that_becomes_an_ellipsoid_has_its_normals(authored, bounds):
    for level, bound in zip((3, 4), bounds, strict=True):
        points, faces = sphere(level)
        scene, mesh = mesh_of(points, faces, points if authored else "smooth")
        _, renderer = seen(scene)
        np.testing.assert_allclose(corner_normals(renderer), points[faces], atol=1e-6)
        mesh.points.assign((points @ STRETCH).astype(np.float32))
        renderer.update()
        exact = points @ np.linalg.inv(STRETCH).T
        assert degrees(corner_normals(renderer), exact[faces]).max() < bound
        # On the ellipsoid x Q x = 1 the normal is Q x; between vertices it is interpolated, which is as exact.
        shown, _ = seen(scene, renderer)
        inverse = np.linalg.inv(STRETCH)
        on = shown["primId"] == 0
        gradient = shown["position"][on] @ (inverse @ inverse.T)
        assert on.sum() > 100
        facing = degrees(shown["normal"][on], gradient)
        assert np.median(facing) < bound / 2 and np.quantile(facing, 0.99) < 2 * bound


@pytest.mark.parametrize("interpolation", ["vertex", "faceVarying", "uniform"])
def test_normals_of_any_kind_turn_with_a_rigid_body(interpolation):
    rng = np.random.default_rng(3)
    points, faces = scenes.cube()
    scene, mesh = mesh_of(points, faces, None)
    count = {"vertex": 8, "faceVarying": 24, "uniform": 6}[interpolation]
    authored = rng.normal(size=(count, 3)).astype(np.float32)
    mesh.normals = Primvar(authored, interpolation)
    _, renderer = seen(scene)
    before = corner_normals(renderer).copy()
    turn = scenes.look_at((1.0, 2.0, 3.0))[:3, :3]
    mesh.points.assign((points @ turn * 0.3 + (2, -1, 0.5)).astype(np.float32))
    renderer.update()
    np.testing.assert_allclose(corner_normals(renderer), before @ turn, atol=2e-6 * np.abs(before).max())


def test_a_triangle_carries_its_normals_as_a_covector():
    # Stretched by 3 and 0.5 in its plane, and by the root of 1.5 across: normals go by the inverse transposed.
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], np.float32)
    authored = np.float32([(0.3, 0.2, 1.0), (-0.5, 0.1, 0.8), (0.0, 0.6, 0.5)])
    scene, mesh = mesh_of(points, [[0, 1, 2]], authored)
    _, renderer = seen(scene)
    shear = np.array([[3.0, 0.0, 0.0], [0.7, 0.5, 0.0], [0.0, 0.0, np.sqrt(1.5)]])
    mesh.points.assign((points @ shear).astype(np.float32))
    renderer.update()
    exact = authored @ np.linalg.inv(shear).T
    assert degrees(corner_normals(renderer)[0], exact).max() < 2e-5


def test_a_flat_sheet_that_is_bent_is_as_smooth_as_the_cylinder():
    # 60 by 2 quads about a cylinder of radius 1; the mean over a vertex of facets that lie alike is its own normal.
    across, along = np.meshgrid(np.linspace(-1, 1, 61), (-1.0, 0.0, 1.0), indexing="ij")
    points = np.stack([across, along, 0 * across], -1).reshape(-1, 3)
    number = np.arange(points.shape[0]).reshape(61, 3)
    faces = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], -1).reshape(-1, 4)
    up = np.tile(np.float32([0, 0, 1]), (len(points), 1))
    scene, mesh = mesh_of(points, faces, up)
    _, renderer = seen(scene)
    angle = points[:, 0]
    bent = np.stack([np.sin(angle), points[:, 1], np.cos(angle) - 1], 1)
    mesh.points.assign(bent.astype(np.float32))
    renderer.update()
    exact = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], 1)
    ends = np.abs(angle) > 0.99
    error = np.zeros(len(points))
    np.maximum.at(error, mesh.triangles, degrees(corner_normals(renderer), exact[mesh.triangles]))
    # At the two ends, where there are facets on one side alone, half a facet's angle is missing.
    step = np.degrees(2 / 60)
    assert error[~ends].max() < 0.01 * step and error[ends].max() < 0.51 * step


# ---------------------------------------------------------------- the rules


def test_at_rest_authored_normals_are_the_same_bits():
    points, faces = sphere()
    rng = np.random.default_rng(1)
    authored = (points * rng.uniform(0.5, 2.0, (len(points), 1))).astype(np.float32)
    scene = wr.Scene()
    scene.add_mesh("/m", points, faces, normals=authored)
    first, renderer = seen(scene)
    scene.meshes["/m"].points.assign(points @ STRETCH.astype(np.float32))
    renderer.update()
    moved, _ = seen(scene, renderer)
    assert (moved["normal"] != first["normal"]).any()
    assert_same(moved, seen(scene)[0])
    scene.meshes["/m"].points.assign(points)
    renderer.update()
    assert_same(seen(scene, renderer)[0], first)
    assert_same(seen(scene)[0], first)


@pytest.mark.parametrize("authored", [True, False])
def test_a_new_renderer_shows_the_same_bits(authored):
    points, faces = sphere()
    scene, mesh = mesh_of(points, faces, points if authored else "smooth")
    _, renderer = seen(scene)
    for step in (1.0, 2.0):
        mesh.points.assign((points * (1 + 0.2 * np.sin(5 * points[:, :1] + step))).astype(np.float32))
        renderer.update()
    assert_same(seen(scene, renderer)[0], seen(scene)[0])


def test_normals_may_stay_and_may_be_written():
    points, faces = sphere()
    bent = (points @ STRETCH).astype(np.float32)
    fixed, mesh = mesh_of(points, faces, points)
    mesh.normals_follow = False
    _, renderer = seen(fixed)
    mesh.points.assign(bent)
    renderer.update()
    still = wr.Scene()
    still.add_mesh("/m", bent, faces, normals=points)
    expected = seen(still)[0]
    assert_same(seen(fixed, renderer)[0], expected)
    mesh.normals_follow = True
    renderer.update()
    assert (seen(fixed, renderer)[0]["normal"] != expected["normal"]).any()

    own = wp.array(-points, dtype=wp.vec3)
    written, mesh = mesh_of(bent, faces, own)
    _, renderer = seen(written)
    own.assign(points)
    assert_same(seen(written, renderer)[0], expected)
    mesh.normals = None
    renderer.update()
    flat = wr.Scene()
    flat.add_mesh("/m", bent, faces)
    assert_same(seen(written, renderer)[0], seen(flat)[0])


def test_hard_edges_stay_hard_and_seams_stay_smooth():
    # Two quads that meet at x = 0 twice over: points 1, 2 and 4, 7 are at the same places.
    points = np.float32([(-1, 0, 0), (0, 0, 0), (0, 1, 0), (-1, 1, 0), (0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    faces = [[0, 1, 2, 3], [4, 5, 6, 7]]
    folded = points + np.float32([(0, 0, abs(p[0])) for p in points])
    for right, between in (((0, 0, 1), 0.0), ((0, 0, 2), 90.0)):
        normals = np.float32([(0, 0, 1)] * 4 + [right] * 4)
        scene, mesh = mesh_of(points, faces, normals)
        _, renderer = seen(scene)
        mesh.points.assign(folded)
        renderer.update()
        at = corner_normals(renderer).reshape(-1, 3)
        owner = mesh.triangles.reshape(-1)
        assert degrees(at[owner == 1][0], at[owner == 4][0]) == pytest.approx(between, abs=1e-3)


def test_a_mesh_of_a_stage_with_authored_normals_is_followed():
    stage = stage_of(
        """
        def Mesh "m" {
            int[] faceVertexCounts = [4]
            int[] faceVertexIndices = [0, 1, 2, 3]
            point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
            normal3f[] normals = [(0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1)] (interpolation = "faceVarying")
            uniform token subdivisionScheme = "none"
        }
        """
    )
    scene = wr.load(stage)
    first, renderer = seen(scene)
    points = scene.meshes["/m"].points
    points.assign(points.numpy() @ np.float32([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]]))
    renderer.update()
    after = seen(scene, renderer)[0]
    on = after["primId"] == 0
    assert on.sum() > 50 and (first["primId"] == 0).sum() > 50
    np.testing.assert_allclose(after["normal"][on], np.broadcast_to([-0.6, 0, 0.8], (on.sum(), 3)), atol=1e-6)


# ---------------------------------------------------------------- bad input


@pytest.mark.parametrize("authored", [True, False])
def test_bad_points_leave_the_other_normals_alone(authored):
    points, faces = sphere(2)
    scene, mesh = mesh_of(points, faces, points if authored else "smooth")
    _, renderer = seen(scene)
    bad = points.copy()
    bad[5] = np.nan
    bad[faces[(faces == 40).any(1)][0]] = points[40]  # a triangle without an area
    mesh.points.assign(bad)
    renderer.update()
    normals = corner_normals(renderer)
    touched = np.isin(faces, [5, *faces[(faces == 40).any(1)].reshape(-1)]).any(1)
    touched |= np.isin(faces, faces[touched]).any(1)
    assert np.isfinite(normals).all() and 0 < touched.sum() < len(faces) / 2
    np.testing.assert_allclose(normals[~touched], points[faces][~touched], atol=1e-6)
    mesh.points.assign(points)
    renderer.update()
    np.testing.assert_allclose(corner_normals(renderer), points[faces], atol=1e-6)


@pytest.mark.parametrize("scale", [1e-18, 1e-6, 1e6, 1e15])
def test_normals_know_no_scale(scale):
    points, faces = sphere(2)
    for normals in (points, "smooth"):
        scene, mesh = mesh_of(points * scale, faces, normals)
        _, renderer = seen(scene)
        mesh.points.assign((points @ (STRETCH * scale)).astype(np.float32))
        renderer.update()
        exact = points @ np.linalg.inv(STRETCH).T
        assert degrees(corner_normals(renderer), exact[faces]).max() < 4.0


@pytest.mark.parametrize("normals", ["soft", wp.zeros(3, dtype=wp.vec3), wp.zeros(12, dtype=float)])
def test_bad_normals_are_one_line_that_names_the_prim(normals):
    scene, _ = mesh_of(*sphere(0), normals)
    with pytest.raises(wr.SceneError, match=r"^/m: its normals"):
        seen(scene)
