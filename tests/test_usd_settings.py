"""Render settings, products, variables and passes decide which picture is drawn."""

import numpy as np
import OpenImageIO as oiio
import pytest
from usd_stage import scene_of

import warprender as wr
from warprender import images
from warprender.camera import Camera, DataWindow
from warprender.cli import main
from warprender.framing import choose_camera, choose_data_window
from warprender.scene import Scene, SceneError
from warprender.usd.render_vars import output_of

SPHERE = """def Sphere "s" { double3 xformOp:translate = (0.3, 0.2, -6)
    uniform token[] xformOpOrder = ["xformOp:translate"] }
def Camera "c" { float fStop = 2
    float focusDistance = 5 }
def Camera "d" { float horizontalAperture = 40
    float verticalAperture = 20 }
"""


def settings_of(body, products=""):
    return scene_of(SPHERE + f'def RenderSettings "r" {{ {body} }} ' + products).settings


def product(body):
    scene = settings_of(
        """rel camera = </c>
        uniform int2 resolution = (40, 30)
        uniform float pixelAspectRatio = 2
        rel products = </p>""",
        f'def RenderProduct "p" {{ {body} }}',
    )
    (found,) = scene.products
    return found


def test_a_product_has_from_its_settings_what_it_does_not_say():
    found = product('token productName = "a.exr"')
    assert (found.resolution, found.camera, found.pixelAspectRatio) == ((40, 30), "/c", 2.0)
    assert (found.productName, found.outputs) == ("a.exr", ("color",))


def test_a_product_overrides_its_settings():
    found = product("""token productName = "a.exr"
        rel camera = </d>
        uniform int2 resolution = (8, 4)
        uniform float pixelAspectRatio = 1
        uniform token aspectRatioConformPolicy = "cropAperture"
        uniform float4 dataWindowNDC = (-0.5, 0, 1, 0.5)
        uniform bool disableDepthOfField = 1
        uniform bool disableMotionBlur = 1""")
    assert (found.resolution, found.camera, found.pixelAspectRatio) == ((8, 4), "/d", 1.0)
    assert (found.aspectRatioConformPolicy, found.dataWindowNDC) == ("cropAperture", (-0.5, 0, 1, 0.5))
    assert found.disableDepthOfField and found.disableMotionBlur


def test_a_product_without_any_resolution_has_the_schemas():
    scene = scene_of('def RenderSettings "r" { rel products = </p> } def RenderProduct "p" { }')
    (found,) = scene.settings.products
    assert found.resolution == (2048, 1080) and found.productName == "p.exr"
    assert scene.warnings == ["/p: it has no productName; p.exr is taken"]


@pytest.mark.parametrize(
    ("body", "warning"),
    [
        ("uniform float pixelAspectRatio = 0", "pixelAspectRatio 0.0 is ignored"),
        ("uniform float pixelAspectRatio = nan", "pixelAspectRatio nan is ignored"),
        ('uniform token aspectRatioConformPolicy = "stretch"', "aspectRatioConformPolicy stretch is ignored"),
        ("uniform float4 dataWindowNDC = (0.5, 0, 0.5, 1)", "is ignored"),
        ("uniform float4 dataWindowNDC = (nan, 0, 1, 1)", "is ignored"),
        ("uniform int2 resolution = (0, -3)", "resolution 0 by -3 is ignored"),
        ("rel camera = </nobody>", "its camera /nobody does not exist"),
        ("rel products = </c>", "its product /c is no RenderProduct prim"),
        ('uniform token[] includedPurposes = ["default", "all"]', "includedPurposes has all"),
        ('uniform token renderingColorSpace = "acescg"', "renderingColorSpace acescg is not drawn in"),
    ],
)
def test_what_makes_no_sense_is_named_once_and_left_out(body, warning):
    scene = scene_of(SPHERE + f'def RenderSettings "r" {{ {body} }}')
    assert len(scene.warnings) == 1 and scene.warnings[0].startswith("/r: ") and warning in scene.warnings[0]
    assert (scene.settings.pixelAspectRatio, scene.settings.dataWindowNDC) == (1.0, (0.0, 0.0, 1.0, 1.0))


def test_included_purposes_of_the_settings_hold_unless_others_are_asked_for():
    text = """def Sphere "proxy" { uniform token purpose = "proxy" }
        def Sphere "render" { uniform token purpose = "render" }
        def Sphere "default" { } def SphereLight "light" { uniform token purpose = "render" }"""
    settings = 'def RenderSettings "r" { uniform token[] includedPurposes = ["default", "render"] }'
    assert set(scene_of(text).placements) == {"/proxy", "/default"} and not scene_of(text).lights
    with_settings = scene_of(text + settings)
    assert set(with_settings.placements) == {"/render", "/default"} and set(with_settings.lights) == {"/light"}
    assert set(scene_of(text + settings, purposes=("proxy",)).placements) == {"/proxy", "/default"}


@pytest.mark.parametrize(
    ("purposes", "color"),
    [(None, 1.0), ('["full", ""]', 1.0), ('["preview", ""]', 2.0), ('[""]', 3.0), ('["other", ""]', 3.0)],
)
def test_material_binding_purposes_choose_the_material(purposes, color):
    materials = "".join(
        f"""def Material "m{i}" {{ token outputs:surface.connect = </m{i}/s.outputs:surface>
            def Shader "s" {{ uniform token info:id = "UsdPreviewSurface"
                float inputs:ior = {i}
                token outputs:surface }} }} """
        for i in (1, 2, 3)
    )
    body = f"uniform token[] materialBindingPurposes = {purposes}" if purposes else ""
    scene = scene_of(
        materials
        + f'def RenderSettings "r" {{ {body} }}'
        + """def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"]) { rel material:binding:full = </m1>
            rel material:binding:preview = </m2>
            rel material:binding = </m3> }"""
    )
    assert scene.materials[scene.placements["/ball"].material].ior == color


def test_no_depth_of_field_where_the_settings_say_so():
    text = SPHERE + 'def RenderSettings "r" { rel camera = </c> } '
    assert choose_camera(scene_of(text)).fStop == 2
    text = text.replace("</c>", "</c>\nuniform bool disableDepthOfField = 1")
    assert choose_camera(scene_of(text)).fStop == 0
    assert choose_camera(scene_of(text), "/c").effects() == ("perspective",)


@pytest.mark.parametrize(
    ("ndc", "expected"),
    [
        ((0, 0, 1, 1), (0, 0, 10, 4)),
        ((0.5, 0, 1, 1), (5, 0, 5, 4)),
        ((0, 0.5, 1, 1), (0, 0, 10, 2)),
        ((0, 0, 1, 0.25), (0, 3, 10, 1)),
        ((0.05, 0, 0.95, 1), (0, 0, 9, 4)),
        ((-0.5, -1, 1.5, 2), (-5, -4, 20, 12)),
    ],
)
def test_a_pixel_is_drawn_where_its_centre_is_in_the_data_window(ndc, expected):
    window = DataWindow.of((10, 4), ndc)
    assert (window.x, window.y, window.width, window.height) == expected
    centres = (np.arange(-20, 30) + 0.5) / 10
    inside = centres[(centres >= ndc[0]) & (centres < ndc[2])]
    assert len(inside) == window.width and inside[0] == pytest.approx((window.x + 0.5) / 10)


def test_a_data_window_without_a_pixel_is_an_error():
    scene = scene_of('def RenderSettings "r" { uniform float4 dataWindowNDC = (0.5, 0, 0.51, 1) }')
    with pytest.raises(SceneError, match="10x4 pixels holds no pixel's centre"):
        choose_data_window(scene, (10, 4))


@pytest.mark.parametrize("policy", ["expandAperture", "cropAperture", "adjustApertureWidth", "adjustPixelAspectRatio"])
@pytest.mark.parametrize("visibility", ["rays", "raster"])
def test_a_data_window_is_a_part_of_the_whole_picture(policy, visibility):
    scene = scene_of(
        SPHERE
        + f"""def RenderSettings "r" {{ rel camera = </d>
        uniform int2 resolution = (40, 30)
        uniform token aspectRatioConformPolicy = "{policy}" }}"""
    )
    names = ("primId", "normal", "Neye", "cameraDepth")
    whole = wr.Renderer(scene, outputs=names, visibility=visibility).render()
    scene.settings.dataWindowNDC = (0.25, 0.2, 1.5, 0.8)
    part = wr.Renderer(scene, outputs=names, visibility=visibility).render()
    assert part.resolution == (50, 18)
    assert (part.numpy("primId")[:, :30] == whole.numpy("primId")[6:24, 10:]).all()
    assert (part.numpy("primId") == 0).any()
    # Rays differ by some roundings, 2e-6 of a unit at the sphere; where they graze it, by 1 / cos as much.
    cosine = np.maximum(whole.numpy("Neye")[6:24, 10:, 2], 0.1)
    turned = np.abs(part.numpy("normal")[:, :30] - whole.numpy("normal")[6:24, 10:]).max(-1)
    assert (turned * cosine <= 4e-6).all()
    deeper = np.abs(part.numpy("cameraDepth")[:, :30] - whole.numpy("cameraDepth")[6:24, 10:])
    assert (deeper * cosine <= 4e-6).all()


def test_overscan_sees_beyond_the_picture():
    scene = scene_of(
        """def Sphere "s" { double3 xformOp:translate = (-5, 0, -10)
            uniform token[] xformOpOrder = ["xformOp:translate"] } def Camera "c" { float focalLength = 20.955 } """
    )
    scene.settings.camera, scene.settings.resolution = "/c", (16, 16)
    whole = wr.Renderer(scene, outputs="primId").render().numpy("primId")
    scene.settings.dataWindowNDC = (-0.5, 0, 1, 1)
    wide = wr.Renderer(scene, outputs="primId").render().numpy("primId")
    assert wide.shape == (16, 24) and (wide[:, 8:] == whole).all() and (wide[:, :8] == 0).any()
    assert (whole == 0).any() and not (whole == 0).all()


@pytest.mark.parametrize(
    ("kind", "name", "output"),
    [
        ("raw", "color", "color"),
        ("raw", "Ci", "color"),
        ("raw", "RGBA", "color"),
        ("raw", "depth", "depth"),
        ("raw", "Z", "cameraDepth"),
        ("raw", "N", "normal"),
        ("raw", "Neye", "Neye"),
        ("raw", "P", "position"),
        ("raw", "primId", "primId"),
        ("lpe", "C.*[LO]", "color"),
        ("lpe", "C.*[<L.>O]", "color"),
        ("lpe", "C[DS]*[<L.>O]", "color"),
        ("lpe", "C<RD>L", ""),
        ("raw", "cryptomatte", ""),
        ("primvar", "st", ""),
    ],
)
def test_variables_go_by_hydras_names_and_by_other_renderers(kind, name, output):
    assert output_of(kind, name) == output


PRODUCTS = """#usda 1.0
( renderSettingsPrimPath = "/r" )
def Sphere "s" {}
def RenderSettings "r" {
    int2 resolution = (8, 6)
    rel products = [</beauty>, </crop>, </lidar>]
}
def RenderProduct "beauty" {
    token productName = "beauty.exr"
    rel orderedVars = [</Ci>, </far>, </again>, </odd>]
}
def RenderProduct "crop" {
    token productName = "crop.png"
    int2 resolution = (20, 10)
    float4 dataWindowNDC = (0.5, 0, 1.5, 1)
    rel orderedVars = [</far>]
}
def RenderProduct "lidar" {
    token productType = "lidar"
}
def RenderVar "Ci" {}
def RenderVar "far" {
    string sourceName = "cameraDepth"
}
def RenderVar "again" {
    string sourceName = "lpe:C.*[<L.>O]"
}
def RenderVar "odd" {
    string sourceName = "st"
    token sourceType = "primvar"
}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_all_products_are_drawn_in_one_run(folder, capsys):
    (folder / "a.usda").write_text(PRODUCTS)
    assert main(["render", "a.usda", "--samples", "1"]) == 0
    layers, _ = images.read("beauty.exr")
    assert {name: layer.shape for name, layer in layers.items()} == {"color": (6, 8, 4), "cameraDepth": (6, 8)}
    assert images.read("crop.png")[0]["color"].shape == (10, 20, 4)
    warnings = capsys.readouterr().err.splitlines()
    assert [w.removeprefix("warprender: warning: ") for w in warnings] == [
        "/crop: crop.png does not keep cameraDepth; .exr holds all",
        "/odd: there is no output for primvar 'st', and it is left out",
        "/lidar: productType lidar is not drawn",
    ]


def test_products_that_see_the_same_are_rendered_once(folder, monkeypatch):
    text = (
        PRODUCTS.replace("</crop>, </lidar>", "</data>, </crop>")
        + """def RenderProduct "data"
{
    token productName = "data.exr"
    rel orderedVars = [</far>, </normal>]
}
def RenderVar "normal" {}
"""
    )
    (folder / "a.usda").write_text(text)
    made, renderer = [], wr.Renderer
    monkeypatch.setattr(wr, "Renderer", lambda *a, **k: made.append(k["outputs"]) or renderer(*a, **k))
    assert main(["render", "a.usda", "--samples", "1"]) == 0
    assert made == [("color", "cameraDepth", "normal"), ("color",)]
    beauty, data = (images.read(f"{name}.exr")[0] for name in ("beauty", "data"))
    assert set(beauty) == {"color", "cameraDepth"} and set(data) == {"cameraDepth", "normal"}
    np.testing.assert_array_equal(beauty["cameraDepth"], data["cameraDepth"])
    assert images.read("crop.png")[0]["color"].shape == (10, 20, 4)


def test_products_are_drawn_from_python():
    scene = scene_of(
        SPHERE
        + """def RenderSettings "r" { rel products = </p> }
        def RenderProduct "p" { uniform int2 resolution = (8, 6)
            rel camera = </d>
            rel orderedVars = </far> }
        def RenderVar "far" { uniform string sourceName = "cameraDepth" }"""
    )
    (found,) = scene.settings.products
    frame = wr.render(scene.for_product(found), outputs=found.outputs)
    assert list(frame.outputs) == ["cameraDepth"] and frame.resolution == (8, 6)
    assert scene.settings.path == "/r"


def test_an_exr_keeps_the_place_of_its_data_window(folder):
    (folder / "a.usda").write_text(PRODUCTS.replace("crop.png", "crop.exr"))
    assert main(["render", "a.usda", "--samples", "1"]) == 0
    spec = oiio.ImageInput.open("crop.exr").spec()
    assert (spec.x, spec.y, spec.width, spec.height) == (10, 0, 20, 10)
    assert (spec.full_x, spec.full_y, spec.full_width, spec.full_height) == (0, 0, 20, 10)


def test_frames_of_products_go_to_one_file_each(folder):
    (folder / "a.usda").write_text(PRODUCTS.replace("beauty.exr", "b.##.exr").replace("crop.png", "c.##.png"))
    assert main(["render", "a.usda", "--samples", "1", "-f", "1:2"]) == 0
    assert sorted(p.name for p in folder.iterdir() if p.suffix != ".usda") == [
        "b.01.exr", "b.02.exr", "c.01.png", "c.02.png",
    ]  # fmt: skip


def test_a_product_may_be_named_anew_at_each_time(folder):
    names = 'token productName.timeSamples = { 1: "one.exr", 2: "two.exr" }'
    text = PRODUCTS.replace('token productName = "beauty.exr"', names).replace(", </crop>, </lidar>", "")
    (folder / "a.usda").write_text(text)
    assert main(["render", "a.usda", "--samples", "1", "-f", "1:2"]) == 0
    assert (folder / "one.exr").exists() and (folder / "two.exr").exists()


@pytest.mark.parametrize(
    ("text", "flags", "message"),
    [
        (PRODUCTS, ["-f", "1:2"], "beauty.exr: all frames would go there; productName needs a placeholder"),
        (PRODUCTS.replace("crop.png", "beauty.exr"), [], "beauty.exr: two render products have this productName"),
        ("#usda 1.0\n", [], "a.usda has no render products to name files"),
        (PRODUCTS.replace("</beauty>, </crop>, ", ""), [], "/r has no render products to name files"),
        (PRODUCTS.replace("beauty.exr", "no/b.exr").replace("crop.png", "c.tga"), [], "/beauty: no/b.exr: the folder"),
    ],
)
def test_without_output_there_must_be_products_that_can_be_written(folder, capsys, text, flags, message):
    (folder / "a.usda").write_text(text)
    assert main(["render", "a.usda", *flags]) == 1
    error = capsys.readouterr().err.splitlines()[-1]
    assert error.startswith("warprender: error: ") and message in error


def test_flags_overrule_products(folder):
    (folder / "a.usda").write_text(PRODUCTS)
    assert main(["render", "a.usda", "--samples", "1", "--resolution", "4x2", "--aov", "color"]) == 0
    layers, _ = images.read("beauty.exr")
    assert {name: layer.shape for name, layer in layers.items()} == {"color": (2, 4, 4)}


PASS = """def Sphere "a" { } def Sphere "b" { } def Xform "x" { def Sphere "c" { } def SphereLight "l" { } }
def RenderSettings "r" { uniform int2 resolution = (8, 6) } def RenderSettings "q" { }
def RenderPass "pass" { rel renderSource = </r>
"""


@pytest.mark.parametrize(
    ("collections", "placements", "lights"),
    [
        ("", {"/a", "/b", "/x/c"}, {"/x/l"}),
        ("rel collection:prune:includes = </x>", {"/a", "/b"}, set()),
        ("rel collection:renderVisibility:excludes = [</a>, </x/l>]", {"/b", "/x/c"}, set()),
        (
            "uniform bool collection:renderVisibility:includeRoot = 0\nrel collection:renderVisibility:includes = </x>",
            {"/x/c"},
            {"/x/l"},
        ),
    ],
)
def test_a_pass_takes_its_settings_and_leaves_prims_out(collections, placements, lights):
    scene = scene_of(PASS + collections + " }", render_pass="/pass")
    assert (set(scene.placements), set(scene.lights)) == (placements, lights)
    assert scene.settings.path == "/r" and not scene.warnings


def test_what_a_pass_asks_for_in_vain_is_named():
    scene = scene_of(
        PASS
        + """rel inputPasses = </pass>
            rel collection:matte:includes = </a>
            rel collection:cameraVisibility:excludes = </b> }""",
        render_pass="/pass",
    )
    assert [w.split(": ")[1].split()[0] for w in scene.warnings] == ["its", "cameraVisibility", "matte"]
    assert len(scene.placements) == 3


@pytest.mark.parametrize(("path", "message"), [("/none", "no such RenderPass"), ("/empty", "renderSource names no")])
def test_a_pass_that_cannot_be_drawn_is_an_error(path, message):
    with pytest.raises(SceneError, match=message):
        scene_of(PASS + '} def RenderPass "empty" { }', render_pass=path)


def test_a_pass_and_settings_are_one_too_many():
    with pytest.raises(SceneError, match="/pass: it has settings of its own"):
        scene_of(PASS + "}", render_pass="/pass", render_settings="/q")


def test_conforming_follows_the_pixels_aspect():
    camera = Camera(horizontalAperture=20, verticalAperture=10, focalLength=10)
    assert camera.window(1.0) == pytest.approx((-1, -1, 1, 1))
    assert camera.window(1.0, "cropAperture") == pytest.approx((-0.5, -0.5, 0.5, 0.5))
    assert camera.window(1.0, "adjustApertureWidth") == pytest.approx((-0.5, -0.5, 0.5, 0.5))
    assert camera.window(1.0, "adjustApertureHeight") == pytest.approx((-1, -1, 1, 1))
    assert camera.window(1.0, "adjustPixelAspectRatio") == pytest.approx((-1, -0.5, 1, 0.5))
    assert Scene().settings.products == ()
