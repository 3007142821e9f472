"""Cases A1, A3, A5 and A8 of the catalogue: long sums, fireflies, the ends of the unit interval, many Sobol points.

A2, A4, A6 and A7 are in `tests/test_pictures.py`, `tests/test_sampling.py` and `tests/test_images.py`.
"""

import numpy as np
import pytest
import scenes
import warp as wp
from pictures import prepare
from test_sampling import pairs

import warprender as wr
from warprender.sampling import DIMENSION_PIXEL, REPLICATES, random_pair, sample_stream, to_unit


def test_A1_a_long_sum_does_not_stall():
    # A film that already has 2^25 samples of radiance 1: in float32 not one more would count.
    scene = wr.Scene()
    scene.add_mesh("/quad", *scenes.quad(4.0), material=wr.PreviewSurface(diffuseColor=(0, 0, 0)))
    scene.add_light(wr.DomeLight(intensity=0.0))
    scene.add_mesh(
        "/glow",
        scenes.quad(4.0)[0] + (0, 0, 0.5),
        scenes.quad(4.0)[1],
        material=wr.PreviewSurface(diffuseColor=(0, 0, 0), ior=1.0, emissiveColor=(1.0, 1.0, 1.0)),
    )
    renderer = prepare(scene, scenes.window(2.0), 4, bounces=0)
    renderer.render(samples=1)
    film, many = renderer._films.last.record, 2**25
    film.sums.fill_(wp.vec4d(many, many, many, many))
    film.samples.fill_(many)
    renderer._pass(renderer._path_request(0), many, 64)
    np.testing.assert_array_equal(film.sums.numpy()[..., 0], many + 64)
    assert np.float32(many) + np.float32(1) == np.float32(many)


@wp.kernel(module="unique", enable_backward=False)
def units_of(bits: wp.array(dtype=wp.uint32), out: wp.array(dtype=wp.float32)):
    out[wp.tid()] = to_unit(bits[wp.tid()])


def test_A5_numbers_stay_below_1():
    bits = np.array([0, 1, 255, 256, 2**31, 2**32 - 256, 2**32 - 129, 2**32 - 128, 2**32 - 1], np.uint32)
    out = wp.zeros(len(bits), dtype=wp.float32, device="cpu")
    wp.launch(units_of, len(bits), [wp.array(bits, dtype=wp.uint32, device="cpu"), out], device="cpu")
    found = out.numpy()
    assert found[0] == 0.0 and found.max() <= np.float32(1 - 2**-24) and (np.diff(found) >= 0).all()
    np.testing.assert_allclose(found, bits / 2.0**32, atol=2**-23)


@wp.kernel(module="unique", enable_backward=False)
def late_pairs(first: int, bounce: int, sobol: int, out: wp.array(dtype=wp.vec2)):
    out[wp.tid()] = random_pair(sample_stream(wp.uint32(3), 7, first + wp.tid(), sobol), bounce, DIMENSION_PIXEL)


@pytest.mark.parametrize("first", [2**16, 2**24, 2**31 - 2**14], ids=lambda n: f"A8-{n}")
def test_late_sobol_points_are_new_and_even(first):
    count = 2**14
    early, late = (np.empty((count, 2)) for _ in range(2))
    for start, points in ((0, early), (first, late)):
        out = wp.empty(count, dtype=wp.vec2, device="cpu")
        wp.launch(late_pairs, count, [start, 0, 1, out], device="cpu")
        points[:] = out.numpy()
    # Replicates of two nets of 4096 points each: one in every box of 64 × 64, wherever in the sequence they begin.
    for replicate in range(int(REPLICATES)):
        for net in late[replicate::REPLICATES].reshape(-1, 4096, 2):
            cells = np.floor(net * 64).astype(int)
            assert len(np.unique(cells[:, 0] * 64 + cells[:, 1])) == 4096
    same = (early[:, None, :].view(np.complex128) == late[None, :64].view(np.complex128)).sum()
    assert same == 0


def test_A8_far_dimensions_repeat_none():
    # 20 bounces of one pixel's 256 points: 4 of their 2 × 20 numbers in a pair of dimensions may be near, none equal.
    columns = np.concatenate([pairs(seed=5, samples=256, bounce=b, n=256, sobol=1) for b in range(60, 80)], 1)
    correlation = np.corrcoef(columns.T.astype(float)) - np.eye(40)
    # 780 pairs: one false alarm in 10 000 at 5.4 standard deviations.
    assert abs(correlation).max() < 5.4 / np.sqrt(256)


def test_a3_fireflies_stay_in_the_mean():
    # A small bright light behind a glass ball: what reaches the floor through the glass comes in rare bright samples.
    scene = wr.Scene()
    floor = np.array([(-0.05, 0, 0.05), (0.05, 0, 0.05), (0.05, 0, -0.05), (-0.05, 0, -0.05)])
    scene.add_mesh("/floor", floor, [[0, 1, 2, 3]], color=(0.5, 0.5, 0.5))
    scene.add_sphere("/ball", radius=0.01, material=wr.Dielectric(ior=1.5), pose=(0, 0.012, 0, 0, 0, 0, 1))
    scene.add_light(wr.SphereLight(radius=1e-3, intensity=1000.0), pose=scenes.look_at((0, 0.03, 0), up=(0, 0, 1)))
    view = scenes.camera((0, 0.004, 0.02), fov=12.0, clippingRange=(1e-4, 10.0))
    renderer = prepare(scene, view, 16, camera_light="off", bounces=4)
    pictures = [renderer.render(samples=64, seed=seed).numpy("color")[..., 0].astype(float) for seed in range(1, 17)]
    long = renderer.render(samples=6400, seed=0).numpy("color")[..., 0].astype(float).mean()
    short = np.array([picture.mean() for picture in pictures])
    # Student's t of 15 degrees of freedom is beyond 5 once in 6000 times.
    assert abs(short.mean() - long) < 5 * short.std(ddof=1) * np.sqrt(1 / 16 + 1 / 100)
    # There are fireflies: a clamp at ten times the median would take far more from the mean than chance does.
    clamped = [np.minimum(picture, 10 * np.median(picture)).mean() for picture in pictures]
    assert long - np.mean(clamped) > 5 * short.std(ddof=1) / 4
