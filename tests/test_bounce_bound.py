"""How many bounces a plan follows: as few as keep what is left out below the stated share of what is emitted."""

import numpy as np
import pytest
import scenes
from pictures import prepare

import warprender as wr
from warprender.plan import BOUNCE_TOLERANCE, MOST_BOUNCES, Request, analyse

NOISE = np.random.default_rng(3).random((4, 4, 4)).astype(np.float32)


def bounds_of(material=None, color=None, **options):
    scene = wr.Scene()
    scene.add_sphere("/ball", 1.0, material=material, color=color)
    scene.add_light(wr.DomeLight())
    return analyse(scene, wr.Camera(), Request(**options)).bounds


def left_out(albedo, bounces):
    """Σ ρ^n over n > d + 1, as d bounces bring d + 1 scatterings."""
    return sum(albedo**n for n in range(bounces + 2, bounces + 50000))


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


@pytest.mark.parametrize(("albedo", "bounces"), [(0.0, 0), (0.0099, 0), (0.0101, 1), (0.5, 13), (0.999, MOST_BOUNCES)])
def test_counts_by_hand(albedo, bounces):
    """ρ² / (1 - ρ) passes 1e-4 at ρ = 0.00995; 2^-14 = 6.1e-5 is what 13 bounces leave of a half."""
    bounds = bounds_of(color=(albedo,) * 3)
    assert bounds["bounces"] == bounces
    if albedo > 0:
        assert bounds["unfollowed"] == pytest.approx(left_out(bounds["albedo"], bounces), rel=1e-6)


@pytest.mark.parametrize("albedo", [1.0, 1.5, 1e30])
def test_more_than_all_light_is_taken_as_all(albedo):
    bounds = bounds_of(color=(albedo, 0.1, 0.1))
    assert (bounds["albedo"], bounds["bounces"], bounds["unfollowed"]) == (1.0, MOST_BOUNCES, np.inf)


@pytest.mark.parametrize("asked", [0, 1, 7])
def test_the_bound_stands_for_an_asked_number_too(asked):
    bounds = bounds_of(color=(0.5, 0.5, 0.5), bounces=asked)
    assert bounds["unfollowed"] == pytest.approx(left_out(0.5, asked), rel=1e-12)


@pytest.mark.parametrize("bounces", [0, 1, 3])
def test_a_closed_grey_box_loses_the_bound(bounces):
    """Every surface glows with radiance e and reflects ρ: d bounces show e Σ ρ^n up to n = d + 1 of e / (1 - ρ)."""
    glow, albedo = 0.25, 0.6
    scene = wr.Scene()
    look = wr.PreviewSurface(
        emissiveColor=(glow,) * 3, diffuseColor=(albedo,) * 3, useSpecularWorkflow=1, specularEdgeColor=(0, 0, 0)
    )
    scene.add_mesh("/box", *scenes.cube(2.0), material=look)
    renderer = prepare(scene, scenes.camera((0.2, 0.1, 0.3)), 8, bounces=bounces, camera_light="off")
    color = renderer.render(samples=256).numpy("color")[..., :3].astype(np.float64)
    lost = 1.0 - color.mean() * (1.0 - albedo) / glow
    bound = renderer.plan.bounds["unfollowed"] * (1.0 - renderer.plan.bounds["albedo"])
    # Between what next-event estimation and chance say there is noise; five standard errors of the mean.
    spread = 5 * np.sqrt((renderer.standard_error() ** 2).sum()) / color.size * (1.0 - albedo) / glow * np.sqrt(3)
    assert renderer.plan.bounds["albedo"] == pytest.approx(albedo, abs=1e-6)
    assert abs(lost - bound) < spread + 1e-5
    assert spread < 0.2 * bound
