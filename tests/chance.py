"""Statistical tests with a stated rate of false alarms, and float64 integrals to test against."""

import math

import numpy as np

#: |z| beyond it happens to a normal number once in 150 000 times; a test makes far fewer comparisons.
SIGMAS = 4.5


def z_of(values, expected, floor=1e-6):
    """How many standard errors the mean of `values` is off, with a floor for the rounding of float32."""
    values = np.asarray(values, np.float64)
    error = values.std(ddof=1) / np.sqrt(len(values))
    return (values.mean() - expected) / np.hypot(error, floor * abs(expected) + 1e-300)


def chi_square(observed, probabilities, total):
    """Probability of counts at least this far from those expected of `total` draws.

    Bins of fewer than five expected draws are pooled, and what `probabilities` leave of 1 is a bin of its own. The
    tail is Wilson and Hilferty's (1931), good to a few percent down to 1e-6.
    """
    observed, expected = np.ravel(observed).astype(float), np.ravel(probabilities) * total
    observed = np.append(observed, total - observed.sum())
    expected = np.append(expected, total - expected.sum())
    small = expected < 5
    pairs = [(observed[~small], expected[~small])]
    if expected[small].sum() >= 5:
        pairs.append((observed[small].sum()[None], expected[small].sum()[None]))
    o, e = (np.concatenate(part) for part in zip(*pairs, strict=True))
    statistic, freedom = ((o - e) ** 2 / e).sum(), len(o) - 1
    spread = 2 / (9 * freedom)
    z = ((statistic / freedom) ** (1 / 3) - (1 - spread)) / math.sqrt(spread)
    return 0.5 * math.erfc(z / math.sqrt(2))


def chi_square_of_directions(pdf, directions, total, bins=(16, 32), fine=16):
    """`chi_square` of unit directions (N, 3) of the upper hemisphere against their density per solid angle.

    `pdf` takes directions (M, 3); bins in θ and φ are integrated by `fine` × `fine` midpoints. What it leaves of 1 is
    what goes below the horizon, straight through or into a delta lobe.
    """
    theta = (np.arange(bins[0] * fine) + 0.5) / (bins[0] * fine) * np.pi / 2
    phi = (np.arange(bins[1] * fine) + 0.5) / (bins[1] * fine) * 2 * np.pi - np.pi
    sine, cosine = np.sin(theta)[:, None], np.cos(theta)[:, None]
    grid = np.stack(np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), cosine), -1)
    density = np.asarray(pdf(grid.reshape(-1, 3)), float).reshape(len(theta), len(phi)) * sine
    cells = density.reshape(bins[0], fine, bins[1], fine).mean((1, 3)) * (np.pi**2 / (bins[0] * bins[1]))
    azimuth = np.arctan2(directions[:, 1], directions[:, 0])
    polar = np.arctan2(np.hypot(directions[:, 0], directions[:, 1]), directions[:, 2])
    observed, _, _ = np.histogram2d(polar, azimuth, bins, [(0, np.pi / 2), (-np.pi, np.pi)])
    return chi_square(observed, cells, total)


def polygon_irradiance(point, normal, corners):
    """Irradiance at a point from a polygon of radiance 1, all of it above the horizon (Lambert 1760)."""
    v = np.asarray(corners, float) - point
    v = v / np.linalg.norm(v, axis=1, keepdims=True)
    w = np.roll(v, -1, axis=0)
    cross = np.cross(v, w)
    length = np.linalg.norm(cross, axis=1)
    angle = np.arctan2(length, (v * w).sum(1))
    return abs((angle * (cross @ normal) / np.maximum(length, 1e-300)).sum()) / 2


def solid_angle(point, corners):
    """Solid angle of a planar convex polygon, as a fan of triangles (Van Oosterom and Strackee 1983)."""
    v = np.asarray(corners, float) - point
    r = np.linalg.norm(v, axis=1)
    total = 0.0
    for i in range(1, len(v) - 1):
        a, b, c = 0, i, i + 1
        triple = np.dot(v[a], np.cross(v[b], v[c]))
        below = r[a] * r[b] * r[c] + v[a] @ v[b] * r[c] + v[a] @ v[c] * r[b] + v[b] @ v[c] * r[a]
        total += 2 * math.atan2(abs(triple), below)
    return total
