"""Closed meshes and rays that find their seams: every ray from inside must hit."""

import numpy as np


def icosphere(level):
    """Unit sphere, 20 * 4**level faces."""
    g = (1 + 5**0.5) / 2
    p = np.array([(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0)], float)
    p = np.concatenate([p, np.roll(p, 1, 1), np.roll(p, 2, 1)])
    d = np.linalg.norm(p[:, None] - p[None], axis=2)
    near = d < 2.1
    faces = [
        (a, b, c)
        for a in range(12)
        for b in range(a + 1, 12)
        for c in range(b + 1, 12)
        if near[a, b] and near[b, c] and near[a, c]
    ]
    f = np.array(faces)
    flip = np.einsum("ij,ij->i", np.cross(p[f[:, 1]] - p[f[:, 0]], p[f[:, 2]] - p[f[:, 0]]), p[f[:, 0]]) < 0
    f[flip] = f[flip][:, ::-1]
    for _ in range(level):
        p, f = _subdivide(p, f)
    return p / np.linalg.norm(p, axis=1, keepdims=True), f


def _subdivide(p, f):
    edges = np.sort(np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]]), axis=1)
    unique, inverse = np.unique(edges, axis=0, return_inverse=True)
    a, b, c = np.split(len(p) + inverse.ravel(), 3)
    middle = p[unique].mean(1)
    middle *= np.linalg.norm(p[0]) / np.linalg.norm(middle, axis=1, keepdims=True)
    f = np.concatenate([np.stack(t, 1) for t in ((f[:, 0], a, c), (f[:, 1], b, a), (f[:, 2], c, b), (a, b, c))])
    return np.concatenate([p, middle]), f


def grid_cube(n):
    """Cube [-1, 1]^3, n x n quads a side on a dyadic lattice: every leaf box is flat."""
    i = np.arange(n + 1)
    a, b = (g.ravel() for g in np.meshgrid(i, i, indexing="ij"))
    quad = (i[:-1, None] * (n + 1) + i[None, :-1]).ravel()
    two = np.concatenate([np.stack([quad, quad + n + 1, quad + n + 2], 1), np.stack([quad, quad + n + 2, quad + 1], 1)])
    points, faces = [], []
    for axis in range(3):
        for side in (0, n):
            p = np.empty((a.size, 3), np.int64)
            p[:, axis], p[:, (axis + 1) % 3], p[:, (axis + 2) % 3] = side, a, b
            faces.append((two if side else two[:, ::-1]) + len(points) * a.size)
            points.append(p)
    points, faces = np.concatenate(points), np.concatenate(faces)
    unique, inverse = np.unique(points, axis=0, return_inverse=True)
    return unique / n * 2.0 - 1.0, inverse.ravel()[faces]


def needles(n):
    """Cylinder of radius and half height 1: n needles, and n slivers to one vertex at either end."""
    angle = 2 * np.pi * np.arange(n) / n
    ring = np.stack([np.cos(angle), np.sin(angle)], 1)
    low, high = (np.column_stack([ring, np.full(n, z)]) for z in (-1.0, 1.0))
    p = np.concatenate([low, high, [[0, 0, -1], [0, 0, 1]]])
    i = np.arange(n)
    j = (i + 1) % n
    f = [(i, j, n + j), (i, n + j, n + i), (j, i, 0 * i + 2 * n), (n + i, n + j, 0 * i + 2 * n + 1)]
    return p, np.concatenate([np.stack(t, 1) for t in f])


SHAPES = {"icosphere": lambda: icosphere(5), "cube": lambda: grid_cube(64), "needles": lambda: needles(2000)}


def placed(shape, scale=1.0, shift=0.0):
    """Points (float32) and faces of one of SHAPES, scaled, then moved along (1, 1, 1)."""
    p, f = SHAPES[shape]()
    return (p * scale + shift).astype(np.float32), f.astype(np.int32)


def aimed_rays(points, faces, count, at, rng, scale=1.0, shift=0.0):
    """Rays from within ±0.3 of the middle at "edges", "vertices" or in "random" directions.

    Directions are normalised in float64, then rounded.
    """
    origin = (rng.uniform(-0.3, 0.3, (count, 3)) * scale + shift).astype(np.float32)
    p = points.astype(np.float64)
    if at == "vertices":
        target = p[rng.choice(np.unique(faces), count)]
    elif at == "edges":
        face, k = rng.integers(0, len(faces), count), rng.integers(0, 3, count)
        w = rng.random((count, 1))
        target = p[faces[face, k]] * (1 - w) + p[faces[face, (k + 1) % 3]] * w
    else:
        target = origin + rng.normal(size=(count, 3))
    direction = target - origin
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return origin, direction.astype(np.float32)


def brute_force(points, faces, origins, directions, t_max=np.inf):
    """Closest hits in float64, every ray against every face: t, face, u, v."""
    p = points.astype(np.float64)[faces]
    a, e1, e2 = p[:, 0], p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    out = np.full(len(origins), np.inf), np.full(len(origins), -1), *np.zeros((2, len(origins)))
    for i, (o, d) in enumerate(zip(origins.astype(np.float64), directions.astype(np.float64), strict=True)):
        with np.errstate(all="ignore"):
            q = np.cross(d, e2)
            inverse = 1.0 / np.einsum("ij,ij->i", e1, q)
            s = o - a
            u = np.einsum("ij,ij->i", s, q) * inverse
            r = np.cross(s, e1)
            v = (r @ d) * inverse
            t = np.einsum("ij,ij->i", e2, r) * inverse
            t[~((u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t < t_max))] = np.inf
        k = int(np.argmin(t))
        if np.isfinite(t[k]):
            for column, value in zip(out, (t[k], k, u[k], v[k]), strict=True):
                column[i] = value
    return out
