"""Reconstruction filters: how the samples of a pixel lie about its centre."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import warp as wp

from .nets import shuffled_net
from .sampling import REPLICATES

FILTERS = ("box", "triangle", "gaussian")

#: Straight pieces of the tables that turn uniform numbers into filter offsets; the tails of a Gaussian need many.
_TABLE = 2048
#: A replicate's net has 2 to this many points; further samples begin another.
_DIGITS = 10
#: Tells these numbers from others of the same seed.
_STREAM = 0x0FF5


def filter_table(name: str) -> np.ndarray:
    """Inverse distribution of a reconstruction filter along one axis: (2049,) float32 offsets in pixels.

    "box" is one pixel wide, a sensor's own average; "triangle" and "gaussian" (σ = 0.5) reach 1 and 1.5 pixels.
    """
    if name not in FILTERS:
        raise ValueError(f"filter {name!r} is not one of {', '.join(FILTERS)}")
    radius = {"box": 0.5, "triangle": 1.0, "gaussian": 1.5}[name]
    x = np.linspace(-radius, radius, 16 * _TABLE + 1)
    density = {
        "box": np.ones_like(x),
        "triangle": 1.0 - np.abs(x),
        "gaussian": np.exp(-2.0 * x * x) - np.exp(-2.0 * radius * radius),
    }[name]
    distribution = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2)])
    return np.interp(np.linspace(0, 1, _TABLE + 1), distribution / distribution[-1], x).astype(np.float32)


@wp.func
def filter_offset(table: wp.array(dtype=wp.float32), u: float) -> float:
    """Offset from the pixel's centre, distributed as the filter."""
    position = u * wp.float32(wp.static(_TABLE))
    cell = wp.min(wp.int32(position), wp.static(_TABLE - 1))
    a = table[cell]
    return a + (table[cell + 1] - a) * (position - wp.float32(cell))


def pixel_offset(table: np.ndarray, seed: int, sample: int) -> tuple[float, float]:
    """Offset in pixels from all pixels' centres of a rasterized sample, distributed as the filter with this table.

    `REPLICATES` independent sequences take turns, as for rays, each an Owen-scrambled (0, 2)-sequence: its first 2^k
    points have one in each of 2^k columns and rows of the pixel. The first sample is the centre.
    """
    replicates = int(REPLICATES)
    net, number = divmod(sample // replicates, 1 << _DIGITS)
    u = _net(seed & 0xFFFFFFFF, sample % replicates, net)[number]
    x, y = np.interp(u, np.linspace(0.0, 1.0, len(table)), table)
    return float(x), float(y)


@lru_cache(maxsize=32)
def _net(seed: int, replicate: int, net: int) -> np.ndarray:
    """Points of one net of a replicate in [0, 1)², (1024, 2); the very first is (0.5, 0.5)."""
    random = np.random.default_rng((seed, replicate, net, _STREAM))
    return shuffled_net(random, _DIGITS, centre_first=replicate == net == 0)
