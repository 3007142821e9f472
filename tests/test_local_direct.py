"""Transports "local" and "direct": every light by its closed form, shadows, clear surfaces, many lights."""

from dataclasses import replace

import numpy as np
import pytest
import scenes
from pictures import mean_and_error, picture
from test_specialised import BUILDERS

import warprender as wr
from warprender.plan import everything

TRANSPORTS = ("local", "direct")
TILT = np.radians(60)
SUN = wr.DistantLight(intensity=3.0, angle=0.0, direction=(0.0, np.sin(TILT), -np.cos(TILT)))


def floor(color=(0.5, 0.25, 1.0), **options):
    """A quad in the XY plane, and an orthographic camera above that sees it alone."""
    scene = wr.Scene()
    scene.add_mesh("/floor", *scenes.quad(4.0), color=color, **options)
    return scene, scenes.window(2.0)


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_a_lambert_surface_under_the_sun(transport):
    scene, view = floor()
    scene.add_light(SUN)
    color, _ = picture(scene, view, 8, 16, transport=transport)
    expected = np.array([0.5, 0.25, 1.0]) / np.pi * 3.0 * 0.5
    np.testing.assert_allclose(color[..., :3], np.broadcast_to(expected, (8, 8, 3)), rtol=2e-6)
    assert (color[..., 3] == 1.0).all()


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_lights_add_up_one_by_one(transport):
    """Two suns and a dome: no light is left to chance, and the dome of one colour has no variance on Lambert."""
    scene, view = floor()
    scene.add_light(SUN)
    scene.add_light(wr.DistantLight(intensity=1.0, angle=0.0))
    scene.add_light(wr.DomeLight(intensity=0.7))
    color, _ = picture(scene, view, 8, 4, transport=transport)
    expected = np.array([0.5, 0.25, 1.0]) * (1.5 / np.pi + 1.0 / np.pi + 0.7)
    np.testing.assert_allclose(color[..., :3], np.broadcast_to(expected, (8, 8, 3)), rtol=5e-6)


@pytest.mark.parametrize("many", [3, 40])
@pytest.mark.parametrize("transport", TRANSPORTS)
def test_few_lights_and_many_have_the_same_sum(transport, many):
    """The mean over the floor against the same lights met by path tracing without bounces; 4.5 standard errors."""
    scene, view = floor((0.6,) * 3)
    random = np.random.default_rng(3)
    for _ in range(many):
        place = (*random.uniform(-2, 2, 2), random.uniform(0.5, 2))
        scene.add_light(wr.SphereLight(radius=0.1, intensity=random.uniform(1, 5)), pose=scenes.look_at(place))
    scene.add_light(wr.DomeLight(intensity=0.2))
    scene.add_light(SUN)
    value, error = mean_and_error(*picture(scene, view, 16, 64, transport=transport))
    expected, spread = mean_and_error(*picture(scene, view, 16, 64, bounces=0, transport="path", seed=1))
    assert abs(value - expected) < 4.5 * np.hypot(error, spread)
    assert error < 0.02 * value


def test_direct_is_path_tracing_without_bounces():
    """Pixel by pixel, on a box whose shadow is soft; z is a standard normal number of 32 × 32 pixels."""
    scene, view = BUILDERS[0]()
    a, a_error = picture(scene, view, 32, 256, transport="direct")
    b, b_error = picture(scene, view, 32, 256, transport="path", bounces=0, seed=1)
    spread = np.hypot(a_error, b_error).mean(-1)
    lit = spread > 0
    z = (a - b)[..., :3].mean(-1)[lit] / spread[lit]
    assert abs(z.mean()) < 4.5 / np.sqrt(z.size)
    assert abs(z.std() - 1.0) < 0.15
    assert np.abs(z).max() < 5.0


def test_local_ignores_what_is_in_the_way():
    scene, view = floor((1.0,) * 3)
    scene.add_light(wr.DistantLight(intensity=np.pi, angle=0.0))
    scene.add_mesh("/roof", *scenes.quad(4.0, 10.0), color=(0.0,) * 3)
    local, _ = picture(scene, view, 8, 4, transport="local")
    direct, _ = picture(scene, view, 8, 4, transport="direct")
    np.testing.assert_allclose(local[..., :3], 1.0, rtol=2e-6)
    np.testing.assert_array_equal(direct[..., :3], 0.0)


def test_a_rect_light_over_an_edge_has_the_penumbra_of_similar_triangles():
    """A lamp of width w at height H, an edge at height h: the penumbra is w h / (H - h) wide, lit to its share."""
    width, high, low = 0.4, 4.0, 1.0
    scene, _ = floor((1.0,) * 3)
    lamp = wr.RectLight(width=width, height=width, intensity=10.0)
    scene.add_light(lamp, pose=scenes.look_at((0, 0, high), (0, 0, 0)))
    half_plane = np.array([(-9, -9, low), (0, -9, low), (0, 9, low), (-9, 9, low)])
    scene.add_mesh("/edge", half_plane, [[0, 1, 2, 3]], color=(0.0,) * 3)
    half = width / 2 * low / (high - low)
    # A row of pixels below the edge, seen past it from the lit side, 1/40 of the penumbra each.
    view = scenes.window(2 * half * 1.5, eye=(0, 0, 0.5), target=(0, 0, 0))
    view = replace(view, verticalAperture=view.verticalAperture / 60)
    color, error = picture(scene, view, (60, 1), 1024, transport="direct")
    x = ((np.arange(60) + 0.5) / 60 - 0.5) * 3 * half
    bare, _ = picture(scene, view, (60, 1), 1024, transport="local")
    share, spread = (color / bare)[0, :, 0], (error / bare[..., :3])[0, :, 0]
    umbra, full = x < -half * 1.02, x > half * 1.02
    np.testing.assert_array_equal(share[umbra], 0.0)
    np.testing.assert_allclose(share[full], 1.0, atol=2e-3)
    # Across the penumbra the lamp that is in sight grows in proportion: the cosines differ by less than 1 %.
    inside = np.abs(x) < half
    expected = 0.5 + x[inside] / (2 * half)
    assert (np.abs(share[inside] - expected) < 4.5 * spread[inside] + 0.01).all()


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_clear_layers_are_laid_over_each_other_without_noise(transport):
    """Three layers of opacity 1/2, 1/4 and 1, as their albedos under the camera light."""
    scene = wr.Scene()
    for height, opacity, color in ((0.2, 0.5, 0.8), (0.1, 0.25, 0.4), (0.0, 1.0, 0.6)):
        material = wr.DisplayColor((color,) * 3, opacity)
        scene.add_mesh(f"/at{opacity}", *scenes.quad(4.0, height), material=material)
    view = scenes.window(0.01, eye=(0, 0, 1000))
    scene.add_light(wr.DistantLight(intensity=np.pi, angle=0.0))
    color, _ = picture(scene, view, 4, 2, transport=transport)
    shadowed = 1.0 if transport == "local" else 0.5, 1.0 if transport == "local" else 0.375
    expected = 0.5 * 0.8 + 0.5 * 0.25 * 0.4 * shadowed[0] + 0.375 * 0.6 * shadowed[1]
    np.testing.assert_allclose(color[..., :3], expected, rtol=5e-6)
    np.testing.assert_array_equal(color[..., 3], 1.0)


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_emission_is_seen_and_lights_other_surfaces(transport):
    """A lamp that is geometry: what it emits, and its form factor on the floor below (discs of equal axis)."""
    scene, view = floor((1.0,) * 3)
    angle = np.linspace(0, 2 * np.pi, 256, endpoint=False)
    rim = np.stack([np.cos(angle), -np.sin(angle), np.full_like(angle, 2.0)], 1)
    lamp = wr.PreviewSurface(emissiveColor=(2.0, 2.0, 2.0), diffuseColor=(0,) * 3, metallic=1.0)
    scene.add_mesh("/lamp", rim, [list(range(256))], material=lamp)
    view = scenes.window(0.01, eye=(0, 0, 1))
    color, error = picture(scene, view, 8, 256, transport=transport, camera_light="off")
    value, spread = mean_and_error(color, error)
    area = 128 * np.sin(2 * np.pi / 256) / np.pi
    assert abs(value - 2.0 * area / (4.0 + area)) < 4.5 * spread + 1e-4
    assert spread < 2e-3
    up = scenes.window(0.01, eye=(0, 0, 1), target=(0, 0, 2))
    np.testing.assert_allclose(
        picture(scene, up, 4, 2, transport=transport, camera_light="off")[0][..., :3], 2.0, rtol=1e-6
    )


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_perfect_mirrors_reflect_no_light(transport):
    mirror = wr.PreviewSurface(metallic=1.0, roughness=0.0, diffuseColor=(1.0,) * 3)
    scene = wr.Scene()
    scene.add_mesh("/floor", *scenes.quad(4.0), material=mirror)
    scene.add_light(wr.DomeLight())
    scene.add_light(wr.DistantLight(angle=10.0))
    color, _ = picture(scene, scenes.window(2.0), 4, 16, transport=transport)
    np.testing.assert_array_equal(color[..., :3], 0.0)


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_a_plans_own_kernel_is_the_one_with_every_effect(transport):
    scene, view = BUILDERS[2]()
    renderer = wr.Renderer(scene, view, (32, 32), transport=transport, threads=1)
    own = renderer.render(samples=8)
    renderer.plan.path, renderer.threads = everything(), 2
    general = renderer.render(samples=8)
    np.testing.assert_array_equal(own.numpy("color"), general.numpy("color"))
    assert own.stats["rays"] == general.stats["rays"]
    assert (own.stats["rays"]["shadow"] == 0) == (transport == "local")
    assert own.stats["rays"]["bounce"] == 0


# ---------------------------------------------------------------- the plan


def plan_of(scene, **options):
    return wr.Renderer(scene, scenes.window(2.0), (8, 8), **options).plan


def test_auto_takes_the_cheapest_that_leaves_out_nothing():
    scene, _ = floor()
    assert plan_of(scene).transport == "path"
    assert plan_of(scene, camera_light="off").transport == "local"
    assert plan_of(scene, outputs=("normal",)).transport == "none"
    glowing = wr.Scene()
    black = wr.PreviewSurface(emissiveColor=(1.0,) * 3, diffuseColor=(0,) * 3, metallic=1.0)
    glowing.add_mesh("/lamp", *scenes.quad(4.0), material=black)
    plan = plan_of(glowing)
    assert plan.transport == "local" and plan.reasons["transport local"] == "nothing reflects light"
    assert plan.bounds == {"bounces": 0}
    assert plan_of(glowing, energy_compensation=True).transport == "local"


def test_bounces_of_transports_that_follow_none_are_an_error():
    scene, _ = floor()
    for transport in TRANSPORTS:
        assert plan_of(scene, transport=transport, bounces=0).bounds == {"bounces": 0}
        with pytest.raises(wr.SceneError, match=f"'{transport}' follows none"):
            plan_of(scene, transport=transport, bounces=2)
