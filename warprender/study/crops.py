"""Crops and error maps of a report, as PNG bytes."""

from __future__ import annotations

import io

import numpy as np

from ..images import display_bytes

#: Colours of error maps, by matplotlib's name.
MAP_COLORS = "magma"


def shown(color: np.ndarray) -> bytes:
    """A linear picture (H, W, 3) as usdrecord would write it."""
    return _png(display_bytes(color))


def error_map(color: np.ndarray, reference: np.ndarray) -> bytes:
    """Difference over (reference + a tenth of its mean), averaged over channels: black 0, white 1 and beyond."""
    from matplotlib import colormaps

    gap = np.abs(color - reference).mean(-1) / (reference.mean(-1) + 0.1 * max(reference.mean(), 1e-30))
    return _png((colormaps[MAP_COLORS](np.clip(gap, 0.0, 1.0))[..., :3] * 255).astype(np.uint8))


def worst_corner(color: np.ndarray, reference: np.ndarray, size: int = 32) -> tuple[slice, slice]:
    """Rows and columns of the square crop in which two pictures differ most."""
    gap = ((color - reference) ** 2).mean(-1)
    height, width = gap.shape
    size = min(size, height, width)
    sums = np.pad(gap, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    inside = sums[size:, size:] - sums[:-size, size:] - sums[size:, :-size] + sums[:-size, :-size]
    y, x = np.unravel_index(inside.argmax(), inside.shape)
    return slice(y, y + size), slice(x, x + size)


def _png(pixels: np.ndarray) -> bytes:
    """8-bit pixels as they are."""
    from matplotlib.image import imsave

    file = io.BytesIO()
    imsave(file, pixels, format="png")
    return file.getvalue()
