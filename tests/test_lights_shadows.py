"""ShadowAPI, light linking and shadow linking."""

import numpy as np
import pytest
from light_scenes import assert_illuminance, floor, pose

import warprender as wr
from warprender.lights import DistantLight, DomeLight, Shadow, SphereLight

LAMP = 4.0 * np.pi * 0.1**2 / 4.0


def lamp(**fields):
    """A sphere light two units above the floor."""
    return SphereLight(radius=0.1, intensity=4.0, transform=pose((0, 0, 2.0)), **fields)


def card(scene, path, height, opacity=1.0):
    """A square that keeps all light from above off the patch of floor."""
    points = np.array([(-3, -3, height), (3, -3, height), (3, 3, height), (-3, 3, height)], float)
    material = wr.DisplayColor(color=(0, 0, 0), opacity=opacity)
    scene.add_mesh(path, points, [[0, 1, 2, 3]], material=material)
    return scene


def test_a_card_keeps_the_light_off():
    assert_illuminance(card(floor(lamp()), "/card", 1.0), 0.0)


def test_shadows_can_be_switched_off():
    assert_illuminance(card(floor(lamp(shadow=Shadow(enable=False))), "/card", 1.0), LAMP)


@pytest.mark.parametrize("opacity", [1.0, 0.75])
def test_shadow_color_is_what_arrives_in_full_shadow(opacity):
    color = np.array([0.2, 0.5, 0.0])
    scene = card(floor(lamp(shadow=Shadow(color=tuple(color)))), "/card", 1.0, opacity)
    assert_illuminance(scene, LAMP * (color * opacity + (1 - opacity)))


@pytest.mark.parametrize(
    ("shadow", "passed"),
    [
        (Shadow(distance=0.9), 1.0),
        (Shadow(distance=1.1), 0.0),
        (Shadow(distance=1.5, falloff=1.0), 0.5),
        (Shadow(distance=1.5, falloff=1.0, falloffGamma=2.0), 0.75),
        (Shadow(distance=1.5, falloff=9.0), 2.0 / 3.0),
        (Shadow(distance=1.5, falloff=0.2), 0.0),
    ],
)
def test_shadows_reach_as_far_as_their_distance(shadow, passed):
    assert_illuminance(card(floor(lamp(shadow=shadow)), "/card", 1.0), LAMP * passed, within=0.02, slack=2e-3)


def test_shadow_linking_lets_light_through_prims():
    scene = floor(lamp(unshadowed=frozenset({"/glass"})), lamp())
    card(scene, "/glass", 1.0)
    assert_illuminance(scene, LAMP, within=0.05)
    card(scene, "/wall", 0.5)
    assert_illuminance(scene, 0.0)


def test_light_linking_leaves_prims_dark():
    assert_illuminance(floor(lamp(unlit=frozenset({"/floor"}))), 0.0)
    assert_illuminance(floor(lamp(unlit=frozenset({"/other"})), lamp()), 2 * LAMP)


def test_linking_holds_for_lights_that_are_only_met():
    dome = DomeLight(intensity=0.5, unlit=frozenset({"/floor"}))
    assert_illuminance(floor(dome), 0.0)
    through = DomeLight(intensity=0.5, unshadowed=frozenset({"/card"}))
    scene = card(floor(through), "/card", 1.0)
    assert_illuminance(scene, 0.5 * np.pi, within=0.03)


def test_both_ways_to_a_large_light_agree_about_changed_shadows():
    # So wide that most of it is met by chance: with weights of two ways that disagree it would not come out.
    sun = DistantLight(angle=120.0, intensity=1.0, shadow=Shadow(color=(0.25, 0.25, 0.25)))
    expected = np.pi * np.sin(np.radians(60)) ** 2
    scene = floor(sun)
    assert_illuminance(scene, expected, within=0.02)
    # The card reaches 71.6 degrees from the zenith on its sides: all of the sun is behind it.
    assert_illuminance(card(scene, "/card", 1.0), 0.25 * expected, within=0.02)
