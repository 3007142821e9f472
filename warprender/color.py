"""Colour: linear Rec.709 inside, the sRGB curve at the edges, colour temperature as UsdLux has it."""

from __future__ import annotations

import numpy as np
import warp as wp

#: Rec.709 luminance weights.
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@wp.func
def luminance(rgb: wp.vec3) -> float:
    """Rec.709 luminance of a linear colour."""
    return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]


@wp.func
def srgb_byte(linear: float) -> wp.uint32:
    """A linear value on the sRGB curve as 0 … 255; values outside of 0 … 1 end there."""
    x = wp.clamp(linear, 0.0, 1.0)
    encoded = 12.92 * x
    if x > 0.0031308:
        encoded = 1.055 * wp.pow(x, 1.0 / 2.4) - 0.055
    return wp.uint32(encoded * 255.0 + 0.5)


def srgb_encode(linear: np.ndarray) -> np.ndarray:
    """Linear values to the sRGB curve (IEC 61966-2-1); values below 0 become 0, above 1 are kept."""
    linear = np.maximum(np.asarray(linear, np.float64), 0.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def srgb_decode(encoded: np.ndarray) -> np.ndarray:
    """The inverse of `srgb_encode`."""
    encoded = np.asarray(encoded, np.float64)
    return np.where(encoded <= 0.04045, encoded / 12.92, ((np.maximum(encoded, 0.0) + 0.055) / 1.055) ** 2.4)


# Linear Rec.709 knots every 500 K from 1000 K, as tabulated by UsdLux (blackbody.cpp, OpenUSD).
_BLACKBODY = np.array(
    [
        (1.0, 0.02749, 0.0), (1.0, 0.149664, 0.0), (1.0, 0.256644, 0.008095), (1.0, 0.372033, 0.06745),
        (1.0, 0.476725, 0.153601), (1.0, 0.570376, 0.259196), (1.0, 0.65348, 0.377155),
        (1.0, 0.726878, 0.501606), (1.0, 0.791543, 0.62805), (1.0, 0.848462, 0.753228),
        (1.0, 0.898581, 0.874905), (1.0, 0.942771, 0.991642), (0.906947, 0.890456, 1.0),
        (0.828247, 0.841838, 1.0), (0.765791, 0.801896, 1.0), (0.715255, 0.768579, 1.0),
        (0.673683, 0.740423, 1.0), (0.638992, 0.716359, 1.0), (0.609681, 0.695588, 1.0),
    ]
)  # fmt: skip


def blackbody_tint(kelvin: float) -> np.ndarray:
    """Colour (3,) of luminance 1 for a temperature, as `UsdLuxBlackbodyTemperatureAsRgb` gives it."""
    position = (min(max(float(kelvin), 1000.0), 10000.0) - 1000.0) / 500.0
    first = min(int(position), len(_BLACKBODY) - 2)
    t = position - first
    knots = _BLACKBODY[np.clip(np.arange(first - 1, first + 3), 0, len(_BLACKBODY) - 1)]
    weights = 0.5 * np.array([-t + 2 * t**2 - t**3, 2 - 5 * t**2 + 3 * t**3, t + 4 * t**2 - 3 * t**3, -(t**2) + t**3])
    rgb = weights @ knots
    return np.maximum(rgb / (rgb @ LUMINANCE), 0.0)
