"""How many samples each pixel gets, decided by a pilot pass so that the picture stays unbiased.

A pixel that looks at its own samples to decide whether it wants more is biased: where none of its pilot samples found
a small bright light, it stops, and its light is lost. Here a pixel's number of samples follows from the pilot samples
of its neighbours alone, never from its own, and no later sample changes it. Pixels are independent, so given its number
of samples each of a pixel's samples, pilot or later, has the right mean (the argument of a fixed sample size).
"""

from __future__ import annotations

import numpy as np

from .film import Film
from .noise import LIT
from .sampling import PARTS

#: Samples a pixel of the pilot pass.
PILOT = 16
#: A pixel's neighbours are those up to this far to each side.
_REACH = 4
#: Least and most share of the mean number of samples: what the pilot did not find is still sampled.
_LEAST, _MOST = 0.25, 8.0
#: Power of brightness: 0 makes the squared error least, 1 that relative to brightness; between, as it is seen.
_POWER = 0.5
#: Steps of the places at which pixels round: the golden ratio spreads them.
_GOLDEN = 0.6180339887498949


class Allocation:
    """Numbers of samples by pixel, for any mean number of samples."""

    def __init__(self, film: Film) -> None:
        """Decide by the pilot samples, all that `film` has."""
        self._shares = shares(*_pilot(film))
        self._places = np.arange(self._shares.size).reshape(self._shares.shape) * _GOLDEN % 1.0

    def samples(self, mean: float) -> np.ndarray:
        """(H, W) int32 samples beyond the pilot's where the mean over all pixels shall be `mean`; never falls with it.

        The mean is met but for a few per cent: a sum that is met exactly would depend on each pixel.
        """
        return np.floor(self._shares * (mean - PILOT) + self._places).astype(np.int32)


def shares(variance: np.ndarray, mean: np.ndarray, cost: np.ndarray) -> np.ndarray:
    """Share of the mean number of samples that each pixel gets, (H, W) float64, 1 on average.

    The squared error relative to brightness is least at a given cost where samples go as
    deviation / (brightness · √cost) (Neyman 1934). All three are taken of the neighbours, without the pixel itself.

    Args:
        variance: (H, W) of a sample's luminance.
        mean: (H, W) luminance.
        cost: (H, W) of a sample, in any unit.
    """
    around = np.maximum(neighbours(np.ones(variance.shape)), 1.0)
    deviation = np.sqrt(neighbours(variance) / around)
    brightness = neighbours(mean) / around
    wish = deviation / (np.sqrt(np.maximum(neighbours(cost) / around, 1e-30)) * np.maximum(brightness, LIT) ** _POWER)
    # The mean over the pixels whose wishes do not know of this one: those that are not its neighbours.
    far = wish.sum() - neighbours(wish) - wish
    count = wish.size - around - 1.0
    usual = np.maximum(far, 0.0) / np.maximum(count, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(usual > 0.0, wish / usual, np.where(wish > 0.0, _MOST, 1.0))
    return np.clip(np.where(count < 1, 1.0, share), _LEAST, _MOST)


def neighbours(values: np.ndarray) -> np.ndarray:
    """Sum over each pixel's neighbours, itself left out, (H, W) float64; nothing is added and taken off again."""
    column = _others(values, 0)
    return column + _others(column + values, 1)


def _others(values: np.ndarray, axis: int) -> np.ndarray:
    """Sum of the values up to `_REACH` places before and behind along an axis."""
    total = np.zeros(values.shape)
    ahead, behind = np.moveaxis(total, axis, 0), np.moveaxis(values, axis, 0)
    for step in range(1, min(_REACH, len(behind) - 1) + 1):
        ahead[:-step] += behind[step:]
        ahead[step:] += behind[:-step]
    return total


def _pilot(film: Film) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Variance and mean of luminance, and rays, of a sample, from the spread of the parts."""
    sums, count = film.parts()
    mean = sums.sum(-1) / np.maximum(count.sum(-1), 1.0)
    of_parts = np.divide(sums, count, out=np.zeros(sums.shape), where=count > 0)
    variance = (count * (of_parts - mean[..., None]) ** 2).sum(-1) / (int(PARTS) - 1)
    rays = film.record.rays.numpy().reshape(*mean.shape, 3).sum(-1, dtype=np.float64)
    return variance, mean, rays / PILOT
