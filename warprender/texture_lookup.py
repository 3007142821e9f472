"""Look-up of textures on the host, bilinear in the finest level: for what is settled before a picture is taken.

Displacement and baked node graphs read their textures here; what a picture sees is looked up on the device.
"""

from __future__ import annotations

import numpy as np

from .images import Picture
from .texels import decoded, is_srgb, rgba
from .textures import FIRST_TILE, TILES, WRAPS, Texture, as_picture

_WIDEST = np.int64(2**40)


def sampled(texture: Texture, st: np.ndarray) -> np.ndarray:
    """Results of a texture: texel, scale and bias, or the fallback where there is no picture.

    Args:
        texture: its `st` is not asked.
        st: (P, 2) coordinates before the texture's transform; what is not finite counts as 0.

    Returns:
        (P, 4) float64.

    Raises:
        ValueError: a file cannot be read.
    """
    place = np.asarray(st, np.float64) @ texture.transform[:, :2].T + texture.transform[:, 2]
    place = np.where(np.isfinite(place), place, 0.0)
    result = np.tile(np.resize(np.asarray(texture.fallback, np.float64), 4), (len(place), 1))
    scale, bias = np.resize(texture.scale, 4), np.resize(texture.bias, 4)
    tile = np.floor(place).clip(-1, TILES).astype(np.int64)
    number = np.where(((tile >= 0) & (tile < 10)).all(1), FIRST_TILE + tile @ (1, 10), -1)
    for source_number, source in texture.sources():
        here = np.full(len(place), True) if source_number == 0 else number == source_number
        if not here.any():
            continue
        local = place[here] if source_number == 0 else place[here] - tile[here]
        values = _bilinear(as_picture(source), texture, local)
        result[here] = values * scale + bias
    return result


def _bilinear(picture: Picture, texture: Texture, st: np.ndarray) -> np.ndarray:
    """(P, 4) float64 decoded texels between the four neighbours of each place (P, 2)."""
    texels = rgba(picture.pixels)[::-1]
    srgb = is_srgb(picture, texture.sourceColorSpace)
    height, width = texels.shape[:2]
    wraps = texture.wraps()
    x = st * (width, height) - 0.5
    low = np.floor(x).clip(-_WIDEST, _WIDEST)
    part = (x - low).clip(0.0, 1.0)
    total = np.zeros((len(st), 4))
    for right in (0, 1):
        for up in (0, 1):
            i, inside_s = _wrapped(low[:, 0].astype(np.int64) + right, width, WRAPS[wraps[0]])
            j, inside_t = _wrapped(low[:, 1].astype(np.int64) + up, height, WRAPS[wraps[1]])
            weight = np.abs(1 - right - part[:, 0]) * np.abs(1 - up - part[:, 1]) * (inside_s & inside_t)
            total += decoded(texels[j, i], srgb) * weight[:, None]
    return total


def _wrapped(index: np.ndarray, size: int, wrap: str) -> tuple[np.ndarray, np.ndarray]:
    """Texel numbers in range, and whether they are texels at all rather than a black border."""
    inside = (index >= 0) & (index < size)
    if wrap == "repeat":
        return index % size, np.full(len(index), True)
    if wrap == "mirror":
        folded = index % (2 * size)
        return np.where(folded < size, folded, 2 * size - 1 - folded), np.full(len(index), True)
    return index.clip(0, size - 1), inside if wrap == "black" else np.full(len(index), True)
