"""When each sample of a frame is taken while the shutter is open."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from .nets import shuffled_net
from .sampling import REPLICATES

#: Different times in a frame, at most: further samples take the same ones in turn.
MOST_TIMES = 64

_EACH = MOST_TIMES // int(REPLICATES)
#: Tells these numbers from others of the same seed.
_STREAM = 0x5E77


def shutter_share(seed: int, sample: int) -> float:
    """How much of the time that the shutter is open has gone by at a sample of all pixels: from 0 to below 1.

    Each replicate has times of its own, so that how far their means lie apart tells the error of the times too: the
    first 2^k of a replicate's samples, up to 32, lie one in each of 2^k equal parts.
    """
    shares = _replicate(seed & 0xFFFFFFFF, sample % int(REPLICATES))
    return shares[sample // int(REPLICATES) % _EACH]


@lru_cache(maxsize=256)
def _replicate(seed: int, replicate: int) -> tuple[float, ...]:
    """The times of one replicate in the order of its samples."""
    random = np.random.default_rng((seed, replicate, _STREAM))
    return tuple(shuffled_net(random, _EACH.bit_length() - 1)[:, 0].tolist())
