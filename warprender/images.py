"""Image files, all by OpenImageIO: 8-bit pictures, Radiance HDR, and EXR with one layer for each output.

Pictures for display (PNG, JPEG, TIFF) hold what usdrecord writes: colour as it comes from the renderer, that
is premultiplied by alpha, through the sRGB curve. PNG calls its colour unassociated, so on an empty
background a viewer darkens the rims of objects; draw a dome light, or take EXR, where premultiplied is the
convention.

EXR keeps every value: floats as 32-bit floats, int32 as 32-bit unsigned integers of the same bits (EXR
knows no signed ones), so -1, "nothing here", is stored as 4294967295 and `read` turns it back. OpenImageIO
takes one type for each part, hence integers go into a second part named "integers".
"""

from __future__ import annotations

import io
import os
import tempfile
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from .color import srgb_encode

#: Extensions by what they hold.
DISPLAY_FORMATS = (".png", ".jpg", ".jpeg", ".tif", ".tiff")
LAYERED_FORMATS = (".exr",)
LINEAR_FORMATS = (".hdr",)

#: Choices of usdrecord's --colorCorrectionMode.
COLOR_CORRECTIONS = ("sRGB", "disabled", "openColorIO")

#: What configurations call linear Rec.709.
REC709_NAMES = ("lin_rec709_scene", "lin_rec709", "Linear Rec.709 (sRGB)")

_HALF_MAX = 65504.0
_COLOR_LAYERS = ("color", "albedo", "standardError")


def check_destination(path: str | Path) -> None:
    """Raise ValueError, naming `path`, where it cannot become an image: to be asked before rendering."""
    path = Path(path)
    known = DISPLAY_FORMATS + LAYERED_FORMATS + LINEAR_FORMATS
    if path.is_dir():
        raise ValueError(f"{path}: is a folder")
    if path.suffix.lower() not in known:
        raise ValueError(f"{path}: unknown image extension {path.suffix!r}; known are {' '.join(known)}")
    if not path.parent.is_dir():
        raise ValueError(f"{path}: the folder {path.parent} does not exist")


def kept(path: str | Path, outputs: Iterable[str]) -> list[str]:
    """Those of the outputs that the format of `path` keeps: all in EXR, `color` in the others."""
    return [name for name in outputs if name == "color" or Path(path).suffix.lower() in LAYERED_FORMATS]


def write(
    path: str | Path,
    layers: Mapping[str, np.ndarray],
    metadata: Mapping[str, str] | None = None,
    color_correction: str = "sRGB",
    half: bool = False,
    display: tuple[int, int, int, int] | None = None,
) -> None:
    """Write what the extension of `path` holds: every layer (.exr), or the layer `color` (all others).

    Args:
        path: the file; its folder must exist.
        layers: output name to (H, W) or (H, W, C) array, float or int32.
        metadata: attribute name to text.
        color_correction: as in `display_bytes`; for display formats alone.
        half: 16-bit floats; for EXR alone.
        display: column and row of the first pixel in the display window, and that window's width and height; for EXR
            alone, the others hold the pixels and nothing else. None: the pixels fill it.

    Raises:
        ValueError: an unknown extension, a missing folder, no layer `color`, a file that cannot be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    check_destination(path)
    if not kept(path, layers):
        raise ValueError(f"{path}: {suffix} holds color alone, and there is none; .exr holds all")
    if suffix in LAYERED_FORMATS:
        return write_exr(path, layers, metadata, half, display)
    if suffix in LINEAR_FORMATS:
        return _write_hdr(path, layers["color"], metadata)
    return write_png(path, layers["color"], metadata, color_correction)


def write_png(
    path: str | Path,
    rgba: np.ndarray,
    metadata: Mapping[str, str] | None = None,
    color_correction: str = "sRGB",
) -> None:
    """Write an 8-bit picture: PNG, or JPEG or TIFF by extension; JPEG drops alpha.

    Args:
        path: the file; its folder must exist.
        rgba: (H, W, 3 or 4) float, premultiplied linear Rec.709, row 0 at the top.
        metadata: attribute name to text.
        color_correction: as in `display_bytes`; "disabled" writes linear values and says so in the file.

    Raises:
        ValueError: the file cannot be written, or an unknown `color_correction`.
    """
    check_destination(path)
    pixels = display_bytes(rgba, color_correction)
    suffix = Path(path).suffix.lower()
    if suffix in (".jpg", ".jpeg"):
        pixels = np.ascontiguousarray(pixels[..., :3])
    spec = _spec(pixels, None, oiio.UINT8, metadata)
    if suffix == ".png":
        # Colours are written as they are: without this OpenImageIO divides them by alpha.
        spec.attribute("oiio:UnassociatedAlpha", 1)
    spec.attribute("oiio:ColorSpace", "lin_rec709" if color_correction == "disabled" else "sRGB")
    _write_parts(path, [(spec, pixels)])


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
            raise ValueError(f"{file}: no OpenColorIO configuration: {_oiio_reason(fault)}")


def _displayed(values: np.ndarray) -> np.ndarray:
    """Linear Rec.709 (H, W, C) through the configuration's default view; the scene's space where it has no Rec.709."""
    config = oiio.ColorConfig(os.environ["OCIO"])
    spaces = {*config.getColorSpaceNames(), *(a for n in config.getColorSpaceNames() for a in config.getAliases(n))}
    source = next((name for name in REC709_NAMES if name in spaces), "scene_linear")
    pixels = np.ascontiguousarray(values, np.float32)
    buffer = oiio.ImageBuf(_spec(pixels, None, oiio.FLOAT, None))
    buffer.set_pixels(oiio.ROI(), pixels)
    display = config.getDefaultDisplayName()
    view, file = config.getDefaultViewName(display), os.environ["OCIO"]
    seen = oiio.ImageBufAlgo.ociodisplay(buffer, display, view, source, "", False, colorconfig=file)
    if seen.has_error:
        raise ValueError(f"{file}: {_oiio_reason(seen.geterror())}")
    return seen.get_pixels(oiio.FLOAT).astype(np.float64)


def write_exr(
    path: str | Path,
    layers: Mapping[str, np.ndarray],
    metadata: Mapping[str, str] | None = None,
    half: bool = False,
    display: tuple[int, int, int, int] | None = None,
) -> None:
    """Write every layer: `color` as R, G, B, A, any other as NAME.Z, NAME.X,Y,Z, NAME.R,G,B or NAME.id.

    Args:
        path: the file; its folder must exist.
        layers: output name to (H, W) or (H, W, C) array of one height and width, float or int32.
        metadata: attribute name to text, stored in the first part.
        half: 16-bit floats; finite values beyond 65504 become 65504. Integers keep their 32 bits.
        display: as in `write`.

    Raises:
        ValueError: the file cannot be written, or layers of different sizes.
    """
    check_destination(path)
    if len({np.shape(a)[:2] for a in layers.values()}) != 1:
        raise ValueError(f"{path}: an EXR needs one or more layers, all of one height and width")
    floats = {n: a for n, a in layers.items() if not np.issubdtype(np.asarray(a).dtype, np.integer)}
    integers = {n: a for n, a in layers.items() if n not in floats}
    parts = []
    if floats:
        names, pixels = _stack(floats, np.float32)
        if half:
            pixels = np.where(np.isfinite(pixels), np.clip(pixels, -_HALF_MAX, _HALF_MAX), pixels)
        parts.append(_exr_part("main", names, pixels, oiio.HALF if half else oiio.FLOAT, metadata))
    if integers:
        names, pixels = _stack(integers, np.int32)
        metadata = None if parts else metadata
        parts.append(_exr_part("integers", names, pixels.view(np.uint32), oiio.UINT32, metadata))
    for spec, _ in parts:
        if display is not None:
            spec.x, spec.y, spec.full_width, spec.full_height = display
    _write_parts(path, parts)


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
            raise ValueError(f"{path}: cannot be read: {_oiio_reason(source.geterror())}")
        pixels = pixels.reshape(spec.height, spec.width, spec.nchannels)
        layers |= _unstack(spec.channelnames, pixels.view(np.int32) if integers else pixels)
        part += 1
    source.close()
    return layers, metadata


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


#: OpenImageIO's types that are kept as they are; all others become float32.
_KEPT_TYPES = {oiio.UINT8: np.uint8, oiio.UINT16: np.uint16, oiio.HALF: np.float16}


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
            raise ValueError(f"{path}: cannot be read: {_oiio_reason(source.geterror())}")
        pixels = np.asarray(pixels).view(dtype).reshape(spec.height, spec.width, spec.nchannels)
        channels = _color_channels(spec.channelnames)
        if channels != list(range(spec.nchannels)):
            pixels = np.ascontiguousarray(pixels[..., channels])
        return Picture(pixels, {a.name: a.value for a in spec.extra_attribs})


@dataclass(frozen=True)
class PictureHeader:
    """What is known of a picture without its pixels; `itemsize` is the bytes of a channel."""

    height: int
    width: int
    itemsize: int
    metadata: Mapping[str, object]


def picture_header(path: str) -> PictureHeader:
    """The header of the file that `read_picture` reads; raises as it does."""
    with unpacked(path) as file:
        spec = _open_as_stored(file, path).spec()
        itemsize = np.dtype(_KEPT_TYPES.get(spec.format.basetype, np.float32)).itemsize
        return PictureHeader(spec.height, spec.width, itemsize, {a.name: a.value for a in spec.extra_attribs})


def exists(path: str) -> bool:
    """Whether there is a file, which may lie in a package."""
    file, *inner = _package_chain(path)
    if not inner:
        return os.path.isfile(path)
    try:
        return inner[0] in zipfile.ZipFile(file).namelist()
    except (OSError, zipfile.BadZipFile):
        return False


def _open_as_stored(file: str, path: str) -> oiio.ImageInput:
    """Open with alpha left alone; `path` names the file in messages."""
    as_stored = oiio.ImageSpec()
    as_stored.attribute("oiio:UnassociatedAlpha", 1)
    source = oiio.ImageInput.open(file, as_stored)
    if source is None:
        raise ValueError(f"{path}: cannot be read: {_oiio_reason(oiio.geterror())}")
    return source


def _color_channels(names: tuple[str, ...]) -> list[int]:
    """Positions of R, G, B and A where the file names them, else of the first channels, four at most."""
    found = [names.index(letter) for letter in "RGBA" if letter in names]
    return found if len(found) >= 3 else list(range(min(len(names), 4)))


def _package_chain(path: str) -> list[str]:
    """The file, then the paths in the packages that it nests: "a.usdz[b.usdz[c.png]]" has three, "c.png" one."""
    return path.rstrip("]").split("[") if path.endswith("]") else [path]


@contextmanager
def unpacked(path: str) -> Iterator[str]:
    """The path of a file that can be opened; a copy in the temporary folder for one in a package.

    OpenImageIO reads from memory too, but its Python package does not offer it.
    """
    file, *inner = _package_chain(path)
    if not inner:
        yield path
        return
    try:
        data = Path(file).read_bytes()
        for name in inner:
            data = zipfile.ZipFile(io.BytesIO(data)).read(name)
    except (OSError, KeyError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path}: cannot be read: {error}") from None
    with tempfile.TemporaryDirectory() as folder:
        file = os.path.join(folder, Path(inner[-1]).name)
        Path(file).write_bytes(data)
        yield file


def _write_hdr(path: Path, rgba: np.ndarray, metadata: Mapping[str, str] | None) -> None:
    pixels = np.ascontiguousarray(np.asarray(rgba, np.float32)[..., :3])
    _write_parts(path, [(_spec(pixels, None, oiio.FLOAT, metadata), pixels)])


def _exr_part(name: str, channels: list[str], pixels: np.ndarray, kind: object, metadata) -> tuple:
    spec = _spec(pixels, channels, kind, metadata)
    spec.attribute("compression", "zip")
    spec.attribute("oiio:subimagename", name)
    return spec, pixels


def _spec(pixels: np.ndarray, channels: list[str] | None, kind: object, metadata) -> oiio.ImageSpec:
    height, width, count = pixels.shape
    spec = oiio.ImageSpec(width, height, count, kind)
    if channels is not None:
        spec.channelnames = tuple(channels)
    for name, text in (metadata or {}).items():
        spec.attribute(name, text)
    return spec


def _stack(layers: Mapping[str, np.ndarray], dtype: type) -> tuple[list[str], np.ndarray]:
    """Channel names, and all channels as one contiguous (H, W, C) array."""
    names, planes = [], []
    for name, array in layers.items():
        array = np.asarray(array).astype(dtype, copy=False)
        array = array.reshape(*array.shape[:2], -1)
        names += _channel_names(name, array.shape[2], dtype is np.int32)
        planes.append(array)
    return names, np.ascontiguousarray(np.concatenate(planes, axis=2))


def _channel_names(layer: str, count: int, integers: bool) -> list[str]:
    if count == 1:
        letters = ["id" if integers else "Z"]
    elif count == 4 or layer.partition(":")[0] in _COLOR_LAYERS:
        letters = list("RGBA"[:count])
    else:
        letters = list("XYZ"[:count])
    return letters if layer == "color" else [f"{layer}.{c}" for c in letters]


def _unstack(channels: tuple[str, ...], pixels: np.ndarray) -> dict[str, np.ndarray]:
    """The layers of `_stack` from channels in any order: EXR stores them by name."""
    members: dict[str, list[tuple[str, int]]] = {}
    for index, channel in enumerate(channels):
        layer, _, letter = channel.rpartition(".")
        members.setdefault(layer or "color", []).append((letter, index))
    layers = {}
    for layer, found in members.items():
        order = [index for _, index in sorted(found, key=lambda c: "XYZRGBA".find(c[0]))]
        layers[layer] = pixels[..., order] if len(order) > 1 else pixels[..., order[0]]
    return layers


def _write_parts(path: str | Path, parts: list[tuple]) -> None:
    """Write (spec, pixels) pairs as the parts of one file."""
    target = oiio.ImageOutput.create(str(path))
    if target is None:
        raise ValueError(f"{path}: cannot be written: {_oiio_reason(oiio.geterror())}")
    specs = tuple(spec for spec, _ in parts)
    for index, (spec, pixels) in enumerate(parts):
        if index == 0:
            opened = target.open(str(path), specs if len(specs) > 1 else spec)
        else:
            opened = target.open(str(path), spec, "AppendSubimage")
        if not opened or not target.write_image(pixels):
            raise ValueError(f"{path}: cannot be written: {_oiio_reason(target.geterror())}")
    if not target.close():
        raise ValueError(f"{path}: cannot be written: {_oiio_reason(target.geterror())}")


def _oiio_reason(message: str) -> str:
    return " ".join(message.split()) or "OpenImageIO gives no reason"
