"""Meshes of the benchmarks: balls with seeded bumps."""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "hard_cases"))

from closed_meshes import grid_cube


def cube_sphere(n):
    """Unit sphere of 6 n x n quads: directions and triangles."""
    points, faces = grid_cube(n)
    x = np.tan(points * (np.pi / 4))
    return x / np.linalg.norm(x, axis=1, keepdims=True), faces


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
