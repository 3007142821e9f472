"""Meshes of the benchmarks: balls with seeded bumps."""

import numpy as np


def cube_sphere(n):
    """Unit sphere of 6 n x n quads: directions and triangles."""
    i = np.arange(n + 1)
    a, b = (g.ravel() for g in np.meshgrid(i, i, indexing="ij"))
    q = (i[:-1, None] * (n + 1) + i[None, :-1]).ravel()
    two = np.concatenate([np.stack([q, q + n + 1, q + n + 2], 1), np.stack([q, q + n + 2, q + 1], 1)])
    points, faces = [], []
    for axis in range(3):
        for side in (0, n):
            p = np.empty((a.size, 3), np.int64)
            p[:, axis], p[:, (axis + 1) % 3], p[:, (axis + 2) % 3] = side, a, b
            faces.append((two if side else two[:, ::-1]) + len(points) * a.size)
            points.append(p)
    unique, inverse = np.unique(np.concatenate(points), axis=0, return_inverse=True)
    x = np.tan((unique / n * 2 - 1) * (np.pi / 4))
    return x / np.linalg.norm(x, axis=1, keepdims=True), inverse.ravel()[np.concatenate(faces)]


def bumpy(n, radius, amplitude, seed):
    """A ball whose radius is a sum of seeded waves."""
    d, faces = cube_sphere(n)
    rng = np.random.default_rng(seed)
    height = np.zeros(len(d))
    for octave in range(5):
        for _ in range(6):
            k = rng.normal(size=3)
            k *= 3.0 * 2.0**octave / np.linalg.norm(k)
            height += 0.5**octave / 6 * np.sin(d @ k + rng.uniform(0, 2 * np.pi))
    return d * (radius * (1 + amplitude * height))[:, None], faces
