"""luxtest (Anders Langlands): each attribute moves the picture as its description says, in ratios between frames.

The lamps turn above a white floor and a small tilted mirror of it; the mean of the floor under the light is measured.
"""

import json
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from pictures import outputs, picture

import warprender as wr
from warprender.color import LUMINANCE, blackbody_tint

LUXTEST = Path(__file__).parents[2] / "shared" / "usd_assets" / "luxtest"
pytestmark = pytest.mark.skipif(not LUXTEST.exists(), reason="../shared/usd_assets/luxtest is not there")

AREA_LIGHTS = ("sphere", "disk", "rect", "cylinder")


@cache
def descriptions():
    """What each file varies."""
    return json.loads((LUXTEST / "light_descriptions.json").read_text())


@cache
def frame(name, time, samples=64):
    """(24, 24, 3) radiance of a frame's direct light, its scene, and the standard error of the mean (3,)."""
    scene = wr.load(str(LUXTEST / "usd" / f"{name}.usda"), time=time)
    color, error = picture(scene, None, 24, samples, bounces=0)
    return color[..., :3], scene, np.sqrt((error**2).sum((0, 1))) / error[..., 0].size


def mean(name, time):
    return frame(name, time)[0].mean((0, 1))


def light(name, time):
    (found,) = frame(name, time)[1].lights.values()
    return found


def all_groups(name):
    """What each group of frames varies, and what it holds fast."""
    for group in descriptions()[name]["frame_groups"]:
        yield group["varying"], group["non_default_constants"]


def groups(name, attribute):
    """Frame to value, of the groups that vary an attribute."""
    for group in descriptions()[name]["frame_groups"]:
        if f"inputs:{attribute}" in group["varying"]:
            values = group["varying"][f"inputs:{attribute}"]
            yield {int(time): value for time, value in values.items()}, group["non_default_constants"]


@pytest.mark.parametrize("name", [*AREA_LIGHTS, "distant"])
def test_colour_temperature_tints_by_the_black_body(name):
    for values, _ in groups(name, "colorTemperature"):
        times = sorted(values)
        reference = mean(name, times[2])
        for time in times:
            tint = blackbody_tint(values[time]) / blackbody_tint(values[times[2]])
            np.testing.assert_allclose(mean(name, time), reference * tint, rtol=1e-3)
            assert abs(blackbody_tint(values[time]) @ LUMINANCE - 1) < 0.02


@pytest.mark.parametrize(
    ("name", "attribute"), [(n, "radius") for n in ("sphere", "disk", "cylinder")] + [("rect", "width")]
)
def test_size_without_and_with_normalize(name, attribute):
    plain, normalised = (v for v, constants in groups(name, attribute) if "inputs:shaping:cone:angle" not in constants)
    times = sorted(plain)
    for first, second in pairwise(times):
        # A cylinder of twice the radius is twice as wide.
        power = 2 if name in ("sphere", "disk") else 1
        ratio = (plain[second] / plain[first]) ** power
        # The floor is near: what is seen of a light grows a little less than its area.
        measured = mean(name, second)[0] / mean(name, first)[0]
        assert 0.8 * ratio < measured < 1.1 * ratio
    times = sorted(normalised)
    for time in times[1:]:
        assert 0.7 < mean(name, time)[0] / mean(name, times[0])[0] < 1.1


@pytest.mark.parametrize("name", ["sphere", "disk", "rect", "cylinder"])
def test_cone_angle_takes_light_and_leaves_the_middle(name):
    for values, _ in groups(name, "shaping:cone:angle"):
        times = sorted(values, key=values.get)
        totals = [mean(name, time)[0] for time in times]
        assert (np.diff(totals) >= -0.02 * max(totals)).all() and totals[0] < 0.9 * totals[-1]


@pytest.mark.parametrize("name", ["sphere", "disk", "rect", "cylinder"])
def test_softness_only_takes_light(name):
    for values, _ in groups(name, "shaping:cone:softness"):
        times = sorted(values, key=values.get)
        pictures = [frame(name, time, 256)[0][..., 0] for time in times]
        for sharper, softer in pairwise(pictures):
            assert softer.mean() < sharper.mean()


@pytest.mark.parametrize("name", ["sphere", "disk", "rect", "cylinder"])
def test_focus_only_takes_light_where_its_tint_is_black(name):
    for values, constants in groups(name, "shaping:focus"):
        times = sorted(values, key=values.get)
        reference = mean(name, times[0])
        black = constants.get("inputs:shaping:focusTint", [0, 0, 0])
        for time in times[1:]:
            share = mean(name, time) / reference
            for channel in range(3):
                expected = share[channel] < 0.99 if black[channel] == 0 else abs(share[channel] - 1) < 0.02
                assert expected, (time, share)


@pytest.mark.parametrize("name", ["sphere", "disk", "rect", "cylinder"])
def test_focus_tint_is_linear(name):
    for values, _ in groups(name, "shaping:focusTint"):
        times = sorted(values)
        black = mean(name, next(t for t in times if values[t] == [0, 0, 0]))
        white = mean(name, next(t for t in times if values[t] == [1, 1, 1]))
        for time in times:
            expected = black + (white - black) * np.array(values[time])
            np.testing.assert_allclose(mean(name, time), expected, rtol=0.02)


def test_normalised_distant_lights_keep_their_illuminance():
    for values, constants in groups("distant", "angle"):
        times = [time for time in sorted(values) if 0 < values[time] < 90]
        if constants.get("inputs:normalize") and len(times) > 1:
            first = mean("distant", times[0])[0]
            for time in times[1:]:
                assert mean("distant", time)[0] == pytest.approx(first, rel=0.03)


def floor_under(time):
    """Where the floor is seen, and what it reflects of the distant light there."""
    color, scene, _ = frame("distant", time)
    normal = outputs(scene, None, ("normal",), 24)["normal"]
    return normal[..., 1] > 0.999, color[..., 0]


def test_distant_lights_go_by_the_cosine():
    ((poses, _),) = (g for g in all_groups("distant") if "xformOp:transform" in g[0])
    seen, first = floor_under(1)
    for time, matrix in poses["xformOp:transform"].items():
        # Light travels along -Z; what is away from edges and shadows is most of the floor. Its black specular lobe
        # still reflects at grazing angles (Schlick), which takes 2 % of the diffuse light at 60 degrees.
        share = np.median(floor_under(int(time))[1][seen] / first[seen])
        if matrix[2][1] >= 0.4:
            assert share == pytest.approx(matrix[2][1], rel=0.03)


def test_distant_lights_of_an_angle_shine_by_its_sine_squared():
    plain, normalised = (values for values, _ in groups("distant", "angle"))
    for values, power in ((plain, 2), (normalised, 0)):
        times = [time for time in sorted(values) if 0 < values[time] <= 100]
        seen, first = floor_under(times[0])
        cosine = light("distant", times[0]).transform[2, 1]
        for time in times[1:]:
            half = np.radians(values[time]) / 2
            if np.sin(half) < cosine:
                share = np.median(floor_under(time)[1][seen] / first[seen])
                expected = (np.sin(half) / np.sin(np.radians(values[times[0]]) / 2)) ** power
                assert share == pytest.approx(expected, rel=0.05), (time, values[time])


@pytest.mark.parametrize(("uniform", "other"), [(11, 1), (13, 3), (18, 8), (20, 10), (31, 36)])
def test_profiles_of_other_steps_shine_alike(uniform, other):
    # Two files of the same stripes; scales of 0, 4e-16 and -7e-16 are the same.
    def bottom(time):
        scene = wr.load(str(LUXTEST / "usd" / "iesTest.usda"), time=time)
        return picture(scene, "/cameras/iesBottom", 32, 16, bounces=0)[0][..., 0]

    first, second = bottom(uniform), bottom(other)
    assert first.max() > 0
    np.testing.assert_allclose(second.mean(), first.mean(), rtol=0.01)


@pytest.mark.parametrize("name", AREA_LIGHTS)
def test_a_normalised_profile_divides_by_its_power(name):
    plain, normalised = (
        (v, c) for v, c in groups(name, "shaping:ies:angleScale") if "omni002" in c["inputs:shaping:ies:file"]
    )
    for time, scale in plain[0].items():
        twin = next(t for t, s in normalised[0].items() if s == scale)
        power = light(name, time).shaping.iesProfile.power()
        assert light(name, twin).shaping.iesNormalize
        ratio = light(name, twin).radiance()[0] / light(name, time).radiance()[0]
        np.testing.assert_allclose(mean(name, twin), mean(name, time) * ratio, rtol=0.02)
        intensity = {t: light(name, t).intensity * 2.0 ** light(name, t).exposure for t in (time, twin)}
        np.testing.assert_allclose(ratio, intensity[twin] / intensity[time] / power)
