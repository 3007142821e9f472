"""Cases L2 and L4 to L7 of the catalogue of hard cases, for the lights that `tests/test_lights.py` does not have."""

import numpy as np
import pytest
from light_scenes import floor, illuminance, pose
from test_lights import irradiances, sampled
from usd_stage import scene_of

import warprender as wr
from warprender.color import blackbody_tint
from warprender.emitters import lit
from warprender.errors import SceneError
from warprender.lights import CylinderLight, DistantLight, DomeLight, LightTexture, MeshLight, RectLight, SphereLight


@pytest.mark.parametrize("distance", [0.5, float(np.nextafter(np.float32(0.5), np.float32(1))), 0.5001, 0.6])
def test_l2_on_and_near_the_side_of_a_cylinder(distance):
    light = CylinderLight(radius=0.5, length=3.0, intensity=2.0)
    values = irradiances(sampled(light, (0.2, 0, -distance), 1 << 14), np.array([0, 0, 1.0]))
    assert np.isfinite(values).all() and (values <= 2 * np.pi * 2.0 * (1 + 1e-4)).all()
    if distance > 0.5:
        assert 0 < values.mean() < np.pi * 2.0 * (1 + 1e-3)


def test_l2_on_a_triangle_that_glows():
    scene = floor(MeshLight(prim="/floor", intensity=1.0))
    mean, _ = illuminance(scene)
    # The floor sees nothing of itself: what the window sees is the floor's own light.
    np.testing.assert_allclose(mean, np.pi / 0.5, rtol=1e-4)


@pytest.mark.parametrize(
    "light",
    [
        CylinderLight(radius=0.0),
        CylinderLight(length=0.0, normalize=True),
        CylinderLight(intensity=0.0),
        RectLight(texture=LightTexture.of(np.zeros((2, 2, 3)))),
    ],
    ids=["radius", "length", "intensity", "texture"],
)
def test_l4_lights_without_size_or_power_are_left_out(light):
    scene = floor(light)
    assert not lit(scene, camera_light=False)
    assert illuminance(scene, samples=4)[0].max() == 0


def test_l4_one_light_of_a_thousand_has_power():
    lights = [SphereLight(intensity=0.0, transform=pose((i, 0, 1))) for i in range(1000)]
    lights[531] = SphereLight(radius=1e-3, intensity=1e6, transform=pose((0, 0, 1)))
    mean, error = illuminance(floor(*lights), samples=16)
    np.testing.assert_allclose(mean, np.pi, rtol=1e-4)
    assert error.max() < 1e-4


@pytest.mark.parametrize("kelvin", [1, 300, 1e3, 6500, 1e5, 1e7, 1e9])
def test_l5_black_bodies_of_any_temperature(kelvin):
    tint = blackbody_tint(kelvin)
    assert np.isfinite(tint).all() and (tint >= 0).all()
    light = SphereLight(enableColorTemperature=True, colorTemperature=kelvin)
    np.testing.assert_array_equal(light.radiance(), tint)


@pytest.mark.parametrize("kind", [CylinderLight, DistantLight])
def test_l6_exposure_of_30_stops(kind):
    light = kind(intensity=1e9, exposure=30.0, transform=pose((0, 0, 2.0)))
    scene = floor(light)
    mean, error = illuminance(scene, samples=64)
    assert np.isfinite(mean).all() and np.isfinite(error).all() and (mean > 1e13).all()


@pytest.mark.parametrize("exposure", [200.0, 1e30, 3e38])
def test_l6_more_than_float32_holds_is_left_out_and_said(exposure):
    text = f'def SphereLight "lamp" {{ float inputs:exposure = {exposure} }} def Sphere "ball" {{ }}'
    scene = scene_of(text)
    assert not scene.lights
    assert any("/lamp" in warning and "intensity and exposure" in warning for warning in scene.warnings)
    # From Python it is refused, and dark where it was put past that.
    lamp = SphereLight(exposure=exposure)
    with pytest.raises(SceneError, match="/python: intensity and exposure"):
        scene.add_light(lamp, path="/python")
    scene.lights["/python"] = lamp
    assert not scene.lights["/python"].radiance().any() and not lit(scene, False)


@pytest.mark.parametrize("kind", ["SphereLight", "RectLight", "DiskLight", "CylinderLight"])
def test_l4_lights_too_large_for_float32_are_left_out_and_said(kind):
    size = {"RectLight": "width", "CylinderLight": "length"}.get(kind, "radius")
    text = f'def {kind} "lamp" {{ float inputs:{size} = 1e30 }} def SphereLight "good" {{ float inputs:radius = 1 }}'
    scene = scene_of(text)
    assert set(scene.lights) == {"/good"}
    assert any("/lamp" in warning and "too large" in warning for warning in scene.warnings)


@pytest.mark.parametrize("light", [RectLight(width=1e30), CylinderLight(length=1e38)], ids=["width", "length"])
def test_l4_python_is_refused_a_light_of_no_size_that_float32_holds(light):
    scene = wr.Scene()
    with pytest.raises(SceneError, match="/huge: it is too large"):
        scene.add_light(light, path="/huge")
    # Put past that, it is refused before it is drawn, and nothing hangs.
    scene.lights["/huge"] = light
    with pytest.raises(SceneError, match="/huge: it is too large"):
        illuminance(scene, samples=4)


def test_l7_one_texel_of_a_large_map():
    texels = np.zeros((1024, 2048, 3), np.float32)
    texels[300, 777] = 1e6
    up = pose(rotation=[(1, 0, 0), (0, 0, 1), (0, -1, 0)])
    scene = floor(DomeLight(texture=LightTexture.of(texels), transform=up))
    edges = np.cos(np.pi * np.array([300, 301]) / 1024)
    solid_angle = (edges[0] - edges[1]) * 2 * np.pi / 2048
    mean, error = illuminance(scene, samples=256)
    expected = 1e6 * solid_angle * edges.mean()
    assert abs(mean[0] - expected) < 4.5 * error[0] + 1e-3 * expected
    assert error[0] < 0.02 * expected


@pytest.mark.parametrize("texels", ["zero", "nan", "zero row"])
def test_l7_bad_maps(texels):
    values = np.full((8, 16, 3), 0.5, np.float32)
    if texels == "zero":
        values[:] = 0
    elif texels == "nan":
        values[:] = np.nan
    else:
        values[0] = 0
    mean, _ = illuminance(floor(DomeLight(texture=LightTexture.of(values))), samples=16)
    assert np.isfinite(mean).all()
    assert (mean > 1).all() if texels == "zero row" else mean.max() == 0
