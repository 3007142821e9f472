"""ShapingAPI and photometric profiles: formulas of the UsdLux guide (facts §5.4), direction by direction."""

import numpy as np
import pytest
from light_scenes import assert_illuminance, floor, illuminance, pose
from scenes import look_at

from warprender.lights import DiskLight, DistantLight, IesProfile, RectLight, Shaping, SphereLight

SMALL = 1e-4


def lamp(direction_angle, shaping, kind=SphereLight, **fields):
    """A tiny lamp one unit above the floor whose axis is turned by an angle from straight down, and its plain light."""
    angle = np.radians(direction_angle)
    target = np.array([np.sin(angle), 0, 1 - np.cos(angle)])
    transform = look_at((0, 0, 1.0), target, up=(0, 1, 0))
    size = {"radius": SMALL} if kind is not RectLight else {"width": SMALL, "height": SMALL}
    light = kind(intensity=1e8, transform=transform, shaping=shaping, **size, **fields)
    plain = {
        SphereLight: np.pi * SMALL**2,
        DiskLight: np.pi * SMALL**2 * np.cos(angle),
        RectLight: SMALL**2 * np.cos(angle),
    }
    return light, 1e8 * plain[kind]


@pytest.mark.parametrize("kind", [SphereLight, DiskLight, RectLight])
@pytest.mark.parametrize("angle", [0.0, 30.0, 60.0])
def test_focus_takes_light_by_the_power_of_the_cosine(kind, angle):
    light, plain = lamp(angle, Shaping(focus=2.5, focusTint=(0.0, 0.5, 1.0)), kind)
    k = np.cos(np.radians(angle)) ** 2.5
    assert_illuminance(floor(light), plain * (k + (1 - k) * np.array([0.0, 0.5, 1.0])))


def test_focus_shines_backwards_as_well():
    forwards, plain = lamp(20.0, Shaping(focus=3.0))
    backwards, _ = lamp(200.0, Shaping(focus=3.0))
    assert_illuminance(floor(forwards), plain * np.cos(np.radians(20)) ** 3)
    assert_illuminance(floor(backwards), plain * np.cos(np.radians(20)) ** 3)


@pytest.mark.parametrize("scale", [1.0, 5.0])
@pytest.mark.parametrize(("angle", "softness"), [(20, 0.0), (20, 0.5), (35, 0.5), (44, 1.0), (46, 0.5), (30, 2.0)])
def test_cone_cuts_and_fades_by_smoothstep(angle, softness, scale):
    light, plain = lamp(angle, Shaping(coneAngle=45.0, coneSoftness=softness), DiskLight)
    light.transform[:3, :3] *= scale
    start = (1 - min(softness, 1.0)) * 45.0
    t = np.clip((angle - start) / (45.0 - start), 0, 1) if softness else float(angle > 45)
    expected = plain * scale**2 * (1 - t * t * (3 - 2 * t)) if angle <= 45 else 0.0
    assert_illuminance(floor(light), expected, slack=2e-3)


def test_a_cone_of_180_degrees_cuts_nothing():
    light, plain = lamp(150.0, Shaping(coneAngle=180.0))
    assert_illuminance(floor(light), plain)
    assert light.effects() == ()


def test_distant_lights_are_shaped_within_their_angle():
    down = pose()
    light = DistantLight(angle=60.0, intensity=2.0, transform=down, shaping=Shaping(coneAngle=10.0))
    assert_illuminance(floor(light), 2 * np.pi * np.sin(np.radians(10)) ** 2, samples=1024, within=0.1)


HEADER = "IESNA:LM-63-2002\n[TEST] none\nTILT=NONE\n"


def ies(vertical, horizontal, values, multiplier=1.0, ballast=1.0):
    """A file of these angles and candelas."""
    numbers = [1, -1, multiplier, len(vertical), len(horizontal), 1, 2, 0, 0, 0, ballast, 1, 10]
    rows = [numbers, vertical, horizontal, *values]
    return HEADER + "\n".join(" ".join(f"{x:g}" for x in row) for row in rows)


def test_a_profile_is_read_with_its_factors():
    profile = IesProfile.parse(ies([0, 90], [0], [[100, 50]], multiplier=2.0, ballast=0.5))
    np.testing.assert_array_equal(profile.values, [[100, 50]] * 2)
    np.testing.assert_array_equal(profile.horizontal, [0, 360])
    # ∫ (100 - 50 θ / (π/2)) sin θ dθ dφ over the lower half.
    np.testing.assert_allclose(profile.power(), 2 * np.pi * (100 - 50 / (np.pi / 2)))


@pytest.mark.parametrize(
    ("horizontal", "at"),
    [([0, 90], [20, 160, 200, 340]), ([0, 180], [20, 340]), ([0, 90, 180, 270, 360], [20]), ([90, 180, 270], [120])],
)
def test_symmetric_profiles_go_all_round(horizontal, at):
    values = [[10 * (i + 1)] * 2 for i in range(len(horizontal))]
    profile = IesProfile.parse(ies([0, 180], horizontal, values))
    assert profile.horizontal[0] == 0 and profile.horizontal[-1] == 360
    looked_up = np.interp(at, profile.horizontal, profile.values[:, 0])
    np.testing.assert_allclose(looked_up, looked_up[0])
    np.testing.assert_allclose(looked_up[0], np.interp(at[0], horizontal, np.array(values)[:, 0]))


def test_a_uniform_profile_has_the_power_of_a_sphere():
    profile = IesProfile.parse(ies([0, 10, 90, 180], [0], [[7.0] * 4]))
    np.testing.assert_allclose(profile.power(), 4 * np.pi * 7.0)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "not a profile",
        HEADER + "1 -1 1 2",
        HEADER + "1 -1 1 2 1 3 2 0 0 0 1 1 10\n0 90\n0\n1 1",
        HEADER + "one two",
    ],
)
def test_what_is_no_profile_is_said(text):
    with pytest.raises(ValueError):
        IesProfile.parse(text)


@pytest.mark.parametrize(("scale", "seen_at"), [(0.0, 30), (0.5, 60), (2.0, 15), (-2.0, 105), (-0.5, 0), (0.1, 180)])
def test_angle_scale(scale, seen_at):
    vertical = np.arange(0, 181, 15)
    profile = IesProfile.parse(ies(vertical, [0], [100.0 + vertical]))
    light, plain = lamp(30.0, Shaping(iesProfile=profile, iesAngleScale=scale, coneAngle=5.0))
    assert_illuminance(floor(light), plain * (100.0 + seen_at), slack=1e-3)


def test_a_normalised_profile_keeps_the_power():
    profile = IesProfile.parse(ies([0, 45, 90], [0], [[30, 20, 0]]))
    light, plain = lamp(60.0, Shaping(iesProfile=profile, iesNormalize=True))
    assert_illuminance(floor(light), plain * 20.0 * (2 / 3) / profile.power(), slack=1e-3)
    light, _ = lamp(120.0, Shaping(iesProfile=profile))
    assert illuminance(floor(light))[0].max() == 0
