"""Two image files made comparable: one layer of each, in the same kind of values."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import images
from ..color import srgb_decode


@dataclass(frozen=True)
class Pair:
    """One layer of two files.

    Attributes:
        first: (H, W, C) float64.
        second: the same shape.
        encoded: whether values are sRGB-encoded, as both files hold them; else they are linear or no colours.
        left_out: what one of them has beyond the other, in words, or "".
    """

    first: np.ndarray
    second: np.ndarray
    encoded: bool
    left_out: str = ""


def read_pair(first: str | Path, second: str | Path, layer: str = "color") -> Pair:
    """Read a layer of two image files.

    8-bit pictures are taken as they are stored where both files are such, and are decoded to linear values beside
    EXR or HDR. Alpha is compared where both have it, grey with grey or with colour.

    Raises:
        ValueError: a file is missing or no image, lacks the layer, or the two differ in size or kind.
    """
    (a, a_encoded), (b, b_encoded) = _read(first, layer), _read(second, layer)
    if a.shape[:2] != b.shape[:2]:
        sizes = f"{a.shape[1]}x{a.shape[0]} and {b.shape[1]}x{b.shape[0]}"
        raise ValueError(f"{first} and {second}: different sizes, {sizes} pixels")
    encoded = a_encoded and b_encoded
    if not encoded:
        a, b = (_linear(v) if e else v for v, e in ((a, a_encoded), (b, b_encoded)))
    left_out = ""
    if layer == "color":
        if _alpha(a) != _alpha(b):
            left_out = f"; alpha, which {first if _alpha(a) else second} alone has, is not compared"
        channels = 4 if min(map(_alpha, (a, b))) else 3
        a, b = (_as_color(v, channels) for v in (a, b))
    elif a.shape != b.shape:
        raise ValueError(f"{first} and {second}: layer {layer} has {a.shape[2]} and {b.shape[2]} channels")
    return Pair(a, b, encoded, left_out)


def _read(path: str | Path, layer: str) -> tuple[np.ndarray, bool]:
    layers, metadata = images.read(path)
    if layer not in layers:
        raise ValueError(f"{path}: there is no layer {layer!r}; there is {', '.join(layers)}")
    values = np.asarray(layers[layer], np.float64)
    display = Path(path).suffix.lower() in images.DISPLAY_FORMATS
    linear = str(metadata.get("oiio:ColorSpace", "")).startswith("lin")
    return values.reshape(*values.shape[:2], -1), display and not linear


def _alpha(values: np.ndarray) -> bool:
    return values.shape[2] in (2, 4)


def _linear(values: np.ndarray) -> np.ndarray:
    colors = values.shape[2] - _alpha(values)
    return np.concatenate([srgb_decode(values[..., :colors]), values[..., colors:]], axis=2)


def _as_color(values: np.ndarray, channels: int) -> np.ndarray:
    """Three colour channels, of grey ones too, and alpha as the fourth of four."""
    colors, alpha = values[..., : values.shape[2] - _alpha(values)], values[..., -1:]
    colors = np.broadcast_to(colors, (*colors.shape[:2], 3)) if colors.shape[2] == 1 else colors[..., :3]
    return np.concatenate([colors, alpha], axis=2) if channels == 4 else colors
