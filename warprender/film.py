"""The film: sums over samples, and what they say of their own error.

Sums are float64 and in the order of the samples, so 64 samples at once or in four goes give the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import warp as wp

from .filters import filter_table
from .launch import launch
from .noise import Stated, frame_error, part_counts, relative_error
from .outputs import FILM_OUTPUTS


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
    """Per pixel (H, W): sums of radiance and alpha, of squared radiance, of luminance by part, and counts.

    `rays` counts camera, bounce and shadow rays; `dropped` the samples that were not finite; `unfollowed` the
    rays that there was no room for.
    """

    sums: wp.array2d(dtype=wp.vec4d)
    squares: wp.array2d(dtype=wp.vec3d)
    parts: wp.array2d(dtype=wp.vec4d)
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


class Film:
    """Accumulates samples on a device; resumable."""

    def __init__(self, width: int, height: int, device: str, filter: str = "box", terms: tuple[int, ...] = ()) -> None:
        """An empty film of this size in pixels, which also keeps these terms apart."""
        self.width, self.height, self.device = width, height, device
        shape = (height, width)
        self.record = FilmRecord()
        self.record.sums = wp.zeros(shape, dtype=wp.vec4d, device=device)
        self.record.squares = wp.zeros(shape, dtype=wp.vec3d, device=device)
        self.record.parts = wp.zeros(shape, dtype=wp.vec4d, device=device)
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
        for array in (film.sums, film.squares, film.parts, film.samples, film.dropped, film.rays, film.unfollowed):
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

    def relative_error(self) -> Stated:
        """Relative RMS standard error of the frame's luminance over lit pixels: see `noise.relative_error`."""
        return relative_error(*self.parts())

    def frame_error(self) -> Stated:
        """RMS standard error of luminance over lit pixels, over its RMS: see `noise.frame_error`."""
        return frame_error(*self.parts())

    def parts(self) -> tuple[np.ndarray, np.ndarray]:
        """Sums of luminance and numbers of samples of each part, (H, W, PARTS) float64: those of `part_counts`."""
        kept, dropped = (array.numpy().astype(np.int64) for array in (self.record.samples, self.record.dropped))
        taken = kept + dropped
        count = part_counts(taken) * (kept / np.maximum(taken, 1))[..., None]
        return self.record.parts.numpy(), count

    def facts(self) -> dict[str, Callable[[], object]]:
        """What a frame's statistics say of the film, by name, each worked out when it is called for."""
        relative, of_frame = cache(self.relative_error), cache(self.frame_error)
        return {
            "rays": self.ray_counts,
            "error": lambda: relative().error,
            "error within": lambda: relative().within,
            "frame error": lambda: of_frame().error,
            "frame error within": lambda: of_frame().within,
            "dropped samples": self.dropped_samples,
            "unfollowed rays": self.unfollowed_rays,
        }

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
