"""Materials: sampling against evaluation, densities, reciprocity, energy, and the limits of microfacets."""

from functools import partial

import numpy as np
import pytest
import warp as wp
from brdf_tables import few_cells, lobes
from bsdfs import DELTA, PASS, SCATTER, evaluated, hemisphere, sampled, towards, weights
from chance import SIGMAS, chi_square_of_directions
from hypothesis import given, settings
from hypothesis import strategies as st

import warprender as wr
from warprender.materials.albedo import albedo_table
from warprender.materials.microfacet import ggx_density
from warprender.sampling import ggx_visible_normal

LOOKS = {
    "display": wr.DisplayColor(color=(0.2, 0.5, 0.8)),
    "display, half clear": wr.DisplayColor(color=(0.2, 0.5, 0.8), opacity=0.5),
    "plastic": wr.PreviewSurface(diffuseColor=(0.2, 0.5, 0.8), roughness=0.4),
    "metal": wr.PreviewSurface(diffuseColor=(0.9, 0.7, 0.3), metallic=1.0, roughness=0.3),
    "alloy": wr.PreviewSurface(diffuseColor=(0.9, 0.7, 0.3), metallic=0.5, roughness=0.7),
    "coated": wr.PreviewSurface(diffuseColor=(0.6, 0.1, 0.1), roughness=0.6, clearcoat=1.0, clearcoatRoughness=0.3),
    "specular workflow": wr.PreviewSurface(useSpecularWorkflow=1, specularColor=(0.5, 0.3, 0.1), roughness=0.5),
    "weighted edge": wr.PreviewSurface(
        diffuseColor=(0.6, 0.3, 0.1),
        useSpecularWorkflow=1,
        specularColor=(0.02, 0.01, 0.0),
        specularEdgeColor=(0.5, 0.25, 0.0),
        roughness=0.4,
    ),
    "glass": wr.PreviewSurface(opacity=0.25, roughness=0.35),
    "present by half": wr.PreviewSurface(opacity=0.5, opacityMode="presence", roughness=0.35),
    "delta coat": wr.PreviewSurface(roughness=0.5, clearcoat=0.7, clearcoatRoughness=0.0),
    "phong": wr.Phong(diffuseColor=(0.2, 0.5, 0.4), specularColor=(0.3, 0.2, 0.1), exponent=20.0),
    "phong beyond 1": wr.Phong((9.0,) * 3, (2.0, 1.0, 0.5), (3.0, 1.0, 9.0), exponent=0.5),
    "measured": wr.MeasuredBRDF(lobes()),
    "measured, few cells": wr.MeasuredBRDF(few_cells()),
}
COSINES = (1.0, 0.7, 0.2)


def test_a_black_edge_leaves_lambert_alone():
    # The specification's white edge reflects at grazing angles whatever F0; without it nothing but f = ρ / π is left.
    look = wr.PreviewSurface(
        diffuseColor=(0.6, 0.3, 0.1), useSpecularWorkflow=1, specularEdgeColor=(0.0, 0.0, 0.0), roughness=0.2
    )
    wo, wi = hemisphere(512, 8), hemisphere(512, 9)
    values = evaluated(look, wo, wi)
    np.testing.assert_allclose(values["diffuse"], np.outer(wi[:, 2] / np.pi, (0.6, 0.3, 0.1)), rtol=2e-6)
    assert not values["specular"].any()


@pytest.mark.parametrize("look", LOOKS)
def test_samples_weigh_what_evaluation_says(look):
    for cosine in COSINES:
        samples = sampled(LOOKS[look], towards(cosine))
        samples = samples[samples["event"] == SCATTER]
        values = evaluated(LOOKS[look], towards(cosine), samples["direction"])
        np.testing.assert_allclose(samples["pdf"], values["pdf"], rtol=1e-4)
        for part in ("diffuse", "specular"):
            expected = values[part] / values["pdf"][:, None]
            np.testing.assert_allclose(samples[part], expected, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("look", LOOKS)
def test_directions_are_distributed_as_their_pdf(look):
    n = 1 << 17
    for cosine in COSINES:
        samples = sampled(LOOKS[look], towards(cosine), n)
        directions = samples["direction"][samples["event"] == SCATTER]
        pdf = partial(densities, LOOKS[look], towards(cosine))
        assert chi_square_of_directions(pdf, directions, n) > 1e-5


def densities(material, wo, wi):
    return evaluated(material, wo, wi)["pdf"]


@pytest.mark.parametrize("look", [look for look in LOOKS if "phong" not in look])
def test_light_may_travel_either_way(look):
    a, b = hemisphere(4096, 3), hemisphere(4096, 4)
    there, back = evaluated(LOOKS[look], a, b), evaluated(LOOKS[look], b, a)
    for part in ("diffuse", "specular"):
        np.testing.assert_allclose(there[part] / b[:, 2:], back[part] / a[:, 2:], rtol=2e-4, atol=1e-6)


def materials():
    unit = st.floats(0, 1, width=32)
    color = st.tuples(unit, unit, unit)
    return st.builds(
        wr.PreviewSurface,
        diffuseColor=color,
        useSpecularWorkflow=st.integers(0, 1),
        specularColor=color,
        metallic=unit,
        roughness=unit,
        clearcoat=unit,
        clearcoatRoughness=unit,
        opacity=unit,
        opacityMode=st.sampled_from(["transparent", "presence"]),
        opacityThreshold=st.sampled_from([0.0, 0.5]),
        ior=st.floats(1, 3),
    )


@settings(max_examples=60, deadline=None, derandomize=True)
@given(material=materials(), cosine=st.floats(1e-3, 1))
def test_nothing_reflects_and_lets_through_more_than_arrives(material, cosine):
    weight = weights(sampled(material, towards(cosine), 8192))
    assert np.isfinite(weight).all() and (weight >= 0).all()
    excess = weight.mean(0) - 1
    assert (excess <= SIGMAS * weight.std(0) / np.sqrt(len(weight)) + 2e-3).all()


@settings(max_examples=60, deadline=None, derandomize=True)
@given(material=materials(), cosine=st.floats(1e-3, 1))
def test_the_stated_largest_albedo_is_one(material, cosine):
    # It bounds the paths worth following: what comes back, not what goes straight through.
    samples = sampled(material, towards(cosine), 8192)
    weight = np.where((samples["event"] == PASS)[:, None], 0.0, weights(samples))
    spread = SIGMAS * weight.std(0) / np.sqrt(len(weight))
    assert (weight.mean(0) <= material.largest_albedo() + spread + 2e-3).all()


@pytest.mark.parametrize("exponent", [0.0, 0.3, 1.0, 7.0, 100.0, 1e5, 1e7])
@pytest.mark.parametrize("cosine", [1.0, 0.6, 0.05])
def test_phong_reflects_at_most_its_bound(exponent, cosine):
    for diffuse, specular in ((0.5, 0.4), (0.0, 1.0), (2.0, 3.0)):
        material = wr.Phong((1.0,) * 3, (diffuse,) * 3, (specular,) * 3, exponent)
        weight = weights(sampled(material, towards(cosine), 8192))
        spread = SIGMAS * weight.std(0) / np.sqrt(len(weight))
        assert np.isfinite(weight).all()
        assert (weight.mean(0) <= material.largest_albedo() + spread + 1e-5).all()
        if cosine == 1.0:
            # Nothing of the lobe about the normal is lost below the horizon.
            reflected = diffuse + 2 * specular / (exponent + 1)
            assert (np.abs(weight.mean(0) - min(1.0, reflected)) <= spread + 1e-5).all()


@pytest.mark.parametrize("cosine", [1.0, 0.9, 0.5, 0.123, 0.01, 1e-4])
def test_smooth_glass_reflects_and_lets_through_all(cosine):
    glass = wr.PreviewSurface(opacity=0.0, roughness=0.0)
    samples = sampled(glass, towards(cosine), 4096)
    reflected = samples["event"] == DELTA
    assert (reflected | (samples["event"] == PASS)).all()
    fresnel = 0.04 + 0.96 * (1 - cosine) ** 5
    weight, chance = weights(samples)[:, 0], fresnel
    np.testing.assert_allclose(weight, 1.0, atol=2e-6)
    assert abs(reflected.mean() - chance) < SIGMAS * np.sqrt(chance * (1 - chance) / 4096) + 1e-5
    np.testing.assert_allclose(
        samples["direction"][reflected], np.tile(towards(cosine) * (-1, -1, 1), (reflected.sum(), 1)), atol=1e-7
    )


def test_transparent_fades_the_diffuse_part_and_presence_all_of_it():
    wo, wi = towards(0.8), hemisphere(256)
    full = evaluated(wr.PreviewSurface(), wo, wi)
    clear = evaluated(wr.PreviewSurface(opacity=0.25), wo, wi)
    faint = evaluated(wr.PreviewSurface(opacity=0.25, opacityMode="presence"), wo, wi)
    np.testing.assert_allclose(clear["diffuse"], 0.25 * full["diffuse"], rtol=1e-5)
    np.testing.assert_allclose(clear["specular"], full["specular"], rtol=1e-5)
    np.testing.assert_allclose(faint["specular"], 0.25 * full["specular"], rtol=1e-5)
    np.testing.assert_allclose(faint["diffuse"], 0.25 * full["diffuse"], rtol=1e-5)


@pytest.mark.parametrize(("opacity", "seen"), [(0.49, False), (0.5, True), (0.51, True), (0.0, False), (1.0, True)])
@pytest.mark.parametrize("mode", ["transparent", "presence"])
def test_a_cut_out_is_there_from_its_threshold_on(opacity, seen, mode):
    material = wr.PreviewSurface(opacity=opacity, opacityThreshold=0.5, opacityMode=mode, roughness=0.3)
    assert material.passes_light() != seen
    samples = sampled(material, towards(0.8), 1024)
    if seen:
        whole = sampled(wr.PreviewSurface(roughness=0.3), towards(0.8), 1024)
        np.testing.assert_array_equal(samples, whole)
    else:
        assert (samples["event"] == PASS).all()
        np.testing.assert_array_equal(weights(samples), 1.0)


def test_roughness_below_a_delta_lobes_is_a_mirror():
    for roughness in (0.0, 1e-4, 1e-3, 9.9e-3):
        samples = sampled(wr.PreviewSurface(metallic=1.0, roughness=roughness), towards(0.6), 64)
        assert (samples["event"] == DELTA).all() and (samples["pdf"] == 0).all()
        np.testing.assert_allclose(samples["specular"], 0.18, rtol=1e-6)
        assert (
            evaluated(wr.PreviewSurface(metallic=1.0, roughness=roughness), towards(0.6), hemisphere(64))["pdf"] == 0
        ).all()


@pytest.mark.parametrize(
    "look", ["plastic", "metal", "coated", "glass", "delta coat", "phong", "measured", "measured, few cells"]
)
def test_s9_degenerate_directions_give_numbers(look):
    # no half-vector, grazing to the last bit, and the normal itself.
    edge = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, 0, 1), towards(1e-7), towards(1e-7, 0.3 + np.pi), towards(1e-20)]
    edge = np.array([e / np.linalg.norm(e) for e in edge] + [(1, 0, 1e-30), (-1, 0, 1e-30)])
    wo, wi = (grid.reshape(-1, 3) for grid in np.broadcast_arrays(edge[:, None], edge[None]))
    values = evaluated(LOOKS[look], wo, wi)
    for part in ("diffuse", "specular", "pdf"):
        assert np.isfinite(values[part]).all()
    bright = values["pdf"] > 0
    assert np.isfinite(values["specular"][bright] / values["pdf"][bright][:, None]).all()
    for direction in edge:
        assert np.isfinite(weights(sampled(LOOKS[look], direction, 256))).all()


def test_s1_the_density_of_microfacets_keeps_its_digits():
    # angles of 0 to 5 alpha, for every alpha that is not a mirror.
    @wp.kernel(module="unique", enable_backward=False)
    def density(h: wp.array(dtype=wp.vec3), alpha: wp.array(dtype=wp.float32), out: wp.array(dtype=wp.float32)):
        i = wp.tid()
        out[i] = ggx_density(h[i], alpha[i])

    alpha = np.repeat(np.float32(10.0) ** np.arange(-4.0, 0.5, 0.5, dtype=np.float32), 200).astype(np.float32)
    angle = np.tile(np.linspace(0, 5, 200), len(alpha) // 200) * np.minimum(alpha, 0.3)
    h = np.stack([np.sin(angle) * 0.6, np.sin(angle) * 0.8, np.cos(angle)], 1).astype(np.float32)
    out = wp.empty(len(h), dtype=wp.float32)
    wp.launch(density, len(h), [wp.array(h, dtype=wp.vec3), wp.array(alpha), out])
    x, y, z = h.astype(float).T
    a = alpha.astype(float)
    expected = 1 / (np.pi * a**2 * ((x / a) ** 2 + (y / a) ** 2 + z**2) ** 2)
    np.testing.assert_allclose(out.numpy(), expected, rtol=2e-6)


@pytest.mark.parametrize("alpha", [1.0, 0.1, 1e-3, 1e-4, 1e-8])
def test_s3_visible_normals_at_the_limits(alpha):
    # never below the surface, never seen from behind, always numbers.
    @wp.kernel(module="unique", enable_backward=False)
    def visible(wo: wp.vec3, alpha: wp.float32, u: wp.array(dtype=wp.vec2), out: wp.array(dtype=wp.vec3)):
        i = wp.tid()
        out[i] = ggx_visible_normal(wo, alpha, u[i])

    u = np.random.default_rng(0).random((1 << 16, 2), np.float32)
    ends = (0.0, 2.0**-24, 0.25, 0.5, 1 - 2.0**-24)
    u[: len(ends) ** 2] = [(a, b) for a in ends for b in ends]
    for cosine in (1.0, 0.5, 1e-3, 1e-6, 0.0):
        wo = towards(cosine).astype(np.float32)
        out = wp.empty(len(u), dtype=wp.vec3)
        wp.launch(visible, len(u), [wp.vec3(*wo), alpha, wp.array(u, dtype=wp.vec2), out])
        h = out.numpy().astype(float)
        np.testing.assert_allclose(np.linalg.norm(h, axis=1), 1.0, atol=1e-6)
        assert (h[:, 2] > 0).all()
        assert (h @ wo > -1e-7).all()


def test_the_albedo_table_against_closed_forms():
    # Seen from above alpha 1, ∫ 2c/(1+c) over the visible normals is 1 - ln 2; a mirror reflects all.
    table = albedo_table()
    np.testing.assert_allclose(table[-1, -1, 0], 1 - np.log(2), rtol=2e-3)
    np.testing.assert_allclose(table[8:, 0, 0], 1.0, rtol=2e-3)
    cosine = np.linspace(0, 1, len(table)) ** 2
    np.testing.assert_allclose(table[8:, 0, 1], (1 - cosine[8:]) ** 5, atol=1e-3)
    assert (table >= 0).all() and (table <= 1).all() and (table[..., 1] <= table[..., 0]).all()
