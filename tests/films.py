"""Films whose samples are given, as the kernels would have left them."""

import numpy as np
import warp as wp

from warprender.film import Film


def film_of(draws):
    """A film of luminance (H, W, n), a ray a sample, or (N, n) for a row of pixels."""
    draws = draws if draws.ndim == 3 else draws[None]
    height, width, samples = draws.shape
    film = Film(width, height, "cpu")
    film.record.parts = wp.array(part_sums(draws), dtype=wp.vec4d, device="cpu")
    film.record.samples.fill_(samples)
    film.record.rays.fill_(wp.vec3i(samples, 0, 0))
    return film


def part_sums(draws):
    """Samples (H, W, n) added to four parts as the kernel does, one after the other: (H, W, 4)."""
    sums = np.zeros((*draws.shape[:2], 4))
    for i in range(draws.shape[-1]):
        sequence, number = i % 2, i // 2
        if number in (1, 2, 4, 8, 16, 32, 64):
            sums[..., sequence] += sums[..., sequence + 2]
            sums[..., sequence + 2] = 0.0
        sums[..., sequence + 2 * (number > 0)] += draws[..., i]
    return sums
