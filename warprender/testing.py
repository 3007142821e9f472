"""Helpers for other people's test suites.

from warprender.testing import assert_images_agree

renderer = wr.Renderer(scene, outputs=("color", "standardError", "sampleCount"))
assert_images_agree(renderer.render(samples=256), np.load("reference.npy"))
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from .frame import Frame

#: Edge in pixels of the blocks whose means are compared.
_BLOCK = 8
#: Share of a value that float32 and the order of sums may change in it.
_ROUNDING = 4e-7
_CHANNELS = "RGBA"


@dataclass(frozen=True)
class Estimate:
    """A noisy picture.

    Attributes:
        values: (H, W, 3 or 4) float64: linear colour, premultiplied alpha.
        error: (H, W, 3) float64 standard error of the colour; 0 for a picture that is exact.
        samples: (H, W) samples a pixel, or None where they are many or not known.
    """

    values: np.ndarray
    error: np.ndarray
    samples: np.ndarray | None


def assert_images_agree(
    a: Frame | np.ndarray,
    b: Frame | np.ndarray,
    *,
    a_error: np.ndarray | float | None = None,
    b_error: np.ndarray | float | None = None,
    a_samples: np.ndarray | int | None = None,
    b_samples: np.ndarray | int | None = None,
    false_alarms: float = 1e-3,
) -> None:
    """Assert that two noisy pictures are estimates of one picture.

    Each difference is divided by its standard error. Five things are tested, each with its share of the rate of
    false alarms: the mean of the picture, the means of 8 × 8 blocks, single pixels, the share of pixels that are more
    than one standard error apart, and alpha. Where many numbers are tested at once, each gets its part of that share
    (Bonferroni). A pixel's standard error is at least the RMS of its 3 × 3 neighbourhood: a pixel that missed a rare
    bright event looks surer than it is. Student's t takes the place of the normal distribution where the number of
    samples is known. Few samples of very uneven light are beyond any of this: take 64 or more.

    Args:
        a: a frame with the outputs color and standardError (and sampleCount, for alpha and Student's t), or an array
            (H, W, 3 or 4) of linear values.
        b: likewise.
        a_error: standard error of `a`, (H, W, 3), (H, W) or one number, where `a` is an array; None is a picture
            without noise.
        b_error: likewise for `b`.
        a_samples: samples a pixel of `a`, where it is an array.
        b_samples: likewise for `b`.
        false_alarms: probability that pictures which do agree fail; larger finds smaller differences.

    Raises:
        AssertionError: they do not agree; the message says where, by how many standard errors, and what chance allows.
        ValueError: the sizes differ, a frame lacks its outputs, or neither picture has noise.
    """
    if not 0.0 < false_alarms < 1.0:
        raise ValueError(f"false_alarms must lie between 0 and 1, not {false_alarms}")
    first, second = _estimate(a, a_error, a_samples, "a"), _estimate(b, b_error, b_samples, "b")
    if first.values.shape[:2] != second.values.shape[:2]:
        raise ValueError(f"the pictures have the sizes {first.values.shape[:2]} and {second.values.shape[:2]} (H, W)")
    if not (first.error.any() or second.error.any()):
        raise ValueError("neither picture has a standard error; compare them with numpy.testing")
    complaints = [*_not_finite(first, second)] or [*_beyond_chance(first, second, false_alarms / 5)]
    if complaints:
        chance = f"(pictures that agree fail once in {1 / false_alarms:.3g} comparisons)"
        raise AssertionError("\n".join([f"the pictures differ by more than chance {chance}:", *complaints]))


def _estimate(
    picture: Frame | np.ndarray, error: np.ndarray | float | None, samples: np.ndarray | int | None, name: str
) -> Estimate:
    if isinstance(picture, Frame):
        missing = [n for n in ("color", "standardError") if n not in picture.outputs]
        if missing and error is None:
            raise ValueError(f"{name}: the frame has no output {', '.join(missing)}; ask the renderer for it")
        error = picture.numpy("standardError") if error is None else error
        if samples is None and "sampleCount" in picture.outputs:
            samples = picture.numpy("sampleCount")
        picture = picture.numpy("color")
    values = np.asarray(picture, np.float64)
    if values.ndim != 3 or values.shape[2] not in (3, 4) or not values.size:
        raise ValueError(f"{name}: an array of shape {values.shape} is no picture (H, W, 3 or 4)")
    error = np.asarray(0.0 if error is None else error, np.float64)
    error = error[..., None] if error.ndim == 2 else error
    if (error < 0.0).any() or np.isnan(error).any():
        raise ValueError(f"{name}: standard errors must be 0 or more")
    error = np.broadcast_to(error, (*values.shape[:2], 3))
    return Estimate(values, error, None if samples is None else np.broadcast_to(samples, values.shape[:2]))


def _not_finite(a: Estimate, b: Estimate) -> Iterator[str]:
    for name, picture in (("a", a), ("b", b)):
        bad = np.argwhere(~np.isfinite(picture.values).all(-1))
        if len(bad):
            y, x = bad[0]
            yield f"  {name} is not finite in {len(bad)} pixels, the first (x={x}, y={y})"


def _beyond_chance(a: Estimate, b: Estimate, share: float) -> Iterator[str]:
    """A line for each test that fails; each fails by chance with probability `share`."""
    gap = (a.values - b.values)[..., :3]
    size = np.maximum(np.abs(a.values), np.abs(b.values))[..., :3]
    variance = _at_least_of_neighbours(a.error**2 + b.error**2) + (_ROUNDING * size) ** 2
    freedom = _degrees_of_freedom(a, b)
    yield from _mean(gap, variance, share)
    yield from _blocks(gap, variance, share)
    yield from _pixels(a, b, gap, variance, freedom, share)
    yield from _spread(gap, variance, freedom, share)
    yield from _alpha(a, b, share)


def _mean(gap: np.ndarray, variance: np.ndarray, share: float) -> Iterator[str]:
    z = _ratio(gap.sum((0, 1)), np.sqrt(variance.sum((0, 1))))
    limit = _two_sided(share / 3)
    for c in np.flatnonzero(np.abs(z) > limit):
        yield f"  mean of {_CHANNELS[c]}: a − b = {gap[..., c].mean():+.4g}, {_apart(z[c], limit)}"


def _blocks(gap: np.ndarray, variance: np.ndarray, share: float) -> Iterator[str]:
    z = _ratio(_block_sums(gap), np.sqrt(_block_sums(variance)))
    limit = _two_sided(share / z.size)
    y, x, c = np.unravel_index(np.abs(z).argmax(), z.shape)
    if abs(z[y, x, c]) > limit:
        rows, columns = (f"{k * _BLOCK}…{k * _BLOCK + _BLOCK - 1}" for k in (y, x))
        yield f"  block x={columns}, y={rows}, {_CHANNELS[c]}: {_apart(z[y, x, c], limit)}; {_count(z, limit)} blocks"


def _pixels(
    a: Estimate, b: Estimate, gap: np.ndarray, variance: np.ndarray, freedom: np.ndarray | None, share: float
) -> Iterator[str]:
    z = _as_normal(_ratio(gap, np.sqrt(variance)), freedom)
    limit = _two_sided(share / z.size)
    y, x, c = np.unravel_index(np.abs(z).argmax(), z.shape)
    if abs(z[y, x, c]) > limit:
        pair = f"{a.values[y, x, c]:.6g} and {b.values[y, x, c]:.6g}"
        yield f"  pixel (x={x}, y={y}), {_CHANNELS[c]}: {pair}, {_apart(z[y, x, c], limit)}; {_count(z, limit)} pixels"


def _spread(gap: np.ndarray, variance: np.ndarray, freedom: np.ndarray | None, share: float) -> Iterator[str]:
    """Whether too many pixels are more than one standard error apart: a difference all over that no mean shows.

    The channels of a pixel are averaged as if they were wholly correlated, which overstates the error at most.
    """
    z = _as_normal(_ratio(gap.mean(-1), np.sqrt(variance).mean(-1))[..., None], freedom)
    expected = 2.0 * NormalDist().cdf(-1.0)
    found = float((np.abs(z) > 1.0).mean())
    limit = expected + _one_sided(share) * math.sqrt(expected * (1.0 - expected) / z.size)
    if found > limit:
        yield f"  {100 * found:.3g} % of the pixels are more than one standard error apart; chance: {100 * limit:.3g} %"


def _alpha(a: Estimate, b: Estimate, share: float) -> Iterator[str]:
    """Alpha lies between 0 and 1, so that its variance is at most α (1 − α)."""
    if a.values.shape[2] < 4 or b.values.shape[2] < 4 or (a.samples is None and b.samples is None):
        return
    per_sample = sum(1.0 / np.maximum(e.samples, 1) for e in (a, b) if e.samples is not None)
    weights = [1.0 if e.samples is None else 0.0 for e in (a, b)]
    weights = weights if any(weights) else [0.5, 0.5]
    mean = np.clip(weights[0] * a.values[..., 3] + weights[1] * b.values[..., 3], 0.0, 1.0)
    # One sample more or less: where all hit or all miss, the spread is not zero but below what shows.
    variance = (mean * (1.0 - mean) + per_sample / 4) * per_sample
    z = (a.values - b.values)[..., 3] / np.sqrt(variance)
    limit = _two_sided(share / z.size)
    y, x = np.unravel_index(np.abs(z).argmax(), z.shape)
    if abs(z[y, x]) > limit:
        pair = f"{a.values[y, x, 3]:.6g} and {b.values[y, x, 3]:.6g}"
        yield f"  pixel (x={x}, y={y}), alpha: {pair}, {_apart(z[y, x], limit)}"


def _at_least_of_neighbours(variance: np.ndarray) -> np.ndarray:
    """Each pixel's variance, or the mean over its 3 × 3 neighbourhood where that is larger."""
    padded = np.pad(variance, ((1, 1), (1, 1), (0, 0)), mode="edge")
    height, width = variance.shape[:2]
    mean = sum(padded[y : y + height, x : x + width] for y in range(3) for x in range(3)) / 9.0
    return np.maximum(variance, mean)


def _degrees_of_freedom(a: Estimate, b: Estimate) -> np.ndarray | None:
    """(H, W, 1) of the pixel's variance: those of the picture with fewer samples; None where none are known."""
    known = [e.samples for e in (a, b) if e.samples is not None and e.error.any()]
    return np.maximum(np.minimum.reduce(known)[..., None] - 1.0, 1.0) if known else None


def _as_normal(t: np.ndarray, freedom: np.ndarray | None) -> np.ndarray:
    """Normal deviates of the same tail as Student's t (Wallace 1959), to 0.1 % from 10 degrees of freedom on."""
    if freedom is None:
        return t
    bounded = np.clip(np.abs(t), 0.0, 1e100)
    size = (8 * freedom + 1) / (8 * freedom + 3) * np.sqrt(freedom * np.log1p(bounded**2 / freedom))
    return np.copysign(size, t)


def _block_sums(values: np.ndarray) -> np.ndarray:
    """Sums over blocks of 8 × 8 pixels; those at the right and the lower edge may be smaller."""
    rows = np.add.reduceat(values, np.arange(0, values.shape[0], _BLOCK), axis=0)
    return np.add.reduceat(rows, np.arange(0, values.shape[1], _BLOCK), axis=1)


def _ratio(gap: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Gap / error; 0 where both are 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(gap == 0.0, 0.0, gap / error)


def _one_sided(probability: float) -> float:
    """What a standard normal number exceeds with this probability."""
    return -NormalDist().inv_cdf(probability)


def _two_sided(probability: float) -> float:
    """What the size of a standard normal number exceeds with this probability."""
    return _one_sided(probability / 2)


def _apart(z: float, limit: float) -> str:
    return f"{abs(z):.3g} standard errors apart; chance: {limit:.3g}"


def _count(z: np.ndarray, limit: float) -> str:
    beyond = int((np.abs(z) > limit).any(-1).sum())
    return f"so are {beyond} of {z[..., 0].size}"
