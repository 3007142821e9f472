"""Random numbers, the warps that use them, and the frames that they are turned into."""

import numpy as np
import pytest
import warp as wp
from chance import SIGMAS, chi_square

from warprender.filters import FILTERS, filter_offset, filter_table
from warprender.numerics import from_frame, next_up, tangent_of, to_frame
from warprender.sampling import (
    REPLICATES,
    cosine_hemisphere,
    one_minus_cos,
    power_heuristic,
    random_pair,
    sample_stream,
    uniform_cone,
    unit_disk,
)

N = 1 << 18


@wp.kernel(module="unique", enable_backward=False)
def keys_of(seed: wp.uint32, first_pixel: int, samples: int, out: wp.array(dtype=wp.uint64)):
    i = wp.tid()
    out[i] = sample_stream(seed, first_pixel + i // samples, i % samples, 0).key


@wp.kernel(module="unique", enable_backward=False)
def pairs_of(seed: wp.uint32, samples: int, bounce: int, dimension: int, sobol: int, out: wp.array(dtype=wp.vec2)):
    i = wp.tid()
    out[i] = random_pair(sample_stream(seed, i // samples, i % samples, sobol), bounce, dimension)


def keys(seed, first_pixel=0, samples=64, n=1 << 19):
    out = wp.empty(n, dtype=wp.uint64)
    wp.launch(keys_of, n, [seed, first_pixel, samples, out])
    return out.numpy()


def pairs(seed=0, samples=64, bounce=0, dimension=0, n=N, sobol=0):
    out = wp.empty(n, dtype=wp.vec2)
    wp.launch(pairs_of, n, [seed, samples, bounce, dimension, sobol, out])
    return out.numpy()


def test_A4_no_two_samples_share_a_stream():
    # A4: wp.rand_init's 32 bits repeat within one 4K frame; a million keys of two seeds must not.
    for streams in ([keys(0), keys(1)], [keys(0, 0, 1 << 16), keys(0, 2**31 - 8, 1 << 16)]):
        assert np.diff(np.sort(np.concatenate(streams))).all()


@pytest.mark.parametrize("bounce", [-1, 0, 7, 300])
def test_numbers_fill_the_unit_square_evenly(bounce):
    u = pairs(bounce=bounce, dimension=1)
    assert (u >= 0).all() and (u < 1).all()
    counts, _, _ = np.histogram2d(u[:, 0], u[:, 1], 32, [(0, 1), (0, 1)])
    assert chi_square(counts, np.full(counts.shape, 1 / counts.size), N) > 1e-5


def test_neighbours_are_not_correlated():
    # A4: pixels side by side, samples one after another, bounces, dimensions and seeds.
    base = pairs()
    rows = base.reshape(-1, 64, 2)
    others = {
        "pixel": (rows[:-1], rows[1:]),
        "sample": (rows[:, :-1], rows[:, 1:]),
        "bounce": (base, pairs(bounce=1)),
        "dimension": (base, pairs(dimension=1)),
        "seed": (base, pairs(seed=1)),
        "pair": (base[:, :1], base[:, 1:]),
        "next dimension of the bounce before": (pairs(bounce=0, dimension=3), pairs(bounce=1)),
    }
    for name, (a, b) in others.items():
        a, b = np.ravel(a).astype(float), np.ravel(b).astype(float)
        assert abs(np.corrcoef(a, b)[0, 1]) < SIGMAS / np.sqrt(len(a)), name


def mapped(func, dtype, *inputs):
    """A wp.func of one or two arguments over arrays."""
    types = [
        {1: wp.float32, 2: wp.vec2, 3: wp.vec3}[np.ndim(v) and np.shape(v)[-1] if np.ndim(v) > 1 else 1] for v in inputs
    ]
    arrays = [wp.array(np.asarray(v, np.float32), dtype=t) for v, t in zip(inputs, types, strict=True)]
    out = wp.empty(len(arrays[0]), dtype=dtype)
    if len(types) == 1:

        @wp.kernel(module="unique", enable_backward=False)
        def apply(a: wp.array(dtype=types[0]), out: wp.array(dtype=dtype)):
            i = wp.tid()
            out[i] = func(a[i])
    else:

        @wp.kernel(module="unique", enable_backward=False)
        def apply(a: wp.array(dtype=types[0]), b: wp.array(dtype=types[1]), out: wp.array(dtype=dtype)):
            i = wp.tid()
            out[i] = func(a[i], b[i])

    wp.launch(apply, len(arrays[0]), [*arrays, out])
    return out.numpy()


ENDS = np.array([(a, b) for a in (0, 2.0**-24, 0.5, 1 - 2.0**-24) for b in (0, 2.0**-24, 0.5, 1 - 2.0**-24)])


def test_points_of_the_disk_are_even():
    u = np.concatenate([ENDS, pairs()[len(ENDS) :]])
    p = mapped(unit_disk, wp.vec2, u).astype(float)
    r2, phi = (p**2).sum(1), np.arctan2(p[:, 1], p[:, 0])
    assert (r2 <= 1 + 1e-6).all()
    counts, _, _ = np.histogram2d(np.minimum(r2, 1), phi, (16, 32), [(0, 1), (-np.pi, np.pi)])
    assert chi_square(counts, np.full(counts.shape, 1 / counts.size), N) > 1e-5


def test_directions_of_the_hemisphere_have_a_cosine_density():
    u = np.concatenate([ENDS, pairs()[len(ENDS) :]])
    d = mapped(cosine_hemisphere, wp.vec3, u).astype(float)
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1, atol=1e-6)
    assert (d[:, 2] >= 0).all()
    # sin² θ is uniform under it.
    counts, _, _ = np.histogram2d(1 - d[:, 2] ** 2, np.arctan2(d[:, 1], d[:, 0]), (16, 32), [(0, 1), (-np.pi, np.pi)])
    assert chi_square(counts, np.full(counts.shape, 1 / counts.size), N) > 1e-5


@pytest.mark.parametrize("cone", [1e-10, 1e-5, 0.1, 1.0, 2.0])
def test_directions_of_a_cone_are_even(cone):
    u = np.concatenate([ENDS, pairs()[len(ENDS) :]])
    d = mapped(uniform_cone, wp.vec3, u, np.full(len(u), cone)).astype(float)
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1, atol=1e-6)
    # 1 - cos from the sine, which keeps its digits in narrow cones.
    sin2 = d[:, 0] ** 2 + d[:, 1] ** 2
    below = np.where(d[:, 2] > 0, sin2 / (1 + np.sqrt(np.maximum(1 - sin2, 0))), 1 - d[:, 2])
    assert (below <= cone * (1 + 1e-5)).all()
    counts, _, _ = np.histogram2d(below / cone, np.arctan2(d[:, 1], d[:, 0]), (16, 32), [(0, 1), (-np.pi, np.pi)])
    inner = counts[1:-1]
    assert chi_square(inner, np.full(inner.shape, 1 / counts.size), N) > 1e-5


def test_l1_narrow_cones_keep_their_digits():
    # 1 - sqrt(1 - s²) has lost them all at s = 1e-4.
    sine = 10.0 ** -np.arange(0.5, 9, 0.5)
    sin2 = (sine**2).astype(np.float32)
    exact = sin2.astype(float) / (1 + np.sqrt(1 - sin2.astype(float)))
    np.testing.assert_allclose(mapped(one_minus_cos, wp.float32, sin2), exact, rtol=2e-7)


def test_the_weights_of_two_strategies_sum_to_1():
    a, b = np.meshgrid(10.0 ** np.arange(-18, 19), 10.0 ** np.arange(-18, 19))
    a, b = a.ravel(), b.ravel()
    sums = mapped(power_heuristic, wp.float32, a, b) + mapped(power_heuristic, wp.float32, b, a)
    np.testing.assert_allclose(sums, 1, rtol=1e-6)
    # A density of 0 has weight 0 and leaves all to the other.
    np.testing.assert_array_equal(mapped(power_heuristic, wp.float32, [0, 0, 3.0], [0, 1, 0]), [0, 0, 1])


@pytest.mark.parametrize("name", FILTERS)
def test_filters_are_sampled_by_their_shape(name):
    @wp.kernel(module="unique", enable_backward=False)
    def offsets(table: wp.array(dtype=wp.float32), u: wp.array(dtype=wp.float32), out: wp.array(dtype=wp.float32)):
        i = wp.tid()
        out[i] = filter_offset(table, u[i])

    u = np.append(pairs()[:, 0], [0, 1 - 2.0**-24]).astype(np.float32)
    out = wp.empty(len(u), dtype=wp.float32)
    wp.launch(offsets, len(u), [wp.array(filter_table(name)), wp.array(u), out])
    x = out.numpy().astype(float)
    radius = {"box": 0.5, "triangle": 1.0, "gaussian": 1.5}[name]
    assert np.abs(x).max() <= radius
    edges = np.linspace(-radius, radius, 41)
    fine = np.linspace(-radius, radius, 40 * 64 + 1)
    middle = (fine[1:] + fine[:-1]) / 2
    density = (
        {
            "box": np.ones_like(middle),
            "triangle": 1 - np.abs(middle),
            "gaussian": np.exp(-2 * middle**2) - np.exp(-2 * radius**2),
        }[name]
        .reshape(40, 64)
        .sum(1)
    )
    # 2^16 draws resolve 1 % of a bin; the table's straight pieces are nearer to the curve than that.
    counts, _ = np.histogram(x[: 1 << 16], edges)
    assert chi_square(counts, density / density.sum(), 1 << 16) > 1e-5


def test_s8_frames_are_orthonormal_everywhere():
    # about -Z too, where Frisvad's has none.
    rng = np.random.default_rng(0)
    n = rng.normal(size=(100_000, 3))
    n[:6] = [(0, 0, 1), (0, 0, -1), (0, 0, -1), (1e-9, 0, -1), (0, -1e-9, -1), (1e-5, 1e-5, -1)]
    n = (n / np.linalg.norm(n, axis=1, keepdims=True)).astype(np.float32)
    t = mapped(tangent_of, wp.vec3, n).astype(float)
    n = n.astype(float)
    np.testing.assert_allclose(np.linalg.norm(t, axis=1), 1, atol=5e-7)
    np.testing.assert_allclose((t * n).sum(1), 0, atol=5e-7)


def test_a_vector_comes_back_from_a_frame():
    @wp.kernel(module="unique", enable_backward=False)
    def there_and_back(n: wp.array(dtype=wp.vec3), v: wp.array(dtype=wp.vec3), out: wp.array(dtype=wp.vec3)):
        i = wp.tid()
        t = tangent_of(n[i])
        out[i] = from_frame(t, n[i], to_frame(t, n[i], v[i]))

    rng = np.random.default_rng(1)
    n, v = rng.normal(size=(2, 10_000, 3))
    n = (n / np.linalg.norm(n, axis=1, keepdims=True)).astype(np.float32)
    v = v.astype(np.float32)
    out = wp.empty(len(v), dtype=wp.vec3)
    wp.launch(there_and_back, len(v), [wp.array(n, dtype=wp.vec3), wp.array(v, dtype=wp.vec3), out])
    np.testing.assert_allclose(out.numpy(), v, atol=3e-6)


def test_the_next_float_is_numpys():
    tiny = np.float32(1.4e-45)
    x = np.array([0, -0.0, 1, -1, 1e-40, -1e-40, tiny, -tiny, 1.5, 2, 3.4e38, -7e-3], np.float32)
    np.testing.assert_array_equal(mapped(next_up, wp.float32, x), np.nextafter(x, np.float32(np.inf)))
    np.testing.assert_array_equal(-mapped(next_up, wp.float32, -x), np.nextafter(x, np.float32(-np.inf)))


@pytest.mark.parametrize("count", [16, 64, 256])
def test_each_replicate_of_the_sobol_points_puts_one_point_in_every_elementary_box(count):
    pixels, turns = 8, int(REPLICATES)
    points = pairs(seed=3, samples=turns * count, bounce=1, dimension=2, n=pixels * turns * count, sobol=1)
    nets = points.reshape(pixels, count, turns, 2).swapaxes(1, 2).reshape(-1, count, 2).astype(np.float64)
    for columns in 2 ** np.arange(int(np.log2(count)) + 1):
        box = np.floor(nets[..., 0] * columns) * (count // columns) + np.floor(nets[..., 1] * (count // columns))
        assert (np.sort(box, 1) == np.arange(count)).all()


def test_sobol_points_of_pixels_dimensions_and_replicates_are_independent():
    n, samples = 1 << 16, 64
    base = pairs(samples=samples, n=n, sobol=1)
    others = [
        pairs(samples=samples, n=n, sobol=1, dimension=1),
        pairs(samples=samples, n=n, sobol=1, bounce=1),
        pairs(samples=samples, n=n, sobol=1, seed=1),
        np.roll(base, samples, 0),
        np.roll(base.reshape(-1, samples, 2), 1, 1).reshape(-1, 2),
    ]
    for other in others:
        for a in base.T:
            for b in other.T:
                assert abs(np.corrcoef(a, b)[0, 1]) < 4.5 / np.sqrt(n)
