"""How far two pictures lie apart, in one number each."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from ..color import LUMINANCE

#: Added to the reference's square in the relative MSE, so that black pixels count (Rousselle, Knaus and Zwicker 2011).
RELATIVE_FLOOR = 1e-2

#: Luminance below which a reference is black to FLIP, with a margin.
_DARKEST = 4e-6

FLIP_MISSING = 'FLIP needs the package flip-evaluator: pip install "warprender[study]"'


@dataclass(frozen=True)
class Differences:
    """Differences of a picture from a reference, over all pixels and channels.

    Attributes:
        rmse: root of the mean squared difference, in the pictures' own values.
        relative_mse: mean of squared difference over (squared reference + 0.01).
        maximum: largest absolute difference.
        mean: mean of picture − reference, what remains when noise averages out.
        different: share of pixels with any difference.
    """

    rmse: float
    relative_mse: float
    maximum: float
    mean: float
    different: float


def differences(picture: np.ndarray, reference: np.ndarray) -> Differences:
    """Compare two arrays (H, W, C) or (H, W) of one shape, in float64.

    Values that are not finite are equal to themselves alone: any other pair of them is infinitely far apart.

    Raises:
        ValueError: the shapes differ.
    """
    gap = difference(picture, reference)
    reference = np.asarray(reference, np.float64)
    finite = np.where(np.isfinite(reference), reference, 0.0)
    with np.errstate(invalid="ignore", over="ignore"):
        squares = gap * gap
        relative = squares / (finite * finite + RELATIVE_FLOOR)
        mean = float(gap.mean())
    pixels = gap.reshape(*gap.shape[:2], -1)
    return Differences(
        float(np.sqrt(squares.mean())),
        float(relative.mean()),
        float(np.abs(gap).max()),
        mean,
        float((pixels != 0.0).any(-1).mean()),
    )


def difference(picture: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Picture − reference as float64; 0 where both hold the same value, inf where one of a pair is not finite.

    Raises:
        ValueError: the shapes differ.
    """
    if np.shape(picture) != np.shape(reference):
        raise ValueError(f"the pictures have the shapes {np.shape(picture)} and {np.shape(reference)}")
    a, b = np.asarray(picture, np.float64), np.asarray(reference, np.float64)
    same = (a == b) | (np.isnan(a) & np.isnan(b))
    with np.errstate(invalid="ignore"):
        gap = np.where(same, 0.0, a - b)
    return np.where(np.isnan(gap), np.inf, gap)


def flip_available() -> bool:
    """Whether flip-evaluator is installed."""
    return find_spec("flip_evaluator") is not None


def flip(picture: np.ndarray, reference: np.ndarray, encoded: bool = False) -> tuple[float, np.ndarray]:
    """NVIDIA's FLIP, the difference that a person sees when the pictures alternate (Andersson et al. 2020, 2021).

    Args:
        picture: (H, W, 3), linear Rec.709, or sRGB-encoded from 0 to 1.
        reference: likewise.
        encoded: whether the values are sRGB-encoded: LDR-FLIP then, else HDR-FLIP.

    Returns:
        Its mean over pixels, from 0 (same) to 1, and the map (H, W) float32. Values that are not finite are black,
        negative ones 0.

    Raises:
        ValueError: flip-evaluator is not installed.
    """
    if not flip_available():
        raise ValueError(FLIP_MISSING)
    import flip_evaluator

    def usable(values: np.ndarray) -> np.ndarray:
        values = np.nan_to_num(np.asarray(values, np.float32), nan=0.0, posinf=0.0, neginf=0.0)
        return np.ascontiguousarray(np.clip(values, 0.0, 1.0 if encoded else None))

    a, b = usable(reference), usable(picture)
    if (a == b).all():
        return 0.0, np.zeros(a.shape[:2], np.float32)
    # FLIP chooses exposures by the reference's luminance, and ends the process where that is all but black.
    black = not encoded and (a @ LUMINANCE).max() < _DARKEST
    parameters = {"startExposure": 0.0, "stopExposure": 1.0} if black else {}
    found, mean, _ = flip_evaluator.evaluate(a, b, "LDR" if encoded else "HDR", applyMagma=False, parameters=parameters)
    return float(mean), found[..., 0]
