"""Portals: the same dome, directions distributed as is said, and a room with a window that converges faster."""

import numpy as np
import pytest
from chance import SIGMAS, chi_square, polygon_irradiance, z_of
from light_scenes import assert_illuminance, floor, illuminance, pose
from test_lights import cosine_directions, irradiances, met, sampled
from test_lights_dome import N, random_map

import warprender as wr
from warprender.lights import DomeLight, LightTexture, PortalLight

UP = np.array([0, 0, 1.0])
TURN = np.array([(0, 0, -1), (0, 1, 0), (1, 0, 0)], float)
PORTALS = {
    "one": [PortalLight(1.0, 0.5, pose((0, 0, 1.0)))],
    "two that overlap": [PortalLight(1.0, 1.0, pose((0, 0, 1.0))), PortalLight(2.0, 0.4, pose((0.2, 0.1, 0.8)))],
    "turned, scaled, sheared": [
        PortalLight(0.8, 0.6, pose((2.0, 0, 1.0), TURN)),
        PortalLight(1.0, 1.0, pose((-1, 0.3, 1.5), [(1, 0.4, 0), (0, 2, 0.3), (0.1, 0, 1)])),
    ],
    "the back": [PortalLight(1.0, 1.0, pose((0, 0, 1.0), np.diag([1.0, -1, -1])))],
    "of no size": [PortalLight(0.0, 1.0, pose((0, 0, 1.0))), PortalLight(1.0, 1.0, pose((0, 0, 1.0), scale=0.0))],
    "nearly in its plane": [PortalLight(1.0, 1.0, pose((0, 0, 1e-4)))],
    "tiny": [PortalLight(1e-4, 1e-4, pose((0.3, 0, 1.0)))],
    "far and large": [PortalLight(1e4, 2e4, pose((0.3, 0, 1e4)))],
}


def dome(names, textured):
    """A dome of mean radiance about 1 with these portals."""
    texture = LightTexture.of(random_map()) if textured else None
    return DomeLight(texture=texture, portals=tuple(PORTALS[names]))


@pytest.mark.parametrize("textured", [False, True])
@pytest.mark.parametrize("names", PORTALS)
def test_sampling_and_meeting_agree(names, textured):
    light = dome(names, textured)
    samples = sampled(light, (0, 0, 0), 4096)
    found = samples["pdf"] > 0
    hidden = names in ("the back", "of no size")
    assert found.any() == (textured or not hidden)
    if not found.any():
        return
    again = met(light, (0, 0, 0), samples["direction"][found])
    # A rounded direction may cross the rim of a portal, or of a texel.
    apart = np.abs(again["pdf"] / samples["pdf"][found] - 1)
    assert (apart > 1e-3).mean() < (0.01 if names == "tiny" else 2e-3)
    same = apart < 1e-6
    np.testing.assert_allclose(again["radiance"][same], samples["radiance"][found][same], rtol=1e-3, atol=1e-4)
    assert np.isfinite(samples["pdf"]).all() and (np.isinf(samples["distance"]) | ~found).all()


@pytest.mark.parametrize("names", ["one", "two that overlap", "turned, scaled, sheared", "far and large"])
def test_directions_are_distributed_as_their_pdf(names):
    light = dome(names, False)
    samples = sampled(light, (0, 0, 0))
    # Bins over the upper half sphere, of one solid angle each; their shares by 200 x 200 points of the pdf in each.
    count, fine = 12, 200
    edge = (np.arange(count * fine) + 0.5) / (count * fine)
    z, turn = np.meshgrid(edge, edge * 2 * np.pi, indexing="ij")
    directions = np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], -1)
    pdf = met(light, (0, 0, 0), directions.reshape(-1, 3))["pdf"].astype(float).reshape(count, fine, count, fine)
    expected = pdf.mean((1, 3)) * 2 * np.pi / count**2
    np.testing.assert_allclose(expected.sum(), 1.0, rtol=2e-3)
    d = samples["direction"].astype(float)
    turned = np.arctan2(d[:, 1], d[:, 0]) % (2 * np.pi)
    limits = np.linspace(0, 1, count + 1)
    # The midpoints leave 1e-3 of a bin at the portals' rims.
    thin = slice(0, 20_000)
    observed, _, _ = np.histogram2d(d[thin, 2], turned[thin] / (2 * np.pi), (limits, limits))
    assert chi_square(observed, expected / expected.sum(), 20_000) > 1e-5


@pytest.mark.parametrize("names", PORTALS)
def test_the_two_ways_together_give_the_irradiance_of_the_map(names):
    light, plain = dome(names, True), dome("of no size", True)
    directions = cosine_directions(UP)
    reference = irradiances(sampled(plain, (0, 0, 0), 8 * N, seed=7), UP)
    # Weighted by the power heuristic as paths are, aimed and by chance.
    aimed = sampled(light, (0, 0, 0))
    chance = met(light, (0, 0, 0), directions)
    cosine = np.maximum(aimed["direction"] @ UP, 0).astype(float)
    own = np.maximum(cosine, 1e-30) / np.pi
    weight = 1 / (1 + (own / np.maximum(aimed["pdf"], 1e-30)) ** 2)
    value = irradiances(aimed, UP) * weight
    other = np.maximum(directions @ UP, 1e-30) / np.pi
    value = value + chance["radiance"][:, 0] * np.pi / (1 + (chance["pdf"] / other) ** 2)
    slack = SIGMAS * reference.std() / np.sqrt(len(reference)) / reference.mean()
    assert abs(z_of(value, reference.mean(), floor=slack / SIGMAS + 1e-4)) < SIGMAS


def room(light, corners=(0.3, 0.6)):
    """A closed box about the floor of `light_scenes` whose roof has a window, `corners` from x to x, 0.3 deep."""
    scene = floor(light)
    low, high = corners
    walls = [
        [(-1, -1, 1), (low, -1, 1), (low, 1, 1), (-1, 1, 1)],
        [(high, -1, 1), (1, -1, 1), (1, 1, 1), (high, 1, 1)],
        [(low, -1, 1), (high, -1, 1), (high, -0.15, 1), (low, -0.15, 1)],
        [(low, 0.15, 1), (high, 0.15, 1), (high, 1, 1), (low, 1, 1)],
    ]
    corner = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    for k in range(4):
        a, b = corner[k], corner[(k + 1) % 4]
        walls.append([(*a, -1), (*b, -1), (*b, 1), (*a, 1)])
    points = np.array(walls, float).reshape(-1, 3)
    scene.add_mesh("/walls", points, np.arange(len(points)).reshape(-1, 4), color=(0, 0, 0))
    return scene


def window_of(portal_x, width=0.3, **fields):
    return DomeLight(portals=(PortalLight(width, 0.3, pose((portal_x, 0, 1.0))),), **fields)


def test_a_room_with_a_window_is_lit_alike_with_less_noise():
    texture = LightTexture.of(np.random.default_rng(2).random((16, 32, 3)) + 0.5)
    for picture in (None, texture):
        plain, plain_error = illuminance(room(DomeLight(texture=picture)), samples=1024)
        through, error = illuminance(room(window_of(0.45, texture=picture)), samples=1024)
        assert (np.abs(plain - through) < SIGMAS * np.hypot(plain_error, error)).all()
        assert error[0] < 0.4 * plain_error[0]


@pytest.mark.parametrize(("x", "width"), [(0.35, 0.1), (-0.6, 0.3), (0.45, 2.0)])
def test_portals_that_miss_the_window_change_nothing(x, width):
    closed_form, _ = illuminance(room(window_of(0.45)), samples=4096)
    mean, error = illuminance(room(window_of(x, width)), samples=4096)
    assert (np.abs(mean - closed_form) < SIGMAS * error + 1e-3 * closed_form).all()


def test_a_window_has_the_irradiance_of_a_rectangle():
    corners = [(0.3, -0.15, 1), (0.6, -0.15, 1), (0.6, 0.15, 1), (0.3, 0.15, 1)]
    expected = 2.0 * polygon_irradiance(np.zeros(3), UP, corners)
    assert_illuminance(room(window_of(0.45, intensity=2.0)), expected)


def test_a_portal_is_a_kind_of_its_own_in_the_plan():
    scene = room(window_of(0.45))
    plan = wr.plan.analyse(scene, wr.Camera(), wr.plan.Request())
    assert plan.path.lights == ("DomeLight.portals",) and plan.path.sampled_lights
