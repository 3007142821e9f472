"""What the readers of one stage share: its time, the scene being filled, and the remarks made on the way."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeVar

from pxr import Ar, Sdf, Tf, Usd, UsdUtils

from ..lights import IesProfile, LightTexture
from ..scene import Scene
from ..shapes import Mesh, Sphere

if TYPE_CHECKING:
    from ..shapes.subdivision import Subdivision
    from .passes import RenderPass
    from .skeletons import Skin

T = TypeVar("T")

#: A remark made on more prims than this is reported once, with a count.
LISTED_PRIMS = 3

#: How USD ends a diagnostic of composition: what it was doing, the stage's file once more and an address.
_CIRCUMSTANCES = re.compile(r" \((?:instantiating|recomposing)[^()]* on stage @.*\)$")


@dataclass
class Reading:
    """One pass over one stage.

    Attributes:
        stage: the stage being read.
        time: time code at which every attribute is read.
        purposes: purposes that are drawn; "default" is one of them.
        level: subdivision level, 0 draws the cage.
        scene: the scene being filled.
        draw_modes: whether models may be drawn as boxes, axes or cards.
        render_pass: the pass that is drawn, None for all of the stage.
        shapes: shapes read so far by what determines them, so that instances share one.
        primvars: primvars that are read from every shape, with their numbers of components, None for any.
        sources: prim and skin that a shape was read from, by its key in `shapes`; shapes that do not depend on
            one have none.
        surfaces: the last subdivision surface of a mesh, by its path.
        skins: what poses a mesh, by the mesh's path.
        placed: placement's path to the paths of its prim and of the instancers that draw it.
        light_textures: pictures on lights read so far, by file and format; None for one that cannot be read.
        profiles: photometric profiles read so far, by file; None for one that cannot be read.
        portals: PortalLights that domes name.
        sound_instancers: whether USD's own code may look at the point instancers without crashing.
        semantics: labels found so far, by prim.
        remarks: message to the prims that it is about: the path that stands in the scene, by the path of the
            prim itself, which instances share.
    """

    stage: Usd.Stage
    time: Usd.TimeCode
    purposes: frozenset[str]
    level: int = 0
    scene: Scene = field(default_factory=Scene)
    draw_modes: bool = True
    render_pass: RenderPass | None = None
    shapes: dict[tuple, Mesh | Sphere | None] = field(default_factory=dict)
    primvars: dict[str, int | None] = field(default_factory=lambda: {"displayColor": 3, "displayOpacity": 1})
    sound_instancers: bool = True
    sources: dict[tuple, tuple[Usd.Prim, Skin | None]] = field(default_factory=dict)
    surfaces: dict[str, Subdivision] = field(default_factory=dict)
    skins: dict[str, Skin] = field(default_factory=dict)
    placed: dict[str, tuple[Sdf.Path, ...]] = field(default_factory=dict)
    light_textures: dict[tuple[str, str], LightTexture | None] = field(default_factory=dict)
    profiles: dict[str, IesProfile | None] = field(default_factory=dict)
    portals: set[Sdf.Path] = field(default_factory=set)
    semantics: dict[Sdf.Path, str] = field(default_factory=dict)
    remarks: dict[str, dict[str, str]] = field(default_factory=dict)

    def remark(self, prim: Usd.Prim, message: str) -> None:
        """Note that something about `prim` is not drawn as the stage asks, once for all its instances."""
        paths = self.remarks.setdefault(message, {})
        paths.setdefault(str(shared_prim(prim).GetPath()), str(prim.GetPath()))

    def attempt(self, prim: Usd.Prim, read: Callable[..., T], *arguments: object) -> T | None:
        """`read(self, *arguments)`, or None and a remark where it fails.

        Real files hold values that no reader foresees; one such prim must not cost the picture.
        """
        try:
            return read(self, *arguments)
        except Exception as error:
            self.remark(prim, f"it cannot be read: {type(error).__name__}: {one_line(error)}")
            return None

    def get(self, attribute: Usd.Attribute) -> object:
        """The attribute's value at the time of the reading, None where there is none."""
        return attribute.Get(self.time) if attribute else None

    def report(self) -> None:
        """Turn the remarks into the scene's warnings, one line each, a summary where one would be many."""
        for message, paths in self.remarks.items():
            shown = list(paths.values())
            if len(shown) <= LISTED_PRIMS:
                for path in shown:
                    self.scene.warn(f"{path}: {message}")
            else:
                self.scene.warn(f"{shown[0]} and {len(shown) - 1} more prims: {message}")


class Diagnostics:
    """Keeps what USD's C++ code would print on stderr; `lines` has it after the `with` block."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def __enter__(self) -> Diagnostics:
        self._delegate = UsdUtils.CoalescingDiagnosticDelegate()
        return self

    def __exit__(self, *_) -> None:
        for diagnostic in self._delegate.TakeUncoalescedDiagnostics():
            line = one_line(diagnostic.commentary)
            if line not in self.lines:
                self.lines.append(line)
        del self._delegate


def shared_prim(prim: Usd.Prim) -> Usd.Prim:
    """The prim of the prototype that an instance proxy stands for; any other prim itself."""
    return prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim


def one_line(message: object) -> str:
    """The text of a USD diagnostic or exception in one line, without source files and line numbers."""
    if isinstance(message, Tf.ErrorException):
        parts = str(message).split(" : '", 1)
        message = parts[-1].split("'\n")[0].rstrip("'\n")
    return _CIRCUMSTANCES.sub("", " ".join(str(message).split()))


def asset_bytes(path: str) -> bytes:
    """What a file holds, which may lie in a package: `lamp.usdz[beam.ies]`.

    Raises:
        ValueError: it cannot be opened.
    """
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
    if not asset:
        raise ValueError("it cannot be opened")
    with asset:
        return bytes(asset.GetBuffer())
