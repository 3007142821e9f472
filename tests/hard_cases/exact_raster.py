"""Rasterization in rational arithmetic: the definition that the kernels are held to, one pixel at a time."""

from fractions import Fraction

import numpy as np


def determinant(a, b, c):
    return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])


def homogeneous(vertex):
    """(x, y, w) as rationals."""
    return [Fraction(float(vertex[c])) for c in (0, 1, 3)]


def is_left_or_top(a, b):
    """Whether the edge line a X + b Y + c, positive inside, bounds the triangle on its left or is a level top."""
    return a > 0 or (a == 0 and b < 0)


def weights(clip, column, row, width, height):
    """λ with Σ λ_k P_k = (X, Y, 1) of a covered centre, else None."""
    if not np.isfinite(clip).all():
        return None
    p = [homogeneous(v) for v in clip]
    full = determinant(*p)
    if full == 0:
        return None
    centre = [Fraction(2 * column + 1 - width, width), Fraction(height - 2 * row - 1, height), Fraction(1)]
    side = 1 if full > 0 else -1
    result = []
    for k in range(3):
        q, r = p[(k + 1) % 3], p[(k + 2) % 3]
        line = [q[1] * r[2] - q[2] * r[1], q[2] * r[0] - q[0] * r[2], q[0] * r[1] - q[1] * r[0]]
        e = side * sum(line[c] * centre[c] for c in range(3))
        if e < 0 or (e == 0 and not is_left_or_top(side * line[0], side * line[1])):
            return None
        result.append(e * side / full)
    z = sum(l * Fraction(float(v[2])) for l, v in zip(result, clip, strict=True))
    return result if -1 <= z <= 1 else None


def rasterize(clip, faces, width, height):
    """Face (H, W) int, depth and u, v (H, W) float64; depth ties as float32 go to the smaller face."""
    seen = np.full((height, width), -1)
    depth, u, v = np.ones((height, width)), np.zeros((height, width)), np.zeros((height, width))
    for row in range(height):
        for column in range(width):
            for face, corners in enumerate(faces):
                found = weights(clip[corners], column, row, width, height)
                if found is None:
                    continue
                z = np.float32(float(sum(l * Fraction(float(x)) for l, x in zip(found, clip[corners, 2], strict=True))))
                if seen[row, column] < 0 or z < depth[row, column]:
                    total = sum(found)
                    seen[row, column], depth[row, column] = face, z
                    u[row, column], v[row, column] = float(found[1] / total), float(found[2] / total)
    return seen, depth, u, v
