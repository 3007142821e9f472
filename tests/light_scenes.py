"""A patch of floor under lights, measured: what closed forms of illuminance are compared with."""

import numpy as np

import warprender as wr

#: Radiance of a Lambert surface of this albedo under illuminance E is ALBEDO E / π.
ALBEDO = 0.5


def pose(position=(0.0, 0.0, 0.0), rotation=np.eye(3), scale=1.0):
    """(4, 4) matrix for row vectors; rows of `rotation` are the world directions of the local axes."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.asarray(rotation) * np.reshape(scale, (-1, 1))
    matrix[3, :3] = position
    return matrix


def facing(direction):
    """Rotation whose local -Z points along `direction`."""
    back = -np.asarray(direction, float) / np.linalg.norm(direction)
    right = np.cross(np.eye(3)[np.argmin(np.abs(back))], back)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back])


def floor(size=0.02, albedo=ALBEDO):
    """A scene with a square of floor in the XY plane about the origin, that faces +Z."""
    scene = wr.Scene()
    s = size / 2
    points = [(-s, -s, 0), (s, -s, 0), (s, s, 0), (-s, s, 0)]
    scene.add_mesh("/floor", points, [[0, 1, 2, 3]], color=(albedo,) * 3)
    return scene


def window(size=0.01, eye=(0.0, 0.0, 1e-2)):
    """An orthographic camera that looks down at a square of this size about the origin."""
    return wr.Camera(
        projection="orthographic",
        horizontalAperture=10 * size,
        verticalAperture=10 * size,
        clippingRange=(1e-4, 1e6),
        transform=pose(eye),
    )


def illuminance(scene, samples=256, resolution=(16, 16), albedo=ALBEDO, camera=None, **options):
    """Illuminance (3,) of the floor in the window, and its standard error (3,)."""
    options = {"bounces": 0, "camera_light": "off", **options}
    renderer = wr.Renderer(scene, camera=camera or window(), resolution=resolution, **options)
    frame = renderer.render(samples=samples)
    assert frame.stats["dropped samples"] == 0
    color = frame.color.numpy()[..., :3].astype(np.float64)
    error = np.sqrt(np.mean(renderer._film.standard_error() ** 2, (0, 1)) / color[..., 0].size)
    return color.mean((0, 1)) * np.pi / albedo, error * np.pi / albedo


def assert_illuminance(scene, expected, within=0.003, **options):
    """The floor's illuminance is as expected, to four standard errors and at most this relative error."""
    mean, error = illuminance(scene, **options)
    expected = np.broadcast_to(np.asarray(expected, float), 3)
    assert (np.abs(mean - expected) <= 4 * error + 1e-5 * np.abs(expected)).all(), (mean, expected, error)
    assert (4 * error <= within * expected.max() + 1e-12).all(), ("too noisy", mean, error)
