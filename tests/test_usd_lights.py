"""UsdLux lights arrive with their inputs; what is authored and not drawn is named."""

import pytest
from usd_stage import scene_of

from warprender.lights import DiskLight, DistantLight, DomeLight, RectLight, SphereLight


@pytest.mark.parametrize("kind", [SphereLight, RectLight, DiskLight, DistantLight, DomeLight])
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


@pytest.mark.parametrize(
    ("schema", "authored", "word"),
    [
        ("ShapingAPI", "float inputs:shaping:focus = 2", "shaping:focus"),
        ("ShapingAPI", "float inputs:shaping:cone:angle = 30", "shaping:cone"),
        ("ShadowAPI", "bool inputs:shadow:enable = 0", "shadow:enable"),
        ("ShadowAPI", "color3f inputs:shadow:color = (1, 0, 0)", "shadow:color"),
        ("LightAPI", "asset inputs:texture:file = @a.png@", "texture:file"),
        ("LightAPI", "bool collection:lightLink:includeRoot = 0", "lightLink"),
    ],
)
def test_effective_attributes_that_are_not_drawn_are_named(schema, authored, word):
    scene = scene_of(f'def RectLight "l" ( prepend apiSchemas = ["{schema}"] ) {{ {authored} }}')
    assert len(scene.warnings) == 1 and scene.warnings[0].startswith("/l: ") and word in scene.warnings[0]


def test_attributes_without_an_effect_are_not_named():
    scene = scene_of(
        """def RectLight "l" ( prepend apiSchemas = ["ShapingAPI", "ShadowAPI"] ) {
            float inputs:shaping:focus = 0
            float inputs:shaping:cone:angle = 90
            color3f inputs:shadow:color = (0, 0, 0)
            asset inputs:texture:file = @@ }"""
    )
    assert scene.lights and not scene.warnings


def test_lights_that_cannot_be_drawn_are_named():
    scene = scene_of('def CylinderLight "c" { } def SphereLight "n" { float inputs:intensity = nan }')
    assert not scene.lights
    assert [line.split(":")[0] for line in scene.warnings] == ["/c", "/n"]
