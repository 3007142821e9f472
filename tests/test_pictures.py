"""Whole pictures against closed forms and against each other."""

from pathlib import Path

import numpy as np
import pytest
import scenes
from chance import SIGMAS, polygon_irradiance
from pictures import mean_and_error, picture, prepare

import warprender as wr
from warprender.shapes import Primvar

#: In `shared`, beside the repository or above it.
ASSETS = [p / "shared" / "usd_assets" / "lux_analytic" for p in Path(__file__).parents]
ASSETS = next((path for path in ASSETS if path.exists()), None)


def floor(scene, albedo=0.5, size=20.0, **look):
    """A Lambert floor in the plane y = 0, facing up."""
    s = size / 2
    color = None if "material" in look else (albedo,) * 3
    return scene.add_mesh(
        "/floor", np.array([(-s, 0, s), (s, 0, s), (s, 0, -s), (-s, 0, -s)]), [[0, 1, 2, 3]], color=color, **look
    )


def above(size=0.01, at=(0.0, 0.0, 0.0)):
    """Straight down at a small square of the floor."""
    at = np.asarray(at, float)
    return scenes.window(size, at + (0, 1.0, 0), at, up=(0, 0, -1))


def facing_down(x=0.0, y=1.0, z=0.0):
    return scenes.look_at((x, y, z), (x, y - 1, z), up=(0, 0, -1))


def assert_mean(color, error, expected, tolerance=3e-3):
    """The mean agrees within its standard error, which must itself be small for the test to say something."""
    mean, sigma = mean_and_error(color, error)
    assert abs(mean - expected) < SIGMAS * sigma + 1e-5 * abs(expected), (mean, expected, sigma)
    assert sigma < tolerance * abs(expected)


LUX = {"disk_unnormalized": 0.246575, "rect_normalized": 0.228879, "sphere_exposure": 0.078125}
LUX |= {"distant_normalized": 0.477465, "dome_constant": 0.4}


@pytest.mark.skipif(ASSETS is None, reason="../shared/usd_assets is not here")
@pytest.mark.parametrize("name", LUX)
def test_lux_analytic(name):
    scene = wr.load(str(ASSETS / f"{name}.usda"))
    renderer = prepare(scene, None, (33, 33))
    color = renderer.render(samples=512).numpy("color")[15:18, 15:18]
    mean, sigma = mean_and_error(color.astype(float), renderer.standard_error()[15:18, 15:18])
    assert sigma < 2e-3 * LUX[name]
    assert abs(mean / LUX[name] - 1) < 0.01


CORNERS = np.array([(-0.5, -0.4, 0), (0.5, -0.4, 0), (0.5, 0.4, 0), (-0.5, 0.4, 0)])


def test_a_light_and_a_glowing_mesh_of_its_shape_are_alike():
    # The mesh is found by scattered rays alone, the light by aiming at it as well: one irradiance by two estimators.
    place = facing_down(0.3)
    expected = (
        0.5
        / np.pi
        * 2.0
        * polygon_irradiance(np.zeros(3), np.array([0, 1.0, 0]), CORNERS @ place[:3, :3] + place[3, :3])
    )
    lamp = wr.Scene()
    floor(lamp)
    lamp.add_light(wr.RectLight(width=1.0, height=0.8, intensity=2.0), pose=place)
    assert_mean(*picture(lamp, above(), 16, 256), expected)
    glow = wr.Scene()
    floor(glow)
    black = wr.PreviewSurface(emissiveColor=(2.0,) * 3, diffuseColor=(0, 0, 0), useSpecularWorkflow=1)
    glow.add_mesh("/lamp", CORNERS, [[0, 1, 2, 3]], material=black, pose=place)
    view = scenes.window(0.01, (0.9, 0.5, 0.0))
    assert_mean(*picture(glow, view, 16, 1024, bounces=0, camera_light="off"), expected, 6e-3)


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.7])
def test_gloss_sees_a_light_as_it_sees_a_glowing_mesh(roughness):
    # Sharp highlights come from scattered rays, broad ones from aimed ones; the weights must share them out.
    pictures = []
    place = scenes.look_at((0, 1.0, -1.0))
    for kind in ("light", "mesh"):
        scene = wr.Scene()
        floor(scene, material=wr.PreviewSurface(metallic=1.0, diffuseColor=(0.9,) * 3, roughness=roughness))
        if kind == "light":
            scene.add_light(wr.RectLight(width=1.0, height=0.8, intensity=2.0), pose=place)
        else:
            black = wr.PreviewSurface(emissiveColor=(2.0,) * 3, diffuseColor=(0, 0, 0), useSpecularWorkflow=1)
            scene.add_mesh("/lamp", CORNERS, [[0, 1, 2, 3]], material=black, pose=place)
        view = scenes.camera((0, 1.0, 1.2), fov=30.0)
        pictures.append(picture(scene, view, 16, 512, bounces=0, camera_light="off"))
    (light, a), (mesh, b) = pictures
    mean, sigma = mean_and_error(light - mesh, np.hypot(a, b))
    assert abs(mean) < SIGMAS * sigma
    assert sigma < 0.01 * mesh[..., :3].mean()


def test_s10_a_mirror_shows_a_light_whole():
    # a delta lobe cannot be aimed for; the light it shows is weighed by 1.
    scene = wr.Scene()
    floor(scene, material=wr.PreviewSurface(metallic=1.0, diffuseColor=(0.5,) * 3, roughness=0.0))
    scene.add_light(wr.SphereLight(radius=0.5, intensity=3.0), pose=(0, 1.0, -1.0, 0, 0, 0, 1))
    scene.add_light(wr.DistantLight(angle=0.0, intensity=7.0))
    color, _ = picture(scene, scenes.camera((0, 1.0, 1.0), fov=1.0), 4, 64)
    np.testing.assert_allclose(color[..., :3], 1.5, rtol=1e-6)


@pytest.mark.parametrize("height", [1.0, 548.8, 0.1])
def test_a_lamp_may_lie_on_a_ceiling(height):
    # In one plane with geometry as wide as a room's, for shadow rays as for those that happen to meet it.
    scene = wr.Scene()
    floor(scene, size=3.0 * height)
    s = 1.5 * height
    ceiling = np.array([(-s, height, -s), (s, height, -s), (s, height, s), (-s, height, s)])
    scene.add_mesh("/ceiling", ceiling, [[0, 1, 2, 3]], color=(0, 0, 0))
    scene.add_light(wr.RectLight(width=height, height=0.8 * height, intensity=2.0), pose=facing_down(0, height))
    corners = CORNERS * height @ facing_down()[:3, :3] + (0, height, 0)
    expected = 0.5 / np.pi * 2.0 * polygon_irradiance(np.zeros(3), np.array([0, 1.0, 0]), corners)
    view = scenes.window(1e-3 * height, (0.0, 0.05 * height, 0.0), up=(0, 0, -1), clippingRange=(1e-4, 1e4))
    assert_mean(*picture(scene, view, 16, 256), expected)


@pytest.mark.parametrize("height", [0.6, 0.8, 1.0])
def test_a_lamp_on_a_window_is_seen_once(height):
    # Neither missed nor met on both sides of a clear surface that it lies in.
    scene = wr.Scene()
    floor(scene, material=wr.PreviewSurface(metallic=1.0, diffuseColor=(0.5,) * 3, roughness=0.0))
    points, faces = scenes.quad(6.0)
    window = wr.DisplayColor((0, 0, 0), opacity=0.0)
    scene.add_mesh("/window", points[:, [0, 2, 1]] + (0, height, 0), faces, material=window)
    scene.add_light(wr.RectLight(width=4.0, height=4.0, intensity=3.0), pose=facing_down(0, height))
    view = scenes.camera((0, 0.5, 0.5), fov=20.0)
    color, _ = picture(scene, view, 8, 64)
    np.testing.assert_allclose(color[..., :3], 1.5, rtol=1e-6)


def test_no_light_is_lost_between_many():
    # Ten lights and a dome: what one of them gives does not depend on how it is chosen.
    scene = wr.Scene()
    floor(scene)
    expected = 0.3
    scene.add_light(wr.DomeLight(intensity=0.3))
    for i in range(10):
        angle = 2 * np.pi * i / 10
        place = np.array([np.cos(angle), 1.5, np.sin(angle)])
        scene.add_light(wr.SphereLight(radius=0.2, intensity=float(1 + i)), pose=(*place, 0, 0, 0, 1))
        d = np.linalg.norm(place)
        expected += (1 + i) * (0.2 / d) ** 2 * place[1] / d
    assert_mean(*picture(scene, above(), 16, 256), 0.5 * expected, 5e-3)


def test_diffuse_and_specular_multiply_a_lights_effect():
    both, halves = [], []
    for diffuse, specular in ((1.0, 1.0), (1.0, 0.0), (0.0, 1.0)):
        scene = wr.Scene()
        floor(scene, material=wr.PreviewSurface(diffuseColor=(0.5,) * 3, roughness=0.3))
        light = wr.SphereLight(radius=0.3, intensity=5.0, diffuse=diffuse, specular=specular)
        scene.add_light(light, pose=(0, 1, -1, 0, 0, 0, 1))
        result = picture(scene, scenes.camera((0, 1, 1), fov=20.0), 8, 512, bounces=0)
        (both if diffuse == specular else halves).append(result)
    (whole, error), ((matt, a), (gloss, b)) = both[0], halves
    mean, sigma = mean_and_error(whole - matt - gloss, np.sqrt(error**2 + a**2 + b**2))
    assert abs(mean) < SIGMAS * sigma < 0.05 * whole[..., :3].mean()
    assert matt[..., :3].mean() > 0.1 * whole[..., :3].mean() and gloss[..., :3].mean() > 0.1 * whole[..., :3].mean()


@pytest.mark.parametrize(
    ("options", "dome", "ball"),
    [({}, 0, 0), ({"dome_light_visible": True}, 1, 1), ({"lights_visible": True}, 1, 3)],
    ids=str,
)
def test_which_lights_the_camera_sees(options, dome, ball):
    # By default none, and alpha 0; reflections show them all. Radiances add up: lights occlude nothing.
    scene = wr.Scene()
    scene.add_light(wr.DomeLight(intensity=1.0))
    scene.add_light(wr.SphereLight(radius=2.0, intensity=2.0))
    scene.add_mesh(
        "/mirror",
        *scenes.quad(2.0),
        material=wr.PreviewSurface(metallic=1, diffuseColor=(1, 1, 1), roughness=0),
        pose=(4, 0, 0, 0, 0, 0, 1),
    )
    color, _ = picture(scene, scenes.window(12.0, (0, 0, 5)), 12, 16, **options)
    np.testing.assert_allclose(color[6, 0], [dome] * 3 + [float(dome > 0)], rtol=1e-6)
    np.testing.assert_allclose(color[6, 5], [ball] * 3 + [float(ball > 0)], rtol=1e-6)
    np.testing.assert_allclose(color[6, 10], [1, 1, 1, 1], rtol=1e-6)


def test_the_camera_light_reads_1_on_a_facing_white_surface():
    for distance in (0.1, 30.0):
        scene = wr.Scene()
        scene.add_mesh("/card", *scenes.quad(100.0), color=scenes.WHITE)
        view = scenes.camera((0, 0, distance), fov=0.1)
        color, _ = picture(scene, view, 4, 4, bounces=0)
        np.testing.assert_allclose(color, 1.0, rtol=2e-6)
    # It is there only when the stage has no light of its own, unless it is asked for.
    for mode, light, expected in (("off", False, 0), ("auto", True, 0), ("on", True, 1)):
        if light:
            scene.lights = {"/sun": wr.DistantLight(intensity=1.0, transform=scenes.look_at((0, 0, -1)))}
        color, error = picture(scene, view, 8, 64, bounces=0, camera_light=mode)
        mean, sigma = mean_and_error(color, error)
        assert abs(mean - expected) <= SIGMAS * sigma < 0.1
        assert (color[..., 3] == 1).all()


def test_bounces_0_is_emission_and_direct_light():
    # Two facing walls of albedo ρ: each bounce adds what the other wall sends.
    scene = wr.Scene()
    scene.add_sphere("/wall", 2.0, color=(0.5,) * 3)
    scene.add_light(wr.SphereLight(radius=0.5, intensity=3.0))
    direct = 0.5 * 3.0 * (0.5 / 2.0) ** 2
    for bounces in (0, 1, 2, 5):
        # In a sphere each bounce sends on exactly ρ of the one before.
        expected = direct * sum(0.5**k for k in range(bounces + 1))
        color, error = picture(scene, scenes.camera((0, 0, 1), (0, 1, 1.5)), 16, 512, bounces=bounces)
        assert_mean(color, error, expected)


@pytest.mark.parametrize("opacity", [0.0, 0.25, 0.5, 1.0])
@pytest.mark.parametrize("kind", ["display", "black display", "presence", "transparent"])
def test_alpha_is_opacity(kind, opacity):
    # Before nothing, of a surface that keeps its share whatever its colour; a transparent one also reflects.
    material = {
        "display": wr.DisplayColor(color=(0.5, 0.2, 0.1), opacity=opacity),
        "black display": wr.DisplayColor(color=(0, 0, 0), opacity=opacity),
        "presence": wr.PreviewSurface(opacity=opacity, opacityMode="presence"),
        "transparent": wr.PreviewSurface(opacity=opacity, useSpecularWorkflow=1, roughness=0.0),
    }[kind]
    scene = wr.Scene()
    scene.add_mesh("/card", *scenes.quad(9.0), material=material)
    scene.add_light(wr.DomeLight(intensity=1.0))
    color, error = picture(scene, scenes.window(1.0), 16, 256)
    # The coverage of a sample is between 0 and 1, so its deviation is at most a half.
    assert abs(color[..., 3].mean() - opacity) < SIGMAS * 0.5 / np.sqrt(16 * 16 * 256)
    if kind == "display":
        mean, sigma = mean_and_error(color / (0.5, 0.2, 0.1, 1), error / (0.5, 0.2, 0.1))
        assert abs(mean - opacity) < SIGMAS * sigma + 1e-5
    if kind == "black display":
        assert (color[..., :3] == 0).all()


@pytest.mark.parametrize(("opacity", "shadow"), [(0.0, 1.0), (0.3, 0.7), (1.0, 0.0)])
def test_shadows_through_clear_surfaces(opacity, shadow):
    # A card over the floor lets 1 - opacity of the sun through, two cards that squared.
    for cards in (1, 2):
        scene = wr.Scene()
        floor(scene)
        for i in range(cards):
            points = scenes.quad(4.0)[0][:, [0, 2, 1]] + (0, 0.5 + i, 0)
            scene.add_mesh(f"/card{i}", points, [[0, 1, 2, 3]], material=wr.DisplayColor((0, 0, 0), opacity=opacity))
        sun = wr.DistantLight(intensity=2.0, angle=0.0, transform=facing_down())
        scene.add_light(sun)
        view = scenes.window(0.01, (0, 0.3, 0), up=(0, 0, -1))
        color, _ = picture(scene, view, 8, 64)
        expected = 0.5 / np.pi * 2.0 * shadow**cards
        np.testing.assert_allclose(color[..., :3], expected, rtol=1e-5, atol=1e-9)


def test_what_is_seen_through_a_clear_surface():
    # Half of the background's light and half of the card's own; alpha 1 since the wall behind is opaque.
    scene = wr.Scene()
    scene.add_mesh("/card", *scenes.quad(9.0), material=wr.DisplayColor((0.8,) * 3, opacity=0.5))
    glow = wr.PreviewSurface(emissiveColor=(3.0,) * 3, diffuseColor=(0, 0, 0), useSpecularWorkflow=1)
    scene.add_mesh("/wall", *scenes.quad(99.0, -40.0), material=glow)
    sun = wr.DistantLight(intensity=2.0, angle=0.0)
    scene.add_light(sun)
    color, error = picture(scene, scenes.window(0.1), 16, 256, bounces=0)
    assert_mean(color, error, 0.5 * 3.0 + 0.5 * 0.8 / np.pi * 2.0, 0.01)
    assert (color[..., 3] == 1).all()


@pytest.mark.parametrize(("opacity", "there"), [(0.4999, False), (0.5, True), (0.6, True)])
def test_cut_outs(opacity, there):
    cut = wr.PreviewSurface(opacity=opacity, opacityThreshold=0.5, diffuseColor=(0, 0, 0), useSpecularWorkflow=1)
    scene = wr.Scene()
    scene.add_mesh("/card", *scenes.quad(9.0), material=cut)
    glow = wr.PreviewSurface(emissiveColor=(3.0,) * 3, diffuseColor=(0, 0, 0), useSpecularWorkflow=1)
    scene.add_mesh("/wall", *scenes.quad(9.0, -1.0), material=glow)
    color, _ = picture(scene, scenes.window(1.0), 4, 16, camera_light="off")
    expected = np.broadcast_to([0, 0, 0, 1] if there else [3, 3, 3, 1], color.shape)
    np.testing.assert_allclose(color, expected, rtol=1e-6)


def busy():
    scene = wr.Scene()
    floor(scene)
    scene.add_sphere("/ball", 0.7, color=(0.8, 0.4, 0.2), pose=(0, 0.7, 0, 0, 0, 0, 1))
    points, faces = scenes.icosphere(2)
    scene.add_mesh(
        "/glass",
        points,
        faces,
        normals=points,
        material=wr.PreviewSurface(opacity=0.3, roughness=0.1),
        pose=(1.5, 1, 0, 0, 0, 0, 1),
    )
    scene.add_light(wr.SphereLight(radius=0.3, intensity=9.0), pose=(1, 3, 1, 0, 0, 0, 1))
    scene.add_light(wr.DomeLight(intensity=0.2))
    return scene, scenes.camera((0, 2, 5), (0, 0.7, 0))


def test_A7_threads_passes_and_repeats_change_no_bit():
    # A7: 64 samples at once, as four times 16, as 64 times one; on one thread or many.
    scene, view = busy()
    renderer = prepare(scene, view, (24, 20), threads=1)
    base = renderer.render(samples=64).numpy("color").copy()
    for threads, passes in ((1, [64]), (3, [16] * 4), (2, [1] * 64), (5, [50, 1, 13])):
        renderer.threads = threads
        renderer._films.turn()
        request, taken = renderer._path_request(0), 0
        for samples in passes:
            renderer._pass(request, taken, samples)
            taken += samples
        np.testing.assert_array_equal(renderer._films.last.color(1.0).numpy(), base)
    np.testing.assert_array_equal(renderer.render(samples=64).numpy("color"), base)
    other = renderer.render(samples=64, seed=1).numpy("color")
    assert (other != base).any(-1).mean() > 0.5


def test_seeds_are_independent_estimates_of_one_picture():
    scene, view = busy()
    (a, e), (b, f) = (picture(scene, view, 24, 128, seed=seed) for seed in (0, 1))
    wr.testing.assert_images_agree(a, b, a_error=e, b_error=f, a_samples=128, b_samples=128)
    spread = np.hypot(e, f).mean(-1)
    lit = spread > 1e-4
    z = (a - b)[..., :3].mean(-1)[lit] / spread[lit]
    # A sample's deviation of a standard normal, had the samples tails no heavier than that: 1 ± 0.03 for 570 pixels.
    assert 0.85 < z.std() < 1.15


def test_sobol_points_give_the_same_picture_with_less_error():
    scene, view = busy()
    (a, e), (b, f) = (picture(scene, view, 24, 128, sampler=name) for name in ("independent", "sobol"))
    wr.testing.assert_images_agree(a, b, a_error=e, b_error=f, a_samples=128, b_samples=128)
    spread = np.hypot(e, f).mean(-1)
    lit = spread > 1e-4
    z = (a - b)[..., :3].mean(-1)[lit] / spread[lit]
    # The stated error of Sobol points is an upper bound: the difference stays below what it allows.
    assert z.std() < 1.0


def test_the_standard_error_is_that_of_repeated_pictures():
    scene, view = busy()
    renderer = prepare(scene, view, 12)
    pictures, errors = [], []
    for seed in range(40):
        pictures.append(renderer.render(samples=16, seed=seed).numpy("color")[..., :3].astype(float))
        errors.append(renderer.standard_error())
    stated = np.sqrt(np.mean(np.square(errors), 0))
    seen = np.std(pictures, 0, ddof=1)
    # 144 pixels, each known to 1/√(2·39) = 11 %, are together known to 1 %, heavy tails to a few.
    assert abs(np.sqrt((seen**2).mean() / (stated**2).mean()) - 1) < 0.1


def test_A2_a_sample_that_is_not_finite_costs_itself_only():
    # A2: a NaN and an infinite light in one pixel's way; every other pixel keeps its bits.
    def render(bad):
        scene, view = busy()
        if bad:
            points = scenes.quad(0.05)[0] + (-0.8, 0.6, 1.0)
            glow = wr.PreviewSurface(emissiveColor=wr.PrimvarReader("glow"), diffuseColor=(0, 0, 0))
            mesh = scene.add_mesh("/bad", points, [[0, 1, 2, 3]], material=glow)
            mesh.primvars["glow"] = Primvar(np.float32([(float(bad), 1, 1)]), "constant")
        renderer = prepare(scene, view, 24, bounces=0)
        frame = renderer.render(samples=16)
        return frame.numpy("color").copy(), frame.stats["dropped samples"]

    good, none = render("")
    assert none == 0
    for bad in ("nan", "inf"):
        color, dropped = render(bad)
        assert np.isfinite(color).all()
        assert 0 < dropped <= 24 * 24 * 16
        changed = (color != good).any(-1)
        assert 0 < changed.mean() < 0.3


def test_far_from_the_origin_light_falls_as_near_it():
    # C1: the same scene at 1e7.
    shift = np.array([1e7, -2e7, 3e7])
    pictures = []
    for move in (0 * shift, shift):
        scene, view = busy()
        for placement in scene.placements.values():
            placement.transforms[:, 3, :3] += move
        for light in scene.lights.values():
            light.transform = light.transform + np.pad(move[None], ((3, 0), (0, 1)))
        view.transform = view.transform + np.pad(move[None], ((3, 0), (0, 1)))
        pictures.append(picture(scene, view, 16, 64)[0])
    np.testing.assert_allclose(pictures[0], pictures[1], atol=1 / 255)


@pytest.mark.parametrize("scale", [(-1, 1, 1), (-1, -1, -1), (1, 1, -1)])
def test_mirrored_lights_emit_from_the_authored_side(scale):
    # C2: local -Z is where the light goes, whatever the sign of the determinant.
    scene = wr.Scene()
    floor(scene)
    place = np.diag([*np.abs(scale), 1.0]) @ facing_down()
    mirrored = np.diag([*scale, 1.0]) @ facing_down()
    down = mirrored[2, 1] > 0
    scene.add_light(wr.RectLight(intensity=2.0), pose=mirrored)
    corners = np.array([(-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0)]) @ place[:3, :3] + place[3, :3]
    expected = polygon_irradiance(np.zeros(3), np.array([0, 1.0, 0]), corners) / np.pi if down else 0.0
    color, error = picture(scene, scenes.window(0.01, (0, 0.5, 0), up=(0, 0, -1)), 8, 256)
    if down:
        assert_mean(color, error, expected)
    else:
        assert (color[..., :3] == 0).all()


def test_a_small_light_out_of_focus_spreads_over_its_circle_of_confusion():
    # A lens of radius R focused at f shows a point at z as a disk of radius R |1/f - 1/z| at distance 1.
    scene = wr.Scene()
    glow = wr.PreviewSurface(emissiveColor=(1000.0,) * 3, diffuseColor=(0, 0, 0), useSpecularWorkflow=1)
    scene.add_sphere("/spark", 0.03, material=glow, pose=(0, 0, -4.0, 0, 0, 0, 1))
    view = scenes.camera((0, 0, 0), (0, 0, -1), fov=20.0, focusDistance=2.0, fStop=12.5)
    radius = 0.1 * 50.0 / (2 * 12.5) * (1 / 2.0 - 1 / 4.0)
    color, error = picture(scene, view, 48, 2048, camera_light="off")
    c = ((np.arange(48) + 0.5) / 48 * 2 - 1) * np.tan(np.radians(10))
    r = np.hypot(*np.meshgrid(c, c))
    light = color[..., 0]
    pixel, spark = c[1] - c[0], 0.03 / 4
    assert (light[r > radius + spark + pixel] == 0).all()
    inner = r < radius - spark - pixel
    # Even inside: a spark of solid angle ω spreads over π radius², in units of the window at distance 1.
    mean, sigma = mean_and_error(color, error, inner)
    assert abs(mean - 1000.0 * (spark / radius) ** 2) < SIGMAS * sigma
    assert sigma < 0.03 * mean


def test_the_surface_is_not_its_own_shadow():
    # I11: lit by a delta light, no pixel of a convex body is darker than its cosine, wherever it is placed.
    points, faces = scenes.icosphere(3)
    sun = scenes.look_at((0.3, 0.4, 1.0))
    for move, turn, size in (
        ((0, 0, 0), (0, 0, 5), 1.0),
        ((300, -200, 100), (1, 2, 4), 1e-2),
        ((-7, 5, 3), (3, -1, 3), 40.0),
    ):
        for kind in ("quadric", "mesh"):
            scene = wr.Scene()
            pose = np.diag([1.0, 0.6, 1.4, 1.0]) @ scenes.look_at(turn)
            pose[:3, :3] *= size
            pose[3, :3] = move
            if kind == "quadric":
                scene.add_sphere("/body", color=scenes.WHITE, pose=pose)
            else:
                scene.add_mesh("/body", points, faces, color=scenes.WHITE, pose=pose)
            scene.add_light(wr.DistantLight(intensity=np.pi, angle=0.0, transform=sun))
            view = scenes.window(3 * size, np.array(move) + sun[2, :3] * 5 * size, move)
            color, _ = picture(scene, view, 32, 16, bounces=0)
            covered = color[..., 3] == 1
            assert covered.sum() > 100
            # Along the sun's direction everything seen is lit.
            assert color[covered][:, 0].min() > 0
