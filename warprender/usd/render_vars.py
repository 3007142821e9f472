"""UsdRenderVar: which outputs a product's variables ask for."""

from __future__ import annotations

import re

from pxr import Usd, UsdRender

from ..outputs import OUTPUTS, term_of
from .reading import Reading

#: Other renderers' names of outputs, in lower case: RenderMan's, Arnold's, Karma's.
ALIASES = {
    "rgba": "color",
    "rgb": "color",
    "c": "color",
    "ci": "color",
    "beauty": "color",
    "z": "cameraDepth",
    "n": "normal",
    "nn": "normal",
    "normals": "normal",
    "p": "position",
    "id": "primId",
}

#: Light path expressions of all light: from the camera over anything to a light or to what glows.
ALL_LIGHT = re.compile(r"C(\.\*|\[DS\]\*|<\.\*>\*)(\[?(<L\.?>|L|O)*\]?)")


def read_vars(reading: Reading, product: Usd.Prim) -> tuple[str, ...]:
    """The outputs of a product's orderedVars, each once; color without any. What there is not gets a remark."""
    targets = UsdRender.Product(product).GetOrderedVarsRel().GetForwardedTargets()
    outputs = []
    for path in targets:
        prim = reading.stage.GetPrimAtPath(path)
        if not prim or not prim.IsA(UsdRender.Var):
            reading.remark(product, f"its variable {path} is no RenderVar prim")
            continue
        name = output_of(*source_of(reading, prim))
        if name:
            outputs.append(name)
        else:
            kind, source = source_of(reading, prim)
            reading.remark(prim, f"there is no output for {kind} {source!r}, and it is left out")
    return tuple(dict.fromkeys(outputs)) or ("color",)


def source_of(reading: Reading, prim: Usd.Prim) -> tuple[str, str]:
    """Type and name of a variable's source; one without a name is named like its prim."""
    kind = str(reading.get(prim.GetAttribute("sourceType")) or "raw")
    name = str(reading.get(prim.GetAttribute("sourceName")) or prim.GetName())
    if name.startswith("lpe:"):
        return "lpe", name[len("lpe:") :]
    return kind, name


def output_of(kind: str, name: str) -> str:
    """The output for a source, "" where there is none."""
    if kind == "lpe":
        return "color" if ALL_LIGHT.fullmatch("".join(name.split()).replace("'", "")) else ""
    if kind not in ("raw", "intrinsic"):
        return ""
    if name in OUTPUTS or name == "color" or term_of(name) is not None:
        return name
    return ALIASES.get(name.lower(), "")
