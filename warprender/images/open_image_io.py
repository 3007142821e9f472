"""What reading and writing both need of OpenImageIO."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import OpenImageIO as oiio


def spec_of(
    pixels: np.ndarray, channels: list[str] | None, kind: object, metadata: Mapping[str, str] | None
) -> oiio.ImageSpec:
    """The header of an image (H, W, C) of OpenImageIO's type `kind`, its channels named where names are given."""
    height, width, count = pixels.shape
    spec = oiio.ImageSpec(width, height, count, kind)
    if channels is not None:
        spec.channelnames = tuple(channels)
    for name, text in (metadata or {}).items():
        spec.attribute(name, text)
    return spec


def reason(message: str) -> str:
    """What OpenImageIO says of a failure, in one line; of a broken header it says a page, which is cut off."""
    words = " ".join(message.split()) or "OpenImageIO gives no reason"
    return words if len(words) <= 200 else f"{words[:200]} …"
