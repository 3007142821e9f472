"""`assert_images_agree`: how often it is wrong, and what it finds."""

import math

import numpy as np
import pytest
import scenes
from pictures import prepare

import warprender as wr
from warprender.testing import assert_images_agree

OUTPUTS = ("color", "standardError", "sampleCount")
SHAPE = (24, 32, 3)


def noisy(rng, truth=0.5, error=0.01):
    return truth + error * rng.standard_normal(SHAPE)


def test_false_alarms_are_as_rare_as_stated():
    rng, stated, trials = np.random.default_rng(3), 0.2, 300
    alarms = 0
    for _ in range(trials):
        try:
            assert_images_agree(noisy(rng), noisy(rng, error=0.02), a_error=0.01, b_error=0.02, false_alarms=stated)
        except AssertionError:
            alarms += 1
    # Four standard deviations above the stated rate; and no less than a third of it, or power is given away.
    assert stated / 3 < alarms / trials < stated + 4 * math.sqrt(stated * (1 - stated) / trials)


def damage(kind):
    change = np.zeros(SHAPE)
    if kind == "pixel":
        change[7, 9, 1] = 0.01 * 8
    elif kind == "block":
        change[8:16, 16:24, 2] = 0.01
    elif kind == "mean":
        change += 0.01 * 0.3
    elif kind == "one standard error apart":
        change += 0.02 * (np.indices(SHAPE[:2]).sum(0) % 2 * 2 - 1)[..., None]
    return change


@pytest.mark.parametrize("kind", ["pixel", "block", "mean", "one standard error apart"])
def test_each_kind_of_difference_is_found(kind):
    rng = np.random.default_rng(5)
    a, b = noisy(rng), np.full(SHAPE, 0.5)
    assert_images_agree(a, b, a_error=0.01)
    with pytest.raises(AssertionError, match=kind) as found:
        assert_images_agree(a + damage(kind), b, a_error=0.01)
    if kind == "pixel":
        assert "(x=9, y=7), G" in str(found.value) and "so are 1 of 768 pixels" in str(found.value)
    if kind == "block":
        assert "block x=16…23, y=8…15, B" in str(found.value)


def test_few_samples_are_given_the_tails_of_students_t():
    # The mean of four normal numbers over its own estimated error has the tails of t with 3 degrees of freedom.
    rng = np.random.default_rng(11)
    alarms = {4: 0, None: 0}
    for _ in range(100):
        draws = 0.5 + 0.1 * rng.standard_normal((4, *SHAPE))
        a, error = draws.mean(0), draws.std(0, ddof=1) / 2
        for samples in alarms:
            try:
                assert_images_agree(a, np.full(SHAPE, 0.5), a_error=error, a_samples=samples, false_alarms=0.05)
            except AssertionError:
                alarms[samples] += 1
    # Stated: 5 of 100; more than 13 happen once in a thousand times.
    assert alarms[4] <= 13 < alarms[None]


def test_numbers_that_are_not_finite_never_agree():
    a = noisy(np.random.default_rng(0))
    a[3, 4, 0] = np.nan
    with pytest.raises(AssertionError, match=r"a is not finite in 1 pixels, the first \(x=4, y=3\)"):
        assert_images_agree(a, np.full(SHAPE, 0.5), a_error=0.01)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.zeros((4, 4, 3)), np.zeros((4, 5, 3))), "sizes"),
        ((np.zeros((4, 4, 3)), np.zeros((4, 4, 3))), "neither picture"),
        ((np.zeros((4, 4)), np.zeros((4, 4))), "no picture"),
    ],
)
def test_what_cannot_be_compared_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        assert_images_agree(*arguments)


def test_a_frame_without_its_error_is_refused():
    scene, view = lit_ball()
    frame = prepare(scene, view, 8).render(samples=2)
    with pytest.raises(ValueError, match="standardError"):
        assert_images_agree(frame, frame)


def lit_ball(intensity=1.0):
    scene = wr.Scene()
    scene.add_sphere("/ball", color=(0.8, 0.5, 0.2))
    scene.add_light(wr.DomeLight(intensity=0.2))
    scene.add_light(wr.RectLight(intensity=5.0 * intensity), pose=scenes.look_at((2, 2, 2)))
    return scene, scenes.camera((0, 0, 4))


def test_renders_agree_with_themselves_alone():
    settings = ((1, "independent", 0), (1, "independent", 1), (1, "sobol", 2), (1.04, "sobol", 3))
    frames = [
        prepare(*lit_ball(intensity), 32, outputs=OUTPUTS, sampler=sampler).render(samples=256, seed=seed)
        for intensity, sampler, seed in settings
    ]
    wr.testing.assert_images_agree(frames[0], frames[1])
    wr.testing.assert_images_agree(frames[0], frames[2])
    with pytest.raises(AssertionError, match="mean of R"):
        wr.testing.assert_images_agree(frames[0], frames[3])


def test_alpha_is_tested_by_its_bound():
    scene, view = lit_ball()
    frame = prepare(scene, view, 32, outputs=OUTPUTS).render(samples=64)
    color = frame.numpy("color").astype(float)
    error = frame.numpy("standardError")
    other = prepare(scene, view, 32, outputs=OUTPUTS).render(samples=64, seed=1)
    assert_images_agree(other, color, b_error=error, b_samples=64)
    shifted = color.copy()
    rim = np.argwhere((color[..., 3] > 0.3) & (color[..., 3] < 0.7))[0]
    shifted[(*rim, 3)] = 0.0 if color[(*rim, 3)] > 0.5 else 1.0
    with pytest.raises(AssertionError, match="alpha"):
        assert_images_agree(other, shifted, b_error=error, b_samples=64)


def test_what_the_samples_tell_of_themselves():
    scene, view = lit_ball()
    renderer = prepare(scene, view, 16, outputs=("standardError", "rayCount", "sampleCount", "cameraDepth"))
    frame = renderer.render(samples=8)
    assert list(frame.outputs) == ["standardError", "rayCount", "sampleCount", "cameraDepth"]
    assert (frame.numpy("sampleCount") == 8).all()
    assert frame.numpy("rayCount").sum() == sum(frame.stats["rays"].values())
    assert (frame.numpy("rayCount") >= 8).all()
    np.testing.assert_allclose(frame.numpy("standardError"), renderer.standard_error(), rtol=1e-6)
    assert np.isinf(renderer.render(samples=1).numpy("standardError")).all()


def test_transport_none_gives_nothing_of_samples():
    with pytest.raises(wr.SceneError, match="gives no rayCount"):
        wr.Renderer(*lit_ball(), (4, 4), outputs=("rayCount",), transport="none")
