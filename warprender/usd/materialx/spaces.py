"""Colour spaces by the names of MaterialX, OpenColorIO and USD, into linear Rec.709."""

from __future__ import annotations

from functools import cache

import numpy as np
from pxr import Gf

from ...color import srgb_decode

#: Spaces that are taken as they are.
_PLAIN = ("", "raw", "data", "identity", "none", "auto", "lin_rec709", "lin_srgb", "lin_rec709_scene", "unknown")
#: MaterialX's names of spaces to those of USD's colour module.
_NAMES = {
    "acescg": "lin_ap1_scene",
    "lin_ap1": "lin_ap1_scene",
    "lin_ap0": "lin_ap0_scene",
    "aces2065-1": "lin_ap0_scene",
    "lin_rec2020": "lin_rec2020_scene",
    "lin_adobergb": "lin_adobergb_scene",
    "lin_displayp3": "lin_p3d65_scene",
    "lin_p3d65": "lin_p3d65_scene",
    "srgb_displayp3": "srgb_p3d65_scene",
    "srgb_p3d65": "srgb_p3d65_scene",
    "srgb_texture": "srgb_rec709_scene",
    "srgb": "srgb_rec709_scene",
    "adobergb": "g22_adobergb_scene",
    "g22_adobergb": "g22_adobergb_scene",
    "g22_rec709": "g22_rec709_scene",
    "gamma22": "g22_rec709_scene",
    "g18_rec709": "g18_rec709_scene",
    "gamma18": "g18_rec709_scene",
    "rec709_display": "g24_rec709_scene",
    "gamma24": "g24_rec709_scene",
    "g22_ap1": "g22_ap1_scene",
    "srgb_ap1": "srgb_ap1_scene",
}
_SRGB = "srgb_rec709_scene"


def known(name: str) -> bool:
    """Whether a space's name is known."""
    return name.lower() in _PLAIN or Gf.ColorSpace.IsValid(_full(name))


def is_plain(name: str) -> bool:
    """Whether values of the space are linear Rec.709, or no colours, as they stand."""
    return name.lower() in _PLAIN


def is_srgb(name: str) -> bool:
    """Whether the space is Rec.709 on the sRGB curve."""
    return _full(name) == _SRGB


def to_linear(values: np.ndarray, name: str) -> np.ndarray:
    """(P, 3 or 4) values of a known space in linear Rec.709; alpha stays."""
    if is_plain(name):
        return values
    gamma, bias, matrix = _transfer(_full(name))
    color = values[:, :3]
    if bias > 0:
        color = srgb_decode(color)
    elif gamma != 1.0:
        color = np.sign(color) * np.abs(color) ** gamma
    return np.concatenate([color @ matrix.T, values[:, 3:]], 1)


def _full(name: str) -> str:
    return _NAMES.get(name.lower(), name)


@cache
def _transfer(name: str) -> tuple[float, float, np.ndarray]:
    """Exponent, linear offset and (3, 3) matrix to Rec.709: the curve of 0 is 0 and of 1 is 1."""
    space, target = Gf.ColorSpace(name), Gf.ColorSpace("lin_rec709_scene")
    columns = [target.Convert(space, Gf.Vec3f(*unit)).GetRGB() for unit in np.eye(3).tolist()]
    return space.GetGamma(), space.GetLinearBias(), np.array(columns, np.float64).T
