"""Linear colours as 8-bit pictures show them: the sRGB curve, or a view of an OpenColorIO configuration."""

from __future__ import annotations

import os

import numpy as np
import OpenImageIO as oiio

from ..color import srgb_encode
from .open_image_io import reason, spec_of

#: Choices of usdrecord's --colorCorrectionMode.
COLOR_CORRECTIONS = ("sRGB", "disabled", "openColorIO")

#: What configurations call linear Rec.709.
REC709_NAMES = ("lin_rec709_scene", "lin_rec709", "Linear Rec.709 (sRGB)")


def display_bytes(rgba: np.ndarray, color_correction: str = "sRGB") -> np.ndarray:
    """(H, W, C) uint8 of linear colours: NaN becomes 0, all is clamped to [0, 1], colours take the curve.

    Args:
        rgba: (H, W, C) linear Rec.709.
        color_correction: "sRGB", "disabled", or "openColorIO": the default view of the default display in the
            configuration that the environment variable OCIO names, before the clamp.

    Raises:
        ValueError: an unknown `color_correction`, or a configuration that cannot be used.
    """
    check_color_correction(color_correction)
    values = np.nan_to_num(np.asarray(rgba, np.float64), nan=0.0)
    if color_correction == "openColorIO":
        values = _displayed(values)
    values = np.clip(values, 0.0, 1.0)
    if color_correction == "sRGB":
        values[..., :3] = srgb_encode(values[..., :3])
    return np.round(values * 255.0).astype(np.uint8, order="C")


def check_color_correction(color_correction: str) -> None:
    """Raise ValueError where colours cannot be corrected so: to be asked before rendering."""
    if color_correction not in COLOR_CORRECTIONS:
        raise ValueError(f"colour correction {color_correction!r} is none of {', '.join(COLOR_CORRECTIONS)}")
    if color_correction == "openColorIO":
        file = os.environ.get("OCIO", "")
        if not file:
            raise ValueError("colour correction openColorIO: the environment variable OCIO names no configuration")
        if fault := oiio.ColorConfig(file).geterror():
            raise ValueError(f"{file}: no OpenColorIO configuration: {reason(fault)}")


def _displayed(values: np.ndarray) -> np.ndarray:
    """Linear Rec.709 (H, W, C) through the configuration's default view; the scene's space where it has no Rec.709."""
    config = oiio.ColorConfig(os.environ["OCIO"])
    spaces = {*config.getColorSpaceNames(), *(a for n in config.getColorSpaceNames() for a in config.getAliases(n))}
    source = next((name for name in REC709_NAMES if name in spaces), "scene_linear")
    pixels = np.ascontiguousarray(values, np.float32)
    buffer = oiio.ImageBuf(spec_of(pixels, None, oiio.FLOAT, None))
    buffer.set_pixels(oiio.ROI(), pixels)
    display = config.getDefaultDisplayName()
    view, file = config.getDefaultViewName(display), os.environ["OCIO"]
    seen = oiio.ImageBufAlgo.ociodisplay(buffer, display, view, source, "", False, colorconfig=file)
    if seen.has_error:
        raise ValueError(f"{file}: {reason(seen.geterror())}")
    return seen.get_pixels(oiio.FLOAT).astype(np.float64)
