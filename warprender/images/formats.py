"""Which files can be written, and what each format keeps."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

#: Extensions by what they hold.
DISPLAY_FORMATS = (".png", ".jpg", ".jpeg", ".tif", ".tiff")
LAYERED_FORMATS = (".exr",)
LINEAR_FORMATS = (".hdr",)


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
