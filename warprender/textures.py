"""Textures: what UsdUVTexture, UsdTransform2d and UsdPrimvarReader say, and filtered look-up on the device."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import warp as wp

from .images import Picture, exists, picture_header, read_picture
from .records import DeviceScene
from .texels import FORMAT_IDS, file_range, picture_range

#: Wrap modes in the order of their ids on the device; "useMetadata" becomes one of them.
WRAPS = ("black", "clamp", "repeat", "mirror")
#: OpenImageIO's names for them in files.
_WRAP_OF_FILE = {"black": "black", "clamp": "clamp", "periodic": "repeat", "mirror": "mirror"}

CHANNELS = ("r", "g", "b", "a", "rgb")
COLOR_SPACES = ("raw", "sRGB", "auto")

#: UDIM tiles 1001 … 1100, ten in a row.
FIRST_TILE, TILES = 1001, 100


@dataclass(frozen=True)
class PrimvarReader:
    """UsdPrimvarReader: what a material or a texture reads from the shape.

    Attributes:
        varname: name of the primvar, without "primvars:".
        fallback: 1 to 4 numbers that stand for it, `matrix` included, where the shape has no such primvar.
        matrix: a row for each number that is read: weights of the primvar's components and an offset. Empty, they are
            read as they are.
    """

    varname: str
    fallback: tuple[float, ...] = (0.0,)
    matrix: tuple[tuple[float, ...], ...] = ()


@dataclass(eq=False)
class Texture:
    """UsdUVTexture seen through UsdTransform2d; names and fallbacks as in the specification.

    Attributes:
        file: a path, also of a file in a package (`a.usdz[b.png]`) and with `<UDIM>`; or an (H, W, 1 … 4) array of
            uint8, uint16, float16 or float32, row 0 at the top.
        channel: "r", "g", "b" or "a" for one number, "rgb" for a colour.
        wrapS: "black", "clamp", "repeat", "mirror", or "useMetadata", which is "black" where the file says nothing.
        wrapT: the same along t.
        sourceColorSpace: "raw", "sRGB", or "auto".
        scale: multiplies the four channels.
        bias: is added then.
        fallback: stands for the result, scale and bias included, where the file cannot be read.
        st: where the texture coordinates come from; two numbers see one place.
        transform: (2, 3), coordinates on the picture are transform · (s, t, 1).
        prim: the node's path, to name it in warnings.

    Raises:
        ValueError: `channel`, a wrap mode or `sourceColorSpace` is none of these, or `transform` has another shape. A
            file that cannot be read is no error: the renderer warns and takes `fallback`.
    """

    file: str | os.PathLike | np.ndarray
    channel: str = "rgb"
    wrapS: str = "useMetadata"
    wrapT: str = "useMetadata"
    sourceColorSpace: str = "auto"
    scale: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0)
    bias: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    fallback: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0)
    st: PrimvarReader | tuple[float, float] = field(default_factory=lambda: PrimvarReader("st", (0.0, 0.0)))
    transform: np.ndarray = field(default_factory=lambda: np.eye(2, 3))
    prim: str = ""

    def __post_init__(self) -> None:
        if isinstance(self.file, os.PathLike):
            self.file = os.fspath(self.file)
        self.transform = np.asarray(self.transform, np.float64).reshape(2, 3)
        choices = {
            "channel": CHANNELS,
            "wrapS": (*WRAPS, "useMetadata"),
            "wrapT": (*WRAPS, "useMetadata"),
            "sourceColorSpace": COLOR_SPACES,
        }
        for name, known in choices.items():
            if getattr(self, name) not in known:
                raise ValueError(f"{name} {getattr(self, name)!r} is not one of {', '.join(known)}")

    @property
    def name(self) -> str:
        """The file, or what stands in its place in messages."""
        return self.file if isinstance(self.file, str) else f"an array of shape {self.file.shape}"

    @property
    def is_tiled(self) -> bool:
        """Whether the file is a set of UDIM tiles."""
        return isinstance(self.file, str) and "<UDIM>" in self.file

    def sources(self) -> Iterator[tuple[int, str | np.ndarray]]:
        """UDIM tile number and file or array of each picture; 0 where there are no tiles."""
        if not self.is_tiled:
            yield 0, self.file
            return
        for tile in range(FIRST_TILE, FIRST_TILE + TILES):
            file = self.file.replace("<UDIM>", str(tile))
            if exists(file):
                yield tile, file

    def wraps(self) -> tuple[int, int]:
        """Ids of the wrap modes along s and t; tiles are clamped, as their neighbours are other files."""
        if self.is_tiled:
            return WRAPS.index("clamp"), WRAPS.index("clamp")
        stated = ""
        if "useMetadata" in (self.wrapS, self.wrapT) and isinstance(self.file, str):
            stated = str(picture_header(self.file).metadata.get("wrapmodes", ""))
        modes = stated.split(",")
        ids = []
        for wrap, mode in zip((self.wrapS, self.wrapT), (modes[0], modes[-1]), strict=True):
            ids.append(WRAPS.index(_WRAP_OF_FILE.get(mode, "black") if wrap == "useMetadata" else wrap))
        return ids[0], ids[1]

    def least(self) -> float:
        """The least value that the texture may give in its (first) channel, outside and fallback included."""
        channel = "rgba".index(self.channel[0])
        values = []
        try:
            for _, source in self.sources():
                low, high = _range(source, self.sourceColorSpace)
                values += [low[channel], high[channel]]
        except ValueError:
            values = []
        if not values:
            return float(self.fallback[channel])
        if not self.is_tiled and {self.wrapS, self.wrapT} & {"black", "useMetadata"}:
            values.append(0.0)
        results = [value * self.scale[channel] + self.bias[channel] for value in values]
        return float(min(*results, self.fallback[channel]) if self.is_tiled else min(results))


def as_picture(source: str | np.ndarray) -> Picture:
    """The picture of a file or array.

    Raises:
        ValueError: the file cannot be read, or the array is no picture.
    """
    if isinstance(source, str):
        return read_picture(source)
    pixels = np.asarray(source)
    pixels = pixels[..., None] if pixels.ndim == 2 else pixels
    if pixels.dtype == np.float64:
        pixels = pixels.astype(np.float32)
    if pixels.ndim != 3 or not 1 <= pixels.shape[2] <= 4 or pixels.size == 0:
        raise ValueError(f"an array of shape {np.shape(source)} is no picture")
    if pixels.dtype not in (np.uint8, np.uint16, np.float16, np.float32):
        raise ValueError(f"an array of {pixels.dtype} is no picture; it takes uint8, uint16, float16 or float32")
    return Picture(pixels, {})


def pyramid_bytes(source: str | np.ndarray) -> int:
    """Bytes that the pyramid of a file or array takes, from its header alone; raises as `as_picture`."""
    if isinstance(source, str):
        header = picture_header(source)
        return header.height * header.width * header.itemsize * 4 * 4 // 3
    pixels = as_picture(source).pixels
    return pixels.shape[0] * pixels.shape[1] * pixels.itemsize * 4 * 4 // 3


def _range(source: str | np.ndarray, color_space: str) -> tuple[np.ndarray, np.ndarray]:
    if isinstance(source, str):
        return file_range(source, color_space)
    return picture_range(as_picture(source), color_space)


SRGB8 = wp.constant(wp.int32(FORMAT_IDS["srgb8"]))
RAW8 = wp.constant(wp.int32(FORMAT_IDS["raw8"]))
RAW16 = wp.constant(wp.int32(FORMAT_IDS["raw16"]))
HALF = wp.constant(wp.int32(FORMAT_IDS["half"]))

BLACK = wp.constant(wp.int32(WRAPS.index("black")))
REPEAT = wp.constant(wp.int32(WRAPS.index("repeat")))
MIRROR = wp.constant(wp.int32(WRAPS.index("mirror")))

#: A box-filtered level seen through a bilinear tent has the variance of a box of √3 of its texels: a footprint of
#: that many texels belongs to the level.
_TEXELS_OF_FOOTPRINT = wp.constant(wp.float32(3.0**0.5))
#: Look-ups along the longer axis of a footprint, at most.
_MOST_PROBES = wp.constant(wp.int32(8))


@wp.struct
class Footprint:
    """A place on a picture, and the two axes of the area around it that a look-up stands for; all in its widths."""

    st: wp.vec2
    along: wp.vec2
    across: wp.vec2


@wp.func
def low_half(word: wp.uint32) -> wp.uint32:
    """The lower 16 bits."""
    return word & wp.uint32(0xFFFF)


@wp.func
def half_value(bits: wp.uint32) -> float:
    """The value of 16 bits of a half."""
    return wp.float32(wp.cast(wp.uint16(bits), wp.float16))


@wp.func
def texel(scene: DeviceScene, format: int, index: int) -> wp.vec4:
    """The decoded texel whose first word has this number."""
    word = scene.texels[index]
    if format <= RAW8:
        r = wp.int32(word & wp.uint32(0xFF))
        g = wp.int32((word >> wp.uint32(8)) & wp.uint32(0xFF))
        b = wp.int32((word >> wp.uint32(16)) & wp.uint32(0xFF))
        a = wp.float32(word >> wp.uint32(24)) / 255.0
        if format == SRGB8:
            return wp.vec4(scene.decode[r], scene.decode[g], scene.decode[b], a)
        return wp.vec4(wp.float32(r) / 255.0, wp.float32(g) / 255.0, wp.float32(b) / 255.0, a)
    second = scene.texels[index + 1]
    sixteen = wp.uint32(16)
    if format == RAW16:
        return (
            wp.vec4(
                wp.float32(low_half(word)),
                wp.float32(word >> sixteen),
                wp.float32(low_half(second)),
                wp.float32(second >> sixteen),
            )
            / 65535.0
        )
    if format == HALF:
        return wp.vec4(
            half_value(low_half(word)),
            half_value(word >> sixteen),
            half_value(low_half(second)),
            half_value(second >> sixteen),
        )
    return wp.vec4(
        wp.cast(word, wp.float32),
        wp.cast(second, wp.float32),
        wp.cast(scene.texels[index + 2], wp.float32),
        wp.cast(scene.texels[index + 3], wp.float32),
    )


@wp.func
def words_of(format: int) -> int:
    """Words a texel."""
    if format <= RAW8:
        return 1
    return wp.where(format <= HALF, 2, 4)


@wp.func
def folded(x: float, wrap: int) -> float:
    """A coordinate brought near [0, 1]; what is not finite becomes 0."""
    if not wp.isfinite(x):
        return 0.0
    if wrap == REPEAT:
        return x - wp.floor(x)
    if wrap == MIRROR:
        y = x - 2.0 * wp.floor(0.5 * x)
        return wp.where(y > 1.0, 2.0 - y, y)
    return wp.clamp(x, -1.0, 2.0)


@wp.func
def wrapped(i: int, size: int, wrap: int) -> int:
    """Texel number of the neighbour i, which may lie outside by one size; -1 is outside of a black border."""
    if i >= 0 and i < size:
        return i
    if wrap == REPEAT:
        return wp.where(i < 0, i + size, i - size)
    if wrap == BLACK:
        return -1
    return wp.clamp(i, 0, size - 1)


@wp.func
def texel_or_black(scene: DeviceScene, format: int, first: int, width: int, x: int, y: int) -> wp.vec4:
    """A texel of a level, transparent black for coordinates of -1."""
    if x < 0 or y < 0:
        return wp.vec4(0.0, 0.0, 0.0, 0.0)
    return texel(scene, format, first + (y * width + x) * words_of(format))


@wp.func
def bilinear(scene: DeviceScene, format: int, level: int, st: wp.vec2, wrap_s: int, wrap_t: int) -> wp.vec4:
    """Interpolation of the four texels around st."""
    width = scene.levels[level].width
    height = scene.levels[level].height
    first = scene.levels[level].first
    x = folded(st[0], wrap_s) * wp.float32(width) - 0.5
    y = folded(st[1], wrap_t) * wp.float32(height) - 0.5
    i = wp.int32(wp.floor(x))
    j = wp.int32(wp.floor(y))
    fx = x - wp.float32(i)
    fy = y - wp.float32(j)
    x0 = wrapped(i, width, wrap_s)
    x1 = wrapped(i + 1, width, wrap_s)
    y0 = wrapped(j, height, wrap_t)
    y1 = wrapped(j + 1, height, wrap_t)
    low = texel_or_black(scene, format, first, width, x0, y0) * (1.0 - fx)
    low += texel_or_black(scene, format, first, width, x1, y0) * fx
    high = texel_or_black(scene, format, first, width, x0, y1) * (1.0 - fx)
    high += texel_or_black(scene, format, first, width, x1, y1) * fx
    return low * (1.0 - fy) + high * fy


@wp.func
def picture_at(scene: DeviceScene, picture: int, place: Footprint, wrap_s: int, wrap_t: int) -> wp.vec4:
    """The mean of a picture over a footprint: look-ups along its longer axis, each as wide as the shorter one.

    Each look-up is in the two levels around its width.
    """
    format = scene.pictures[picture].format
    finest = scene.pictures[picture].level
    size = wp.vec2(wp.float32(scene.levels[finest].width), wp.float32(scene.levels[finest].height))
    along = wp.length(wp.cw_mul(place.along, size))
    across = wp.length(wp.cw_mul(place.across, size))
    axis = place.along
    if across > along:
        axis = place.across
    longer = wp.max(wp.max(along, across), 1.0)
    shorter = wp.max(wp.min(along, across), 1.0)
    probes = wp.clamp(wp.int32(wp.ceil(wp.min(longer / shorter, 1.0e4))), 1, _MOST_PROBES)
    width = wp.max(shorter, longer / wp.float32(probes))
    level = wp.clamp(wp.log2(width / _TEXELS_OF_FOOTPRINT), 0.0, wp.float32(scene.pictures[picture].levels - 1))
    nearer = wp.int32(level)
    coarser_part = level - wp.float32(nearer)
    total = wp.vec4(0.0, 0.0, 0.0, 0.0)
    for k in range(2 * probes):
        weight = wp.where(k < probes, 1.0 - coarser_part, coarser_part)
        if weight > 0.0:
            coarser = wp.where(k < probes, 0, 1)
            shift = (wp.float32(k - coarser * probes) + 0.5) / wp.float32(probes) - 0.5
            st = place.st + axis * shift
            total += bilinear(scene, format, finest + nearer + coarser, st, wrap_s, wrap_t) * weight
    return total / wp.float32(probes)


@wp.func
def texture_at(scene: DeviceScene, node: int, place: Footprint) -> wp.vec4:
    """Result of a texture node for coordinates before its transform: texel, scale and bias, or the fallback."""
    moved = Footprint()
    moved.st = scene.inputs[node].linear * place.st + scene.inputs[node].offset
    moved.along = scene.inputs[node].linear * place.along
    moved.across = scene.inputs[node].linear * place.across
    picture = scene.inputs[node].picture
    if scene.inputs[node].tiles >= 0:
        column = wp.floor(moved.st[0])
        row = wp.floor(moved.st[1])
        picture = wp.int32(-1)
        if column >= 0.0 and column < 10.0 and row >= 0.0 and row < 10.0:
            picture = scene.tiles[scene.inputs[node].tiles + wp.int32(row) * 10 + wp.int32(column)]
            moved.st = moved.st - wp.vec2(column, row)
    if picture < 0:
        return scene.inputs[node].fallback
    value = picture_at(scene, picture, moved, scene.inputs[node].wrap_s, scene.inputs[node].wrap_t)
    return wp.cw_mul(value, scene.inputs[node].scale) + scene.inputs[node].bias
