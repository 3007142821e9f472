"""`warprender reproduce`: the receipt is enough to get the bits again, and says what changed."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from warprender import images
from warprender.cli import main

BOX = Path(__file__).parent.parent / "scenes_usd" / "cornell_box.usda"

PROP = """#usda 1.0
def Xform "Prop" {
    def Sphere "ball" { double radius.timeSamples = { 1: 30, 5: 60 }
        double3 xformOp:translate = (280, 300, -250)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
"""


@pytest.fixture
def stage(tmp_path):
    """The Cornell box with another layer in it that moves."""
    (tmp_path / "prop.usda").write_text(PROP.replace("{ ", "{\n").replace(" }", "\n}"))
    text = BOX.read_text()
    head = text.index("(") + 1
    path = tmp_path / "stage.usda"
    path.write_text(text[:head] + "\n    subLayers = [@./prop.usda@]\n" + text[head:])
    return path


def rendered(stage, name, *flags):
    picture = str(stage.parent / name)
    assert main(["render", str(stage), picture, "--samples", "3", "-w", "24", *flags]) == 0
    return picture.replace("#", "4")


def test_the_same_bits_of_every_format_and_flag(stage, capsys):
    cases = {
        "a.png": ["--seed", "5", "--colorCorrectionMode", "disabled"],
        "b.exr": ["--aov", "color,cameraDepth,primId", "--filter", "gaussian", "--sampler", "independent"],
        "c.#.exr": ["--frames", "4", "--bounces", "1", "--mask", "/World,/Prop", "--enableLightVisibility"],
        "d.png": ["--defaultTime", "--complexity", "high"],
        "e.exr": ["--aov", "normal,elementId", "--visibility", "raster"],
    }
    for name, flags in cases.items():
        picture = rendered(stage, name, *flags)
        capsys.readouterr()
        assert main(["reproduce", picture]) == 0, name
        assert capsys.readouterr().out == f"{picture}: same bits\n"


def test_a_changed_layer_and_the_first_pixel_are_named(stage, capsys):
    picture = rendered(stage, "a.exr")
    prop = stage.parent / "prop.usda"
    prop.write_text(prop.read_text().replace("(280, 300, -250)", "(280, 250, -250)"))
    capsys.readouterr()
    assert main(["reproduce", picture, "--output", str(stage.parent / "new.exr")]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"changed: layer {prop}: its contents"
    old, new = (images.read(stage.parent / name)[0]["color"] for name in ("a.exr", "new.exr"))
    differ = (old != new).any(-1)
    y, x = np.argwhere(differ)[0]
    assert f"layer color: {differ.sum()} of 576 pixels differ, the first (x={x}, y={y}): " in lines[-1]


def test_a_changed_stage_and_plan_are_named(stage, capsys):
    picture = rendered(stage, "a.exr", "--aov", "color,primId")
    text = stage.read_text()
    stage.write_text(text[: text.rindex("}")] + '\n    def Sphere "new" { double radius = 90 }\n}\n')
    stage.write_text(stage.read_text().replace("{ double radius = 90 }", "{\n double radius = 90\n }"))
    capsys.readouterr()
    assert main(["reproduce", picture]) == 1
    out = capsys.readouterr().out
    assert f"changed: stage {stage}: its contents" in out
    assert "layer color: " in out


def test_versions_and_machine_are_named(stage, capsys):
    picture = rendered(stage, "a.exr")
    layers, metadata = images.read(picture)
    receipt = json.loads(metadata["warprender"])
    receipt["versions"]["numpy"] = "0.1"
    receipt["machine"] = "abacus"
    images.write(picture, layers, {"warprender": json.dumps(receipt)})
    capsys.readouterr()
    assert main(["reproduce", picture]) == 0
    out = capsys.readouterr().out
    assert f"changed: numpy: version 0.1 then, {np.__version__} now\n" in out
    assert "changed: machine: abacus then, " in out and out.endswith("same bits\n")


def test_a_stage_that_moved(stage, capsys):
    picture = rendered(stage, "a.png")
    moved = stage.parent / "elsewhere"
    moved.mkdir()
    for file in (stage, stage.parent / "prop.usda"):
        shutil.move(file, moved)
    capsys.readouterr()
    assert main(["reproduce", picture]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and str(stage) in error and "--stage" in error
    assert main(["reproduce", picture, "--stage", str(moved / "stage.usda")]) == 0


@pytest.mark.parametrize("receipt", [None, "{", "[]", "{}", '{"stage": ""}'])
def test_bad_receipts_are_one_line(tmp_path, capsys, receipt):
    picture = tmp_path / "a.png"
    images.write_png(picture, np.zeros((2, 2, 3)), {} if receipt is None else {"warprender": receipt})
    assert main(["reproduce", str(picture)]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "a.png" in error and "receipt" in error


@pytest.mark.parametrize(
    "spoilt",
    [{"camera": {"fStop": 1}}, {"camera": "x"}, {"resolution": [16]}, {"samples": "x"}, {"seed": None}, {"stage": 5}],
)
def test_receipts_with_a_part_of_another_kind_are_one_line(tmp_path, capsys, spoilt):
    sound = {"stage": str(BOX), "request": {}, "camera": {}, "resolution": [4, 4], "samples": 1, "seed": 0}
    picture = tmp_path / "a.exr"
    images.write(picture, {"color": np.zeros((4, 4, 3))}, {"warprender": json.dumps({**sound, **spoilt})})
    assert main(["reproduce", str(picture)]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "a.exr: its receipt" in error


def test_an_unknown_setting_is_one_line(stage, capsys):
    picture = rendered(stage, "a.exr")
    layers, metadata = images.read(picture)
    receipt = json.loads(metadata["warprender"])
    receipt["request"]["magic"] = 1
    images.write(picture, layers, {"warprender": json.dumps(receipt)})
    capsys.readouterr()
    assert main(["reproduce", picture]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "another version" in error and "magic" in error
