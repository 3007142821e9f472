"""Files of all formats, written by OpenImageIO."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from .display import display_bytes
from .formats import LAYERED_FORMATS, LINEAR_FORMATS, check_destination, kept
from .layers import stack
from .open_image_io import reason, spec_of

#: The largest number of 16 bits.
_HALF_MAX = 65504.0


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
    spec = spec_of(pixels, None, oiio.UINT8, metadata)
    if suffix == ".png":
        # Colours are written as they are: without this OpenImageIO divides them by alpha.
        spec.attribute("oiio:UnassociatedAlpha", 1)
    spec.attribute("oiio:ColorSpace", "lin_rec709" if color_correction == "disabled" else "sRGB")
    _write_parts(path, [(spec, pixels)])


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
        names, pixels = stack(floats, np.float32)
        if half:
            pixels = np.where(np.isfinite(pixels), np.clip(pixels, -_HALF_MAX, _HALF_MAX), pixels)
        parts.append(_exr_part("main", names, pixels, oiio.HALF if half else oiio.FLOAT, metadata))
    if integers:
        names, pixels = stack(integers, np.int32)
        metadata = None if parts else metadata
        parts.append(_exr_part("integers", names, pixels.view(np.uint32), oiio.UINT32, metadata))
    for spec, _ in parts:
        if display is not None:
            spec.x, spec.y, spec.full_width, spec.full_height = display
    _write_parts(path, parts)


def _write_hdr(path: Path, rgba: np.ndarray, metadata: Mapping[str, str] | None) -> None:
    pixels = np.ascontiguousarray(np.asarray(rgba, np.float32)[..., :3])
    _write_parts(path, [(spec_of(pixels, None, oiio.FLOAT, metadata), pixels)])


def _exr_part(name: str, channels: list[str], pixels: np.ndarray, kind: object, metadata) -> tuple:
    spec = spec_of(pixels, channels, kind, metadata)
    spec.attribute("compression", "zip")
    spec.attribute("oiio:subimagename", name)
    return spec, pixels


def _write_parts(path: str | Path, parts: list[tuple]) -> None:
    """Write (spec, pixels) pairs as the parts of one file."""
    target = oiio.ImageOutput.create(str(path))
    if target is None:
        raise ValueError(f"{path}: cannot be written: {reason(oiio.geterror())}")
    specs = tuple(spec for spec, _ in parts)
    for index, (spec, pixels) in enumerate(parts):
        if index == 0:
            opened = target.open(str(path), specs if len(specs) > 1 else spec)
        else:
            opened = target.open(str(path), spec, "AppendSubimage")
        if not opened or not target.write_image(pixels):
            raise ValueError(f"{path}: cannot be written: {reason(target.geterror())}")
    if not target.close():
        raise ValueError(f"{path}: cannot be written: {reason(target.geterror())}")
