"""Files that may lie in a package, as in `folder/model.usdz[textures/wood.png]`."""

from __future__ import annotations

import io
import os
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def exists(path: str) -> bool:
    """Whether there is a file, which may lie in a package."""
    file, *inner = _package_chain(path)
    if not inner:
        return os.path.isfile(path)
    try:
        return inner[0] in zipfile.ZipFile(file).namelist()
    except (OSError, zipfile.BadZipFile):
        return False


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


def _package_chain(path: str) -> list[str]:
    """The file, then the paths in the packages that it nests: "a.usdz[b.usdz[c.png]]" has three, "c.png" one."""
    return path.rstrip("]").split("[") if path.endswith("]") else [path]
