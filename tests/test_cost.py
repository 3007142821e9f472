"""`warprender plan --cost`: every effect that can be taken away is, and what is left is a picture."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import scenes
from test_specialised import BUILDERS

import warprender as wr
from warprender.cli import main
from warprender.study.cost import Cost, table, without_each

BOX = str(Path(__file__).parent.parent / "scenes_usd" / "cornell_box.usda")


@pytest.mark.parametrize("build", BUILDERS)
def test_an_effect_that_is_taken_away_is_gone_from_the_plan(build):
    scene, view = build()
    base = wr.Renderer(scene, view, (16, 16), outputs=("color", "normal"))
    variants = list(without_each(scene, base))
    assert len({v.effect for v in variants}) == len(variants)
    for variant in variants:
        options = {"outputs": ("color", "normal"), "camera_light": "off" if scene.lights else "on", **variant.options}
        left = wr.Renderer(variant.scene, variant.camera, (16, 16), **options)
        if variant.key:
            left.plan.path = replace(left.plan.path, **variant.key)
            assert left.plan.path != base.plan.path
        elif variant.effect == "bounces":
            assert left.plan.bounds["bounces"] == 0 < base.plan.bounds["bounces"]
        else:
            assert variant.effect in base.plan.reasons and variant.effect not in left.plan.reasons
    # What can be taken away, is.
    named = {v.effect for v in variants}
    for effect in ("depth of field", "straight through", "shadow rays", "clipping planes", "material PreviewSurface"):
        assert (effect in base.plan.reasons) == (effect in named), effect


def test_taking_away_leaves_the_scene_alone():
    scene, view = BUILDERS[2]()
    base = wr.Renderer(scene, view, (16, 16))
    before = dict(scene.placements), dict(scene.materials), dict(scene.lights)
    list(without_each(scene, base))
    assert (scene.placements, scene.materials, scene.lights) == before
    assert wr.Renderer(scene, view, (16, 16)).plan == base.plan


def test_the_only_shape_and_the_only_light_stay():
    scene = wr.Scene()
    scene.add_sphere("/ball")
    scene.add_light(wr.DomeLight())
    named = {v.effect for v in without_each(scene, wr.Renderer(scene, scenes.window(3.0), (8, 8)))}
    assert "shape Sphere" not in named and "light DomeLight" not in named


def test_the_table():
    lines = table([Cost("lens", "fStop 0", 2.0, 1.5, 0.02), Cost("bounces", "none", 2.0, 2.1)]).splitlines()
    assert (
        lines[0].startswith("cost: 2 s")
        and "1.5 s" in lines[1]
        and "-25.0 ± 2.0 %" in lines[1]
        and "+5.0 ± 0.0 %" in lines[2]
    )
    assert table([]) == "no effect can be taken away"


def test_the_command(capsys):
    assert main(["plan", BOX, "--cost", "--json", "-w", "16", "--bounces", "1"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {c["effect"] for c in found["cost"]} == {"shadow rays", "bounces"}
    assert all(c["seconds"] > 0 and c["without"] > 0 for c in found["cost"])
