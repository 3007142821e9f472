"""The command line with a renderer that only notes what it is asked for."""

import json
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp

import warprender
from warprender import framing, images
from warprender.camera import Camera
from warprender.cli import main, render
from warprender.frame import Frame
from warprender.framing import choose_resolution
from warprender.scene import RenderSettings, Scene, SceneError


class Recorder:
    """Stands for `StageReader`, `choose_camera` and `Renderer`, and keeps their arguments."""

    def __init__(self):
        self.loads, self.renderers, self.renders = [], [], []
        self.scene = Scene()
        self.stats = {"samples": 4, "error": np.float32(0.5), "rays": {"camera": np.int64(7)}}
        self.plan = SimpleNamespace(explain=lambda: "because", as_dict=lambda: {"key": {"lights": ["dome"]}})

    def load(self, stage, **arguments):
        self.loads.append({"stage": stage, **arguments})
        return self.scene

    def stage_reader(self, stage, **arguments):
        return SimpleNamespace(read=lambda time: self.load(stage, time=time, **arguments))

    def choose_camera(self, scene, name):
        if name == "nobody":
            raise SceneError("there is no camera nobody")
        return Camera()

    def renderer(self, scene, **arguments):
        self.renderers.append(arguments)
        return SimpleNamespace(plan=self.plan, render=self.render)

    def render(self, **arguments):
        self.renders.append(arguments)
        width, height = self.renderers[-1]["resolution"]
        color = wp.array(np.ones((height, width, 4), np.float32), dtype=wp.vec4, device="cpu")
        return Frame({"color": color}, dict(self.stats), {"seed": arguments["seed"]})


@pytest.fixture
def recorder(monkeypatch, tmp_path) -> Recorder:
    recorder = Recorder()
    monkeypatch.setattr(warprender, "StageReader", recorder.stage_reader, raising=False)
    monkeypatch.setattr(warprender, "Renderer", recorder.renderer, raising=False)
    monkeypatch.setattr(framing, "choose_camera", recorder.choose_camera)
    monkeypatch.setattr(framing, "choose_camera_path", lambda scene, name=None: "")
    monkeypatch.chdir(tmp_path)
    return recorder


def test_defaults_are_those_of_usdrecord(recorder, tmp_path, capsys):
    assert main(["render", "a.usda", "a.png"]) == 0
    assert recorder.loads == [
        {
            "stage": "a.usda",
            "time": None,
            "purposes": None,
            "variants": None,
            "mask": None,
            "session_layer": None,
            "complexity": "low",
            "render_settings": None,
            "render_pass": None,
            "draw_modes": True,
        }
    ]
    (renderer,) = recorder.renderers
    assert renderer["resolution"] == (960, 700)
    assert renderer["outputs"] == ("color",)
    assert renderer["camera_light"] == "auto"
    assert not renderer["dome_light_visible"] and not renderer["lights_visible"]
    assert recorder.renders == [dict(samples=None, error=None, seconds=None, seed=0, progress=None)]
    streams = capsys.readouterr()
    assert streams.out == "a.png: Frame(960x700: color; 4 samples)\n"
    assert streams.err == ""
    assert images.read("a.png")[0]["color"].shape == (700, 960, 4)


def test_every_flag_arrives(recorder):
    flags = (
        "--mask /a,/b --purposes render,guide --sessionLayer s.usda -rs /Render/settings -c high -d "
        "--variant /a:look=red --variant /a:size=big -cam /cam --resolution 8x4 --aov color,depth --aov primId "
        "--filter box --cameraLight on --enableDomeLightVisibility --enableLightVisibility --transport path "
        "--visibility rays --samples 9 --error 0.1 --seconds 2.5 --bounces 0 --seed 5 --threads 2 "
        "--energyCompensation --disableGpu --disableDrawMode"
    )
    assert main(["render", *flags.split(), "a.usda", "a.exr"]) == 0
    (load,) = recorder.loads
    assert np.isnan(load.pop("time"))
    assert load == {
        "stage": "a.usda",
        "purposes": ["render", "guide"],
        "variants": {"/a": {"look": "red", "size": "big"}},
        "mask": ["/a", "/b"],
        "session_layer": "s.usda",
        "complexity": "high",
        "render_settings": "/Render/settings",
        "render_pass": None,
        "draw_modes": False,
    }
    (renderer,) = recorder.renderers
    assert isinstance(renderer.pop("camera"), Camera)
    assert renderer == {
        "resolution": (8, 4),
        "outputs": ("color", "depth", "primId"),
        "visibility": "rays",
        "transport": "path",
        "device": "cpu",
        "threads": 2,
        "bounces": 0,
        "camera_light": "on",
        "dome_light_visible": True,
        "lights_visible": True,
        "filter": "box",
        "sampler": "sobol",
        "energy_compensation": True,
        "denoise": False,
        "light_sampling": "tree",
        "ray_accuracy": "watertight",
        "filter_textures": True,
        "adaptive": False,
    }
    assert recorder.renders == [dict(samples=9, error=0.1, seconds=2.5, seed=5, progress=None)]


@pytest.mark.parametrize("place", range(4))
def test_flags_may_stand_anywhere(recorder, place):
    arguments = ["a.usda", "a.png"] if place < 3 else ["-w", "4", "a.usda", "-r", "warprender", "a.png"]
    if place < 3:
        arguments[place:place] = ["-w", "4"]
    assert main(["render", *arguments]) == 0
    assert recorder.loads[0]["stage"] == "a.usda" and recorder.renderers[0]["resolution"][0] == 4


def test_disable_camera_light_is_usdrecords_name_for_off(recorder):
    assert main(["render", "a.usda", "a.png", "--disableCameraLight", "-w", "4"]) == 0
    assert recorder.renderers[0]["camera_light"] == "off"


WIDE = Camera(horizontalAperture=32.0, verticalAperture=18.0)
SETTINGS = RenderSettings(resolution=(512, 256))


@pytest.mark.parametrize(
    ("width", "settings", "camera", "expected"),
    [
        (320, SETTINGS, WIDE, (320, 180)),
        (None, SETTINGS, WIDE, (512, 256)),
        (None, RenderSettings(), WIDE, (960, 540)),
        (None, RenderSettings(), Camera(), (960, 700)),
        (1, RenderSettings(), WIDE, (1, 1)),
    ],
)
def test_resolution_rule(width, settings, camera, expected):
    assert choose_resolution(Scene(settings=settings), camera, width) == expected


def test_frames_go_to_one_file_each(recorder, tmp_path, capsys):
    recorder.scene.warn("/a: odd")
    assert main(["render", "a.usda", "a.##.#.png", "-f", "1:2x0.5", "-w", "2", "--stats", "s.json"]) == 0
    assert [load["time"] for load in recorder.loads] == [1.0, 1.5, 2.0]
    assert sorted(p.name for p in tmp_path.glob("*.png")) == ["a.01.0.png", "a.01.5.png", "a.02.0.png"]
    assert capsys.readouterr().err == "warprender: warning: /a: odd\n"
    stats = json.loads((tmp_path / "s.json").read_text())
    assert stats["stage"] == "a.usda"
    assert stats["frames"][1] == {
        "picture": "a.01.5.png", "time": 1.5, "samples": 4, "error": 0.5, "rays": {"camera": 7},
    }  # fmt: skip


def test_outputs_that_the_format_drops_are_named(recorder, capsys):
    assert main(["render", "a.usda", "a.png", "-w", "2", "--aov", "color,depth,primId"]) == 0
    expected = "warprender: warning: a.png: this format does not keep depth, primId; .exr holds all\n"
    assert capsys.readouterr().err == expected


def test_an_interrupted_frame_is_saved_and_ends_the_range(recorder, tmp_path, capsys):
    recorder.stats["interrupted"] = True
    assert main(["render", "a.usda", "a.#.png", "-f", "1:3", "-w", "2"]) == 130
    assert [p.name for p in tmp_path.glob("*.png")] == ["a.1.png"]
    assert capsys.readouterr().err == "warprender: interrupted; what was finished is in a.1.png\n"


def test_an_interruption_before_the_first_pass_says_so(recorder, monkeypatch, capsys):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(recorder, "load", interrupt)
    assert main(["render", "a.usda", "a.png"]) == 130
    assert capsys.readouterr().err == "warprender: interrupted; the picture under way is not saved\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["a.usda", "a.xyz"], "a.xyz: unknown image extension"),
        (["a.usda", "."], ".: is a folder"),
        (["a.usda", "no/a.png"], "no/a.png: the folder no does not exist"),
        (["a.usda", "a.###.png"], "needs --frames"),
        (["a.usda", "a.png", "-f", "1"], "exactly one placeholder"),
        (["a.usda", "a.png", "--aov", "depth"], "--aov has no color"),
        (["a.usda", "a.png", "--stats", "no/s.json"], "no/s.json: the folder no does not exist"),
        (["a.usda", "a.png", "--camera", "nobody"], "there is no camera nobody"),
        (["a.usda", "a.png", "--device", "nonsense"], "--device nonsense: "),
    ],
)
def test_errors_are_one_line_and_come_before_the_render(recorder, capsys, arguments, message):
    assert main(["render", *arguments]) == 1
    error = capsys.readouterr().err
    assert error.startswith("warprender: error: ") and message in error
    assert error.count("\n") == 1
    assert not recorder.renders


@pytest.mark.parametrize(
    "arguments",
    [
        [], ["paint"], ["render"], ["render", "a", "-w", "5", "b.png", "c.png"],
        ["render", "a", "b.png", "--no"], ["render", "a", "b.png", "--samples", "0"],
        ["render", "a", "b.png", "--resolution", "10"], ["render", "a", "b.png", "--resolution", "0x5"],
        ["render", "a", "b.png", "--error", "nan"], ["render", "a", "b.png", "--frames", "x"],
        ["render", "a", "b.png", "--variant", "a=b"], ["render", "a", "b.png", "-d", "-f", "1"],
        ["render", "a", "b.png", "-w", "5", "--resolution", "5x5"], ["render", "a", "b.png", "-c", "ultra"],
        ["render", "a", "b.png", "-rs", "/a", "-rp", "/b"], ["render", "a", "b.png", "--resolver", "other"],
    ],
)  # fmt: skip
def test_wrong_usage_exits_with_2(arguments, capsys):
    with pytest.raises(SystemExit) as exit:
        main(arguments)
    assert exit.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "error: " in line


def test_an_unknown_flag_names_the_command_and_the_flag_that_may_be_meant(capsys):
    for flag, hint in (("--imagewidth", " (is --imageWidth meant?)"), ("--nothingLikeIt", "")):
        with pytest.raises(SystemExit):
            main(["render", "a", "b.png", flag, "5"])
        expected = f"warprender render: error: unrecognized arguments: {flag} 5{hint}; see warprender render --help\n"
        assert capsys.readouterr().err == expected


def test_plan_as_text_and_as_json(recorder, capsys):
    recorder.scene.warn("/a: odd\nin two lines")
    assert main(["plan", "a.usda", "-r", "Storm", "--samples", "3"]) == 0
    streams = capsys.readouterr()
    assert streams.out == "because\n"
    assert streams.err.splitlines() == [
        "warprender: warning: --renderer Storm: read and ignored; warprender draws the picture",
        "warprender: warning: /a: odd in two lines",
    ]
    assert main(["plan", "a.usda", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"key": {"lights": ["dome"]}}
    assert not recorder.renders


def test_flags_that_change_nothing_say_so(recorder, capsys):
    assert main(["render", "a.usda", "a.png", "-w", "2", "--memstats", "--resolver", "inherit", "-r", "Storm"]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert [line.split(": ")[2].split()[0] for line in lines] == ["--renderer", "--resolver", "--memstats"]
    assert all("read and ignored" in line for line in lines)


@pytest.mark.parametrize("form", ["chrome", "trace"])
def test_usds_own_trace_is_written(recorder, tmp_path, monkeypatch, form):
    from pxr import Usd

    monkeypatch.setattr(recorder, "load", lambda *_, **__: (Usd.Stage.CreateInMemory(), recorder.scene)[1])
    assert main(["render", "a.usda", "a.png", "-w", "2", "--traceToFile", "t", "--traceFormat", form]) == 0
    text = (tmp_path / "t").read_text()
    assert "UsdStage" in text
    if form == "chrome":
        assert json.loads(text)


def test_a_trace_that_cannot_be_written_is_an_error(recorder, capsys):
    assert main(["render", "a.usda", "a.png", "-w", "2", "--traceToFile", "no/t"]) == 1
    assert "no/t: the folder no does not exist" in capsys.readouterr().err
    assert not recorder.renders


def test_a_terminal_gets_a_progress_bar(recorder, monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("TERM", "xterm")

    with render.progress_bar("a.png") as progress:
        progress(0.25, lambda: None)
        time.sleep(0.15)
    assert "25%" in capsys.readouterr().err


def test_help_needs_neither_warp_nor_usd():
    script = (
        "import sys; from warprender.cli import build_parser; build_parser().format_help();"
        "sys.exit(' '.join(m for m in ('warp', 'pxr', 'numpy', 'OpenImageIO') if m in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stderr.strip() == ""
