"""Textures and primvar readers arrive from a stage with their places, transforms and fallbacks."""

import numpy as np
import pytest
from pxr import Sdf
from test_textures import write
from usd_stage import scene_of, stage_of

from warprender import PrimvarReader, Texture
from warprender.usd import load

SQUARE = """def Mesh "m" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
    rel material:binding = </A>
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    uniform token subdivisionScheme = "none"
    texCoord2f[] primvars:uv = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "vertex" )
    float[] primvars:gloss = [0.5] }"""
READER = """def Shader "r" { uniform token info:id = "UsdPrimvarReader_float2"
    string inputs:varname = "uv"
    float2 outputs:result }"""
ST = "float2 inputs:st.connect = </A/r.outputs:result>"


def texture(inputs: str = ST, name: str = "t", file: str = "x.png") -> str:
    return f"""def Shader "{name}" {{ uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{file}@
        {inputs}
        float3 outputs:rgb
        float outputs:r
        float outputs:a }}"""


def material(surface: str, *nodes: str, inputs: str = "") -> str:
    return f"""def Material "A" {{ {inputs}
        token outputs:surface.connect = </A/s.outputs:surface>
        def Shader "s" {{ uniform token info:id = "UsdPreviewSurface"
            {surface}
            token outputs:surface }}
        {" ".join(nodes)} }}"""


def read(surface: str, *nodes: str, inputs: str = ""):
    scene = scene_of(material(surface, *nodes, inputs=inputs) + SQUARE)
    return scene.materials["/A"], scene


COLOR = "color3f inputs:diffuseColor.connect = </A/t.outputs:rgb>"


def test_a_texture_keeps_what_its_node_says():
    inputs = f"""{ST}
        token inputs:wrapS = "mirror"
        token inputs:wrapT = "clamp"
        token inputs:sourceColorSpace = "raw"
        float4 inputs:scale = (2, 2, 2, 1)
        float4 inputs:bias = (-1, -1, -1, 0)
        float4 inputs:fallback = (0.5, 0.5, 1, 1)"""
    surface, scene = read(COLOR, texture(inputs), READER)
    found = surface.diffuseColor
    assert isinstance(found, Texture) and found.file.endswith("x.png") and found.channel == "rgb"
    assert (found.wrapS, found.wrapT, found.sourceColorSpace) == ("mirror", "clamp", "raw")
    assert (found.scale, found.bias, found.fallback) == ((2, 2, 2, 1), (-1, -1, -1, 0), (0.5, 0.5, 1, 1))
    assert found.st == PrimvarReader("uv", (0.0,))
    np.testing.assert_array_equal(found.transform, np.eye(2, 3))
    assert "uv" in scene.meshes["/m"].primvars and not scene.warnings


def test_channels_go_by_output():
    surface, _ = read("float inputs:opacity.connect = </A/t.outputs:a>", texture(), READER)
    assert surface.opacity.channel == "a"


def test_a_transform_scales_then_turns_then_moves():
    chain = """def Shader "x" { uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = </A/r.outputs:result>
        float inputs:rotation = 90
        float2 inputs:scale = (2, 3)
        float2 inputs:translation = (10, 20)
        float2 outputs:result }"""
    surface, _ = read(COLOR, texture("float2 inputs:st.connect = </A/x.outputs:result>"), chain, READER)
    # (1, 1) → (2, 3) → (-3, 2) → (7, 22).
    np.testing.assert_allclose(surface.diffuseColor.transform @ (1, 1, 1), (7, 22), atol=1e-12)


def test_transforms_chain_from_the_reader_on():
    chain = """def Shader "x" { uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = </A/y.outputs:result>
        float2 inputs:scale = (2, 2)
        float2 outputs:result }
        def Shader "y" { uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = </A/r.outputs:result>
        float2 inputs:translation = (1, 0)
        float2 outputs:result }"""
    surface, _ = read(COLOR, texture("float2 inputs:st.connect = </A/x.outputs:result>"), chain, READER)
    np.testing.assert_allclose(surface.diffuseColor.transform @ (0.5, 0.5, 1), (3, 1))


def test_names_come_through_the_interface_and_as_tokens():
    reader = READER.replace('string inputs:varname = "uv"', "string inputs:varname.connect = </A.inputs:set>")
    surface, _ = read(COLOR, texture(), reader, inputs='string inputs:set = "uv"')
    assert surface.diffuseColor.st.varname == "uv"
    surface, _ = read(COLOR, texture(), READER.replace("string inputs", "token inputs"))
    assert surface.diffuseColor.st.varname == "uv"


def test_files_wraps_and_node_graphs_are_followed():
    graph = f"""def NodeGraph "g" {{ asset inputs:image = @y.png@
        token inputs:wrap = "repeat"
        color3f outputs:out.connect = </A/g/t.outputs:rgb>
        {
        texture(
            ST
            + '''
            token inputs:wrapS.connect = </A/g.inputs:wrap>'''
        ).replace("asset inputs:file = @x.png@", "asset inputs:file.connect = </A/g.inputs:image>")
    } }}"""
    surface, scene = read("color3f inputs:diffuseColor.connect = </A/g.outputs:out>", graph, READER)
    assert surface.diffuseColor.file == "y.png" and surface.diffuseColor.wrapS == "repeat"
    assert not scene.warnings


def test_primvars_are_read_as_values():
    reader = """def Shader "p" { uniform token info:id = "UsdPrimvarReader_float"
        string inputs:varname = "gloss"
        float inputs:fallback = 0.25
        float outputs:result }"""
    surface, scene = read("float inputs:roughness.connect = </A/p.outputs:result>", reader)
    assert surface.roughness == PrimvarReader("gloss", (0.25,))
    assert scene.meshes["/m"].primvars["gloss"].values.tolist() == [[0.5]]


BROKEN = {
    "diffuseColor is connected to what is not there": [COLOR],
    "UsdHue is not read": [COLOR, 'def Shader "t" { uniform token info:id = "UsdHue"\nfloat3 outputs:rgb }'],
    "a shader without an id is not read": [COLOR, 'def Shader "t" { float3 outputs:rgb }'],
    "it names no primvar": [COLOR, texture(), READER.replace('"uv"', '""')],
    "it is connected to itself": [
        COLOR,
        texture("float2 inputs:st.connect = </A/x.outputs:result>"),
        'def Shader "x" { uniform token info:id = "UsdTransform2d"\n'
        "float2 inputs:in.connect = </A/x.outputs:result>\nfloat2 outputs:result }",
    ],
    "wrapS 'sideways' is not one of": [COLOR, texture(ST + '\ntoken inputs:wrapS = "sideways"'), READER],
    "scale is ": [COLOR, texture(ST + "\nfloat4 inputs:scale = (nan, 1, 1, 1)"), READER],
    "scale is connected to a shader": [
        COLOR,
        texture(ST + "\nfloat4 inputs:scale.connect = </A/t.outputs:rgb>"),
        READER,
    ],
    "displacement is not drawn": ["float inputs:displacement = 0.5"],
    "diffuseColor is connected to what is not there or to itself": [
        "color3f inputs:diffuseColor.connect = </A/g.outputs:o>",
        'def NodeGraph "g" { color3f outputs:o.connect = </A/h.outputs:o> }',
        'def NodeGraph "h" { color3f outputs:o.connect = </A/g.outputs:o> }',
    ],
}


@pytest.mark.parametrize("message", BROKEN)
def test_what_is_broken_is_named_once_and_falls_back(message):
    surface, scene = read(*BROKEN[message])
    own = [line for line in scene.warnings if line.startswith("/A")]
    assert len(own) == 1 and message in own[0]
    assert isinstance(surface.diffuseColor, Texture) or surface.diffuseColor == (0.18,) * 3


def test_packages_and_tiles(tmp_path):
    for tile in (1001, 1012):
        write(tmp_path / f"u.{tile}.png", np.full((1, 1, 3), 51, np.uint8))
    text = material(COLOR, texture(file="./u.<UDIM>.png"), READER) + SQUARE
    stage = stage_of(text)
    stage.GetRootLayer().Export(str(tmp_path / "s.usda"))
    expected = [1001, 1012]
    loose = load(tmp_path / "s.usda").materials["/A"].diffuseColor
    assert [tile for tile, _ in loose.sources()] == expected
    package = str(tmp_path / "s.usdz")
    with Sdf.ZipFileWriter.CreateNew(package) as archive:
        for name in ("s.usda", "u.1001.png", "u.1012.png"):
            archive.AddFile(str(tmp_path / name), name)
    packed = load(package).materials["/A"].diffuseColor
    assert [tile for tile, _ in packed.sources()] == expected
    assert "[" in packed.file and packed.least() == pytest.approx(0.0)
