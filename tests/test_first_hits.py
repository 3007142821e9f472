"""Rays, rasterizer and painter: who sees what first."""

import numpy as np
import pytest
import scenes
from first_hits import TOLERANCE, differing, edge_distance, first_hits

import warprender as wr
from warprender.plan import Request, analyse

SIZE = (96, 72)


def tilted(x, y, z, scale=1.0):
    """A pose matrix for row vectors: turned about (1, 2, 3), scaled, moved."""
    matrix = scenes.look_at((1.0, 2.0, 3.0))
    matrix[:3, :3] *= scale
    matrix[3, :3] = x, y, z
    return matrix


def ball(scene, path="/ball", level=3, **options):
    points, faces = scenes.icosphere(level)
    scene.add_mesh(path, points.astype(np.float32), faces, **options)
    return scene


def copies(scene):
    scene.add_instances(
        "/copies", "/ball", [tilted(2 * i - 5, j - 2, -3 * i - j, 0.7) for i in range(6) for j in range(5)]
    )
    return scene


def through_the_floor(scene):
    corners = np.array([(-50, -1, 5), (50, -1, 5), (50, -1, -900), (-50, -1, -900)], np.float32)
    scene.add_mesh("/floor", corners, [[0, 1, 2, 3]])
    return scene


def with_spheres(scene):
    for i in range(3):
        scene.add_sphere(f"/sphere{i}", 0.6, pose=tilted(2.0 * i - 2, 0.3, -2.0, 0.5 + 0.3 * i))
    return scene


def cubes(scene, place, scale=1.0):
    points, faces = scenes.cube()
    stretched = points * (1, 0.3, 2.0)
    for i in range(4):
        pose = tilted(1.2 * i * scale + place[0], 0.4 * i * scale + place[1], -i * scale + place[2], scale)
        scene.add_mesh(f"/cube{i}", stretched.astype(np.float32), faces, pose=pose)
    return scene


FAR = np.array((1e5, -2e5, 3e5))
STAGES = {
    "ball": (lambda: ball(wr.Scene()), scenes.camera((0.3, 0.4, 3.1))),
    "ball, orthographic": (lambda: ball(wr.Scene()), scenes.window(3.0, (1.0, 2.0, 5.0))),
    "from inside": (lambda: ball(wr.Scene()), scenes.camera((0.1, 0.2, 0.3), fov=100.0)),
    "copies": (lambda: copies(ball(wr.Scene())), scenes.camera((0.0, 1.0, 9.0), fov=60.0)),
    "through the floor": (lambda: through_the_floor(ball(wr.Scene())), scenes.camera((0.0, 0.2, 4.0), fov=70.0)),
    "spheres": (lambda: with_spheres(ball(wr.Scene())), scenes.camera((0.0, 0.5, 4.0), fov=60.0)),
    "small": (
        lambda: cubes(wr.Scene(), (0, 0, 0), 1e-3),
        scenes.camera((0.002, 0.003, 0.006), clippingRange=(1e-6, 1)),
    ),
    "large": (lambda: cubes(wr.Scene(), (0, 0, 0), 1e4), scenes.camera((2e4, 3e4, 6e4), clippingRange=(1.0, 1e7))),
    "far away": (lambda: cubes(wr.Scene(), FAR), scenes.camera(FAR + (2, 3, 6), FAR)),
    "cut by near and far": (
        lambda: copies(ball(wr.Scene())),
        scenes.camera((0, 1, 6), fov=60.0, clippingRange=(5.3, 14.0)),
    ),
    "cut, orthographic": (
        lambda: with_spheres(copies(ball(wr.Scene()))),
        scenes.window(6.0, (0.0, 1.0, 6.0), clippingRange=(5.3, 14.0)),
    ),
    "shifted window": (
        lambda: ball(wr.Scene()),
        scenes.camera((0.3, 0.4, 3.1), horizontalApertureOffset=5.0, verticalApertureOffset=-7.0),
    ),
}


@pytest.mark.parametrize("name", STAGES)
def test_raster_and_rays_see_the_same(name):
    build, camera = STAGES[name]
    _, by_rays = first_hits(build(), camera, "rays", SIZE)
    renderer, by_raster = first_hits(build(), camera, "raster", SIZE)
    assert (by_rays["instance"] >= 0).mean() > 0.02
    differs = differing(by_rays, by_raster)
    for y, x in np.argwhere(differs):
        hits = [h for h in (by_rays[y, x], by_raster[y, x]) if h["instance"] >= 0]
        cut = min(abs(h["t"]) for h in hits) < 1e-3 or len(hits) == 1
        assert min(edge_distance(renderer, h, x, y) for h in hits) < TOLERANCE or cut
    assert differs.mean() < 0.01
    same = ~differs & (by_rays["instance"] >= 0)
    scale = by_rays["t"][same].max()
    np.testing.assert_allclose(by_raster["t"][same], by_rays["t"][same], rtol=1e-5, atol=1e-5 * scale)
    np.testing.assert_allclose(by_raster["u"][same], by_rays["u"][same], atol=2e-3)
    np.testing.assert_allclose(by_raster["v"][same], by_rays["v"][same], atol=2e-3)


def test_clear_surfaces_are_looked_through():
    scene = ball(wr.Scene())
    points, faces = scenes.quad(4.0, 2.0)
    clear = wr.DisplayColor((0.5, 0.5, 0.5), opacity=0.0)
    scene.add_mesh("/window", points.astype(np.float32), faces, material=clear)
    camera = scenes.camera((0, 0, 5))
    seen = [
        wr.Renderer(scene, camera, SIZE, ("primId",), visibility=v).render().numpy("primId") for v in ("rays", "raster")
    ]
    np.testing.assert_array_equal(*seen)
    assert set(np.unique(seen[1])) == {-1, 0}


# ---------------------------------------------------------------- the painter


def bars():
    """Three bars, each before the next one and behind the one before it, seen from +Z; and which is nearest where."""
    scene = wr.Scene()
    centre = (np.arange(64) + 0.5) / 64 * 3.6 - 1.8
    x, y = np.meshgrid(centre, -centre)
    nearest, height = np.full((64, 64), -1), np.full((64, 64), -np.inf)
    for turn in range(3):
        c, s = np.cos(2 * np.pi / 3 * turn), np.sin(2 * np.pi / 3 * turn)
        bar = np.array([[-1.4, -0.8, 0.5], [1.4, -0.8, -0.5], [1.4, -0.4, -0.5], [-1.4, -0.4, 0.5]])
        bar = bar @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        scene.add_mesh(f"/bar{turn}", bar.astype(np.float32), [[0, 1, 2, 3]])
        z = -(c * x + s * y) * 0.5 / 1.4
        here = (np.abs(c * x + s * y) < 1.4) & (np.abs(c * y - s * x + 0.6) < 0.2) & (z > height)
        nearest[here], height[here] = turn, z[here]
    return scene, scenes.window(3.6), nearest


def test_the_painter_gets_a_cycle_wrong_and_the_depth_buffer_right():
    scene, camera, nearest = bars()
    wrong = {}
    for visibility in ("painter", "raster", "rays"):
        frame = wr.Renderer(scene, camera, (64, 64), ("primId",), visibility=visibility).render()
        wrong[visibility] = int((frame.numpy("primId") != nearest).sum())
        assert ((frame.numpy("primId") >= 0) == (nearest >= 0)).all()
    assert wrong["raster"] == wrong["rays"] == 0
    assert wrong["painter"] > 10


def test_the_painter_is_right_where_triangles_can_be_sorted():
    scene = wr.Scene()
    for i in (2, 0, 3, 1):
        points, faces = scenes.quad(1.0 + 0.3 * i, -float(i))
        scene.add_mesh(f"/quad{i}", (points + (0.2 * i, 0, 0)).astype(np.float32), faces)
    camera = scenes.camera((0, 0, 4))
    seen = [
        wr.Renderer(scene, camera, SIZE, ("primId",), visibility=v).render().numpy("primId")
        for v in ("raster", "painter")
    ]
    np.testing.assert_array_equal(*seen)


# ---------------------------------------------------------------- the plan


def plan_of(scene, camera, visibility="auto", outputs=("primId",), pixels=960 * 540):
    return analyse(scene, camera, Request(outputs, visibility), pixels=pixels)


def test_auto_takes_what_should_be_quicker_and_says_why():
    scene, camera = ball(wr.Scene()), scenes.camera((0, 0, 4))
    many = plan_of(scene, camera)
    assert many.visibility == "raster"
    assert "1280 triangles, 518400 pixels" in many.reasons["visibility raster"]
    assert plan_of(scene, camera, pixels=100).visibility == "rays"
    color = analyse(scene, camera, Request(), camera_light=True)
    assert color.color_visibility == "rays" and color.reasons["color by rays"] == "paths are made of rays"


def test_auto_leaves_clipping_planes_to_rays():
    camera = scenes.camera((0, 0, 4), clippingPlanes=((1.0, 0.0, 0.0, 0.0),))
    plan = plan_of(ball(wr.Scene()), camera)
    assert plan.visibility == "rays" and "clippingPlanes" in plan.reasons["visibility rays"]
    with pytest.raises(wr.SceneError, match="clippingPlanes"):
        plan_of(ball(wr.Scene()), camera, "raster")


def test_the_painter_draws_no_spheres():
    with pytest.raises(wr.SceneError, match="/sphere0 is a sphere"):
        plan_of(with_spheres(wr.Scene()), scenes.camera((0, 0, 4)), "painter")
