"""What stops a render: samples, a time, an error; and what the error that it states is worth."""

import time

import numpy as np
import pytest
import scenes
from pictures import prepare

import warprender as wr
from warprender import renderer as renderer_module


def lit_cube():
    scene = wr.Scene()
    scene.add_mesh("/cube", *scenes.cube(1.5), color=(0.7, 0.6, 0.5))
    scene.add_light(wr.DomeLight(intensity=0.5))
    scene.add_light(wr.RectLight(intensity=8.0), pose=scenes.look_at((1, 2, 2)))
    return scene, scenes.camera((2, 1.5, 4), fov=25.0)


def test_part_of_a_sample_goes_to_the_first_pixels():
    renderer = prepare(*lit_cube(), 16, outputs=("color", "sampleCount"))
    frame = renderer.render(samples=3 + 40 / 256, seed=4)
    counts = frame.numpy("sampleCount").ravel()
    np.testing.assert_array_equal(counts, np.where(np.arange(256) < 40, 4, 3))
    assert frame.stats["samples"] == 3 + 40 / 256 == frame.receipt["samples"]
    four, three = (renderer.render(samples=n, seed=4).numpy("color").reshape(256, 4) for n in (4, 3))
    found = frame.numpy("color").reshape(256, 4)
    np.testing.assert_array_equal(found, np.where(np.arange(256)[:, None] < 40, four, three))


def test_the_pixels_that_a_time_limit_leaves_out_are_few_and_can_be_repeated(monkeypatch):
    # A clock on which a sample of a pixel takes 1/256 of a second: 3.4 s are 3 samples and 40 % of the pixels.
    now, pixels = [0.0], 256

    class Clock:
        perf_counter = staticmethod(lambda: now[0])

    renderer = prepare(*lit_cube(), 16, outputs=("color", "sampleCount"))
    take = renderer._pass

    def slow_pass(request, first, samples, count=None):
        take(request, first, samples, count)
        now[0] += samples * (pixels if count is None else count) / pixels

    monkeypatch.setattr(renderer, "_pass", slow_pass)
    monkeypatch.setattr(renderer_module, "time", Clock)
    frame = renderer.render(seconds=3.4)
    assert now[0] == pytest.approx(3.4, abs=1 / 256)
    assert frame.stats["samples"] == pytest.approx(3.4, abs=1 / 256)
    again = renderer.render(samples=frame.stats["samples"])
    np.testing.assert_array_equal(again.numpy("color"), frame.numpy("color"))


def test_a_time_limit_without_part_samples_on_a_quick_picture():
    renderer = prepare(*lit_cube(), 16)
    renderer.render(samples=1)
    begin = time.perf_counter()
    frame = renderer.render(seconds=0.3)
    # No test asserts on time but this lower bound: the limit was not left early.
    assert time.perf_counter() - begin > 0.29 and frame.stats["samples"] > 1
