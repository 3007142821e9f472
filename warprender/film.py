"""The film: sums over samples, what they say of their own error, and the filter that spreads samples over pixels.

Sums are float64 and in the order of the samples, so 64 samples at once or in four goes give the same bits.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import warp as wp

from .launch import launch
from .outputs import FILM_OUTPUTS
from .sampling import REPLICATES

#: Straight pieces of the tables that turn uniform numbers into filter offsets; the tails of a Gaussian need many.
_TABLE = 2048
#: Steps of the R2 sequence: 1/g and 1/g² with g³ = g + 1 (Roberts 2018).
_R2 = 1.3247179572447460 ** np.array([-1.0, -2.0])
#: Luminance from which on a pixel is lit.
LIT = 1e-3


@wp.struct
class Terms:
    """Single terms of radiance, by how often light was scattered: a row for each of `numbers`, a column for each pixel.

    `sums` are over samples; `sample` is what the sample that is being traced has brought so far.
    """

    numbers: wp.array(dtype=wp.int32)
    sums: wp.array2d(dtype=wp.vec3d)
    sample: wp.array2d(dtype=wp.vec3)


@wp.struct
class FilmRecord:
    """Per pixel (H, W): sums of radiance and alpha, of squared radiance, of each replicate's luminance, and counts.

    `rays` counts camera, bounce and shadow rays; `dropped` the samples that were not finite; `unfollowed` the
    rays that there was no room for.
    """

    sums: wp.array2d(dtype=wp.vec4d)
    squares: wp.array2d(dtype=wp.vec3d)
    replicates: wp.array2d(dtype=wp.vec4d)
    samples: wp.array2d(dtype=wp.int32)
    dropped: wp.array2d(dtype=wp.int32)
    rays: wp.array2d(dtype=wp.vec3i)
    unfollowed: wp.array2d(dtype=wp.int32)
    filter_table: wp.array(dtype=wp.float32)


@wp.func
def keep_term(terms: Terms, pixel: int, number: int, radiance: wp.vec3):
    """Add radiance that was scattered `number` times to the pixel's sample, if that term is kept."""
    for row in range(terms.numbers.shape[0]):
        if terms.numbers[row] == number:
            terms.sample[row, pixel] = terms.sample[row, pixel] + radiance


@wp.func
def keep_no_term(terms: Terms, pixel: int, number: int, radiance: wp.vec3):
    """In the place of `keep_term` where no term is kept."""


def keep_function(terms: bool) -> wp.Function:
    """`keep(request.terms, pixel, number, radiance)` for a transport that keeps terms apart, or does not."""
    return keep_term if terms else keep_no_term


@wp.func
def end_sample(terms: Terms, pixel: int, finite: bool):
    """Add the pixel's sample to the sums, unless color dropped it, and begin another."""
    for row in range(terms.numbers.shape[0]):
        radiance = terms.sample[row, pixel]
        if finite:
            terms.sums[row, pixel] = terms.sums[row, pixel] + wp.vec3d(radiance)
        terms.sample[row, pixel] = wp.vec3(0.0, 0.0, 0.0)


FILTERS = ("box", "triangle", "gaussian")


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

    `REPLICATES` sequences take turns, as for rays, each Roberts' R2 with a shift that depends on the seed; the first
    begins at the centre.
    """
    shift = np.random.default_rng((seed & 0xFFFFFFFF, sample % REPLICATES)).random(2)
    if sample % REPLICATES == 0:
        shift = np.array([0.5, 0.5])
    u = (shift + sample // REPLICATES * _R2) % 1.0
    x, y = np.interp(u, np.linspace(0.0, 1.0, len(table)), table)
    return float(x), float(y)


class Film:
    """Accumulates samples on a device; resumable."""

    def __init__(self, width: int, height: int, device: str, filter: str = "box", terms: tuple[int, ...] = ()) -> None:
        """An empty film of this size in pixels, which also keeps these terms apart."""
        self.width, self.height, self.device = width, height, device
        shape = (height, width)
        self.record = FilmRecord()
        self.record.sums = wp.zeros(shape, dtype=wp.vec4d, device=device)
        self.record.squares = wp.zeros(shape, dtype=wp.vec3d, device=device)
        self.record.replicates = wp.zeros(shape, dtype=wp.vec4d, device=device)
        self.record.samples = wp.zeros(shape, dtype=wp.int32, device=device)
        self.record.dropped = wp.zeros(shape, dtype=wp.int32, device=device)
        self.record.rays = wp.zeros(shape, dtype=wp.vec3i, device=device)
        self.record.unfollowed = wp.zeros(shape, dtype=wp.int32, device=device)
        self.record.filter_table = wp.array(filter_table(filter), dtype=wp.float32, device=device)
        self.terms = Terms()
        self.terms.numbers = wp.array(terms, dtype=wp.int32, device=device)
        self.terms.sums = wp.zeros((len(terms), width * height), dtype=wp.vec3d, device=device)
        self.terms.sample = wp.zeros((len(terms), width * height), dtype=wp.vec3, device=device)

    def clear(self) -> None:
        """Forget all samples."""
        film = self.record
        for array in (film.sums, film.squares, film.replicates, film.samples, film.dropped, film.rays, film.unfollowed):
            array.zero_()
        self.terms.sums.zero_()
        self.terms.sample.zero_()

    def color(self, exposure: float, threads: int | None = None) -> wp.array:
        """The picture so far: (H, W) vec4 float32, premultiplied linear Rec.709 and alpha."""
        picture = wp.empty((self.height, self.width), dtype=wp.vec4, device=self.device)
        launch(
            _resolve_kernel(),
            self.width * self.height,
            [self.record, exposure, picture],
            self.device,
            threads,
        )
        return picture

    def standard_error(self) -> np.ndarray:
        """(H, W, 3) float64 standard error of each pixel's mean, before exposure; inf below two samples.

        From the spread of single samples: an upper bound for Sobol points, whose errors cancel.
        """
        n = self.record.samples.numpy().astype(np.float64)[..., None]
        sums, squares = self.record.sums.numpy()[..., :3], self.record.squares.numpy()
        with np.errstate(divide="ignore", invalid="ignore"):
            variance = np.maximum(squares - sums * sums / n, 0.0) / (n - 1.0)
            return np.where(n > 1, np.sqrt(variance / n), np.inf)

    def output(self, name: str, exposure: float) -> wp.array:
        """One of `FILM_OUTPUTS`, (H, W): samples kept, `standard_error` times exposure, or rays of all kinds."""
        if name == "sampleCount":
            return wp.clone(self.record.samples)
        if name == "rayCount":
            values = self.record.rays.numpy().sum(-1, dtype=np.int32)
        else:
            values = (self.standard_error() * exposure).astype(np.float32)
        return wp.array(values, dtype=FILM_OUTPUTS[name], device=self.device)

    def term(self, number: int, exposure: float) -> wp.array:
        """The mean of a term that is kept, times exposure: (H, W) vec3 float32."""
        row = self.terms.numbers.numpy().tolist().index(number)
        sums = self.terms.sums.numpy()[row].reshape(self.height, self.width, 3)
        mean = sums / np.maximum(self.record.samples.numpy(), 1)[..., None]
        return wp.array((mean * exposure).astype(np.float32), dtype=wp.vec3, device=self.device)

    def relative_error(self) -> float:
        """Relative RMS standard error of the frame's luminance over lit pixels, those above 1e-3; inf below 4 samples.

        From the spread of the replicates: three degrees of freedom a pixel, pooled over the frame. Variance over
        squared mean is too small on average, because pixels that missed bright samples have both too low: the
        jackknife over the replicates takes that bias off to first order (Quenouille 1956).
        """
        sums, count = self.replicate_sums()
        if (count < 1).any():
            return np.inf
        mean = sums.sum(-1) / count.sum(-1)
        lit = mean > LIT
        if not lit.any():
            return 0.0
        sums, count, mean = sums[lit], count[lit], mean[lit]
        whole = _relative_variance(sums, count)
        others = [[i for i in range(REPLICATES) if i != left_out] for left_out in range(REPLICATES)]
        parts = [_relative_variance(sums[:, kept], count[:, kept]) for kept in others]
        # A part without light says nothing of the pixel.
        sound = np.isfinite(parts).all(0)
        corrected = REPLICATES * whole - (REPLICATES - 1) * np.mean(parts, axis=0)
        squared = np.mean(np.where(sound, corrected, whole))
        return float(np.sqrt(squared if squared > 0.0 else np.mean(whole)))

    def frame_error(self) -> float:
        """RMS standard error of luminance over lit pixels, over the RMS of their luminance; inf below 4 samples.

        The same as `relative_error` for a picture of one brightness. Elsewhere bright pixels count for more, and
        single pixels that are nearly black for nothing: it is the steadier figure.
        """
        sums, count = self.replicate_sums()
        if (count < 1).any():
            return np.inf
        mean = sums.sum(-1) / count.sum(-1)
        lit = mean > LIT
        if not lit.any():
            return 0.0
        squares = mean[lit] ** 2
        variance = (_relative_variance(sums[lit], count[lit]) * squares).sum()
        # The square of a noisy mean is too large by its variance; half of it is left where there is little else.
        return float(np.sqrt(variance / max(squares.sum() - variance, squares.sum() / 2)))

    def replicate_sums(self) -> tuple[np.ndarray, np.ndarray]:
        """Sums of luminance and samples of each replicate, (H, W, 4) float64."""
        n = self.record.samples.numpy().astype(np.float64)[..., None]
        count = np.floor((n + REPLICATES - 1 - np.arange(REPLICATES)) / REPLICATES)
        return self.record.replicates.numpy(), count

    def ray_counts(self) -> dict[str, int]:
        """Rays traced so far, by kind."""
        camera, bounce, shadow = self.record.rays.numpy().reshape(-1, 3).sum(0, dtype=np.int64)
        return {"camera": int(camera), "bounce": int(bounce), "shadow": int(shadow)}

    def unfollowed_rays(self) -> int:
        """Rays that the transport had no room for: their light is missing."""
        return int(self.record.unfollowed.numpy().sum(dtype=np.int64))

    def dropped_samples(self) -> int:
        """Samples that were not finite and are in no pixel."""
        return int(self.record.dropped.numpy().sum(dtype=np.int64))


def _relative_variance(sums: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Variance of a pixel's mean of four replicates over that mean squared, from these (N, R); inf for unlit ones.

    With fewer than four it is that of a pixel of as many samples each.
    """
    total, n = sums.sum(-1), count.sum(-1)
    mean = total / n
    variance = (count / n[:, None] * (sums / count - mean[:, None]) ** 2).sum(-1) / (sums.shape[-1] - 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = variance * (sums.shape[-1] / REPLICATES) / mean**2
    return np.where(mean > LIT / 4, relative, np.inf)


@cache
def _resolve_kernel() -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False)
    def resolve(first: wp.int32, film: FilmRecord, exposure: wp.float32, picture: wp.array2d(dtype=wp.vec4)):
        pixel = first + wp.tid()
        y = pixel // picture.shape[1]
        x = pixel % picture.shape[1]
        value = wp.vec4(0.0, 0.0, 0.0, 0.0)
        if film.samples[y, x] > 0:
            mean = film.sums[y, x] / wp.float64(film.samples[y, x])
            value = wp.vec4(
                wp.float32(mean[0]) * exposure,
                wp.float32(mean[1]) * exposure,
                wp.float32(mean[2]) * exposure,
                wp.float32(mean[3]),
            )
        picture[y, x] = value

    return resolve
