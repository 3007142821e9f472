"""Files as they are: layers of a picture that was rendered, or pixels to be looked up as a texture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from .layers import unstack
from .open_image_io import reason
from .packages import unpacked

#: OpenImageIO's types that are kept as they are; all others become float32.
_KEPT_TYPES = {oiio.UINT8: np.uint8, oiio.UINT16: np.uint16, oiio.HALF: np.float16}


@dataclass(frozen=True)
class Picture:
    """An image that is looked up as a texture, as its file holds it.

    Attributes:
        pixels: (H, W, C) uint8, uint16, float16 or float32, row 0 at the top, C from 1 to 4: grey, grey and alpha,
            colour, colour and alpha. Neither curve nor alpha is undone.
        metadata: attribute name to value.
    """

    pixels: np.ndarray
    metadata: Mapping[str, object]


@dataclass(frozen=True)
class PictureHeader:
    """What is known of a picture without its pixels; `itemsize` is the bytes of a channel."""

    height: int
    width: int
    itemsize: int
    metadata: Mapping[str, object]


def read(path: str | Path) -> tuple[dict[str, np.ndarray], dict[str, object]]:
    """Read an image as the file holds it: neither curve nor alpha is undone.

    Returns:
        Layers, name to (H, W) or (H, W, C) array, and the first part's attributes, name to value. A layer is
        float32 (8-bit values become k / 255) or int32; channels without a layer name are the layer `color`.

    Raises:
        ValueError: the file is missing or is no image; the message names it.
    """
    source = _open_as_stored(str(path), str(path))
    layers: dict[str, np.ndarray] = {}
    metadata = {a.name: a.value for a in source.spec().extra_attribs}
    part = 0
    while source.seek_subimage(part, 0):
        spec = source.spec()
        integers = spec.format.basetype in (oiio.UINT32, oiio.INT32)
        pixels = source.read_image(part, 0, 0, spec.nchannels, oiio.UINT32 if integers else oiio.FLOAT)
        if pixels is None:
            raise ValueError(f"{path}: cannot be read: {reason(source.geterror())}")
        pixels = pixels.reshape(spec.height, spec.width, spec.nchannels)
        layers |= unstack(spec.channelnames, pixels.view(np.int32) if integers else pixels)
        part += 1
    source.close()
    return layers, metadata


def read_picture(path: str) -> Picture:
    """Read the first part of an image, which may lie in a package: `folder/model.usdz[textures/wood.png]`.

    Raises:
        ValueError: the file is missing, is no image or has no pixels; the message names it.
    """
    with unpacked(path) as file:
        source = _open_as_stored(file, path)
        spec = source.spec()
        kind = spec.format.basetype
        dtype = _KEPT_TYPES.get(kind, np.float32)
        pixels = source.read_image(0, 0, 0, spec.nchannels, kind if kind in _KEPT_TYPES else oiio.FLOAT)
        if pixels is None or pixels.size == 0:
            raise ValueError(f"{path}: cannot be read: {reason(source.geterror())}")
        pixels = np.asarray(pixels).view(dtype).reshape(spec.height, spec.width, spec.nchannels)
        channels = _color_channels(spec.channelnames)
        if channels != list(range(spec.nchannels)):
            pixels = np.ascontiguousarray(pixels[..., channels])
        return Picture(pixels, {a.name: a.value for a in spec.extra_attribs})


def picture_header(path: str) -> PictureHeader:
    """The header of the file that `read_picture` reads; raises as it does."""
    with unpacked(path) as file:
        spec = _open_as_stored(file, path).spec()
        itemsize = np.dtype(_KEPT_TYPES.get(spec.format.basetype, np.float32)).itemsize
        return PictureHeader(spec.height, spec.width, itemsize, {a.name: a.value for a in spec.extra_attribs})


def _open_as_stored(file: str, path: str) -> oiio.ImageInput:
    """Open with alpha left alone; `path` names the file in messages."""
    as_stored = oiio.ImageSpec()
    as_stored.attribute("oiio:UnassociatedAlpha", 1)
    source = oiio.ImageInput.open(file, as_stored)
    if source is None:
        raise ValueError(f"{path}: cannot be read: {reason(oiio.geterror())}")
    return source


def _color_channels(names: tuple[str, ...]) -> list[int]:
    """Positions of R, G, B and A where the file names them, else of the first channels, four at most."""
    found = [names.index(letter) for letter in "RGBA" if letter in names]
    return found if len(found) >= 3 else list(range(min(len(names), 4)))
