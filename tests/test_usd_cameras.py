"""The camera is the one that usdrecord takes, and automatic framing puts everything in the picture."""

import numpy as np
import pytest
from usd_stage import scene_of

from warprender.framing import auto_camera, choose_camera, placement_bounds
from warprender.renderer import Renderer
from warprender.scene import SceneError

CAMERAS = """def Camera "other" { float focalLength = 20
    float exposure = 1
    float2 clippingRange = (0.5, 9) }
def Xform "x" { def Camera "main_cam" { float focalLength = 30 } }
"""
SETTINGS = """def RenderSettings "r" { rel camera = </other>
    uniform int2 resolution = (320, 200) }"""


def test_attributes_arrive():
    camera = scene_of(CAMERAS).cameras["/other"]
    assert camera.focalLength == 20 and camera.clippingRange == (0.5, 9) and camera.exposureScale == 2


def test_the_order_of_choice_is_usdrecords():
    with_settings, without = scene_of(CAMERAS + SETTINGS), scene_of(CAMERAS)
    assert choose_camera(with_settings, "main_cam").focalLength == 30
    assert choose_camera(with_settings, "/x/main_cam").focalLength == 30
    assert choose_camera(with_settings).focalLength == 20
    assert choose_camera(without).focalLength == 30
    assert choose_camera(scene_of('def Sphere "s" { }')).focalLength == 50


def test_a_camera_that_is_not_there_is_an_error():
    with pytest.raises(SceneError, match="/x/main_cam"):
        choose_camera(scene_of(CAMERAS), "nobody")


@pytest.mark.parametrize("field", ["focalLength", "horizontalAperture", "verticalAperture"])
def test_a_camera_without_a_window_is_an_error_when_it_is_used(field):
    scene = scene_of(f'def Camera "c" {{ float {field} = 0 }}')
    with pytest.raises(SceneError, match=f"/c: {field}"):
        choose_camera(scene, "c")


def test_settings_state_resolution_and_camera():
    settings = scene_of(SETTINGS + CAMERAS).settings
    assert (settings.path, settings.resolution, settings.camera) == ("/r", (320, 200), "/other")
    two = SETTINGS + SETTINGS.replace('"r"', '"q"').replace("320", "640") + CAMERAS
    assert scene_of(two).settings.path == ""
    assert scene_of(two, 'renderSettingsPrimPath = "/q"').settings.resolution == (640, 200)


@pytest.mark.parametrize("up_axis", ["Y", "Z"])
def test_automatic_framing_shows_everything(up_axis):
    scene = scene_of(
        """def Sphere "a" { double radius = 3 
            double3 xformOp:translate = (10, 20, 30)
            uniform token[] xformOpOrder = ["xformOp:translate"] }
        def Sphere "b" { }""",
        f'upAxis = "{up_axis}"',
    )
    camera = auto_camera(scene)
    low, high = scene.bounds
    corners = np.array([[x, y, z, 1] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    seen = corners @ np.linalg.inv(camera.transform)
    window = np.array([camera.horizontalAperture, camera.horizontalAperture]) / 2 / camera.focalLength
    assert (np.abs(seen[:, :2] / -seen[:, 2:3]) <= window + 1e-9).all()
    np.testing.assert_allclose(np.abs(np.linalg.det(camera.transform)), 1)


def test_framing_distance_is_usdrecords():
    camera = auto_camera(scene_of('def Sphere "s" { double radius = 3 }'))
    assert camera.transform[3, 2] == pytest.approx(np.hypot(3, 3) / (20.955 / 100) + 3)


def test_bounds_of_the_placements_agree_with_the_stages():
    scene = scene_of('def Sphere "s" { double radius = 2 }')
    np.testing.assert_allclose(placement_bounds(scene), scene.bounds)


def test_a_broken_extent_leaves_the_bounds_to_the_placements():
    scene = scene_of('def Sphere "s" { float3[] extent = [(nan, 0, 0), (inf, 1, 1)] }')
    assert np.isfinite(auto_camera(scene).transform).all()


def test_clipping_planes_cut_the_picture():
    scene = scene_of(
        """def Sphere "s" { double3 xformOp:translate = (0, 0, -5)
            uniform token[] xformOpOrder = ["xformOp:translate"] }
        def Camera "c" { float4[] clippingPlanes = [(1, 0, 0, 0), (0, 0, -1, -4.5)] }"""
    )
    prims = Renderer(scene, "c", (32, 32), outputs=("primId",)).render().numpy("primId")
    assert (prims[:, :16] == -1).all(), "the half-space x < 0 is not seen"
    assert (prims[:, 17:] == 0).any(), "and beyond 4.5 units the inside of the sphere is"


def test_a_clipping_plane_that_is_not_finite_is_left_out():
    scene = scene_of('def Camera "c" { float4[] clippingPlanes = [(nan, 0, 0, 1), (0, 1, 0, 0)] }')
    assert scene.cameras["/c"].clippingPlanes == ((0, 1, 0, 0),)
    assert any("/c" in warning for warning in scene.warnings)


def test_velocities_do_not_carry_instances_back_to_the_earliest_time():
    scene = scene_of("""def PointInstancer "p" { rel prototypes = </p/s>
        int[] protoIndices = [0]
        point3f[] positions.timeSamples = { 1: [(1, 2, 3)] }
        vector3f[] velocities.timeSamples = { 1: [(24, 0, 0)] }
        def Sphere "s" { } }""")
    np.testing.assert_allclose(scene.placements["/p/s"].transforms[0, 3, :3], [1, 2, 3])


def test_an_extent_without_size_leaves_the_bounds_to_the_placements():
    scene = scene_of('def Sphere "s" { float3[] extent = [(0, 0, 0), (0, 0, 0)] }')
    assert auto_camera(scene).transform[3, 2] > 2


@pytest.mark.parametrize("name", ["fStop", "focusDistance"])
def test_a_lens_that_is_no_number_is_a_pinhole(name):
    values = {"fStop": 2, "focusDistance": 3, name: "nan"}
    lines = "\n".join(f"float {key} = {value}" for key, value in values.items())
    scene = scene_of(f'def Camera "c" {{ {lines}\n}}')
    camera = scene.cameras["/c"]
    assert camera.fault() == "" and "lens" not in camera.effects()
    assert scene.warnings == [f"/c: {name} is nan; 0 is taken, a pinhole"]
