"""Small scenes built in Python, and the shapes that they are made of."""

import numpy as np

import warprender as wr

WHITE = (1.0, 1.0, 1.0)


def icosphere(subdivisions=2):
    """Points (N, 3) on the unit sphere and triangles (T, 3), counter-clockwise from outside."""
    g = (1 + 5**0.5) / 2
    points = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g)]
    points += [(0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]
    faces = "0b5 051 017 07a 0ab 159 5b4 ba2 a76 718 394 342 326 368 389 495 24b 62a 867 981"
    faces = np.array([[int(c, 16) for c in face] for face in faces.split()])
    points = np.array(points, float)
    for _ in range(subdivisions):
        a, b, c = faces.T
        edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        unique, number = np.unique(edges, axis=0, return_inverse=True)
        ab, bc, ca = len(points) + number.reshape(3, -1)
        points = np.concatenate([points, points[unique].mean(1)])
        faces = np.concatenate([np.stack(f, 1) for f in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return points / np.linalg.norm(points, axis=1, keepdims=True), faces


def quad(size=1.0, height=0.0):
    """Points and faces of a square in the XY plane at z = height, facing +Z."""
    s = size / 2
    return np.array([(-s, -s, height), (s, -s, height), (s, s, height), (-s, s, height)]), [[0, 1, 2, 3]]


def cube(size=2.0):
    """Points and quads of a cube about the origin, facing outwards."""
    points = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float) * size / 2
    return points, [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def look_at(eye, target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0)):
    """(4, 4) matrix for row vectors of a camera or light at `eye` whose -Z points at `target`."""
    eye, target = np.asarray(eye, float), np.asarray(target, float)
    back = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = right, np.cross(back, right), back
    matrix[3, :3] = eye
    return matrix


def camera(eye, target=(0.0, 0.0, 0.0), fov=40.0, up=(0.0, 1.0, 0.0), **fields):
    """A square camera with this field of view in degrees."""
    aperture = 2 * 50.0 * np.tan(np.radians(fov) / 2)
    fields = {"clippingRange": (1e-3, 1e6), **fields}
    return wr.Camera(
        horizontalAperture=aperture, verticalAperture=aperture, transform=look_at(eye, target, up), **fields
    )


def window(size, eye=(0.0, 0.0, 5.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), **fields):
    """An orthographic camera that sees a square of this size."""
    fields = {"clippingRange": (1e-3, 1e6), "projection": "orthographic", **fields}
    transform = look_at(eye, target, up)
    return wr.Camera(horizontalAperture=10 * size, verticalAperture=10 * size, transform=transform, **fields)
