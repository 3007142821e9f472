"""Texel storage: pictures as pyramids of levels in one array of 32-bit words.

8-bit pictures keep a word a texel and are decoded when they are looked up; 16-bit ones take two words, floats four.
A level has half the size of the one before, and each of its texels is the mean of exactly the area that it covers,
taken after decoding. Rows run from the bottom, as texture coordinates do.

A pyramid takes 4/3 of its picture: 5.3 bytes a texel for 8 bits, 10.7 for 16 and 21.3 for floats. A scene's pictures
together stay below a budget, 2 GiB unless asked otherwise; the largest are halved until they fit, with a warning.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from .color import srgb_decode
from .images import Picture, read_picture

#: Texel formats in the order of their ids on the device, with their words a texel.
FORMATS = {"srgb8": 1, "raw8": 1, "raw16": 2, "half": 2, "float": 4}
FORMAT_IDS = {name: number for number, name in enumerate(FORMATS)}

#: Most bytes that the pictures of a scene take together.
TEXTURE_BYTES = 2 * 2**30
#: Rows are decoded in strips of about this many texels: a whole picture of floats would be four times its file.
_STRIP_TEXELS = 2**20

_FORMAT_OF_TYPE = {np.dtype(np.uint16): "raw16", np.dtype(np.float16): "half", np.dtype(np.float32): "float"}


def srgb_table() -> np.ndarray:
    """(256,) float32: linear values of the 8-bit codes."""
    return srgb_decode(np.arange(256) / 255.0).astype(np.float32)


def is_srgb(picture: Picture, source_color_space: str) -> bool:
    """Whether the colours take the sRGB curve: as asked, or for "auto" as UsdUVTexture says.

    That is: as the file's metadata has it, else for 8 bits with 3 or 4 channels, else not.
    """
    if source_color_space != "auto":
        return source_color_space == "sRGB"
    stated = picture.metadata
    if stated.get("Exif:ColorSpace") == 1 or "sRGB" in str(stated.get("ICCProfile:profile_description", "")):
        return True
    if str(stated.get("oiio:ColorSpace", "")).startswith("lin"):
        return False
    return picture.pixels.dtype == np.uint8 and picture.pixels.shape[2] >= 3


def rgba(pixels: np.ndarray) -> np.ndarray:
    """(H, W, 4) of (H, W, 1 … 4): one channel is grey, two are grey and alpha, three are opaque."""
    channels = pixels.shape[2]
    if channels == 4:
        return pixels
    opaque = 1.0 if pixels.dtype.kind == "f" else np.iinfo(pixels.dtype).max
    result = np.full((*pixels.shape[:2], 4), opaque, pixels.dtype)
    result[..., :3] = pixels[..., :1] if channels < 3 else pixels
    if channels == 2:
        result[..., 3] = pixels[..., 1]
    return result


def decoded(texels: np.ndarray, srgb: bool) -> np.ndarray:
    """(…, 4) float32 values of stored texels; alpha never takes the curve."""
    if texels.dtype == np.uint8:
        values = texels.astype(np.float32) / np.float32(255.0)
        if srgb:
            values[..., :3] = srgb_table()[texels[..., :3]]
        return values
    values = texels.astype(np.float32)
    if texels.dtype == np.uint16:
        values /= np.float32(65535.0)
    if srgb:
        values[..., :3] = srgb_decode(values[..., :3])
    return values


def encoded(values: np.ndarray, dtype: np.dtype, srgb: bool) -> np.ndarray:
    """Stored texels of (…, 4) float32 values, rounded to the nearest."""
    if dtype == np.uint8:
        codes = values * np.float32(255.0)
        if srgb:
            # The code whose linear value is nearest: halves between neighbours decide.
            table = srgb_table()
            codes[..., :3] = np.searchsorted((table[1:] + table[:-1]) / 2, values[..., :3])
        return np.round(codes).astype(np.uint8)
    if dtype == np.uint16:
        return np.round(values * np.float32(65535.0)).astype(np.uint16)
    return values.astype(dtype)


def reduced(values: np.ndarray, height: int, width: int) -> np.ndarray:
    """(height, width, 4) means of a larger array over equal areas, texels that are cut weighted by their parts."""
    return _box(_box(values, 0, height), 1, width)


def _box(values: np.ndarray, axis: int, size: int) -> np.ndarray:
    count = values.shape[axis]
    if count == size:
        return values
    values = np.moveaxis(values, axis, 0)
    if count == 2 * size:
        means = (values[0::2] + values[1::2]) * np.float32(0.5)
    else:
        ends = np.arange(size + 1) * (count / size)
        whole = np.minimum(ends.astype(np.int64), count - 1)
        sums = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, 0, dtype=np.float64)])
        at_ends = sums[whole] + values[whole] * (ends - whole).reshape(-1, *[1] * (values.ndim - 1))
        means = (np.diff(at_ends, axis=0) * (size / count)).astype(np.float32)
    return np.moveaxis(means, 0, axis)


def halved(texels: np.ndarray, srgb: bool) -> np.ndarray:
    """The float32 values of the next level (H', W', 4) of stored texels, decoded strip by strip."""
    height, width = max(1, texels.shape[0] // 2), max(1, texels.shape[1] // 2)
    if texels.shape[0] % 2 or texels.shape[0] * texels.shape[1] <= _STRIP_TEXELS:
        return reduced(decoded(texels, srgb), height, width)
    result = np.empty((height, width, 4), np.float32)
    rows = max(1, _STRIP_TEXELS // texels.shape[1] // 2)
    for first in range(0, height, rows):
        strip = decoded(texels[2 * first : 2 * (first + rows)], srgb)
        result[first : first + rows] = reduced(strip, len(strip) // 2, width)
    return result


def pyramid(picture: Picture, srgb: bool, halvings: int = 0) -> tuple[str, list[np.ndarray]]:
    """Format and levels, finest first, each (H, W, 4) from the bottom row up, after leaving out some halvings."""
    texels = rgba(picture.pixels)[::-1]
    if srgb and texels.dtype != np.uint8:
        texels, srgb = decoded(texels, True), False
    dtype = texels.dtype
    name = _FORMAT_OF_TYPE.get(dtype, "srgb8" if srgb else "raw8")
    levels = [texels]
    values = None
    while levels[-1].shape[:2] != (1, 1):
        source = levels[-1]
        height, width = max(1, source.shape[0] // 2), max(1, source.shape[1] // 2)
        values = halved(source, srgb) if values is None else reduced(values, height, width)
        levels.append(encoded(values, dtype, srgb))
    return name, levels[min(halvings, len(levels) - 1) :]


@lru_cache(maxsize=1024)
def _file_range(file: str, stamp: tuple, source_color_space: str) -> tuple[np.ndarray, np.ndarray]:
    return picture_range(read_picture(file), source_color_space)


def picture_range(picture: Picture, source_color_space: str) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest decoded value of each channel, (4,) float32 each."""
    texels = rgba(picture.pixels).reshape(-1, 4)
    ends = np.stack([np.fmin.reduce(texels), np.fmax.reduce(texels)])
    low, high = decoded(ends, is_srgb(picture, source_color_space))
    return low, high


def file_range(file: str, source_color_space: str) -> tuple[np.ndarray, np.ndarray]:
    """`picture_range` of a file, which is read once as long as it does not change; raises as `read_picture`."""
    outer = file.split("[", 1)[0]
    stamp = (os.stat(outer).st_mtime_ns, os.stat(outer).st_size) if os.path.isfile(outer) else ()
    return _file_range(file, stamp, source_color_space)


@dataclass
class TexelPool:
    """Pictures packed for a device.

    Attributes:
        budget: most bytes of texels.
        words: (N,) uint32, all texels.
        levels: (first word, width, height) of each level.
        pictures: (format id, number of the first level, count of levels) of each picture.
        warnings: one line for each picture that was made smaller.
    """

    budget: int = TEXTURE_BYTES
    words: np.ndarray = field(default_factory=lambda: np.zeros(0, np.uint32))
    levels: list[tuple[int, int, int]] = field(default_factory=list)
    pictures: list[tuple[int, int, int]] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    _blocks: list[np.ndarray] = field(default_factory=list)
    _used: int = 0

    def add(self, picture: Picture, source_color_space: str, halvings: int = 0) -> int:
        """Number of a picture, stored without its finest `halvings` levels."""
        name, levels = pyramid(picture, is_srgb(picture, source_color_space), halvings)
        self.pictures.append((FORMAT_IDS[name], len(self.levels), len(levels)))
        for level in levels:
            self.levels.append((self._used, level.shape[1], level.shape[0]))
            words = np.ascontiguousarray(level).reshape(-1).view(np.uint32)
            self._blocks.append(words)
            self._used += len(words)
        return len(self.pictures) - 1

    def close(self) -> None:
        """Join what was added into `words`."""
        self.words = np.empty(self._used, np.uint32)
        first = 0
        while self._blocks:
            block = self._blocks.pop(0)
            self.words[first : first + len(block)] = block
            first += len(block)


def halvings_within(sizes: Iterable[int], budget: int) -> list[int]:
    """How often each picture of these sizes in bytes is halved, the largest first, until all fit the budget."""
    sizes = list(sizes)
    halvings = [0] * len(sizes)
    while sum(sizes) > budget and max(sizes) > 64:
        largest = int(np.argmax(sizes))
        sizes[largest] //= 4
        halvings[largest] += 1
    return halvings
