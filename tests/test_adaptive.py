"""Samples where the noise is: the picture must stay unbiased, and the stated error right."""

from itertools import pairwise

import numpy as np
import pytest
import scenes
import warp as wp
from films import film_of, part_sums
from pictures import prepare

import warprender as wr
from warprender.adaptive import _REACH, PILOT, Allocation, neighbours, shares
from warprender.film import Film

SIZE = 24


def test_neighbours_are_all_but_the_pixel_itself():
    values = np.random.default_rng(0).random((11, 7))
    found = neighbours(values)
    for y in range(11):
        for x in range(7):
            window = values[max(y - _REACH, 0) : y + _REACH + 1, max(x - _REACH, 0) : x + _REACH + 1]
            assert found[y, x] == pytest.approx(window.sum() - values[y, x], rel=1e-12)
    np.testing.assert_array_equal(neighbours(np.ones((1, 1))), 0.0)


@pytest.mark.parametrize("changed", [0.0, 1e6])
def test_no_pixel_decides_for_itself(changed):
    rng = np.random.default_rng(1)
    variance, mean = rng.random((2, SIZE, SIZE))
    before = shares(variance, mean, np.ones_like(mean))
    for y, x in ((0, 0), (12, 12), (23, 5)):
        other, level = variance.copy(), mean.copy()
        other[y, x], level[y, x] = changed, changed
        after = shares(other, level, np.ones_like(mean))
        assert after[y, x] == pytest.approx(before[y, x], rel=1e-12)
        # The ones beside it do follow, in the direction of the change.
        assert abs(after[y - 1, x] / before[y - 1, x] - 1) > 1e-4 or y == 0


def test_shares_are_bounded_and_their_mean_is_near_1():
    variance = np.full((64, 64), 1e-4)
    variance[:, 32:] = 1.0
    found = shares(variance, np.ones((64, 64)), np.ones((64, 64)))
    assert found.min() == 0.25 and found.max() <= 8.0
    assert found[:, 40:].min() > 4 * found[:, :24].max()
    assert abs(found.mean() - 1) < 0.25
    np.testing.assert_array_equal(shares(0 * variance, variance, variance + 1), 1.0)
    np.testing.assert_array_equal(shares(np.ones((2, 2)), np.ones((2, 2)), np.ones((2, 2))), 1.0)


def test_the_numbers_of_samples_add_up_however_they_are_reached():
    allocation = Allocation(film_of(np.random.default_rng(2).random((SIZE, SIZE, PILOT))))
    steps = [allocation.samples(mean) for mean in (PILOT, 17.5, 40, 64)]
    assert (steps[0] == 0).all() and all((b >= a).all() for a, b in pairwise(steps))
    assert steps[-1].mean() == pytest.approx(64 - PILOT, rel=0.1)


def estimates(decide, trials=200):
    """Mean of the pictures of a class of pixels of which 2 % of samples are lit, and its standard error."""
    rng, means = np.random.default_rng(3), []
    for _ in range(trials):
        pilot = 50.0 * (rng.random((SIZE, SIZE, PILOT)) < 0.02)
        more = decide(pilot)
        lit = rng.binomial(more, 0.02)
        means.append(((pilot.sum(-1) + 50.0 * lit) / (PILOT + more)).mean())
    return np.mean(means), np.std(means) / np.sqrt(trials)


def test_pixels_lit_in_2_of_100_samples_keep_their_light():
    mean, error = estimates(lambda pilot: Allocation(film_of(pilot)).samples(64))
    # Two-sided, one false alarm in 10 000.
    assert abs(mean - 1) < 3.9 * error and error < 0.005


def test_the_test_notices_pixels_that_decide_for_themselves():
    mean, error = estimates(lambda pilot: np.where(pilot.any(-1), 96, 8))
    assert mean < 1 - 20 * error


def stripes():
    """Over the left half of the picture a strip in each row of pixels, 1/50 of it high, of radiance 50."""
    scene, rng = wr.Scene(), np.random.default_rng(4)
    points, faces = [], []
    for row in range(16):
        low = row - 8 + rng.uniform(0.05, 0.9)
        faces.append([len(points) + k for k in range(4)])
        points += [(-8, low, 0), (0, low, 0), (0, low + 0.02, 0), (-8, low + 0.02, 0)]
    glow = wr.PreviewSurface(diffuseColor=(0, 0, 0), ior=1.0, emissiveColor=(50, 50, 50))
    scene.add_mesh("/strips", np.array(points, float), faces, material=glow)
    grey = wr.PreviewSurface(diffuseColor=(0, 0, 0), ior=1.0, emissiveColor=(1, 1, 1))
    corners = np.array([(0, -8, 0), (8, -8, 0), (8, 8, 0), (0, 8, 0)], float)
    scene.add_mesh("/even", corners, [[0, 1, 2, 3]], material=grey)
    view = wr.Camera(
        projection="orthographic", horizontalAperture=160.0, verticalAperture=160.0, transform=scenes.look_at((0, 0, 5))
    )
    return scene, view


def test_whole_pictures_keep_the_light_of_rarely_lit_pixels():
    renderer = prepare(*stripes(), 16, adaptive=True, bounces=0, outputs=("color", "sampleCount"))
    frames = [renderer.render(samples=48, seed=seed) for seed in range(40)]
    lit = np.array([f.numpy("color")[:, :8, 0].mean() for f in frames])
    assert abs(lit.mean() - 1) < 3.9 * lit.std(ddof=1) / np.sqrt(len(lit))
    assert lit.std() < 0.2
    counts = np.mean([f.numpy("sampleCount") for f in frames], axis=0)
    assert counts[:, :6].mean() > 2 * counts[:, 14:].mean() and counts.min() >= PILOT
    # Beside what it gives off, the even half mirrors a little of the strips along its surface.
    np.testing.assert_allclose([f.numpy("color")[:, 12:, 0] for f in frames], 1.0, atol=1e-4)
    # As many samples in other passes are the same picture.
    parts = prepare(*stripes(), 16, adaptive=True, bounces=0, threads=1).render(samples=48, seed=3)
    np.testing.assert_array_equal(parts.numpy("color"), frames[3].numpy("color"))


def test_the_stated_error_holds_for_unequal_numbers():
    rng, pixels = np.random.default_rng(5), (60, 100)
    film = Film(100, 60, "cpu")
    counts = rng.choice([16, 24, 32, 61, 128], pixels)
    draws = 1 + 0.4 * rng.standard_normal((*pixels, 128))
    draws[np.arange(128) >= counts[..., None]] = 0.0
    of_count = {n: part_sums(np.where(np.arange(128) < n, draws, 0.0)[..., :n]) for n in np.unique(counts)}
    sums = np.select([(counts == n)[..., None] for n in of_count], list(of_count.values()))
    film.record.parts = wp.array(sums, dtype=wp.vec4d, device="cpu")
    film.record.samples = wp.array(counts, dtype=wp.int32, device="cpu")
    expected = 0.4 * np.sqrt((1 / counts).mean())
    # 6000 pixels of one degree of freedom, of which those with few samples weigh more: squared ± √(2/6000 · 1.3) = 2 %.
    assert film.relative_error().error == pytest.approx(expected, rel=4 * 0.011)
    assert film.frame_error().error == pytest.approx(expected, rel=4 * 0.011)


def test_an_error_a_time_or_few_samples_stop_it():
    renderer = prepare(*stripes(), 16, adaptive=True, bounces=0)
    frame = renderer.render(error=0.8)
    assert frame.stats["error"] <= 0.8 and frame.stats["samples"] >= PILOT
    assert renderer.render(samples=5).stats["samples"] == 5
    assert renderer.render(seconds=0.05).stats["samples"] > 0
