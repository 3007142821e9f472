"""Imports run downwards: each file only knows what lies below it, and `pxr` stays at the edges."""

import ast
from pathlib import Path

import pytest

import warprender

ROOT = Path(warprender.__file__).parent

#: What may import from where: everything below its own level. Parts of one level do not know each other.
LEVELS = [
    ["numerics", "color", "launch"],
    ["sampling"],
    ["records", "images"],
    ["textures"],
    ["shapes"],
    ["materials", "lights", "camera", "outputs"],
    ["scene"],
    ["plan", "framing", "upload"],
    # The film's record is what integrators write into.
    ["visibility", "film", "frame", "receipt"],
    ["integrators"],
    ["renderer"],
    ["usd", "sensors", "study"],
    ["cli"],
    ["__main__"],
]
FILES = sorted(ROOT.rglob("*.py"))


def level(part):
    return next(i for i, names in enumerate(LEVELS) if part in names)


def imported(path):
    """First parts of the package's modules that a file imports anywhere, and names of other packages."""
    inside, outside = set(), set()
    folder = path.relative_to(ROOT).parts[:-1]
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            outside |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            outside.add(node.module.split(".")[0])
        elif isinstance(node, ast.ImportFrom):
            base = folder[: len(folder) - node.level + 1]
            names = [node.module] if node.module else [alias.name for alias in node.names]
            inside |= {[*base, *name.split(".")][0] for name in names}
    return inside, outside


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_run_downwards(path):
    inside, outside = imported(path)
    here = path.relative_to(ROOT).parts[0].removesuffix(".py")
    if here != "__init__":
        # Names that are no file, as `__version__`, are the package's own: only its edges may ask for them.
        parts = {other if any(other in names for names in LEVELS) else "cli" for other in inside} - {here}
        assert all(level(other) < level(here) for other in parts), parts
    assert "pxr" not in outside or here in ("usd", "cli")


def test_every_file_has_a_level():
    parts = {path.relative_to(ROOT).parts[0].removesuffix(".py") for path in FILES} - {"__init__"}
    assert parts <= {part for names in LEVELS for part in names}
