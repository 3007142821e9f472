"""UsdLux lights arrive with their inputs; what is authored and not drawn is named."""

import numpy as np
import pytest
from pxr import UsdUtils
from usd_stage import scene_of

from warprender.images import write
from warprender.lights import (
    CylinderLight,
    DiskLight,
    DistantLight,
    DomeLight,
    RectLight,
    Shadow,
    Shaping,
    SphereLight,
)
from warprender.usd import load


@pytest.mark.parametrize("kind", [SphereLight, RectLight, DiskLight, CylinderLight, DistantLight, DomeLight])
def test_defaults_are_the_schemas(kind):
    scene = scene_of(f'def {kind.__name__} "l" {{ }}')
    light, default = scene.lights["/l"], kind()
    assert type(light) is kind and not scene.warnings
    assert light.intensity == default.intensity and light.color == default.color


def test_inputs_arrive_under_their_names_of_today_and_of_old():
    new = """def RectLight "l" { float inputs:width = 3
        color3f inputs:color = (1, 0, 0)
        bool inputs:normalize = 1 }"""
    for text in (new, new.replace("inputs:", "")):
        light = scene_of(text).lights["/l"]
        assert (light.width, light.color, light.normalize) == (3, (1, 0, 0), True)


def light_of(authored, schemas="", kind="RectLight", metadata="", **more):
    """The light `/l` of a stage that has nothing else, or `more` prims."""
    applied = f"( prepend apiSchemas = [{', '.join(repr(s) for s in schemas.split())}] )".replace("'", '"')
    return scene_of(f'def {kind} "l" {applied if schemas else ""} {{ {authored} }}', metadata, **more).lights["/l"]


def test_shaping_arrives():
    shaping = light_of(
        """float inputs:shaping:focus = 2
        color3f inputs:shaping:focusTint = (1, 0.5, 0)
        float inputs:shaping:cone:angle = 30
        float inputs:shaping:cone:softness = 0.25
        float inputs:shaping:ies:angleScale = -0.5
        bool inputs:shaping:ies:normalize = 1""",
        "ShapingAPI",
    ).shaping
    assert shaping == Shaping(2.0, (1, 0.5, 0), 30.0, 0.25, None, -0.5, True)


def test_the_cone_of_90_degrees_comes_with_the_schema():
    assert light_of("", kind="SphereLight").shaping.coneAngle == 180
    assert light_of("", "ShapingAPI", kind="SphereLight").shaping.coneAngle == 90
    assert light_of("float shaping:cone:angle = 20", kind="SphereLight").shaping.coneAngle == 20
    # A dome has no axis that a cone could be about.
    assert light_of("", "ShapingAPI", kind="DomeLight").shaping == Shaping()


def test_shadows_arrive_where_the_schema_is_applied():
    authored = """bool inputs:shadow:enable = 0
        color3f inputs:shadow:color = (1, 0, 0)
        float inputs:shadow:distance = 3
        float inputs:shadow:falloff = 2
        float inputs:shadow:falloffGamma = 4"""
    assert light_of(authored, "ShadowAPI").shadow == Shadow(False, (1, 0, 0), 3.0, 2.0, 4.0)
    assert light_of(authored).shadow == Shadow()


WORLD = """
    def Xform "World" {
        def Sphere "a" { }
        def Sphere "b" { }
        def Xform "Group" { def Sphere "c" { } } }
    def Sphere "d" { }"""
EVERYTHING = {"/World/a", "/World/b", "/World/Group/c", "/d"}


@pytest.mark.parametrize("kind", ["lightLink", "shadowLink"])
@pytest.mark.parametrize(
    ("authored", "members"),
    [
        ("", EVERYTHING),
        ("bool collection:{0}:includeRoot = 1", EVERYTHING),
        ("bool collection:{0}:includeRoot = 0", set()),
        ("rel collection:{0}:excludes = </World/Group>", EVERYTHING - {"/World/Group/c"}),
        (
            """bool collection:{0}:includeRoot = 0
            rel collection:{0}:includes = [</World/Group>, </d>]""",
            {"/World/Group/c", "/d"},
        ),
        (
            """bool collection:{0}:includeRoot = 0
            pathExpression collection:{0}:membershipExpression = "/World/[ab]" """,
            {"/World/a", "/World/b"},
        ),
    ],
)
def test_links_arrive_as_the_placements_they_leave_out(kind, authored, members):
    scene = scene_of(f'def SphereLight "l" {{ {authored.format(kind)} }} {WORLD}')
    light = scene.lights["/l"]
    unlit, unshadowed = light.unlit, light.unshadowed
    left_out, other = (unlit, unshadowed) if kind == "lightLink" else (unshadowed, unlit)
    assert EVERYTHING - left_out == members and not other and not scene.warnings


def test_links_of_instances_follow_their_instancers():
    scene = scene_of(
        """def SphereLight "l" { rel collection:lightLink:excludes = </I> }
        def PointInstancer "I" {
            rel prototypes = </P>
            int[] protoIndices = [0, 0]
            point3f[] positions = [(0, 0, 0), (1, 0, 0)] }
        class Sphere "P" { }"""
    )
    assert scene.lights["/l"].unlit == set(scene.placements)


@pytest.fixture
def picture_file(tmp_path):
    path = tmp_path / "map.exr"
    row, column = np.mgrid[0:4, 0:8]
    write(path, {"color": np.stack([row, column, row * 0, row * 0 + 1], -1).astype(np.float32)})
    return path


@pytest.mark.parametrize("kind", ["RectLight", "DomeLight"])
def test_textures_arrive(kind, picture_file):
    light = light_of(f"asset inputs:texture:file = @{picture_file}@", kind=kind)
    np.testing.assert_array_equal(light.texture.texels[2, 5], (2, 5, 0))


def test_8_bit_pictures_are_on_the_srgb_curve(tmp_path):
    path = tmp_path / "map.png"
    write(path, {"color": np.full((2, 4, 4), 0.5, np.float32)})
    light = light_of(f"asset inputs:texture:file = @{path}@", kind="DomeLight")
    np.testing.assert_allclose(light.texture.texels, 0.5, atol=0.003)


@pytest.mark.parametrize(
    ("kind", "authored", "up", "axis"),
    [
        ("DomeLight", "", "Z", "Y"),
        ("DomeLight_1", "", "Z", "Z"),
        ("DomeLight_1", "", "Y", "Y"),
        ("DomeLight_1", 'uniform token poleAxis = "Y"', "Z", "Y"),
        ("DomeLight_1", 'uniform token poleAxis = "Z"', "Y", "Z"),
    ],
)
def test_the_poles_of_domes(kind, authored, up, axis):
    assert light_of(authored, kind=kind, metadata=f'upAxis = "{up}"').poleAxis == axis


def test_profiles_arrive(tmp_path):
    path = tmp_path / "a.ies"
    path.write_text("IESNA91\nTILT=NONE\n1 -1 2 2 1 1 2 0 0 0\n1 1 5\n0 90\n0\n10 20\n")
    profile = light_of(f"asset inputs:shaping:ies:file = @{path}@", "ShapingAPI").shaping.iesProfile
    np.testing.assert_array_equal(profile.values, [[20, 40]] * 2)


@pytest.mark.parametrize(
    ("authored", "word"),
    [
        ("asset inputs:texture:file = @nowhere.exr@", "nowhere.exr"),
        ("asset inputs:shaping:ies:file = @nowhere.ies@", "nowhere.ies"),
        ("float inputs:shaping:focus = nan", "not finite"),
        ("rel light:filters = </f>", "light:filters"),
    ],
)
def test_what_cannot_be_drawn_is_named(authored, word):
    scene = scene_of(f'def RectLight "l" {{ {authored} }}')
    assert len(scene.lights) == 1
    assert len(scene.warnings) == 1 and scene.warnings[0].startswith("/l: ") and word in scene.warnings[0]


def test_attributes_without_an_effect_are_not_named():
    scene = scene_of(
        """def RectLight "l" ( prepend apiSchemas = ["ShapingAPI", "ShadowAPI"] ) {
            float inputs:shaping:focus = 0
            float inputs:shaping:cone:angle = 90
            color3f inputs:shadow:color = (0, 0, 0)
            asset inputs:texture:file = @@ }"""
    )
    assert not scene.warnings and scene.lights["/l"].effects() == ("shaping",)


def test_lights_that_cannot_be_drawn_are_named():
    scene = scene_of(
        """def PluginLight "c" { } def SphereLight "n" { float inputs:intensity = nan }
        def PortalLight "p" { } def DomeLight "d" { }"""
    )
    assert list(scene.lights) == ["/d"]
    assert {line.split(":")[0] for line in scene.warnings} == {"/c", "/n", "/p"}


def test_domes_have_the_portals_that_they_name():
    scene = scene_of(
        """def DomeLight "d" { rel portals = [</room/a>, </room/b>, </d>] }
        def Xform "room" {
            double3 xformOp:translate = (0, 1, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
            def PortalLight "a" { float inputs:width = 3
                float inputs:height = 2 }
            def PortalLight "b" { float inputs:intensity = 5 }
            def PortalLight "c" { float inputs:width = inf } }"""
    )
    first, second = scene.lights["/d"].portals
    assert (first.width, first.height, second.width, second.height) == (3, 2, 1, 1)
    np.testing.assert_array_equal(first.transform[3, :3], (0, 1, 0))
    named = [line.split(":")[0] for line in scene.warnings]
    assert sorted(named) == ["/d", "/room/b", "/room/c"]


def test_flat_lights_need_no_height():
    light = light_of('double3 xformOp:scale = (2, 3, 0)\nuniform token[] xformOpOrder = ["xformOp:scale"]')
    np.testing.assert_allclose(light.size_factor(), 6.0)


def test_instanced_lights_are_lights_of_their_own():
    scene = scene_of(
        """def PointInstancer "I" {
            rel prototypes = </P>
            int[] protoIndices = [0, 0]
            point3f[] positions = [(0, 0, 0), (1, 0, 0)] }
        class SphereLight "P" { float inputs:radius = 2 }"""
    )
    assert [light.transform[3, 0] for light in scene.lights.values()] == [0, 1]
    assert all(light.radius == 2 for light in scene.lights.values())


@pytest.mark.parametrize("name", ["SphereLight.treatAsPoint", "CylinderLight.treatAsLine"])
def test_inputs_that_never_had_the_prefix_are_not_called_old(name):
    kind, field = name.split(".")
    scene = scene_of(f'def {kind} "l" {{ bool {field} = 1 }} def Sphere "ball" {{ }}')
    assert getattr(scene.lights["/l"], field) is True
    assert not scene.warnings


@pytest.mark.parametrize("packed", [False, True])
def test_profiles_are_read_from_packages_too(tmp_path, packed):
    (tmp_path / "beam.ies").write_text("IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 2 1 1 2 0 0 0 1 1 10\n0 90\n0\n40 20\n")
    usda = """#usda 1.0
def SphereLight "l" ( prepend apiSchemas = ["ShapingAPI"] )
{
    asset inputs:shaping:ies:file = @./beam.ies@
}
"""
    stage = tmp_path / "lamp.usda"
    stage.write_text(usda)
    if packed:
        assert UsdUtils.CreateNewUsdzPackage(str(stage), str(tmp_path / "lamp.usdz"))
        (tmp_path / "beam.ies").unlink()
        stage = tmp_path / "lamp.usdz"
    scene = load(str(stage))
    assert not scene.warnings
    np.testing.assert_array_equal(scene.lights["/l"].shaping.iesProfile.values, [[40, 20]] * 2)
