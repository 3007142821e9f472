"""Bindings choose the material that USD says, and UsdPreviewSurface inputs arrive with their values."""

from usd_stage import scene_of

import warprender as wr


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


def dielectric(inputs: str) -> str:
    return material("A", inputs).replace("UsdPreviewSurface", "warprender:Dielectric") + sphere(
        "x", "rel material:binding = </A>"
    )


def test_dielectrics_arrive_with_their_inputs():
    scene = scene_of(
        dielectric(
            """float inputs:ior = 1.33
            float inputs:roughness = 0.2
            color3f inputs:transmissionColor = (1, 0.5, 0.25)
            color3f inputs:attenuationColor = (0.5, 0.25, 0.125)
            float inputs:attenuationDistance = 3
            int inputs:thinWalled = 1"""
        )
    )
    assert not scene.warnings
    look = scene.materials["/A"]
    assert isinstance(look, wr.Dielectric)
    assert (round(look.ior, 6), round(look.roughness, 6), look.thinWalled) == (1.33, 0.2, 1)
    assert look.transmissionColor == (1, 0.5, 0.25) and look.attenuationColor == (0.5, 0.25, 0.125)
    assert look.attenuationDistance == 3 and look.specularColor == (1, 1, 1)


def test_an_infinite_attenuation_distance_is_a_value():
    scene = scene_of(dielectric("float inputs:attenuationDistance = inf"))
    assert not scene.warnings and scene.materials["/A"].attenuationDistance == float("inf")


def test_indices_and_distances_of_zero_and_below_are_named():
    scene = scene_of(dielectric("float inputs:ior = 0\nfloat inputs:attenuationDistance = -1"))
    assert scene.materials["/A"] == wr.Dielectric()
    assert len(scene.warnings) == 2 and all("is taken" in warning for warning in scene.warnings)


def test_dielectrics_read_primvars():
    scene = scene_of(
        material("A", "float inputs:ior.connect = </A/r.outputs:result>")
        .replace("UsdPreviewSurface", "warprender:Dielectric")
        .rstrip("} ")
        + """} def Shader "r" { uniform token info:id = "UsdPrimvarReader_float"
            string inputs:varname = "index"
            float outputs:result } }"""
        + sphere("x", "rel material:binding = </A>\nfloat primvars:index = 1.7")
    )
    assert scene.materials["/A"].ior.varname == "index"
    assert round(float(scene.placements["/x"].shape.primvars["index"].values[0, 0]), 6) == 1.7


def test_a_clear_preview_surface_with_an_index_says_that_it_does_not_refract():
    clear = "float inputs:opacity = 0.2\n"
    for inputs, said in {
        clear + "float inputs:ior = 1.5": 1,
        clear + "float inputs:ior = 1": 0,
        clear: 0,
        clear + "float inputs:ior = 1.5\nfloat inputs:opacityThreshold = 0.5": 0,
        "float inputs:ior = 1.5": 0,
    }.items():
        scene = scene_of(material("A", inputs) + sphere("x", "rel material:binding = </A>"))
        assert len(scene.warnings) == said
        assert all("straight through" in warning for warning in scene.warnings)
