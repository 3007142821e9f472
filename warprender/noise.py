"""The error of a frame: what it truly is beside a reference, and what the film's own sums say of it.

There are two figures, both of luminance over lit pixels, those above 1e-3. In the relative error every lit pixel counts
alike, in the frame error bright ones count for more. They are estimated from `PARTS` sums of each pixel, of which those
with even and odd numbers belong to independent sequences (`REPLICATES`): how far these lie apart is the error.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .color import LUMINANCE
from .sampling import PARTS, REPLICATES

#: Luminance from which on a pixel is lit.
LIT = 1e-3
#: What a part adds to a pixel's brightness is cut at this many times the largest usual brightness around the pixel.
_OUTLIER = 2.0
#: Half the width of a 95 % interval, in standard deviations.
_SIGMAS = 1.96


class Stated(NamedTuple):
    """An error as the film states it, and the share of it within which the true one lies in 95 of 100 frames.

    Neither knows of light that no sample has found.
    """

    error: float
    within: float


def true_errors(picture: np.ndarray, reference: np.ndarray) -> tuple[float, float]:
    """What `relative_error` and `frame_error` estimate, of a picture beside a reference without noise.

    Args:
        picture: (H, W, 3) linear; further channels are left out.
        reference: the same; it decides which pixels are lit.

    Returns:
        √mean(((picture − reference) / reference)²) and √(Σ (picture − reference)² / Σ reference²), of luminance over
        the pixels whose reference is above 1e-3; both 0 where none is.
    """
    image, wanted = (np.asarray(values, np.float64)[..., :3] @ LUMINANCE for values in (picture, reference))
    lit = wanted > LIT
    if not lit.any():
        return 0.0, 0.0
    gap, wanted = (image - wanted)[lit], wanted[lit]
    return float(np.sqrt(np.mean((gap / wanted) ** 2))), float(np.sqrt((gap**2).sum() / (wanted**2).sum()))


def relative_error(sums: np.ndarray, count: np.ndarray) -> Stated:
    """RMS over lit pixels of standard error over mean; inf below 4 samples, 0 where nothing is lit.

    A rare bright sample shifts a pixel's mean and its standard error by the same amount, so the standard error alone
    follows it. The mean that is divided by is freed of it: no part counts for more than twice the largest median of the
    parts, or mean of pixels, next to the pixel. What is left is too small on average, because pixels that missed bright
    samples have both figures too low: the jackknife over the parts says by how much, to first order (Quenouille 1956).

    Args:
        sums: (H, W, PARTS) float64 luminance of each part of the samples.
        count: (H, W, PARTS) samples of each part.
    """
    if (count < 1).any():
        return Stated(np.inf, np.inf)
    lit = sums.sum(-1) > LIT * count.sum(-1)
    if not lit.any():
        return Stated(0.0, 0.0)
    means = sums / count
    usual, means, count = _usual(means)[lit], means[lit], count[lit]
    cut = np.minimum(means, _OUTLIER * usual[:, None])
    # Where light is so rare that nothing is usual, it is what there is.
    cut = np.where((_mean(cut, count) > LIT)[:, None], cut, means)
    squares = _replicates_variance(means, count) / _mean(cut, count) ** 2
    whole = _variance(means, count) / _mean(cut, count) ** 2
    bias = _bias(whole, means, count, cut)
    share = bias.sum() / whole.sum() if whole.any() else 0.0
    return _stated(squares - bias, squares.mean() * (1.0 - share if share < 1.0 else 1.0))


def frame_error(sums: np.ndarray, count: np.ndarray) -> Stated:
    """RMS standard error over lit pixels, over the RMS of their means; inf below 4 samples, 0 where nothing is lit.

    The same as `relative_error` for a picture of one brightness, and the steadier figure elsewhere: nothing is divided
    by the mean of a single pixel. The arguments are the same.
    """
    if (count < 1).any():
        return Stated(np.inf, np.inf)
    mean = sums.sum(-1) / count.sum(-1)
    lit = mean > LIT
    if not lit.any():
        return Stated(0.0, 0.0)
    variance = _replicates_variance((sums / count)[lit], count[lit])
    light, noise = (mean[lit] ** 2).sum(), variance.sum()
    # The square of a noisy mean is too large by its variance; half of it is left where there is little else.
    return _stated(variance, noise / max(light - noise, light / 2))


def part_counts(samples: np.ndarray) -> np.ndarray:
    """How many samples are in each part of pixels that took so many, (H, W) int → (H, W, PARTS) float64.

    Sample i is number i // REPLICATES of sequence i % REPLICATES. Of a sequence's m samples the first part has as many
    as the greatest power of two below m, the second the rest: parts of 2^k samples are as well spread as a sequence of
    their own.
    """
    sequences = int(REPLICATES)
    of_sequence = (np.asarray(samples)[..., None] + sequences - 1 - np.arange(sequences)) // sequences
    first = np.where(of_sequence > 1, 2.0 ** np.floor(np.log2(np.maximum(of_sequence - 1, 1))), of_sequence)
    return np.concatenate([first, of_sequence - first], -1)


def _stated(squares: np.ndarray, squared: float) -> Stated:
    """The root of a squared error to which each pixel adds its own of `squares`, up to a factor.

    Var(Σ q) ≤ Σ E(q²) of independent pixels, for what is stated and for what is true alike; a root has half of it.
    """
    total = squares.sum()
    within = _SIGMAS / 2 * np.sqrt(2.0 * (squares**2).sum()) / total if total > 0.0 else float(squares.any())
    return Stated(float(np.sqrt(squared)), float(within))


def _usual(means: np.ndarray) -> np.ndarray:
    """The largest median of the parts among 3 × 3 pixels, or the mean of the other eight where that is larger: (H, W).

    Edges are kept: beside a bright pixel nothing is unusual.
    """
    height, width = means.shape[:2]
    medians = np.pad(np.median(means, axis=-1), 1)
    mean = np.pad(means.mean(-1), 1)
    inside = np.pad(np.ones((height, width)), 1)
    largest, total, others = np.zeros((3, height, width))
    for y in range(3):
        for x in range(3):
            place = slice(y, y + height), slice(x, x + width)
            largest = np.maximum(largest, medians[place])
            if (y, x) != (1, 1):
                total, others = total + mean[place], others + inside[place]
    return np.maximum(largest, total / np.maximum(others, 1.0))


def _mean(values: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Of all samples, from the means (N, R) of as many groups of them."""
    return (values * count).sum(-1) / count.sum(-1)


def _variance(means: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Of the mean of all samples, from the means (N, R) of as many independent groups of them."""
    gap = means - _mean(means, count)[:, None]
    return _mean(gap**2, count) / (means.shape[-1] - 1)


def _replicates_variance(means: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Of the mean of all samples, from the means (N, PARTS) of the parts of independent replicates."""
    step = int(REPLICATES)
    groups = [slice(first, None, step) for first in range(step)]
    of_groups = np.stack([_mean(means[:, group], count[:, group]) for group in groups], -1)
    return _variance(of_groups, np.stack([count[:, group].sum(-1) for group in groups], -1))


def _bias(whole: np.ndarray, means: np.ndarray, count: np.ndarray, cut: np.ndarray) -> np.ndarray:
    """By how much `whole`, variance over squared mean from the parts, is too large on average: (N,).

    The jackknife for groups of unequal size (Busing, Meijer and van der Leeden 1999).
    """
    parts = int(PARTS)
    bias, sound = (1 - parts) * whole, np.ones(whole.shape, bool)
    for left_out in range(parts):
        kept = [part for part in range(parts) if part != left_out]
        share = count[:, kept].sum(-1) / count.sum(-1)
        mean = _mean(cut[:, kept], count[:, kept])
        # What is left of the pixel's light may be none: then it says nothing.
        sound &= mean > LIT / 4
        # Scaled to a pixel with as many samples as the whole has.
        variance = _variance(means[:, kept], count[:, kept]) * share
        bias += share * variance / np.maximum(mean, LIT / 4) ** 2
    return np.where(sound, bias, 0.0)
