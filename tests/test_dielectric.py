"""Dielectrics: Fresnel and Snell against closed forms, rough lobes against Walter et al. 2007 in float64."""

import numpy as np
import pytest
import warp as wp
from bsdfs import ABSORB, DELTA, SCATTER, evaluated, sampled, towards, weights
from chance import SIGMAS, chi_square
from hypothesis import given, settings
from hypothesis import strategies as st

import warprender as wr
from warprender.materials.fresnel import fresnel_dielectric, refracted

ETAS = (1.5, 1 / 1.5, 1.33, 0.75, 2.42, 1 / 2.42, 1.0001, 0.9999, 1.0)


@wp.kernel(module="unique", enable_backward=False)
def boundary(
    cosine: wp.array(dtype=wp.float32),
    eta: wp.float32,
    share: wp.array(dtype=wp.float32),
    direction: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    share[i] = fresnel_dielectric(cosine[i], eta)
    sine = wp.sqrt((1.0 - cosine[i]) * (1.0 + cosine[i]))
    direction[i] = refracted(wp.vec3(sine, 0.0, cosine[i]), wp.vec3(0.0, 0.0, 1.0), eta)


def at_boundary(cosine, eta):
    cosine = np.asarray(cosine, np.float32)
    share, direction = wp.empty(len(cosine), dtype=wp.float32), wp.empty(len(cosine), dtype=wp.vec3)
    wp.launch(boundary, len(cosine), [wp.array(cosine), float(eta), share, direction])
    return share.numpy().astype(float), direction.numpy().astype(float)


def fresnel(cosine, eta, moved=0.0):
    """Fresnel's equations as Walter et al. 2007 write them (22), 1 where all is reflected.

    `moved` is added to the squared cosine beyond the boundary, times eta², which is where float32 rounds.
    """
    c, eta = np.asarray(cosine, np.float64), float(np.float32(eta))
    squared = eta**2 - 1 + c**2 + moved
    g = np.sqrt(np.maximum(squared, 0))
    with np.errstate(all="ignore"):
        share = 0.5 * ((g - c) / (g + c)) ** 2 * (1 + ((c * (g + c) - 1) / (c * (g - c) + 1)) ** 2)
    return np.where(squared <= 0, 1.0, share)


def critical_cosine(eta):
    return np.sqrt(max(0.0, 1 - eta**2))


@pytest.mark.parametrize("eta", ETAS[:6])
def test_fresnel_is_that_of_unpolarised_light(eta):
    near = critical_cosine(eta) + np.linspace(-1e-4, 1e-4, 401)
    cosine = np.concatenate([np.linspace(0, 1, 4001), near, np.logspace(-7, 0, 200)]).clip(0, 1).astype(np.float32)
    share, _ = at_boundary(cosine, eta)
    # Two roundings move the critical angle; away from it they move the share by no more than this either.
    moved = 4 * 2.0**-24 * max(1.0, eta**2)
    ends = [fresnel(cosine, eta, d) for d in (-moved, moved)]
    assert (share >= np.minimum(*ends) - 1e-6).all() and (share <= np.maximum(*ends) + 1e-6).all()


@pytest.mark.parametrize("eta", ETAS)
def test_fresnel_at_the_angles_that_are_known(eta):
    share, _ = at_boundary([1.0, np.cos(np.arctan(eta)), 0.0, critical_cosine(eta) * 0.999], eta)
    exact = float(np.float32(eta))
    assert abs(share[0] - ((exact - 1) / (exact + 1)) ** 2) <= 3e-7 * share[0]
    # At Brewster's angle the reflected light is polarised: half of what the perpendicular part alone would be.
    np.testing.assert_allclose(share[1], 0.5 * ((exact**2 - 1) / (exact**2 + 1)) ** 2, rtol=2e-5)
    if eta == 1:
        assert (share == 0).all()
    else:
        assert share[2] == 1
    if eta < 1:
        assert share[3] == 1


def test_equal_media_reflect_nothing_at_any_angle():
    share, direction = at_boundary(np.logspace(-8, 0, 1000), 1.0)
    assert (share == 0).all()
    assert (direction[:, 2] <= 0).all()


@pytest.mark.parametrize("eta", ETAS)
def test_refraction_is_snells(eta):
    cosine = np.linspace(critical_cosine(eta) * 1.001 + 1e-4, 1, 2000).astype(np.float32)
    _, direction = at_boundary(cosine, eta)
    sine = np.sqrt(1 - cosine.astype(float) ** 2)
    np.testing.assert_allclose(direction[:, 0], -sine / float(np.float32(eta)), atol=2e-7)
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1, atol=3e-7)
    assert (direction[:, 1] == 0).all() and (direction[:, 2] < 0).all()


def test_beyond_the_critical_angle_nothing_is_refracted():
    share, direction = at_boundary(np.linspace(0, critical_cosine(1 / 1.5) * 0.99999, 1000), 1 / 1.5)
    assert (share == 1).all() and (direction == 0).all()


@pytest.mark.parametrize("front", [1, 0])
@pytest.mark.parametrize("ior", [1.5, 0.75])
@pytest.mark.parametrize("cosine", [1.0, 0.8, 0.5, 0.1])
def test_smooth_glass_splits_light_in_two(ior, cosine, front):
    eta = ior if front else 1 / ior
    samples = sampled(wr.Dielectric(ior=ior), towards(cosine), 1 << 14, front=front)
    assert (samples["event"] == DELTA).all() and (samples["pdf"] == 0).all()
    above = samples["direction"][:, 2] > 0
    share = fresnel(cosine, eta)
    assert abs(above.mean() - share) <= SIGMAS * np.sqrt(share * (1 - share) / len(above))
    np.testing.assert_allclose(weights(samples), np.where(above, 1, 1 / eta**2)[:, None].repeat(3, 1), rtol=1e-5)
    there = np.tile(towards(cosine), (len(samples), 1)).astype(np.float32)
    np.testing.assert_array_equal(samples["direction"][above], there[above] * (-1, -1, 1))
    np.testing.assert_allclose(samples["direction"][~above][:, :2] * eta, -there[~above][:, :2], rtol=1e-6)


ROUGH = {
    "glass": {"ior": 1.5, "roughness": 0.4},
    "fine": {"ior": 1.5, "roughness": 0.2},
    "coarse": {"ior": 1.33, "roughness": 1.0},
    "bubble": {"ior": 0.7, "roughness": 0.5},
    "diamond": {"ior": 2.42, "roughness": 0.6},
    "nearly nothing": {"ior": 1.1, "roughness": 0.7},
    "tinted": {"roughness": 0.5, "specularColor": (0.9, 0.5, 0.2), "transmissionColor": (0.1, 0.4, 0.8)},
    "sheet": {"ior": 1.5, "roughness": 0.5, "thinWalled": 1},
}
COSINES = (1.0, 0.6, 0.15)


def walter(look, wo, wi, front):
    """Value f |cos θ| of Walter et al. 2007, equations 20, 21, 33, in float64; without colours."""
    ior, alpha = look.get("ior", 1.5), look["roughness"] ** 2
    n_o, n_i = (1.0, ior) if front else (ior, 1.0)
    wo, wi = np.asarray(wo, float), np.asarray(wi, float)
    across = wi[:, 2] < 0
    h = np.where(across[:, None], -(n_i * wi + n_o * wo), wi + wo)
    h = h / np.linalg.norm(h, axis=1, keepdims=True)
    h *= np.where(h[:, 2] < 0, -1, 1)[:, None]
    o_h, i_h = (wo * h).sum(1), (wi * h).sum(1)
    tan_h = np.sqrt(1 - h[:, 2] ** 2) / h[:, 2]
    density = alpha**2 / (np.pi * h[:, 2] ** 4 * (alpha**2 + tan_h**2) ** 2)
    tan2 = [1 / np.minimum(w[:, 2] ** 2, 1) - 1 for w in (wo, wi)]
    lambda_o, lambda_i = ((np.sqrt(1 + alpha**2 * t) - 1) / 2 for t in tan2)
    share = fresnel(o_h, n_i / n_o)
    reflected = share * density / (1 + lambda_o + lambda_i) / (4 * wo[:, 2])
    masking = 1 / ((1 + lambda_o) * (1 + lambda_i))
    spread = (n_i * i_h + n_o * o_h) ** 2
    crossing = np.abs(i_h * o_h) / wo[:, 2] * n_o**2 * (1 - share) * masking * density / spread
    seen = (o_h > 0) & (across == (i_h < 0))
    return np.where(seen, np.where(across, crossing, reflected), 0.0)


def all_around(n, seed):
    z = np.random.default_rng(seed).uniform(-1, 1, n)
    phi = np.random.default_rng(seed + 1).uniform(0, 2 * np.pi, n)
    return np.stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z], 1).astype(np.float32)


@pytest.mark.parametrize("front", [1, 0])
@pytest.mark.parametrize("look", ["glass", "coarse", "bubble", "diamond"])
def test_rough_lobes_are_walters(look, front):
    wo, wi = all_around(1 << 14, 3) * (1, 1, 1), all_around(1 << 14, 5)
    wo[:, 2] = np.abs(wo[:, 2])
    value = evaluated(wr.Dielectric(**ROUGH[look]), wo, wi, front)["specular"][:, 0]
    expected = walter(ROUGH[look], wo.astype(np.float32), wi, front)
    assert (expected[wi[:, 2] < 0] > 0).any() and (expected[wi[:, 2] > 0] > 0).any()
    np.testing.assert_allclose(value, expected, rtol=2e-3, atol=2e-5)
    assert np.median(np.abs(value / np.maximum(expected, 1e-30) - 1)[expected > 1e-3]) < 2e-6


@pytest.mark.parametrize("front", [1, 0])
@pytest.mark.parametrize("look", ROUGH)
def test_samples_weigh_what_evaluation_says(look, front):
    material = wr.Dielectric(**ROUGH[look])
    for cosine in COSINES:
        samples = sampled(material, towards(cosine), front=front)
        samples = samples[samples["event"] == SCATTER]
        values = evaluated(material, towards(cosine), samples["direction"], front)
        # A half-vector that is found again has few digits where wo and wi are nearly opposite, or graze the facet.
        for part in ("pdf", "specular"):
            scale = samples["pdf"] if part == "specular" else 1.0
            weighed = samples[part].T * scale
            off = np.abs(weighed - values[part].T) > 2e-3 * np.abs(weighed)
            assert off.mean() < 2e-3, off.mean()


@pytest.mark.parametrize("front", [1, 0])
@pytest.mark.parametrize("look", ROUGH)
def test_directions_on_both_sides_are_distributed_as_their_pdf(look, front):
    # 32 × 32 bins in θ and φ over the whole sphere, each integrated by 60 × 60 midpoints: the refracted lobe ends at a
    # steep edge, where fewer than that are off by more than the counts.
    n, bins, fine = 1 << 16, (32, 32), 60
    material = wr.Dielectric(**ROUGH[look])
    theta = (np.arange(bins[0] * fine) + 0.5) / (bins[0] * fine) * np.pi
    phi = (np.arange(bins[1] * fine) + 0.5) / (bins[1] * fine) * 2 * np.pi - np.pi
    grid = towards(np.cos(theta)[:, None], phi[None, :]).reshape(-1, 3)
    for cosine in (0.9, 0.3)[front : front + 1]:
        pdf = evaluated(material, towards(cosine), grid, front)["pdf"].reshape(len(theta), len(phi))
        cells = (pdf * np.sin(theta)[:, None]).astype(float).reshape(bins[0], fine, bins[1], fine).mean((1, 3))
        samples = sampled(material, towards(cosine), n, front=front)
        x, y, z = samples["direction"][samples["event"] == SCATTER].T
        observed, _, _ = np.histogram2d(
            np.arctan2(np.hypot(x, y), z), np.arctan2(y, x), bins, [(0, np.pi), (-np.pi, np.pi)]
        )
        assert chi_square(observed, cells * (2 * np.pi**2 / (bins[0] * bins[1])), n) > 1e-5


@pytest.mark.parametrize("look", ROUGH)
def test_light_may_travel_either_way(look):
    # The value for light that comes the other way is eta² times larger or smaller where it crosses.
    material = wr.Dielectric(**ROUGH[look])
    a, b = all_around(4096, 7), all_around(4096, 9)
    a[:, 2] = np.abs(a[:, 2]) + np.float32(1e-3)
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    across = b[:, 2] < 0
    # From the other side the frame is turned over: z is along the normal on the viewer's side.
    there = evaluated(material, a, b, 1)["specular"] / np.abs(b[:, 2:])
    viewer, light = b * (1, 1, -1), a * (1, 1, -1)
    back = evaluated(material, np.where(across[:, None], viewer, b), np.where(across[:, None], light, a), 1)
    inside = evaluated(material, np.where(across[:, None], viewer, b), np.where(across[:, None], light, a), 0)
    thin = material.thinWalled
    back = np.where(across[:, None] & (not thin), inside["specular"], back["specular"]) / a[:, 2:]
    scale = np.where(across & (not thin), material.ior**2, 1.0)[:, None]
    np.testing.assert_allclose(back, there * scale, rtol=5e-3, atol=1e-4)
    assert (there[across] > 0).any() and (there[~across] > 0).any()


def dielectrics():
    unit = st.floats(0, 1, width=32)
    return st.builds(
        wr.Dielectric,
        ior=st.sampled_from([0.5, 0.75, 1.0, 1.0001, 1.01, 1.33, 1.5, 2.42, 10.0]),
        roughness=st.one_of(unit, st.sampled_from([0.0, 1e-3, 0.01, 0.02])),
        specularColor=st.tuples(unit, unit, unit),
        transmissionColor=st.tuples(unit, unit, unit),
        thinWalled=st.integers(0, 1),
    )


@settings(max_examples=80, deadline=None, derandomize=True)
@given(material=dielectrics(), cosine=st.floats(1e-4, 1), front=st.integers(0, 1))
def test_no_more_light_leaves_than_arrives(material, cosine, front):
    samples = sampled(material, towards(cosine), 4096, front=front)
    assert np.isfinite(samples["direction"]).all()
    # What crosses carries radiance, which eta² makes power again.
    eta = 1.0 if material.thinWalled else (material.ior if front else 1 / material.ior)
    power = weights(samples) * np.where(samples["direction"][:, 2] < 0, eta**2, 1.0)[:, None]
    assert np.isfinite(power).all() and (power >= 0).all()
    limit = material.largest_albedo()
    assert (power.mean(0) <= limit + SIGMAS * power.std(0) / np.sqrt(len(power)) + 1e-5).all()


@pytest.mark.parametrize("look", ROUGH)
def test_degenerate_directions_give_numbers(look):
    edge = [(1, 0, 0), (-1, 0, 0), (0, 0, 1), (0, 0, -1), towards(1e-7), -towards(1e-7), towards(1e-20)]
    edge = np.array([e / np.linalg.norm(e) for e in edge] + [(1, 0, 1e-30), (-1, 0, -1e-30)])
    wo, wi = (grid.reshape(-1, 3) for grid in np.broadcast_arrays(edge[:, None], edge[None]))
    for front in (0, 1):
        values = evaluated(wr.Dielectric(**ROUGH[look]), wo, wi, front)
        assert np.isfinite(values["specular"]).all() and np.isfinite(values["pdf"]).all()
        for direction in edge:
            samples = sampled(wr.Dielectric(**ROUGH[look]), direction, 256, front=front)
            assert np.isfinite(weights(samples)).all()


def test_a_boundary_between_equal_media_is_not_there():
    for roughness in (0.0, 0.5, 1.0):
        for cosine in (1.0, 0.3, 1e-3):
            samples = sampled(wr.Dielectric(ior=1.0, roughness=roughness), towards(cosine), 64)
            assert (samples["event"] == DELTA).all()
            np.testing.assert_allclose(samples["direction"], -towards(cosine) * np.ones((64, 1)), atol=1e-7)
            np.testing.assert_allclose(weights(samples), 1.0)


def test_bad_numbers_are_taken_within_bounds():
    for ior in (0.0, -1.5, 1e9):
        samples = sampled(wr.Dielectric(ior=ior, roughness=0.3), towards(0.5), 256)
        assert np.isfinite(weights(samples)).all() and np.isfinite(samples["pdf"]).all()
    samples = sampled(wr.Dielectric(roughness=7.0), towards(0.5), 256)
    np.testing.assert_array_equal(samples, sampled(wr.Dielectric(roughness=1.0), towards(0.5), 256))
    assert (samples["event"] == ABSORB).any()
