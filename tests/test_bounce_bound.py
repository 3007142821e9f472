"""How many bounces a plan follows: as few as keep what is left out below the stated share of what is emitted."""

import numpy as np
import pytest

import warprender as wr
from warprender.plan import BOUNCE_TOLERANCE, MOST_BOUNCES, Request, analyse

NOISE = np.random.default_rng(3).random((4, 4, 4)).astype(np.float32)


def bounds_of(material=None, color=None, **options):
    scene = wr.Scene()
    scene.add_sphere("/ball", 1.0, material=material, color=color)
    scene.add_light(wr.DomeLight())
    return analyse(scene, wr.Camera(), Request(**options)).bounds


def left_out(albedo, bounces):
    """Σ ρ^k over k > d: no less than what more than d + 1 scatterings bring."""
    return sum(albedo**k for k in range(bounces + 1, bounces + 5000))


def assert_smallest(bounds):
    albedo, bounces = bounds["albedo"], bounds["bounces"]
    assert left_out(albedo, bounces) <= BOUNCE_TOLERANCE * (1 + 1e-9)
    assert bounces == 0 or left_out(albedo, bounces - 1) > BOUNCE_TOLERANCE * (1 - 1e-9)
    assert bounds["unfollowed"] == pytest.approx(left_out(albedo, bounces), rel=1e-9)


@pytest.mark.parametrize("albedo", [0.2, 0.37, 0.5, 0.73, 0.9, 0.95])
def test_the_smallest_number_for_a_grey_surface(albedo):
    bounds = bounds_of(color=(albedo, 0.1, 0.1))
    assert bounds["albedo"] == pytest.approx(albedo, rel=1e-6)
    assert_smallest(bounds)


@pytest.mark.parametrize(("specular", "transmission"), [(0.6, 0.3), (0.3, 0.6), (0.6, 0.6)])
def test_transmitted_light_counts_as_reflected_light_does(specular, transmission):
    glass = wr.Dielectric(specularColor=(specular,) * 3, transmissionColor=(0.0, transmission, 0.1))
    bounds = bounds_of(glass)
    assert bounds["albedo"] == pytest.approx(0.6)
    assert_smallest(bounds)


def test_clear_glass_has_no_bound():
    bounds = bounds_of(wr.Dielectric())
    assert (bounds["bounces"], bounds["unfollowed"]) == (MOST_BOUNCES, np.inf)


def test_emission_and_its_texture_change_nothing():
    plain = wr.PreviewSurface(diffuseColor=(0.4, 0.2, 0.1), ior=1.0)
    constant = wr.PreviewSurface(diffuseColor=(0.4, 0.2, 0.1), ior=1.0, emissiveColor=(50, 50, 50))
    textured = wr.PreviewSurface(diffuseColor=(0.4, 0.2, 0.1), ior=1.0, emissiveColor=wr.Texture(NOISE))
    assert bounds_of(plain) == bounds_of(constant) == bounds_of(textured)
    assert_smallest(bounds_of(textured))


def test_a_textured_albedo_has_no_bound_below_1():
    assert bounds_of(wr.PreviewSurface(diffuseColor=wr.Texture(NOISE)))["bounces"] == MOST_BOUNCES
    glass = wr.Dielectric(transmissionColor=wr.Texture(NOISE))
    assert bounds_of(glass)["bounces"] == MOST_BOUNCES
