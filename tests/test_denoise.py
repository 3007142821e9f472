"""Open Image Denoise: off unless asked, less noise, the same bits again."""

import numpy as np
import pytest
from pictures import prepare
from test_testing import lit_ball

import warprender as wr
from warprender import denoise

NEEDED = pytest.mark.skipif(not denoise.available(), reason="pyoidn, of the extra denoise, is not installed")


@NEEDED
def test_it_takes_noise_away_and_alpha_along():
    scene, view = lit_ball()
    reference = prepare(scene, view, 64).render(samples=512, seed=1).numpy("color")
    noisy = prepare(scene, view, 64).render(samples=1)
    clean = prepare(scene, view, 64, denoise=True).render(samples=1)
    assert "denoised" not in noisy.stats and clean.stats["denoised"] and clean.stats["seconds"]["denoise"] > 0
    assert list(clean.outputs) == ["color"]

    def rmse(frame):
        return np.sqrt(np.mean((frame.numpy("color")[..., :3] - reference[..., :3]) ** 2))

    assert rmse(clean) < 0.75 * rmse(noisy)
    np.testing.assert_array_equal(clean.numpy("color")[..., 3], noisy.numpy("color")[..., 3])
    again = prepare(scene, view, 64, denoise=True).render(samples=1)
    np.testing.assert_array_equal(again.numpy("color"), clean.numpy("color"))


@NEEDED
def test_any_size_and_black_pictures_are_taken():
    for height, width in ((1, 1), (3, 17)):
        black = np.zeros((height, width, 4), np.float32)
        guide = np.full((height, width, 3), -1.0, np.float32)
        np.testing.assert_array_equal(denoise.denoised(black, guide, guide), black)
        black[..., 3] = 1.0
        # The network's guess for black is black to within 5e-5.
        np.testing.assert_allclose(denoise.denoised(black, guide, guide), black, atol=2e-4)


def test_without_the_package_it_says_what_to_install(monkeypatch):
    monkeypatch.setattr(denoise, "find_spec", lambda name: None)
    with pytest.raises(wr.SceneError, match=r"pip install \"warprender\[denoise\]\""):
        wr.Renderer(*lit_ball(), (4, 4), denoise=True)


@NEEDED
def test_there_must_be_color_to_denoise():
    with pytest.raises(wr.SceneError, match="of color"):
        wr.Renderer(*lit_ball(), (4, 4), outputs="normal", denoise=True)
