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
    usual, means, count = _usual(means)[lit], _by_part(means[lit]), _by_part(count[lit])
    cut = np.minimum(means, _OUTLIER * usual)
    # Where light is so rare that nothing is usual, it is what there is.
    cut = np.where(_mean(cut, count) > LIT, cut, means)
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
    variance = _replicates_variance(_by_part(sums[lit] / count[lit]), _by_part(count[lit]))
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
    # Of four numbers the median is the mean of those that are neither largest nor smallest.
    medians = (means.sum(-1) - means.max(-1) - means.min(-1)) / (int(PARTS) - 2)
    mean, inside = means.mean(-1), np.ones(medians.shape)
    others = _around(np.add, inside) - inside
    return np.maximum(_around(np.maximum, medians), (_around(np.add, mean) - mean) / np.maximum(others, 1.0))


def _around(combine: np.ufunc, values: np.ndarray) -> np.ndarray:
    """Of 3 × 3 pixels, or as many as there are; values are not negative."""
    for axis in range(2):
        rows = np.moveaxis(values, axis, 0)
        found = rows.copy()
        combine(found[1:], rows[:-1], out=found[1:])
        combine(found[:-1], rows[1:], out=found[:-1])
        values = np.moveaxis(found, 0, axis)
    return values


def _by_part(values: np.ndarray) -> np.ndarray:
    """(N, PARTS) → (PARTS, N), in order in memory."""
    return np.ascontiguousarray(values.T)


def _mean(values: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Of all samples, from the means (R, N) of as many groups of them."""
    return (values * count).sum(0) / count.sum(0)


def _variance(means: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Of the mean of all samples, from the means (R, N) of as many independent groups of them."""
    gap = means - _mean(means, count)
    return _mean(gap * gap, count) / (len(means) - 1)


def _replicates_variance(means: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Of the mean of all samples, from the means (PARTS, N) of the parts of independent replicates."""
    step = int(REPLICATES)
    of_groups = np.stack([_mean(means[first::step], count[first::step]) for first in range(step)])
    return _variance(of_groups, np.stack([count[first::step].sum(0) for first in range(step)]))


def _bias(whole: np.ndarray, means: np.ndarray, count: np.ndarray, cut: np.ndarray) -> np.ndarray:
    """By how much `whole`, variance over squared mean from the parts, is too large on average: (N,).

    The jackknife for groups of unequal size (Busing, Meijer and van der Leeden 1999).
    """
    parts = int(PARTS)
    bias, sound = (1 - parts) * whole, np.ones(whole.shape, bool)
    for left_out in range(parts):
        other_means, other_count, other_cut = (np.delete(values, left_out, 0) for values in (means, count, cut))
        share = other_count.sum(0) / count.sum(0)
        mean = _mean(other_cut, other_count)
        # What is left of the pixel's light may be none: then it says nothing.
        sound &= mean > LIT / 4
        # Scaled to a pixel with as many samples as the whole has.
        variance = _variance(other_means, other_count) * share
        bias += share * variance / np.maximum(mean, LIT / 4) ** 2
    return np.where(sound, bias, 0.0)
