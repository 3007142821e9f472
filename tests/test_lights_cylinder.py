"""Cylinder lights: both ways to them, their pdf, and integrals done by quadrature."""

import numpy as np
import pytest
from chance import SIGMAS, chi_square, z_of
from light_scenes import assert_illuminance, floor, pose
from test_lights import PLACES, irradiances, met, sampled

from warprender.lights import CylinderLight

N = 1 << 17


def side_irradiance(radius, length, height):
    """Irradiance below the middle of a cylinder of radiance 1 that lies along X, by azimuth and elevation."""
    arc = np.arcsin(radius / height)
    azimuth = ((np.arange(4000) + 0.5) / 4000 * 2 - 1) * arc
    across = height * np.cos(azimuth) - np.sqrt(radius**2 - (height * np.sin(azimuth)) ** 2)
    beta = np.arctan(length / 2 / across)
    return np.mean((beta + np.sin(beta) * np.cos(beta)) * np.cos(azimuth)) * 2 * arc


@pytest.mark.parametrize(("radius", "height"), [(0.1, 1.0), (0.5, 0.6), (1e-4, 1.0), (0.3, 20.0)])
def test_irradiance_below_a_cylinder(radius, height):
    light = CylinderLight(radius=radius, length=1.5, intensity=3.0, transform=pose((0, 0, height)))
    expected = 3.0 * side_irradiance(radius, 1.5, height)
    values = irradiances(sampled(light, (0, 0, 0)), np.array([0, 0, 1.0]))
    assert abs(z_of(values, expected)) < SIGMAS
    # A uniform elevation and arc leave little spread.
    assert values.std() < 0.5 * values.mean()


def test_scale_makes_another_cylinder():
    scaled = CylinderLight(radius=0.25, length=1.0, intensity=3.0, transform=pose((0, 0, 1), scale=(2.0, 0.4, 0.4)))
    assert_illuminance(floor(scaled), 3.0 * side_irradiance(0.1, 2.0, 1.0))


@pytest.mark.parametrize("place", PLACES)
def test_sampling_and_meeting_agree(place):
    light = CylinderLight(radius=0.3, length=1.2)
    light.transform[:3, :3] = PLACES[place]
    p = np.array([0.3, -1.7, 1.4]) @ PLACES[place]
    aimed = sampled(light, p, 4096)
    hit = met(light, p, aimed["direction"])
    seen = hit["pdf"] > 0
    assert (~seen).sum() <= 8
    # At the rim of the arc a rounded azimuth is worth half the digits of the distance.
    np.testing.assert_allclose(hit["pdf"][seen], aimed["pdf"][seen], rtol=5e-3)
    np.testing.assert_allclose(hit["distance"][seen], aimed["distance"][seen], rtol=5e-3)


def test_directions_are_distributed_as_their_pdf():
    light = CylinderLight(radius=0.4, length=1.5)
    p = np.array([0.4, 0.3, -1.0])
    d = sampled(light, p, N)["direction"].astype(float)
    # Bins of the gnomonic plane about +Z, each integrated over 32 × 32 points.
    edges = np.linspace(-2.2, 2.2, 23)
    observed, _, _ = np.histogram2d(d[:, 0] / d[:, 2], d[:, 1] / d[:, 2], (edges, edges))
    fine = (np.arange(22 * 32) + 0.5) / (22 * 32) * 4.4 - 2.2
    x, y = np.meshgrid(fine, fine, indexing="ij")
    norm = np.sqrt(1 + x**2 + y**2)
    directions = np.stack([x, y, np.ones_like(x)], -1) / norm[..., None]
    pdf = met(light, p, directions.reshape(-1, 3).astype(np.float32))["pdf"].reshape(x.shape)
    expected = (pdf / norm**3).reshape(22, 32, 22, 32).sum((1, 3)) * (4.4 / (22 * 32)) ** 2
    # The quadrature of the rim is good to a few in 10⁴; so many draws tell 3 in 10³ of a bin.
    assert expected.sum() == pytest.approx(1, abs=2e-3)
    assert chi_square(observed, expected / expected.sum(), N) > 1e-5


def test_ends_and_inside_do_not_emit():
    light = CylinderLight(radius=0.5, length=1.0)
    for p in [(0, 0.1, 0.2), (2.0, 0.1, 0.2), (0.5, 0.3, 0)]:
        assert (sampled(light, p, 64)["pdf"] == 0).all()
    # In through the open end and against the far side from within: not met.
    d = np.array([(-1.0, 0.0, 0.25)]) / np.hypot(1, 0.25)
    assert met(light, (1.0, 0, 0.3), d)["pdf"][0] == 0
    assert met(light, (2.0, 0, 0.4), d * (1, 1, 0) / abs(d[0, 0]))["pdf"][0] == 0


def test_normalised_by_the_side_alone():
    light = CylinderLight(radius=0.2, length=2.0, normalize=True)
    np.testing.assert_allclose(light.radiance(), 1 / (2 * np.pi * 0.2 * 2.0))
    light.transform = np.diag([2.0, 3.0, 1.0, 1.0])
    a, b = 0.6, 0.2
    perimeter = np.pi * (3 * (a + b) - np.sqrt((3 * a + b) * (a + 3 * b)))
    np.testing.assert_allclose(light.size_factor(), 4.0 * perimeter)


def test_far_away_a_cylinder_is_its_silhouette():
    light = CylinderLight(radius=0.01, length=0.02, intensity=1e6, transform=pose((0, 0, 10.0)))
    assert_illuminance(floor(light), 1e6 * 0.02 * 0.02 / 100.0, slack=1e-3)
