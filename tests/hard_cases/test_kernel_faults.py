"""Case M7: sizes that users set, at 0 and beyond what there is. A fault in a kernel would end the process."""

import subprocess
import sys

import numpy as np
import pytest
import scenes
from pictures import picture, prepare

import warprender as wr
from warprender.lights import LightTexture

EMPTY = np.zeros((0, 3), np.float32)
TRIANGLE = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], np.float32), [[0, 1, 2]]


def ball():
    scene = wr.Scene()
    scene.add_sphere("/ball")
    return scene


def render_nothing():
    color, _ = picture(wr.Scene(), scenes.camera((0, 0, 4)), 4, samples=1)
    assert not color.any()


def render_an_empty_mesh():
    scene = ball()
    scene.add_mesh("/empty", EMPTY, [])
    picture(scene, scenes.camera((0, 0, 4)), 4, samples=1)


def render_no_copies():
    scene = ball()
    scene.add_instances("/copies", "/ball", np.zeros((0, 7)))
    picture(scene, scenes.camera((0, 0, 4)), 4, samples=1)


def render_points_in_one_place():
    scene = wr.Scene()
    scene.add_mesh("/spot", np.zeros((3, 3)), [[0, 1, 2]])
    color, _ = picture(scene, scenes.camera((0, 0, 4)), 4, samples=1)
    assert not color.any()


def render_a_texture_of_one_texel():
    scene = ball()
    scene.add_light(wr.DomeLight(texture=LightTexture.of(np.ones((1, 1, 3), np.float32))))
    color, _ = picture(scene, scenes.camera((0, 0, 4)), 4, samples=1)
    assert np.isfinite(color).all()


def render_one_pixel():
    color, _ = picture(ball(), scenes.camera((0, 0, 4)), 1, samples=1)
    assert color.shape == (1, 1, 4)


def cast_no_rays():
    assert len(wr.RayCaster(*TRIANGLE).closest(EMPTY, EMPTY).t) == 0
    assert len(wr.RayCaster(*TRIANGLE, accuracy="fast").closest(EMPTY, EMPTY).t) == 0


def cast_at_nothing():
    for accuracy in ("watertight", "fast"):
        hits = wr.RayCaster(EMPTY, np.zeros((0, 3), np.int32), accuracy=accuracy).closest(
            np.zeros((2, 3)), np.ones((2, 3))
        )
        assert (hits.face.numpy() == -1).all()


def rasterize_nothing():
    seen = wr.rasterize(np.zeros((0, 4), np.float32), np.zeros((0, 3), np.int32), 3, 2)
    assert (seen.face.numpy() == -1).all()


#: What draws, and what is refused in one line.
DRAWN = [
    render_nothing, render_an_empty_mesh, render_no_copies, render_points_in_one_place, render_a_texture_of_one_texel,
    render_one_pixel, cast_no_rays, cast_at_nothing, rasterize_nothing,
]  # fmt: skip
REFUSED = {
    "M7 no pixels": lambda: wr.Renderer(ball(), None, (0, 4)),
    "M7 no rows": lambda: wr.Renderer(ball(), None, (4, -1)),
    "M7 no samples": lambda: prepare(ball(), scenes.camera((0, 0, 4)), 4).render(samples=0),
    "M7 no threads": lambda: wr.Renderer(ball(), None, (4, 4), threads=0),
    "M7 an index too high": lambda: ball().add_mesh("/m", TRIANGLE[0], [[0, 1, 3]]),
    "M7 an index below 0": lambda: ball().add_mesh("/m", TRIANGLE[0], [[0, 1, -1]]),
    "M7 a face index of rays too high": lambda: wr.RayCaster(TRIANGLE[0], [[0, 1, 2**31 - 1]]),
    "M7 a face index to rasterize too high": lambda: wr.rasterize(np.zeros((3, 4), np.float32), [[0, 1, 3]], 4, 4),
    "M7 no picture to rasterize": lambda: wr.rasterize(np.zeros((3, 4), np.float32), [[0, 1, 2]], 0, 4),
    "M7 no texels": lambda: LightTexture.of(np.zeros((0, 0, 3), np.float32)),
    "M7 no cells": lambda: wr.measure_brdf(wr.PreviewSurface(), cells=(0, 1, 1)),
    "M7 a sensor without pixels": lambda: wr.CameraSensor(ball(), width=0, height=4, fov=60.0),
}


def test_m7_nothing_to_draw_ends_no_process():
    """In a process of its own, which a fault in a kernel would end."""
    code = "import sys; sys.path[:0] = %r; import test_kernel_faults as m; [draw() for draw in m.DRAWN]"
    done = subprocess.run([sys.executable, "-c", code % sys.path], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]


@pytest.mark.parametrize("name", REFUSED)
def test_m7_sizes_are_checked_before_kernels(name):
    with pytest.raises(ValueError) as refused:
        REFUSED[name]()
    assert "\n" not in str(refused.value)
