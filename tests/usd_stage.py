"""Small stages written in the tests themselves."""

import re

from pxr import Usd

from warprender.scene import Scene
from warprender.usd import load


def stage_of(text: str, metadata: str = "") -> Usd.Stage:
    """A stage of usda text, in which braces and prims need no lines of their own."""
    text = text.replace("{", "{\n").replace("}", "\n}\n")
    text = re.sub(r"\b(def|class|over) ", r"\n\1 ", text)
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(f"#usda 1.0\n({metadata}\n)\n{text}\n")
    return stage


def scene_of(text: str, metadata: str = "", **options) -> Scene:
    """The scene of a stage of usda text."""
    return load(stage_of(text, metadata), **options)
