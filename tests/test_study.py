"""What a study computes, and `warprender study` from stage to report."""

import csv
import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scenes
from pictures import prepare

import warprender as wr
from warprender import images
from warprender.cli import main
from warprender.plan import TRANSPORTS, RenderPlan
from warprender.study import analysis, crops, leaks, measure, plots
from warprender.study.kept import Folder, Measurement, Reference
from warprender.study.settings import ladder, sweep

BOX = str(Path(__file__).parent.parent / "scenes_usd" / "cornell_box.usda")
SHAPE = (40, 50, 3)


def pictures_of(rng, count, bias=0.0, deviation=0.1):
    return 0.5 + bias + deviation * rng.standard_normal((count, *SHAPE))


@pytest.mark.parametrize("noise_of_the_reference", [0.0, 0.05])
def test_bias_and_variance_are_told_apart(noise_of_the_reference):
    rng = np.random.default_rng(2)
    color = 0.5 + noise_of_the_reference * rng.standard_normal(SHAPE)
    reference = Reference(color, noise_of_the_reference**2, "")
    bias, sigmas, deviation = analysis.bias_and_deviation(pictures_of(rng, 4), reference)
    assert abs(sigmas) < 4 and bias < 0.02
    assert deviation == pytest.approx(0.1, rel=0.02)
    # 6000 values of spread 0.05 to 0.07: a bias of 0.03 is many standard errors, and is known to 6 %.
    bias, sigmas, deviation = analysis.bias_and_deviation(pictures_of(rng, 4, bias=0.03), reference)
    assert sigmas > 5 and bias == pytest.approx(0.03, rel=0.24)
    assert deviation == pytest.approx(0.1, rel=0.02)


def test_bias_alarms_are_rare_and_two_sided():
    rng = np.random.default_rng(4)
    found = [
        analysis.bias_and_deviation(pictures_of(rng, 2), Reference(np.full(SHAPE, 0.5), 0.0, ""))[1] for _ in range(200)
    ]
    # Squared bias over its standard error is near normal: mean 0 ± 0.07, deviation 1 ± 0.05.
    assert abs(np.mean(found)) < 0.3 and 0.8 < np.std(found) < 1.25


def test_pictures_without_noise_have_bias_alone():
    bias, sigmas, deviation = analysis.bias_and_deviation(
        np.full((2, *SHAPE), 0.75), Reference(np.full(SHAPE, 0.5), 0.0, "")
    )
    assert bias == 0.25 and sigmas == np.inf and deviation == 0.0


def test_the_confidence_of_slopes():
    # 300 fits with known slope and noise: 95 % of the intervals hold it; binomial deviation 1.3 %.
    rng = np.random.default_rng(9)
    n = np.repeat([4, 16, 64, 256], 3)
    inside = 0
    for _ in range(300):
        found, half = analysis.slope(n, n**-0.5 * np.exp(0.1 * rng.standard_normal(n.size)))
        inside += abs(found + 0.5) < half
    assert 0.95 - 0.05 < inside / 300 <= 0.95 + 0.05


def test_what_is_varied():
    assert ladder(256) == [4, 16, 64, 256] and ladder(100) == [6, 25, 100] and ladder(2) == [2]
    plan = RenderPlan("path", "rays", "rays", None, None, bounds={"bounces": 3})
    settings = sweep(plan, 16, denoiser=True)
    assert len({s.name for s in settings}) == len(settings)
    knobs = {(s.knob, s.value) for s in settings}
    assert {("sampler", "sobol"), ("sampler", "independent"), ("denoised", "yes")} <= knobs
    assert {v for k, v in knobs if k == "bounces"} == {"0", "1", "2"}
    assert {v for k, v in knobs if k == "transport"} == set(TRANSPORTS) - {"none", "path"}
    assert {"denoised", "adaptive", "asked error", "together"} <= {k for k, _ in knobs}
    assert {v for k, v in knobs if k == "together"} >= {"bounces 2, independent", "bounces 2, denoised"}
    assert not any("denoise" in dict(s.options) for s in sweep(plan, 16, denoiser=False))
    assert not {"texture filter", "light sampling", "complexity", "visibility"} & {k for k, _ in knobs}
    reasons = {"texture diffuseColor": "/m", "light rect": "/l"}
    local = RenderPlan("local", "raster", "raster", None, None, reasons)
    knobs = {(s.knob, s.value) for s in sweep(local, 16, False, levels=("medium",))}
    assert {("texture filter", "off"), ("complexity", "medium"), ("visibility", "rays")} <= knobs
    assert ("visibility", "raster") not in knobs and ("transport", "path") in knobs


def test_the_worst_corner_and_the_front():
    reference = np.zeros((64, 80, 3))
    color = reference.copy()
    color[40:44, 60:64] = 1.0
    rows, columns = crops.worst_corner(color, reference, 16)
    assert rows.start <= 40 and rows.stop >= 44 and columns.start <= 60 and columns.stop >= 64
    assert crops.worst_corner(color[:4], reference[:4]) == (slice(0, 4), slice(0, 4))


def study(folder, *flags):
    size = ["-w", "16", "--samples", "16", "--bounces", "2", "--pictures", "2"]
    return main(["study", BOX, str(folder), *size, *flags])


class TestCommand:
    @pytest.fixture(autouse=True)
    def _needs_the_package(self):
        pytest.importorskip("matplotlib", reason="matplotlib, of the extra study, is not installed")

    def test_from_stage_to_report_with_a_stop_on_the_way(self, tmp_path, capsys, monkeypatch):
        folder = tmp_path / "study"
        whole, count = measure.Study._measure, [0]

        def impatient(self, *arguments):
            count[0] += 1
            if count[0] > 3:
                raise KeyboardInterrupt
            whole(self, *arguments)

        monkeypatch.setattr(measure.Study, "_measure", impatient)
        assert study(folder) == 130
        assert f"what was measured is in {folder}" in capsys.readouterr().err
        kept = (folder / "measurements.jsonl").read_text()
        assert kept.count("\n") == 3 and not (folder / "report.html").exists()

        # A line that was cut off is measured again, and one whose picture was; the others are kept.
        spoilt = folder / "pictures" / f"{json.loads(kept.splitlines()[2])['setting']}, seed 0.npy"
        spoilt.write_bytes(spoilt.read_bytes()[:200])
        (folder / "measurements.jsonl").write_text(kept + '{"setting": "sampler')
        kept = "".join(kept.splitlines(keepends=True)[:2])
        monkeypatch.setattr(measure.Study, "_measure", whole)
        reference = (folder / "reference.exr").read_bytes()
        assert study(folder) == 0
        out = capsys.readouterr().out
        assert "report.html" in out and (folder / "reference.exr").read_bytes() == reference
        assert (folder / "measurements.jsonl").read_text().startswith(kept)

        page = (folder / "report.html").read_text()
        # Nothing comes from elsewhere, and every picture is described.
        assert "http" not in page and all(source.startswith("data:") for source in re.findall(r'src="([^"]*)', page))
        assert page.count("data:image/png") > 8 and page.count("data:image/svg+xml") > 8
        assert all(len(alt) > 10 for alt in re.findall(r'alt="([^"]*)', page)) and 'alt=""' not in page
        rows = list(csv.DictReader(open(folder / "results.csv")))
        results = json.loads((folder / "results.json").read_text())
        for row, result in zip(rows, results["settings"], strict=True):
            assert row == {name: "" if value is None else str(value) for name, value in result.items()}
        assert results["fast rays"]["rays"] > 0 and results["machine"]["processor"] and results["packages"]["numpy"]
        assert {r["knob"] for r in rows} >= {"sampler", "bounces"}
        by_name = {r["setting"]: r for r in results["settings"]}
        # Without bounces the room lacks its indirect light; with as many as matter nothing but noise is missing.
        assert by_name["bounces 0, 16 samples"]["biased"]
        assert not by_name["sampler independent, 16 samples"]["biased"]
        assert by_name["bounces 0, 16 samples"]["rays"] < by_name["sampler sobol, 16 samples"]["rays"]
        row = by_name["sampler sobol, 4 samples"]
        assert row["efficiency"] == pytest.approx(1 / (row["rmse"] ** 2 * row["seconds"]))
        assert row["rmse"] ** 2 == pytest.approx(row["bias"] ** 2 + row["deviation"] ** 2, rel=0.2)

        def must_not(*arguments):
            raise AssertionError("everything has been measured")

        monkeypatch.setattr(measure.Study, "_measure", must_not)
        assert study(folder) == 0

        other = ["study", BOX, str(folder), "-w", "17", "--samples", "16"]
        capsys.readouterr()
        assert main(other) == 1
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and "another resolution" in error
        for name in ("reference.exr", "study.json"):
            (folder / name).write_bytes(b"{")
            assert study(folder) == 1
            error = capsys.readouterr().err
            assert error.count("\n") == 1 and name in error

    def test_a_picture_as_reference_and_a_budget(self, tmp_path, capsys):
        reference = tmp_path / "reference.exr"
        images.write(reference, {"color": np.full((16, 16, 4), 0.5, np.float32)})
        assert study(tmp_path / "a", "--reference", str(reference), "--budget", "1e-9") == 0
        assert "0 settings" in capsys.readouterr().out
        small = tmp_path / "small.exr"
        images.write(small, {"color": np.full((8, 16, 4), 0.5, np.float32)})
        assert study(tmp_path / "a", "--reference", str(small)) == 1
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and "small.exr" in error and "16x8" in error

    @pytest.mark.parametrize(
        ("layers", "message"),
        [
            ({"color": np.full((16, 16), 0.5)}, "1 channels; a reference needs R, G and B"),
            ({"depth": np.full((16, 16), 0.5)}, "no layer color"),
            ({"color": np.where(np.arange(256).reshape(16, 16, 1) == 37, np.nan, np.ones(3))}, r"(x=5, y=2)"),
        ],
    )
    def test_what_is_no_reference_is_one_line(self, tmp_path, capsys, layers, message):
        file = tmp_path / "reference.exr"
        images.write(file, {name: values.astype(np.float32) for name, values in layers.items()})
        assert study(tmp_path / "a", "--reference", str(file)) == 1
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and "reference.exr" in error and message in error


def test_leaks_are_those_of_fast_rays_alone():
    # A cube of many equal squares: its edges lie on planes that boxes share.
    n = 16
    x, y = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1))
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    square = np.stack([first, first + 1, first + n + 2, first + n + 1], 1)
    points, faces = [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            faces.append(square + len(points) * x.size)
            points.append(np.roll(np.stack([x.ravel(), y.ravel(), np.full(x.size, side)], 1), axis, axis=1))
    scene = wr.Scene()
    scene.add_mesh("/cube", np.concatenate(points), np.concatenate(faces))
    found = leaks.measure_leaks(scene, rays=5000)
    assert found.mesh == "/cube" and found.triangles == 12 * n * n and found.time > 0
    # 1.5 % at vertices and 0.5 % at edges of closed meshes; of random rays about one in a million.
    assert found.vertices > 10 and found.edges > 0 and found.faces <= 1
    assert f"{found.vertices} aimed at vertices" in found.words()
    assert leaks.measure_leaks(wr.Scene()) is None
    # Triangles that are not drawn are not asked.
    points.append(np.full((3, 3), np.nan))
    faces = [*np.concatenate(faces).tolist(), [6 * x.size, 6 * x.size + 1, 6 * x.size + 2]]
    scene = wr.Scene()
    scene.add_mesh("/cube", np.concatenate(points), faces)
    spoilt = leaks.measure_leaks(scene, rays=5000)
    lost = [(one.triangles, one.vertices, one.edges, one.faces) for one in (found, spoilt)]
    assert lost[0] == lost[1]


def test_figures_go_with_a_reference_that_is_gone(tmp_path):
    """Nothing says that they were against the picture that takes its place."""
    file, color = tmp_path / "truth.exr", np.full((4, 6, 3), 0.25, np.float32)
    images.write(file, {"color": color})
    kept = Folder(tmp_path / "a", {})
    kept.keep_reference(Reference(2.0 * color, 0.0, "another"))
    kept.keep(Measurement("plain", 0, 1.0, 1.0, 1, 0.5, 0.5, 0.5, None, 0.5, 0.5, 4.0), color)
    (tmp_path / "a" / "reference.json").unlink()
    renderer = SimpleNamespace(resolution=(6, 4), request=SimpleNamespace(adaptive=False), render=lambda **asked: None)
    study = measure.Study(tmp_path / "a", lambda **options: renderer, {})
    assert len(study.measurements) == 1
    study.take_reference(str(file))
    assert study.measurements == [] and kept.measurements() == []


def test_without_matplotlib_it_says_what_to_install(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(plots, "find_spec", lambda name: None)
    assert study(tmp_path) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and 'pip install "warprender[study]"' in error


def corner():
    """Three walls under a rect light: smooth, with light between the walls."""
    scene = wr.Scene()
    floor = np.array([(-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2)], float)
    scene.add_mesh("/floor", floor, [[0, 1, 2, 3]], color=(0.7, 0.7, 0.7))
    back = np.array([(-2, 0, -2), (2, 0, -2), (2, 3, -2), (-2, 3, -2)], float)
    scene.add_mesh("/back", back, [[0, 1, 2, 3]], color=(0.7, 0.4, 0.3))
    scene.add_light(
        wr.RectLight(width=1.5, height=1.5, intensity=6.0), pose=scenes.look_at((0, 3, 1), (0, 0, 0), (0, 0, 1))
    )
    return scene, scenes.camera((0, 1.2, 2.2), (0, 0.7, -1), fov=45.0)


def test_how_the_error_falls_with_samples():
    scene, view = corner()

    def color(sampler, samples, seed):
        renderer = renderers[sampler]
        return renderer.render(samples=samples, seed=seed).numpy("color")[..., :3].astype(float)

    renderers = {name: prepare(scene, view, 16, sampler=name, bounces=2) for name in ("independent", "sobol")}
    halves = [color("sobol", 4096, seed) for seed in (1001, 1002)]
    reference = Reference(np.mean(halves, 0), float(np.mean((halves[0] - halves[1]) ** 2)) / 4, "")
    found = {}
    for sampler in renderers:
        counts, errors = [], []
        for samples in (16, 64, 256):
            shots = np.stack([color(sampler, samples, seed) for seed in range(4)])
            counts += [samples] * 4
            errors += [np.sqrt(np.mean((shot - reference.color) ** 2) - reference.variance) for shot in shots]
            # Both samplers are unbiased: what is left of the mean picture's error is chance.
            _, sigmas, _ = analysis.bias_and_deviation(shots, reference)
            assert abs(sigmas) < 4, (sampler, samples)
        found[sampler] = analysis.slope(counts, errors)
    slope, half = found["independent"]
    assert half < 0.05 and abs(slope + 0.5) < 2 * half
    slope, half = found["sobol"]
    assert slope + half < -0.55
