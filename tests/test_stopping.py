"""What stops a render: samples, a time, an error; and what the error that it states is worth."""

import time

import numpy as np
import pytest
import scenes
from films import film_of, part_sums
from pictures import prepare

import warprender as wr
from warprender import stopping
from warprender.noise import part_counts, true_errors


def lit_cube():
    scene = wr.Scene()
    scene.add_mesh("/cube", *scenes.cube(1.5), color=(0.7, 0.6, 0.5))
    scene.add_light(wr.DomeLight(intensity=0.5))
    scene.add_light(wr.RectLight(intensity=8.0), pose=scenes.look_at((1, 2, 2)))
    return scene, scenes.camera((2, 1.5, 4), fov=25.0)


def test_part_of_a_sample_goes_to_the_first_pixels():
    renderer = prepare(*lit_cube(), 16, outputs=("color", "sampleCount"))
    frame = renderer.render(samples=3 + 40 / 256, seed=4)
    counts = frame.numpy("sampleCount").ravel()
    np.testing.assert_array_equal(counts, np.where(np.arange(256) < 40, 4, 3))
    assert frame.stats["samples"] == 3 + 40 / 256 == frame.receipt["samples"]
    four, three = (renderer.render(samples=n, seed=4).numpy("color").reshape(256, 4) for n in (4, 3))
    found = frame.numpy("color").reshape(256, 4)
    np.testing.assert_array_equal(found, np.where(np.arange(256)[:, None] < 40, four, three))


def test_the_pixels_that_a_time_limit_leaves_out_are_few_and_can_be_repeated(monkeypatch):
    # A clock on which a sample of a pixel takes 1/256 of a second: 3.4 s are 3 samples and 40 % of the pixels.
    now, pixels = [0.0], 256

    class Clock:
        perf_counter = staticmethod(lambda: now[0])

    renderer = prepare(*lit_cube(), 16, outputs=("color", "sampleCount"))
    take = renderer._pass

    def slow_pass(request, first, samples, count=None):
        take(request, first, samples, count)
        now[0] += samples * (pixels if count is None else count) / pixels

    monkeypatch.setattr(renderer, "_pass", slow_pass)
    monkeypatch.setattr(stopping, "time", Clock)
    frame = renderer.render(seconds=3.4)
    assert now[0] == pytest.approx(3.4, abs=1 / 256)
    assert frame.stats["samples"] == pytest.approx(3.4, abs=1 / 256)
    again = renderer.render(samples=frame.stats["samples"])
    np.testing.assert_array_equal(again.numpy("color"), frame.numpy("color"))


def test_a_time_limit_without_part_samples_on_a_quick_picture():
    renderer = prepare(*lit_cube(), 16)
    renderer.render(samples=1)
    begin = time.perf_counter()
    frame = renderer.render(seconds=0.3)
    # No test asserts on time but this lower bound: the limit was not left early.
    assert time.perf_counter() - begin > 0.29 and frame.stats["samples"] > 1


def test_parts_hold_what_they_are_said_to():
    for samples in (*range(1, 40), 64, 65, 127, 128, 129):
        np.testing.assert_array_equal(part_counts(np.full((1, 1), samples)), part_sums(np.ones((1, 1, samples))))


def test_the_film_keeps_the_parts_of_each_pixel():
    """Single samples are what a picture of one more adds."""
    renderer = prepare(*lit_cube(), 16, sampler="sobol")
    at, before = [], np.zeros((16, 16))
    for samples in range(1, 23):
        renderer.render(samples=samples, seed=2)
        total = renderer._films.last.parts()[0].sum(-1)
        at.append(total - before)
        before = total
    draws = np.stack(at, -1)
    for samples in (7, 22):
        renderer.render(samples=samples, seed=2)
        sums, count = renderer._films.last.parts()
        np.testing.assert_allclose(sums, part_sums(draws[..., :samples]), atol=1e-9)
        assert (count.sum(-1) == samples).all()


@pytest.mark.parametrize("samples", [16, 30, 64])
def test_the_error_is_that_of_the_distribution(samples):
    rng, pixels = np.random.default_rng(samples), 20_000
    # Pixels of brightness 0.5 to 4, standard deviation of a sample 0.4 of it: one degree of freedom a pixel.
    level = rng.uniform(0.5, 4.0, (pixels, 1))
    film = film_of(level * (1 + 0.4 * rng.standard_normal((pixels, samples))))
    expected = 0.4 / np.sqrt(samples)
    # The mean of 20 000 squares of normal numbers, squared: ± √(2 / 20 000) = 1 %; the brightness weighs some more.
    assert film.relative_error().error == pytest.approx(expected, rel=4 * 0.005 * 1.2)
    assert film.frame_error().error == pytest.approx(expected, rel=4 * 0.005 * 1.5)


def test_skewed_samples_bias_the_error_little():
    # Exponential samples: where the mean comes out low so does the variance. Uncorrected, 16 samples state 3 % less.
    rng, pixels, samples = np.random.default_rng(1), (300, 333), 16
    draws = rng.exponential(2.0, (*pixels, samples))
    mean = draws.mean(-1)
    plain = np.sqrt(np.mean((draws[..., ::2].mean(-1) - mean) ** 2 / mean**2))
    assert plain < 0.975 / np.sqrt(samples)
    film = film_of(draws)
    assert film.relative_error().error == pytest.approx(1 / np.sqrt(samples), rel=0.015)
    assert film.frame_error().error == pytest.approx(1 / np.sqrt(samples), rel=0.02)


def test_a_firefly_is_stated_as_large_as_it_is():
    """One sample of 64 a thousand times as bright, in one pixel: the mean is off by 16 times its true value."""
    draws = np.ones((8, 8, 64)) + 0.01 * np.random.default_rng(0).standard_normal((8, 8, 64))
    draws[3, 4, 17] = 1000.0
    true, of_frame = true_errors(np.repeat(draws.mean(-1)[..., None], 3, -1), np.ones((8, 8, 3)))
    assert true == pytest.approx(999 / 64 / 8, rel=0.01)
    film = film_of(draws)
    # By hand: the part that holds it is cut at 2, so the mean that is divided by is 5/4, and 4/3 where the jackknife
    # leaves another part out: 4 · f²/16 / (5/4)² − 3 · 3/4 · f²/12 / (4/3)² = 0.0545 f², where f²/16 is true.
    assert film.relative_error().error == pytest.approx(true * np.sqrt(0.0545 * 16), rel=0.01)
    # The frame's light is not freed of it.
    assert film.frame_error().error == pytest.approx(of_frame, rel=0.5)
    assert film.relative_error().within > 0.9 and film.frame_error().within > 0.9


@pytest.mark.parametrize("size", [12, 48])
def test_the_true_error_lies_within_what_is_stated(size):
    """Gamma-distributed samples over a ramp of brightness: 19 of 20 frames, for both figures."""
    rng, samples, frames = np.random.default_rng(size), 32, 200
    level = np.linspace(0.1, 2.0, size)[None, :, None] * np.ones((size, 1, 1))
    reference = np.repeat(level, 3, -1)
    inside = np.zeros(2)
    for _ in range(frames):
        draws = level * rng.gamma(0.5, 2.0, (size, size, samples))
        film = film_of(draws)
        true = true_errors(np.repeat(draws.mean(-1)[..., None], 3, -1), reference)
        stated = film.relative_error(), film.frame_error()
        inside += [abs(a - s.error) <= s.within * s.error for a, s in zip(true, stated, strict=True)]
        if size == 48:
            assert all(s.within < 0.1 for s in stated)
    # Binomial of 200 at 0.95 or above: below 0.9 with a chance of 0.3 %.
    assert (inside / frames >= 0.9).all()


def test_unlit_pixels_are_left_out():
    draws = np.full((100, 16), 1e-4)
    assert film_of(draws).relative_error() == film_of(draws).frame_error() == (0.0, 0.0)
    assert film_of(draws[:, :3]).relative_error() == (np.inf, np.inf)
    draws[:50] = 1 + 0.1 * np.random.default_rng(0).standard_normal((50, 16))
    # 50 pixels: ± 20 %.
    assert film_of(draws).frame_error().error == pytest.approx(0.025, rel=0.5)
    assert film_of(draws).relative_error().error == pytest.approx(0.025, rel=0.5)


@pytest.mark.parametrize("needed", [16, 17, 100, 1000])
def test_an_error_is_overshot_by_a_tenth_at_most(needed):
    passes = stopping.Passes(stopping.Limits(error=needed**-0.5), 256, lambda: passes.taken**-0.5)
    for _ in passes:
        pass
    assert needed <= passes.taken <= max(1.1 * needed + 1, 18)


def test_an_error_stops_the_render_when_it_is_reached():
    renderer = prepare(*lit_cube(), 32, sampler="sobol")
    frame = renderer.render(error=0.03)
    assert frame.stats["error"] <= 0.03 and frame.stats["samples"] >= 16
    assert renderer.render(error=0.015).stats["samples"] > frame.stats["samples"]
