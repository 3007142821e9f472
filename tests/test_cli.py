"""The command line from stage to file, on the Cornell box."""

import json
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from warprender import images
from warprender.cli import main, render

BOX = str(Path(__file__).parent.parent / "scenes_usd" / "cornell_box.usda")
QUICK = ["--samples", "4", "-w", "24", "--threads", "2"]


def test_png_of_the_cornell_box(tmp_path, capfd):
    path = tmp_path / "box.png"
    assert main(["render", BOX, str(path), *QUICK]) == 0
    streams = capfd.readouterr()
    assert streams.err == ""
    assert streams.out.startswith(f"{path}: Frame(24x24")

    layers, metadata = images.read(path)
    color = layers["color"]
    assert color.shape == (24, 24, 4)
    # The red wall is on the left, the green one on the right, the box fills the picture.
    left, right = color[6:18, :3, :3].mean((0, 1)), color[6:18, -3:, :3].mean((0, 1))
    assert left[0] > 2 * left[1] and right[1] > 1.5 * right[0]
    np.testing.assert_array_equal(color[4:20, 4:20, 3], 1.0)
    assert json.loads(metadata["warprender"])["seed"] == 0


def test_the_same_seed_gives_the_same_bytes_whatever_the_threads(tmp_path):
    pictures = []
    for number, flags in enumerate((["--threads", "1"], ["--threads", "2"], ["--seed", "1"])):
        path = tmp_path / f"{number}.exr"
        assert main(["render", BOX, str(path), "--samples", "4", "-w", "24", *flags]) == 0
        pictures.append(images.read(path)[0]["color"])
    np.testing.assert_array_equal(pictures[0], pictures[1])
    assert (pictures[0] != pictures[2]).any()


def test_exr_keeps_the_outputs_as_layers(tmp_path):
    path = tmp_path / "box.exr"
    outputs = ["color", "cameraDepth", "normal", "primId", "elementId"]
    stats = tmp_path / "stats.json"
    flags = ["--aov", ",".join(outputs), "--stats", str(stats)]
    assert main(["render", BOX, str(path), *QUICK, *flags]) == 0
    layers, _ = images.read(path)
    assert set(layers) == set(outputs)
    assert layers["primId"].dtype == np.int32
    assert layers["primId"].min() >= -1
    middle = layers["cameraDepth"][12, 12]
    # The middle of the picture looks over the boxes at the back wall.
    np.testing.assert_allclose(middle, 800.0 + 559.2, rtol=1e-5)
    # In the middle of the floor's nearest row that is drawn, the floor faces up.
    np.testing.assert_allclose(layers["normal"][22, 12], (0, 1, 0), atol=1e-3)
    (frame,) = json.loads(stats.read_text())["frames"]
    assert frame["samples"] == 4


def test_geometry_alone_needs_no_light(tmp_path):
    path = tmp_path / "depth.exr"
    assert main(["render", BOX, str(path), *QUICK, "--aov", "cameraDepth", "--transport", "none"]) == 0
    assert set(images.read(path)[0]) == {"cameraDepth"}


def test_the_render_settings_give_the_resolution(tmp_path):
    path = tmp_path / "a.exr"
    assert main(["render", BOX, str(path), "--samples", "1", "--aov", "cameraDepth"]) == 0
    assert images.read(path)[0]["cameraDepth"].shape == (512, 512)


def test_frames(tmp_path):
    assert main(["render", BOX, str(tmp_path / "a.##.png"), "-f", "1:2", *QUICK]) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.01.png", "a.02.png"]


def test_ctrl_c_saves_what_is_finished(tmp_path, monkeypatch, capsys):
    @contextmanager
    def impatient_bar(title):
        def show(done, frame_so_far):
            if done > 0.0:
                raise KeyboardInterrupt

        yield show

    monkeypatch.setattr(render, "progress_bar", impatient_bar)
    path = tmp_path / "box.png"
    assert main(["render", BOX, str(path), "-w", "24", "--samples", "4096"]) == 130
    assert capsys.readouterr().err == f"warprender: interrupted; what was finished is in {path}\n"
    assert images.read(path)[0]["color"][..., :3].max() > 0.5


def test_plan(capsys):
    assert main(["plan", BOX]) == 0
    assert "/World/lamp" in capsys.readouterr().out
    assert main(["plan", BOX, "--json"]) == 0
    assert isinstance(json.loads(capsys.readouterr().out), dict)


@pytest.mark.parametrize(
    ("flags", "named"),
    [
        (["--camera", "/World/nobody"], "nobody"),
        (["--aov", "color,beauty"], "beauty"),
        (["--transport", "magic"], "magic"),
        (["--filter", "magic"], "magic"),
        (["--variant", "/World:look=red"], "look"),
        (["--sessionLayer", "missing.usda"], "missing.usda"),
        (["--renderSettingsPrimPath", "/Render/none"], "/Render/none"),
        (["--purposes", "magic"], "magic"),
    ],
)
def test_bad_flags_are_one_line(tmp_path, capfd, flags, named):
    assert main(["render", BOX, str(tmp_path / "a.png"), *QUICK, *flags]) == 1
    error = capfd.readouterr().err
    assert error.startswith("warprender: error: ") and named in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("content", [None, "", "#usda 1.0\ndef Mesh {", "no stage"])
def test_bad_stages_are_one_line(tmp_path, content):
    stage = tmp_path / "bad.usda"
    if content is not None:
        stage.write_text(content)
    command = [sys.executable, "-m", "warprender", "render", str(stage), str(tmp_path / "a.png")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith("warprender: error: ") and "bad.usda" in done.stderr
    assert done.stderr.count("\n") == 1
