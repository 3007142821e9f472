"""Perlin's gradient noise as MaterialX and OSL define it, to the bit of its hash (Bob Jenkins' lookup3)."""

from __future__ import annotations

import numpy as np

#: What brings the gradients of two dimensions to about −1 … 1.
_SCALE = 0.6616


def perlin_noise_2d(st: np.ndarray, width: int = 1) -> np.ndarray:
    """(P, width) noise at coordinates (P, 2); width 1 to 3 takes other bits of the hash for each component."""
    cell = np.floor(st).astype(np.int64)
    x, y = (st - cell).T
    u, v = _fade(x), _fade(y)
    corners = [[_gradient(_hash(cell[:, 0] + i, cell[:, 1] + j), x - i, y - j, width) for i in (0, 1)] for j in (0, 1)]
    low = corners[0][0] + (corners[0][1] - corners[0][0]) * u[:, None]
    high = corners[1][0] + (corners[1][1] - corners[1][0]) * u[:, None]
    return _SCALE * (low + (high - low) * v[:, None])


def _fade(t: np.ndarray) -> np.ndarray:
    return t * t * t * (t * (t * 6.0 - 15.0) + 10.0)


def _gradient(bits: np.ndarray, x: np.ndarray, y: np.ndarray, width: int) -> np.ndarray:
    """(P, width) products of the offset and one of the eight gradients (±1, ±2), (±2, ±1)."""
    parts = []
    for component in range(width):
        h = (bits >> np.uint32(8 * component)) & np.uint32(7)
        u = np.where(h < 4, x, y)
        v = 2.0 * np.where(h < 4, y, x)
        parts.append(np.where(h & np.uint32(1), -u, u) + np.where(h & np.uint32(2), -v, v))
    return np.stack(parts, 1)


def _hash(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """32 bits for each cell; arithmetic is modulo 2³²."""
    start = np.uint32(0xDEADBEEF + (2 << 2) + 13)
    c = np.full(x.shape, start)
    a = start + x.astype(np.uint32)
    b = start + y.astype(np.uint32)
    c = (c ^ b) - _turned(b, 14)
    a = (a ^ c) - _turned(c, 11)
    b = (b ^ a) - _turned(a, 25)
    c = (c ^ b) - _turned(b, 16)
    a = (a ^ c) - _turned(c, 4)
    b = (b ^ a) - _turned(a, 14)
    return (c ^ b) - _turned(b, 24)


def _turned(x: np.ndarray, k: int) -> np.ndarray:
    return (x << np.uint32(k)) | (x >> np.uint32(32 - k))
