"""`warprender compare` and the figures behind it."""

import json

import numpy as np
import OpenImageIO as oiio
import pytest

from warprender import images
from warprender.cli import main
from warprender.study import metrics

RNG = np.random.default_rng(7)


def saved(tmp_path, name, values):
    path = tmp_path / name
    images.write(path, {"color": np.asarray(values, np.float32)})
    return str(path)


def figures_of(capsys, *arguments):
    code = main(["compare", *arguments, "--json"])
    return code, json.loads(capsys.readouterr().out)


def test_figures_are_those_of_their_definitions():
    reference = RNG.random((5, 7, 3))
    picture = reference + RNG.normal(size=(5, 7, 3))
    picture[0, 0] = reference[0, 0]
    found = metrics.differences(picture, reference)
    gap = [p - r for p, r in zip(picture.ravel(), reference.ravel(), strict=True)]
    assert found.rmse == pytest.approx(np.sqrt(sum(g * g for g in gap) / len(gap)), rel=1e-12)
    expected = sum(g * g / (r * r + 0.01) for g, r in zip(gap, reference.ravel(), strict=True)) / len(gap)
    assert found.relative_mse == pytest.approx(expected, rel=1e-12)
    assert found.maximum == max(map(abs, gap))
    assert found.mean == pytest.approx(sum(gap) / len(gap), rel=1e-9)
    assert found.different == pytest.approx(34 / 35)


def test_numbers_that_are_not_finite_equal_themselves_alone():
    a = np.array([[[np.nan, np.inf, -np.inf]]])
    assert metrics.differences(a, a) == metrics.Differences(0.0, 0.0, 0.0, 0.0, 0.0)
    for b in (np.zeros_like(a), np.full_like(a, np.inf)):
        found = metrics.differences(a, b)
        assert found.maximum == np.inf and found.rmse == np.inf and found.relative_mse == np.inf
        assert found.different == 1.0


@pytest.mark.parametrize("suffix", [".png", ".exr", ".hdr", ".tif"])
def test_same_files_are_the_same(tmp_path, capsys, suffix):
    path = saved(tmp_path, "a" + suffix, RNG.random((6, 4, 4)))
    code, found = figures_of(capsys, path, path)
    assert code == 0
    assert found["rmse"] == found["maximum"] == found["different"] == 0.0 and found["beyond"] == []


def test_limits_decide_the_exit_code(tmp_path, capsys):
    a, b = (saved(tmp_path, f"{v}.exr", np.full((4, 4, 3), v)) for v in (0.5, 0.25))
    assert figures_of(capsys, a, b)[0] == 1
    code, found = figures_of(capsys, a, b, "--rmse", "0.25", "--maximum", "0.25")
    assert code == 0 and found["rmse"] == 0.25 and found["mean"] == 0.25
    code, found = figures_of(capsys, a, b, "--rmse", "0.2499", "--maximum", "0.25")
    assert code == 1 and found["beyond"] == ["rmse"]
    code, found = figures_of(capsys, a, b, "--relativeMse", "1")
    assert code == 0 and found["relativeMse"] == pytest.approx(0.0625 / (0.0625 + 0.01), rel=1e-6)


def test_an_8_bit_picture_is_decoded_beside_a_linear_one(tmp_path, capsys):
    values = RNG.random((8, 8, 3))
    png, exr = saved(tmp_path, "a.png", values), saved(tmp_path, "a.exr", values)
    code, found = figures_of(capsys, png, exr, "--maximum", "0.005")
    # Half a step of 1/255, times the curve's steepest slope from code to light, 2.275 at white.
    assert code == 0 and 0 < found["maximum"] <= 0.5 / 255 * 2.28
    linear = tmp_path / "linear.png"
    images.write_png(linear, values, color_correction="disabled")
    assert figures_of(capsys, str(linear), exr, "--maximum", "0.00197")[0] == 0


def test_alpha_counts_where_both_have_it(tmp_path, capsys):
    opaque, clear = np.full((4, 4, 4), 1.0), np.full((4, 4, 4), 1.0)
    clear[0, 0, 3] = 0.5
    a, b = saved(tmp_path, "a.exr", opaque), saved(tmp_path, "b.exr", clear)
    code, found = figures_of(capsys, a, b)
    assert code == 1 and found["maximum"] == 0.5 and found["rmse"] == 0.0
    without = saved(tmp_path, "c.exr", opaque[..., :3])
    assert figures_of(capsys, without, b)[0] == 0


def test_grey_pictures(tmp_path, capsys):
    for channels in (1, 2):
        spec = oiio.ImageSpec(3, 2, channels, oiio.UINT8)
        target = oiio.ImageOutput.create("x.png")
        path = str(tmp_path / f"grey{channels}.png")
        assert target.open(path, spec)
        pixels = np.full((2, 3, channels), 51, np.uint8)
        pixels[..., 1:] = 255
        assert target.write_image(pixels) and target.close()
        stored = np.array([0.2, 0.2, 0.2, 1.0])
        color = tmp_path / "color.png"
        images.write_png(color, np.broadcast_to(stored, (2, 3, 4)), color_correction="disabled")
        linear = str(tmp_path / "color.exr")
        decoded = ((0.2 + 0.055) / 1.055) ** 2.4
        images.write(linear, {"color": np.broadcast_to([decoded] * 3 + [1.0], (2, 3, 4)).astype(np.float32)})
        assert figures_of(capsys, path, linear, "--maximum", "1e-6")[0] == 0


def test_layers_of_exr(tmp_path, capsys):
    depth = RNG.random((4, 4)).astype(np.float32)
    for name, values in (("a", depth), ("b", depth + np.float32(0.5))):
        images.write(tmp_path / f"{name}.exr", {"color": np.ones((4, 4, 4)), "cameraDepth": values})
    a, b = str(tmp_path / "a.exr"), str(tmp_path / "b.exr")
    assert figures_of(capsys, a, b)[0] == 0
    code, found = figures_of(capsys, a, b, "--aov", "cameraDepth")
    assert code == 1 and found["rmse"] == pytest.approx(0.5, rel=1e-6) and found["flip"] is None
    assert main(["compare", a, b, "--aov", "normal"]) == 1
    assert "there is no layer 'normal'; there is" in capsys.readouterr().err


def test_different_sizes_are_one_line(tmp_path, capsys):
    a, b = saved(tmp_path, "a.png", np.zeros((4, 5, 3))), saved(tmp_path, "b.exr", np.zeros((4, 6, 3)))
    assert main(["compare", a, b]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "different sizes, 5x4 and 6x4 pixels" in error


def test_missing_files_are_one_line(tmp_path, capsys):
    a = saved(tmp_path, "a.png", np.zeros((4, 5, 3)))
    for pair in ((a, str(tmp_path / "none.png")), (str(tmp_path / "none.png"), a)):
        assert main(["compare", *pair]) == 1
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and "none.png" in error


def test_the_difference_picture(tmp_path, capsys):
    first, second = RNG.random((4, 5, 3)), RNG.random((4, 5, 3))
    a, b = saved(tmp_path, "a.exr", first), saved(tmp_path, "b.exr", second)
    gap = np.float32(first).astype(float) - np.float32(second)
    assert main(["compare", a, b, "--output", str(tmp_path / "d.exr")]) == 1
    np.testing.assert_allclose(images.read(tmp_path / "d.exr")[0]["color"], gap, atol=1e-7)
    assert main(["compare", a, b, "--output", str(tmp_path / "d.png")]) == 1
    shown = images.read(tmp_path / "d.png")[0]["color"]
    assert shown.max() == 1.0
    assert shown.argmax() == np.abs(gap).argmax()
    assert main(["compare", a, b, "--output", str(tmp_path / "d.doc")]) == 1
    assert "unknown image extension" in capsys.readouterr().err


class TestFlip:
    @pytest.fixture(autouse=True)
    def _needs_the_package(self):
        pytest.importorskip("flip_evaluator", reason="flip-evaluator, of the extra study, is not installed")

    def test_bounds(self):
        white, black = np.ones((8, 8, 3)), np.zeros((8, 8, 3))
        for encoded in (False, True):
            assert metrics.flip(white, white, encoded)[0] == 0.0
            mean, found = metrics.flip(white, black, encoded)
            assert 0.9 < mean <= 1.0 and found.shape == (8, 8)
            assert mean == pytest.approx(found.mean(), rel=1e-4)

    @pytest.mark.parametrize("reference", [0.0, 1e-9, 1e-7, 1e-6, 1e30, np.nan, np.inf, -1.0])
    def test_no_reference_ends_the_process(self, reference):
        mean, _ = metrics.flip(np.full((4, 4, 3), 0.5), np.full((4, 4, 3), reference))
        assert 0.0 < mean <= 1.0

    def test_it_grows_with_the_difference(self):
        reference = RNG.random((16, 16, 3))
        means = [metrics.flip(reference * scale, reference)[0] for scale in (1.0, 1.02, 1.1, 1.5)]
        assert means == sorted(means) and means[1] > 0.0

    def test_it_is_a_limit(self, tmp_path, capsys):
        a, b = (saved(tmp_path, f"{v}.png", np.full((8, 8, 3), v)) for v in (0.5, 0.45))
        _, found = figures_of(capsys, a, b)
        assert main(["compare", a, b, "--flip", str(found["flip"] * 1.01)]) == 0
        assert main(["compare", a, b, "--flip", str(found["flip"] * 0.99)]) == 1


def test_without_flip_the_rest_is_measured(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(metrics, "find_spec", lambda name: None)
    a, b = (saved(tmp_path, f"{v}.png", np.full((8, 8, 3), v)) for v in (0.5, 0.25))
    assert main(["compare", a, b, "--rmse", "1"]) == 0
    assert 'pip install "warprender[study]"' in capsys.readouterr().out
    assert main(["compare", a, b, "--flip", "0.5"]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "flip-evaluator" in error


def test_files_that_were_cut_off_are_one_line(tmp_path, capfd):
    whole = saved(tmp_path, "whole.exr", RNG.random((8, 8, 4)))
    for name in ("a.exr", "a.png"):
        path = tmp_path / name
        content = (tmp_path / saved(tmp_path, name, RNG.random((40, 40, 3)))).read_bytes()
        for share in (0.0, 0.1, 0.6):
            path.write_bytes(content[: int(share * len(content))])
            assert main(["compare", str(path), whole]) == 1
            # Libraries write to the file descriptor itself.
            error = capfd.readouterr().err
            assert error.count("\n") == 1 and str(path) in error and len(error) < 400 + len(str(path)), error


def test_what_is_not_compared_or_no_number_is_said(tmp_path, capsys):
    values = RNG.random((3, 4, 4))
    a = saved(tmp_path, "a.exr", values)
    b = saved(tmp_path, "b.exr", values[..., :3])
    assert main(["compare", a, b]) == 0
    assert f"alpha, which {a} alone has, is not compared" in capsys.readouterr().out
    values[1, 2, 0] = np.nan
    values[2, 2, 1] = np.inf
    c = saved(tmp_path, "c.exr", values)
    assert main(["compare", c, a]) == 1
    assert "not finite    2 pixels of A, 0 of B" in capsys.readouterr().out
    single = saved(tmp_path, "one.exr", np.full((1, 1, 3), 0.5))
    assert main(["compare", single, single]) == 0
