"""Directional albedos of the lobes, tabulated: what a white lobe reflects of the light from one direction.

They keep a sum of lobes from reflecting more than arrives, and say how much of it is left for what lies below.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import warp as wp

from .microfacet import SMALLEST_ALPHA, schlick_weight

#: Entries along √cosine and along the roughness (√alpha), both uniform from 0 to 1; grazing angles bend most.
SIZE = 32
_SAMPLES = 1024


@lru_cache(maxsize=1)
def albedo_table() -> np.ndarray:
    """(SIZE, SIZE, 4) float32 by cosine and roughness: GGX with F = 1, with F = (1 - cos)⁵, and Lambert with that.

    The fourth is the first one's mean over the cosine-weighted hemisphere, alike for all cosines.

    By 1024 points of the Hammersley set over the visible normals, so that no entry is noisier than 1e-3.
    """
    cosine = np.linspace(0, 1, SIZE) ** 2
    cosine[0] = 1e-4
    u = _hammersley(_SAMPLES)
    table = np.zeros((SIZE, SIZE, 4), np.float32)
    for j, alpha in enumerate(np.maximum(np.linspace(0, 1, SIZE), 0.01) ** 2):
        table[:, j, :2] = _ggx_albedos(cosine[:, None], alpha, u)
    table[..., 2] = _lambert_schlick(cosine, u)[:, None]
    # ∫ 2 cos E(cos) d cos by midpoints.
    middles = (np.arange(4096) + 0.5) / 4096
    for j in range(SIZE):
        table[:, j, 3] = (2 * middles * np.interp(np.sqrt(middles), np.linspace(0, 1, SIZE), table[:, j, 0])).mean()
    return table


def _ggx_albedos(z: np.ndarray, a: float, u: np.ndarray) -> np.ndarray:
    """(K, 2) for cosines z (K, 1): the GGX albedos of `albedo_table`."""
    wo = np.stack(np.broadcast_arrays(np.sqrt(1 - z * z), 0.0 * z, z))
    h = _visible_normals(wo, a, u)
    half_cos = np.clip((wo * h).sum(0), 0.0, 1.0)
    wi_z = 2 * half_cos * h[2] - wo[2]
    wi_length = np.sqrt(wi_z**2 + a * a * np.maximum(1 - wi_z**2, 0))
    wo_length = np.sqrt(z * z + a * a * (1 - z * z))
    # The weight of a sampled visible normal is G2 / G1.
    weight = np.where(wi_z > 0, wi_z * (z + wo_length) / np.maximum(z * wi_length + wi_z * wo_length, 1e-30), 0.0)
    return np.stack([weight.mean(-1), (weight * (1 - half_cos) ** 5).mean(-1)], -1)


def _hammersley(count: int) -> np.ndarray:
    """(2, count) points of the unit square."""
    index = np.arange(count, dtype=np.uint32)
    bits = np.zeros(count)
    for digit in range(count.bit_length() - 1):
        bits += ((index >> digit) & 1) / 2.0 ** (digit + 1)
    return np.stack([(index + 0.5) / count, bits])


def _visible_normals(wo: np.ndarray, alpha: float, u: np.ndarray) -> np.ndarray:
    """`sampling.ggx_visible_normal` on arrays, (3, …)."""
    stretched = np.stack([alpha * wo[0], alpha * wo[1], wo[2]])
    stretched = stretched / np.linalg.norm(stretched, axis=0)
    phi = 2 * np.pi * u[0]
    z = (1 - u[1]) * (1 + stretched[2]) - stretched[2]
    radius = np.sqrt(np.clip(1 - z * z, 0, 1))
    half = np.stack([radius * np.cos(phi), radius * np.sin(phi), z]) + stretched
    half = np.stack([alpha * half[0], alpha * half[1], np.maximum(half[2], 0)])
    return half / np.linalg.norm(half, axis=0)


def _lambert_schlick(cosine: np.ndarray, u: np.ndarray) -> np.ndarray:
    """∫ (1 - v·h)⁵ cos θ / π dω for each cosine of the viewer."""
    radius, phi = np.sqrt(u[0]), 2 * np.pi * u[1]
    wi = np.stack([radius * np.cos(phi), radius * np.sin(phi), np.sqrt(1 - u[0])])
    wo = np.stack([np.sqrt(1 - cosine**2), 0 * cosine, cosine])
    along = np.clip(np.einsum("ki,kj->ij", wo, wi), -1, 1)
    return ((1 - np.sqrt((1 + along) / 2)) ** 5).mean(-1)


@wp.func
def white_albedo(table: wp.array2d(dtype=wp.vec4), cosine: float, alpha: float) -> wp.vec4:
    """The table's albedos at a cosine and an alpha, bilinear; of a delta lobe the first two are exact."""
    x = wp.sqrt(wp.clamp(cosine, 0.0, 1.0)) * wp.float32(wp.static(SIZE - 1))
    y = wp.clamp(wp.sqrt(alpha), 0.0, 1.0) * wp.float32(wp.static(SIZE - 1))
    i = wp.min(wp.int32(x), wp.static(SIZE - 2))
    j = wp.min(wp.int32(y), wp.static(SIZE - 2))
    s = x - wp.float32(i)
    t = y - wp.float32(j)
    near = table[i, j] * (1.0 - t) + table[i, j + 1] * t
    far = table[i + 1, j] * (1.0 - t) + table[i + 1, j + 1] * t
    white = near * (1.0 - s) + far * s
    if alpha < SMALLEST_ALPHA:
        return wp.vec4(1.0, schlick_weight(cosine), white[2], 1.0)
    return white
