"""Opening stages: files, metadata, USD's own diagnostics, and the assets shared with this project."""

from pathlib import Path

import pytest
from usd_stage import scene_of

from warprender.scene import SceneError
from warprender.usd import load

ASSETS = Path(__file__).parents[2] / "shared" / "usd_assets"
SOME_ASSETS = (
    "arnold_regression/test_0202/data/test.usda",
    "lux_analytic/rect_normalized.usda",
    "openusd_baselines/ColorOpacityPrimvar/color_opacity_primvar.usda",
    "openusd_baselines/Instancing/ni_pi.usda",
    "wg_normals_bias_scale/NormalsTextureBiasAndScale.usdz",
    "wg_test_assets/schemaTests/usdGeom/meshes/points_types/pointsTypes.usda",
    "wg_test_assets/schemaTests/usdGeom/transforms/weird_matrix_transform.usda",
)


def test_a_folder_is_named(tmp_path):
    with pytest.raises(SceneError, match="is a folder, not a USD stage"):
        load(tmp_path)


@pytest.mark.parametrize("text", [None, "this is no stage", "#usda 1.0\n( framesPerSecond = 0 )\n"])
def test_a_file_that_is_no_stage_is_an_error_that_names_it(tmp_path, text):
    file = tmp_path / "broken.usda"
    if text is not None:
        file.write_text(text)
    with pytest.raises(SceneError, match=r"broken\.usda") as error:
        load(file)
    assert "\n" not in str(error.value)


def test_a_missing_reference_is_a_warning_and_not_a_line_on_stderr(tmp_path, capfd):
    file = tmp_path / "s.usda"
    file.write_text('#usda 1.0\ndef "a" ( references = @missing.usda@ ) {\n}\ndef Sphere "s" {\n}\n')
    scene = load(file)
    assert "/s" in scene.placements
    assert len(scene.warnings) == 1 and "missing.usda" in scene.warnings[0]
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("metadata", ['upAxis = "X"', "metersPerUnit = 0", "metersPerUnit = -1"])
def test_senseless_metadata_is_a_warning(metadata):
    scene = scene_of('def Sphere "s" { }', metadata)
    assert (scene.up_axis, scene.meters_per_unit) == ("Y", 0.01)
    assert len(scene.warnings) == 1


def test_a_unit_that_a_crate_file_holds_as_a_float_is_read(monkeypatch):
    """USD's own getter raises on it; Python cannot write such a file."""

    def refuse(_):
        raise RuntimeError("Requested type double for metersPerUnit, found float")

    monkeypatch.setattr("warprender.usd.stage.UsdGeom.GetStageMetersPerUnit", refuse)
    scene = scene_of("", "metersPerUnit = 0.125")
    assert scene.meters_per_unit == 0.125 and not scene.warnings


def test_a_session_layer_wins(tmp_path):
    session = tmp_path / "session.usda"
    session.write_text('#usda 1.0\nover "s" {\n double radius = 7\n}\n')
    scene = scene_of('def Sphere "s" { }', session_layer=session)
    assert scene.placements["/s"].shape.radius == 7


@pytest.mark.skipif(not ASSETS.exists(), reason="../shared/usd_assets is not there")
@pytest.mark.parametrize("name", SOME_ASSETS)
def test_shared_assets_load(name):
    scene = load(ASSETS / name)
    assert scene.placements or scene.warnings


def test_a_missing_reference_is_one_short_warning(tmp_path):
    (tmp_path / "a.usda").write_text('#usda 1.0\ndef Xform "x" ( references = @not_there.usda@ ) { }')
    (warning,) = load(tmp_path / "a.usda").warnings
    assert "/x" in warning and "not_there.usda" in warning and "instantiating" not in warning


@pytest.mark.parametrize(
    ("prim", "message"),
    [
        ("Volume", "Volume is not drawn yet"),
        ("ParticleField3DGaussianSplat", "ParticleField3DGaussianSplat is not drawn yet"),
        ("GenerativeProcedural", "GenerativeProcedural is not drawn: nothing here generates"),
        ("HoudiniThing", "its type HoudiniThing is not known to USD here"),
        ("PluginLight", "PluginLight is not drawn yet"),
        ("PortalLight", "no dome names it in its portals"),
        ("Sphere", None),
        ("Scope", None),
        ("SkelRoot", None),
        ("Skeleton", None),
        ("OpenVDBAsset", None),
        ("PhysicsScene", None),
        ("RenderSettings", None),
        ("LightFilter", None),
    ],
)
def test_types_that_are_not_drawn_are_named_once_and_their_children_are_drawn(prim, message):
    scene = scene_of(f'def {prim} "a" {{ def Cube "b" {{ }} }} def {prim} "c" {{ }}')
    assert "/a/b" in scene.placements
    assert [line.split(": ", 1)[0] for line in scene.warnings] == (["/a", "/c"] if message else [])
    assert all(message in line for line in scene.warnings)


def test_many_prims_of_a_type_that_is_not_drawn_are_one_warning():
    scene = scene_of("".join(f'def HoudiniThing "a{i}" {{ }} ' for i in range(9)))
    (line,) = scene.warnings
    assert line.startswith("/a0 and 8 more prims: its type HoudiniThing")


def test_what_is_not_drawn_for_its_purpose_gets_no_warning():
    assert not scene_of('def Xform "g" { uniform token purpose = "guide" def HoudiniThing "a" { } }').warnings
    assert not scene_of('def Volume "a" { uniform token purpose = "guide" }').warnings


@pytest.mark.parametrize(("index", "drawn"), [(0, "far"), (1, "near"), (7, "near"), (-1, "far")])
def test_of_levels_of_detail_the_default_is_drawn(index, drawn):
    scene = scene_of(
        f"""def Xform "m" (prepend apiSchemas = ["LODRootAPI"]) {{ int lod:default:index = {index}
            def Sphere "far" {{ }} def Sphere "near" {{ }} }}"""
    )
    assert list(scene.placements) == [f"/m/{drawn}"]
    assert scene.warnings == [f"/m: of its 2 levels of detail {drawn}, the default, is drawn"]
