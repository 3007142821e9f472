"""Well spread points that all pixels of a frame share, made on the host."""

from __future__ import annotations

import numpy as np


def shuffled_net(random: np.random.Generator, digits: int, centre_first: bool = False) -> np.ndarray:
    """2^digits points of a shuffled, Owen-scrambled (0, 2)-sequence in [0, 1)²: (N, 2) float64.

    The first 2^k points, and each following 2^k, have one in each of 2^a columns by 2^(k − a) rows, as those of
    `sampling.owen_sobol`. Every second point is no better spread than chance has it, whatever came between.

    Args:
        random: where the flips and shuffles come from.
        digits: of both coordinates; below them points are random.
        centre_first: the first point is (0.5, 0.5).
    """
    order = _owen(np.arange(1 << digits), digits, random)
    cells = np.stack([_owen(column, digits, random) for column in _sobol(digits)], -1)[order]
    places = random.random(cells.shape)
    if centre_first:
        # A digital shift keeps one point in every box.
        cells ^= cells[0] ^ (1 << (digits - 1))
        places[0] = 0.0
    return (cells + places) / (1 << digits)


def _sobol(digits: int) -> tuple[np.ndarray, np.ndarray]:
    """Both coordinates of Sobol's first points, as integers of so many bits: van der Corput's, and Pascal's."""
    number, x, y = np.arange(1 << digits), 0, 0
    x_step = y_step = 1 << (digits - 1)
    for digit in range(digits):
        taken = number >> digit & 1
        x, y = x ^ taken * x_step, y ^ taken * y_step
        x_step, y_step = x_step >> 1, y_step ^ y_step >> 1
    return x, y


def _owen(values: np.ndarray, digits: int, random: np.random.Generator) -> np.ndarray:
    """Flip each digit by a random bit of its own for the digits above it (Owen 1995)."""
    result = np.zeros_like(values)
    for digit in range(digits):
        above, bit = values >> (digits - digit), values >> (digits - 1 - digit) & 1
        result = result << 1 | bit ^ random.integers(2, size=1 << digit)[above]
    return result
