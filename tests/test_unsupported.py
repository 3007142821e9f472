"""`warprender check` names what a stage asks for and is not drawn, and old names that are taken: each once."""

import pytest
from usd_stage import scene_of

from warprender.checks import check

BOUND = '( prepend apiSchemas = ["MaterialBindingAPI"] )'


def bound(inputs="", identifier="UsdPreviewSurface", output="surface", extra=""):
    """A sphere with a material of one shader."""
    return f"""def Material "m" {{ token outputs:{output}.connect = </m/s.outputs:out>
        {extra}
        def Shader "s" {{ uniform token info:id = "{identifier}"
            {inputs}
            token outputs:out }} }}
      def Sphere "q" {BOUND} {{ rel material:binding = </m> }}"""


def texture(name, st=""):
    return f"""def Shader "{name}" {{ uniform token info:id = "UsdUVTexture"
        asset inputs:file = @none.png@
        {st}
        float3 outputs:rgb }}"""


READER = """def Shader "r" { uniform token info:id = "UsdPrimvarReader_float"
    token inputs:varname = "a"
    float outputs:result }"""
PATCH = """def NurbsPatch "n" { int uVertexCount = 2
    int vVertexCount = 2
    int uOrder = 2
    int vOrder = 2
    double[] uKnots = [0, 0, 1, 1]
    double[] vKnots = [0, 0, 1, 1]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]
    int[] trimCurve:counts = [1]
    int[] trimCurve:orders = [2]
    int[] trimCurve:vertexCounts = [2] }"""

STAGES = {
    "volumes": ('def Volume "v" { }', "/v: Volume is not drawn yet"),
    "splats": ('def ParticleField3DGaussianSplat "v" { }', "/v: ParticleField3DGaussianSplat is not drawn yet"),
    "light filters": ('def SphereLight "l" { rel light:filters = </f> }', "/l: light:filters is not drawn yet"),
    "portals": ('def PortalLight "p" { }', "/p: no dome names it"),
    "plug-in lights": ('def PluginLight "p" { }', "/p: PluginLight is not drawn yet"),
    "unknown types": (
        'def PxrEnvDayLight "p" { float inputs:intensity = 1 }',
        "/p: its type PxrEnvDayLight is not",
    ),
    "other renderers' surfaces": (bound(identifier="PxrSurface", output="ri:surface"), "/m: surface ri:surface is not"),
    "unknown surfaces": (bound(identifier="Mine"), "/m: surface Mine is not drawn yet"),
    "MaterialX surfaces": (bound(identifier="ND_lama", output="mtlx:surface"), "/m: surface ND_lama is not drawn yet"),
    "volume shaders": (bound(identifier="PxrVolume", output="volume"), "/m: its volume is not drawn"),
    "unknown inputs": (bound("float inputs:subsurface = 0.5"), "/m/s: PreviewSurface has no input subsurface"),
    "a mode that varies": (
        bound(
            "token inputs:opacityMode.connect = </m/r.outputs:result>",
            extra=READER.replace("token inputs", "string inputs"),
        ),
        "/m/s: opacityMode cannot vary",
    ),
    "textures of textures": (
        bound(
            "color3f inputs:diffuseColor.connect = </m/t.outputs:rgb>",
            extra=texture("t", "float2 inputs:st.connect = </m/u.outputs:rgb>") + texture("u"),
        ),
        "/m/u: texture coordinates from a texture are not read",
    ),
    "glowing quadrics": ('def Sphere "s" ( prepend apiSchemas = ["MeshLightAPI"] ) { }', "/s: only meshes shine"),
    "trims": (PATCH, "/n: its trim curves are not drawn"),
    "old names of lights": (
        'def SphereLight "l" { float intensity = 3\nfloat radius = 2\ncolor3f color = (1, 0, 0) }',
        "/l: its inputs have the names of before OpenUSD 21.05",
    ),
    "old types of varname": (
        bound("float inputs:roughness.connect = </m/r.outputs:result>", extra=READER),
        "/m/r: varname is a token, as in old stages",
    ),
}


@pytest.mark.parametrize("name", STAGES)
def test_what_is_not_drawn_as_asked_is_named_once(name):
    text, message = STAGES[name]
    findings = [str(finding) for finding in check(scene_of(text))]
    assert len([line for line in findings if line.startswith(message)]) == 1, findings


def test_old_names_count():
    light = scene_of('def SphereLight "l" { float intensity = 3\nfloat radius = 2 }').lights["/l"]
    assert (light.intensity, light.radius) == (3, 2)
    new = scene_of('def SphereLight "l" { float inputs:intensity = 3 }')
    assert new.warnings == []
