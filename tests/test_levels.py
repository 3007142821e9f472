"""A file imports only from lower levels, and `pxr` is imported at the edges alone: CONTRIBUTING.md, "Levels"."""

import ast
from pathlib import Path

import warprender

PACKAGE = Path(warprender.__file__).parent

#: Files and folders of the package by level.
LEVELS = (
    {"numerics", "sampling", "nets", "color", "launch", "watched", "errors", "given"},
    {"records", "images", "denoise", "shutter", "picture_settings", "stopping", "filters", "noise"},
    {"texels", "textures", "texture_lookup"},
    {"materials", "lights", "shapes", "camera", "outputs", "bodies", "lenses"},
    {"scene", "placement", "scene_arguments", "scene_shapes", "material_tables"},
    {"emitters", "plan", "framing"},
    {"visibility", "film"},
    {"adaptive", "integrators", "upload", "upload_shapes", "upload_placed"}
    | {"upload_lights", "upload_light_pictures", "upload_light_tree", "upload_glow"}
    | {"attaching", "checks", "receipt"},
    {"frame", "films", "live", "viewpoint", "hit_finders", "renderer", "gonioreflectometer"},
    {"usd", "sensors", "newton", "newton_shapes", "testing", "study", "cli"},
    {"__init__", "__main__"},
)
LEVEL = {name: number for number, names in enumerate(LEVELS) for name in names}

#: Neighbours on one level of which the first needs the second.
NEIGHBOURS = {
    ("sampling", "numerics"),
    ("materials", "shapes"),
    ("lights", "shapes"),
    ("textures", "texels"),
    ("texture_lookup", "textures"),
    ("texture_lookup", "texels"),
    ("scene", "placement"),
    ("scene", "scene_arguments"),
    ("scene", "scene_shapes"),
    ("scene_shapes", "scene_arguments"),
    ("plan", "emitters"),
    ("upload", "upload_lights"),
    ("upload", "upload_shapes"),
    ("upload", "attaching"),
    ("upload", "upload_placed"),
    ("upload_placed", "upload_shapes"),
    ("upload_lights", "upload_placed"),
    ("upload_lights", "upload_light_pictures"),
    ("upload_lights", "upload_light_tree"),
    ("upload_light_tree", "upload_glow"),
    ("films", "frame"),
    ("upload_lights", "upload_glow"),
    ("renderer", "frame"),
    ("renderer", "films"),
    ("renderer", "live"),
    ("renderer", "viewpoint"),
    ("renderer", "hit_finders"),
    ("cli", "study"),
    ("newton", "newton_shapes"),
    ("__main__", "__init__"),
}
EDGES = {"usd", "cli"}


def imports(file):
    """Top-level parts of the package that a file imports from, and "pxr"."""
    parts = file.relative_to(PACKAGE).with_suffix("").parts
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = parts[: len(parts) - node.level]
            for target in [node.module] if node.module else [alias.name for alias in node.names]:
                yield (*base, *target.split("."))[0]
        elif isinstance(node, ast.ImportFrom):
            yield node.module.split(".")[0]
        elif isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)


def test_every_part_has_a_level():
    parts = {path.stem for path in PACKAGE.iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()}
    assert parts <= set(LEVEL)


def test_imports_go_down():
    wrong = []
    for file in sorted(PACKAGE.rglob("*.py")):
        part = file.relative_to(PACKAGE).with_suffix("").parts[0]
        for target in set(imports(file)) - {part}:
            if target == "warprender":
                wrong.append(f"{file.name} imports warprender by name")
            if target == "pxr" and part not in EDGES:
                wrong.append(f"{file.name} imports pxr")
            if target in LEVEL and LEVEL[target] >= LEVEL[part] and (part, target) not in NEIGHBOURS:
                wrong.append(f"{part}/{file.name} imports {target}")
    assert not wrong
