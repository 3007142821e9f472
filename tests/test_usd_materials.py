"""Bindings choose the material that USD says, and UsdPreviewSurface inputs arrive with their values."""

from usd_stage import scene_of


def material(name: str, inputs: str = "", output: str = "outputs:surface") -> str:
    return f"""def Material "{name}" {{ token {output}.connect = </{name}/s.outputs:surface>
        def Shader "s" {{ uniform token info:id = "UsdPreviewSurface"
            {inputs}
            token outputs:surface }} }}"""


def sphere(name: str, binding: str = "") -> str:
    return f'def Sphere "{name}" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {{ {binding} }}'


def bound(binding: str, *materials: str) -> str:
    return scene_of("".join(map(material, materials)) + sphere("x", binding)).placements["/x"].material


def test_inputs_arrive_and_the_rest_keeps_its_fallback():
    scene = scene_of(
        material("A", "color3f inputs:diffuseColor = (1, 0.5, 0)\nfloat inputs:metallic = 1")
        + sphere("x", "rel material:binding = </A>")
    )
    assert scene.placements["/x"].material == "/A"
    surface = scene.materials["/A"]
    assert surface.diffuseColor == (1, 0.5, 0) and surface.metallic == 1 and surface.roughness == 0.5


def test_inputs_come_through_the_material_interface():
    scene = scene_of(
        """def Material "A" { float inputs:gloss = 0.25
            token outputs:surface.connect = </A/s.outputs:surface>
            def Shader "s" { uniform token info:id = "UsdPreviewSurface"
                float inputs:roughness.connect = </A.inputs:gloss>
                token outputs:surface } }"""
        + sphere("x", "rel material:binding = </A>")
    )
    assert scene.materials["/A"].roughness == 0.25


def test_a_child_binding_wins_unless_the_parent_is_stronger():
    text = material("A") + material("B")
    weak = 'def Xform "w" ( prepend apiSchemas = ["MaterialBindingAPI"] ) { rel material:binding = </A>\n'
    strong = weak.replace('"w"', '"s"').replace("</A>", '</A> ( bindMaterialAs = "strongerThanDescendants" )')
    child = sphere("x", "rel material:binding = </B>")
    scene = scene_of(text + weak + child + "}" + strong + child + "}")
    assert [scene.placements[f"/{p}/x"].material for p in "ws"] == ["/B", "/A"]


def test_collection_bindings_apply():
    scene = scene_of(
        material("A")
        + """def Xform "g" ( prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:red"] ) {
            rel collection:red:includes = </g/x>
            rel material:binding:collection:red = [</g.collection:red>, </A>]
            def Sphere "x" { }
            def Sphere "y" { } }"""
    )
    assert scene.placements["/g/x"].material == "/A" and scene.placements["/g/y"].material == ""


def test_full_beats_all_purpose_and_preview_serves_when_nothing_else_does():
    assert bound("rel material:binding = </A>\nrel material:binding:full = </B>", "A", "B") == "/B"
    assert bound("rel material:binding:preview = </A>", "A") == "/A"


def test_a_surface_that_is_not_drawn_is_named_and_falls_back():
    scene = scene_of(
        material("A").replace("UsdPreviewSurface", "ND_disney_principled") + sphere("x", "rel material:binding = </A>")
    )
    assert scene.placements["/x"].material == ""
    assert scene.warnings == ["/A: surface ND_disney_principled is not drawn yet"]


def test_a_texture_without_a_file_leaves_its_fallback_and_a_warning():
    scene = scene_of(
        material("A", "color3f inputs:diffuseColor.connect = </A/t.outputs:rgb>").rstrip("} ")
        + """} def Shader "t" { uniform token info:id = "UsdUVTexture"
            float4 inputs:fallback = (0.1, 0.2, 0.3, 1)
            float3 outputs:rgb } }"""
        + sphere("x", "rel material:binding = </A>")
    )
    assert [round(c, 6) for c in scene.materials["/A"].diffuseColor] == [0.1, 0.2, 0.3]
    assert len(scene.warnings) == 1 and scene.warnings[0].startswith("/A/t: it names no file")


def test_bad_values_keep_the_fallback_with_a_warning():
    scene = scene_of(
        material("A", "float inputs:roughness = nan\nfloat inputs:diffuseColor = 1")
        + sphere("x", "rel material:binding = </A>")
    )
    assert scene.materials["/A"].roughness == 0.5 and scene.materials["/A"].diffuseColor == (0.18,) * 3
    assert len(scene.warnings) == 2
