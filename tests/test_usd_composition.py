"""Stages as pipelines compose them: payloads in variants, layers without defaultPrim, nested instancers with lights."""

import numpy as np
import pytest

from warprender import StageReader
from warprender.framing import choose_camera
from warprender.usd import load

MAIN = """#usda 1.0
(
    upAxis = "Z"
    startTimeCode = 1
    endTimeCode = 3
    metersPerUnit = 0.01
)
def Xform "w"
{
    def "one" ( prepend references = @lib.usda@ )
    {
    }
    def "two" (
        prepend payload = @lib.usda@
        variants = { string look = "b" }
    )
    {
        double3 xformOp:translate = (3, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def "three" (
        prepend references = @pay.usda@</nodefault>
        instanceable = true
    )
    {
        double3 xformOp:translate = (-3, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Mesh "changing"
    {
        int[] faceVertexCounts.timeSamples = { 1: [3], 2: [4], 3: [3, 3] }
        int[] faceVertexIndices.timeSamples = { 1: [0, 1, 2], 2: [0, 1, 2, 3], 3: [0, 1, 2, 0, 2, 3] }
        point3f[] points.timeSamples = { 1: [(0, 0, 3), (1, 0, 3), (0, 0, 4)],
            2: [(0, 0, 3), (1, 0, 3), (1, 0, 4), (0, 0, 4)],
            3: [(0, 0, 3), (1, 0, 3), (1, 0, 4), (0, 0, 5)] }
        color3f[] primvars:displayColor (
            interpolation = "vertex"
        )
        color3f[] primvars:displayColor.timeSamples = { 1: [(1, 0, 0), (1, 0, 0), (1, 0, 0)],
            2: [(0, 1, 0), (0, 1, 0), (0, 1, 0), (0, 1, 0)] }
    }
    def PointInstancer "outer"
    {
        int[] protoIndices = [0, 0, 1]
        point3f[] positions = [(0, 5, 0), (4, 5, 0), (-4, 5, 0)]
        float3[] scales = [(1, 1, 1), (0.5, 0.5, 0.5), (1, 1, 1)]
        rel prototypes = [</w/outer/p/inner>, </w/outer/p/lamp>]
        def Scope "p"
        {
            def PointInstancer "inner"
            {
                int[] protoIndices = [0, 1, 0]
                point3f[] positions = [(0, 0, 0), (0, 0, 1), (0, 0, 2)]
                rel prototypes = [<ball>, <lamp>]
                def Sphere "ball"
                {
                    double radius = 0.3
                }
                def SphereLight "lamp"
                {
                    float inputs:radius = 0.1
                    float inputs:intensity = 5
                }
            }
            def Xform "lamp"
            {
                def DiskLight "d"
                {
                    float inputs:intensity = 3
                }
                def Cylinder "stand"
                {
                }
            }
        }
    }
    def Xform "cams"
    {
        float3 xformOp:scale = (2, 2, 2)
        uniform token[] xformOpOrder = ["xformOp:scale"]
        def Camera "main_cam"
        {
            double3 xformOp:translate = (0, -8, 1.5)
            float xformOp:rotateX = 90
            uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
            float horizontalAperture = 0.0036
            float verticalAperture = 0.0024
            float focalLength = 0.0035
            float2 clippingRange = (0.01, 1e9)
        }
    }
}
"""

LIBRARY = """#usda 1.0
(
    defaultPrim = "asset"
    upAxis = "Z"
)
def Xform "asset" (
    variants = { string look = "a" }
    prepend variantSets = "look"
)
{
    variantSet "look" = {
        "a" {
            def Cube "c"
            {
                double size = 1
            }
        }
        "b" ( prepend payload = @pay.usda@ ) {
            def Sphere "s"
            {
                double radius = 0.5
            }
        }
    }
}
"""

#: A layer without a defaultPrim.
PAYLOAD = """#usda 1.0
def Xform "nodefault"
{
    def Cone "k"
    {
    }
}
"""


@pytest.fixture
def stage(tmp_path):
    for name, text in (("main", MAIN), ("lib", LIBRARY), ("pay", PAYLOAD)):
        (tmp_path / f"{name}.usda").write_text(text)
    return tmp_path / "main.usda"


def test_what_can_be_composed_is_drawn_and_the_rest_is_one_warning(stage):
    scene = load(stage)
    assert {path: len(p.transforms) for path, p in scene.placements.items()} == {
        "/w/one/c": 1,
        "/w/two/s": 1,
        "/w/three/k": 1,
        "/w/changing": 1,
        "/w/outer/p/inner/ball": 4,
        "/w/outer/p/lamp/stand": 1,
    }
    (warning,) = scene.warnings
    assert "/w/two" in warning and "pay.usda" in warning


def test_lights_in_nested_instancers_stand_in_each_copy(stage):
    lights = load(stage).lights
    places = {path: light.transform[3, :3].tolist() for path, light in lights.items()}
    assert places == {
        "/w/outer/p/inner/lamp[1]": [0, 5, 1],
        "/w/outer/p/inner/lamp[4]": [4, 5, 0.5],
        "/w/outer/p/lamp/d[2]": [-4, 5, 0],
    }
    assert lights["/w/outer/p/inner/lamp[4]"].transform[0, 0] == 0.5


def test_a_variant_may_be_chosen_below_a_payload(stage):
    scene = load(stage, variants={"/w/two": {"look": "a"}})
    assert "/w/two/c" in scene.placements and not scene.warnings


def test_cameras_ignore_the_scale_above_them(stage):
    camera = choose_camera(load(stage))
    np.testing.assert_allclose(camera.frame_of_reference(), [(1, 0, 0), (0, 0, -1), (0, 1, 0)], atol=1e-7)
    np.testing.assert_allclose(camera.transform[3, :3], [0, -16, 3])
    assert camera.window(1.5)[2] == pytest.approx(0.0036 / 2 / 0.0035)


def test_frames_in_any_order_are_what_each_time_is_alone(stage):
    reader = StageReader(stage)
    for time in (3.0, 1.0, 1.5, 2.0, 1.0, None):
        together, alone = reader.read(time), load(stage, time)
        assert list(together.placements) == list(alone.placements) and list(together.lights) == list(alone.lights)
        for path, placement in alone.placements.items():
            np.testing.assert_array_equal(together.placements[path].transforms, placement.transforms)
        for path, mesh in alone.meshes.items():
            np.testing.assert_array_equal(together.meshes[path].points, mesh.points)
            np.testing.assert_array_equal(together.meshes[path].triangles, mesh.triangles)
            for name, primvar in mesh.primvars.items():
                np.testing.assert_array_equal(together.meshes[path].primvars[name].values, primvar.values)


@pytest.mark.parametrize(
    ("time", "faces", "color"), [(1, 1, (1, 0, 0)), (1.5, 1, (1, 0, 0)), (2, 2, (0, 1, 0)), (3, 2, (0, 1, 0))]
)
def test_topology_and_colours_change_together(stage, time, faces, color):
    mesh = load(stage, time).meshes["/w/changing"]
    assert len(mesh.triangles) == faces
    np.testing.assert_array_equal(mesh.primvars["displayColor"].values, np.tile(color, (len(mesh.points), 1)))
