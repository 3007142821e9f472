"""Furnaces: closed scenes whose radiance is known exactly."""

import numpy as np
import pytest
import scenes
from pictures import mean_and_error, picture

import warprender as wr

#: Rounding of float32 radiances along a path.
FLOAT32 = 1e-5


def white_dome(**light):
    scene = wr.Scene()
    scene.add_light(wr.DomeLight(**light))
    return scene


def assert_all_near(color, error, expected, sigmas=4.5):
    """Each pixel within `sigmas`: among 10 000 pixels one false alarm in 15 runs, were they Gaussian."""
    difference = np.abs(color[..., :3] - expected)
    assert (difference <= sigmas * error + FLOAT32 * expected).all(), difference.max()


SPHERES = {
    "quadric": lambda scene, **look: scene.add_sphere("/ball", **look),
    "flat mesh": lambda scene, **look: scene.add_mesh("/ball", *scenes.icosphere(3), **look),
}


@pytest.mark.parametrize("kind", SPHERES)
def test_a_white_object_in_a_white_dome_disappears(kind):
    scene = white_dome()
    SPHERES[kind](scene, color=scenes.WHITE)
    color, error = picture(scene, scenes.camera((0, 0, 4)), 24, 64, dome_light_visible=True)
    assert abs(color[..., :3].mean() - 1) < 1e-3
    assert_all_near(color, error, 1.0)


def test_smooth_normals_lose_only_what_they_send_below_the_surface():
    # A cosine lobe tilted by δ sends (1 - cos δ) / 2 of itself below the true surface: 1.4e-3 at most for this
    # mesh, whose normals deviate by up to 0.075.
    points, faces = scenes.icosphere(3)
    scene = white_dome()
    scene.add_mesh("/ball", points, faces, normals=points, color=scenes.WHITE)
    color, error = picture(scene, scenes.camera((0, 0, 4)), 24, 256, dome_light_visible=True)
    assert (color[..., :3] <= 1 + FLOAT32).all()
    mean, sigma = mean_and_error(color, error)
    assert 1 - 1.4e-3 < mean + 4.5 * sigma
    assert abs(mean - 1) < 1e-3


@pytest.mark.parametrize("reflectance", [0.2, 0.5, 0.8])
def test_an_integrating_sphere_is_filled_evenly(reflectance):
    # Any light inside a Lambert sphere of reflectance ρ gives the wall ρ/π (E + Φ/A ρ/(1-ρ)); a ball of radiance L
    # in the middle, of radius r, has E = Φ/A = π L (r/R)².
    scene = wr.Scene()
    scene.add_sphere("/wall", 2.0, color=(reflectance,) * 3)
    scene.add_light(wr.SphereLight(radius=0.5, intensity=3.0))
    color, error = picture(scene, scenes.camera((0, 0, 1), (0, 1, 1.5)), 12, 1024)
    expected = reflectance / (1 - reflectance) * 3.0 * (0.5 / 2.0) ** 2
    # By quarters of the picture: single pixels are not Gaussian, few of their paths survive the roulette.
    for quarter in np.indices((2, 2)).reshape(2, -1).T:
        where = tuple(slice(6 * q, 6 * q + 6) for q in quarter)
        mean, sigma = mean_and_error(color, error, where)
        assert abs(mean - expected) < 4.5 * sigma
        assert sigma < 4e-3 * expected


def test_an_integrating_sphere_with_its_light_off_centre():
    # Direct light: π L (r/d)² cos θ; what bounces is even.
    scene = wr.Scene()
    scene.add_sphere("/wall", 2.0, color=(0.5,) * 3)
    scene.add_light(wr.SphereLight(radius=0.25, intensity=10.0), pose=(0.8, 0, 0, 0, 0, 0, 1))
    view = scenes.window(0.01, eye=(0, 0, 0), target=(-1, 0, 0))
    color, error = picture(scene, view, 8, 2048)
    direct = np.pi * 10 * (0.25 / 2.8) ** 2
    flux = 4 * np.pi**2 * 0.25**2 * 10
    expected = 0.5 / np.pi * (direct + flux / (16 * np.pi) * 0.5 / 0.5)
    mean, sigma = mean_and_error(color, error)
    assert abs(mean - expected) < 3.5 * sigma + 1e-4 * expected
    assert sigma < 3e-3 * expected


def test_a_closed_box_of_glowing_mirrors_sums_the_geometric_series():
    # Each wall emits e and mirrors ρ of what it gets, at every angle: e / (1 - ρ).
    glow = wr.PreviewSurface(metallic=1.0, roughness=0.0, diffuseColor=(0.2, 0.5, 0.8), emissiveColor=(0.3, 0.2, 0.1))
    scene = wr.Scene()
    scene.add_mesh("/box", *scenes.cube(4.0), material=glow)
    color, error = picture(scene, scenes.camera((0.3, 0.2, 0.1), (1, 0.3, -1)), 12, 256, camera_light="off")
    assert_all_near(color, error, np.array([0.3 / 0.8, 0.2 / 0.5, 0.1 / 0.2]))


def test_a_glowing_box_with_glossy_walls_gains_nothing():
    # Reflectance at most ρ, so radiance between e and e / (1 - ρ).
    glow = wr.PreviewSurface(metallic=1.0, roughness=0.5, diffuseColor=(0.5,) * 3, emissiveColor=(1.0,) * 3)
    scene = wr.Scene()
    scene.add_mesh("/box", *scenes.cube(4.0), material=glow)
    color, error = picture(scene, scenes.camera((0.3, 0.2, 0.1), (1, 0.3, -1)), 12, 256, camera_light="off")
    mean, sigma = mean_and_error(color, error)
    assert 1.5 < mean < 2.0 + 4.5 * sigma


@pytest.mark.parametrize("roughness", [0.0, 1e-3, 0.05, 0.3, 1.0])
@pytest.mark.parametrize("look", ["metal", "glossy", "coated"])
def test_no_material_reflects_more_than_arrives(look, roughness):
    material = {
        "metal": wr.PreviewSurface(metallic=1.0, diffuseColor=scenes.WHITE, roughness=roughness),
        "glossy": wr.PreviewSurface(diffuseColor=scenes.WHITE, roughness=roughness),
        "coated": wr.PreviewSurface(diffuseColor=scenes.WHITE, clearcoat=1.0, clearcoatRoughness=roughness),
    }[look]
    scene = white_dome()
    scene.add_sphere("/ball", material=material)
    color, error = picture(scene, scenes.window(1.9), 16, 256)
    inside = color[..., 3] == 1.0
    assert inside.any()
    excess = (color[..., :3] - 1 - 4.5 * error)[inside]
    assert excess.max() < FLOAT32
    if look == "metal" and roughness <= 1e-3:
        np.testing.assert_allclose(color[inside][:, :3], 1.0, rtol=FLOAT32)
    # One scattering event loses light between rough facets: seen from above alpha 1, all but 1 - ln 2 of it.
    assert (color[..., :3] + 4.5 * error)[inside].min() > 1 - np.log(2)


def test_roughness_0_is_the_limit_of_small_roughnesses():
    pictures = []
    for roughness in (0.0, 1e-4, 0.011, 0.02):
        scene = white_dome()
        scene.add_light(wr.SphereLight(radius=1.0, intensity=5.0), pose=(0, 3, 3, 0, 0, 0, 1))
        metal = wr.PreviewSurface(metallic=1.0, diffuseColor=(0.9, 0.6, 0.3), roughness=roughness)
        scene.add_sphere("/ball", material=metal)
        pictures.append(picture(scene, scenes.camera((0, 0, 4)), 24, 64))
    (mirror, error), *rough = pictures
    assert mirror[..., :3].max() > 3.0
    for color, other in rough:
        mean, sigma = mean_and_error(color - mirror, np.hypot(error, other))
        assert abs(mean) < 0.01 * mirror[..., :3].mean() + 4.5 * sigma
