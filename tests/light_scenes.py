"""A patch of floor under lights, measured: what closed forms of illuminance are compared with."""

import numpy as np
from chance import SIGMAS
from pictures import picture
from scenes import window

import warprender as wr

#: Radiance of a Lambert surface of this albedo under illuminance E is ALBEDO E / π.
ALBEDO = 0.5


def pose(position=(0.0, 0.0, 0.0), rotation=None, scale=1.0):
    """(4, 4) matrix for row vectors; rows of `rotation` are the world directions of the local axes."""
    matrix = np.eye(4)
    matrix[:3, :3] = (np.eye(3) if rotation is None else np.asarray(rotation)) * np.reshape(scale, (-1, 1))
    matrix[3, :3] = position
    return matrix


def floor(*lights, size=0.02):
    """A scene with a square of floor in the XY plane about the origin, that faces +Z, under these lights."""
    scene = wr.Scene()
    s = size / 2
    points = [(-s, -s, 0), (s, -s, 0), (s, s, 0), (-s, s, 0)]
    scene.add_mesh("/floor", points, [[0, 1, 2, 3]], color=(ALBEDO,) * 3)
    for number, light in enumerate(lights):
        scene.add_light(light, path=f"/light{number}")
    return scene


def illuminance(scene, samples=256, size=8, at=(0.0, 0.0), **options):
    """Illuminance (3,) of the floor about a place of it, and its standard error (3,)."""
    view = window(0.002, (*at, 0.01), (*at, 0.0))
    options = {"bounces": 0, "camera_light": "off", **options}
    color, error = picture(scene, view, size, samples, **options)
    value = color[..., :3].mean((0, 1))
    return value * np.pi / ALBEDO, np.sqrt((error**2).sum((0, 1))) / size**2 * np.pi / ALBEDO


def assert_illuminance(scene, expected, within=0.02, slack=2e-5, **options):
    """The floor's illuminance is as expected, and known to `within`, a share of it.

    `slack` is what the closed form itself leaves out, the size of lamps that it takes for points above all.
    """
    mean, error = illuminance(scene, **options)
    expected = np.broadcast_to(np.asarray(expected, float), 3)
    assert (np.abs(mean - expected) <= SIGMAS * error + slack * np.abs(expected)).all(), (mean, expected, error)
    assert (SIGMAS * error <= within * expected.max() + 1e-9).all(), ("too noisy", mean, error)
