"""The walk over a stage: which prims are drawn, and with which transforms."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pxr import Tf, Usd, UsdGeom, UsdProc, UsdShade

from .draw_modes import applies, inherited_mode
from .instances import Frame, expand
from .reading import Reading, one_line

#: Prims that stand in the world.
IN_WORLD = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
#: Prims under a point instancer's prototype, which may be an `over` or a `class`.
IN_PROTOTYPE = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)


@dataclass
class Visit:
    """A prim to be drawn.

    Attributes:
        prim: the prim, an instance proxy inside native instances.
        local: (4, 4) float64 transform from the prim to its frame, for row vectors.
        frame: where that frame is drawn.
        draw_mode: what to draw in place of a model; "default" for the prim itself.
        is_sound: whether it is known to be drawn once, with a transform that needs no check.
    """

    prim: Usd.Prim
    local: np.ndarray
    frame: Frame
    draw_mode: str = "default"
    is_sound: bool = False

    def transforms(self) -> np.ndarray:
        """(K, 4, 4) float64 prim-to-world."""
        return self.local @ self.frame.copies


@dataclass
class _Step:
    """A prim that the walk has still to look at, and what it inherits."""

    prim: Usd.Prim
    parent: np.ndarray
    frame: Frame
    purpose: UsdGeom.Imageable.PurposeInfo | None = None
    predicate: object = IN_WORLD
    draw_mode: str = "default"


def walk(reading: Reading) -> Iterator[Visit]:
    """Every drawable prim and light that is visible and of an included purpose, in namespace order.

    Where the others stand goes to `scene.frames`.

    Native instances are walked through as if they stood there; point instancers multiply the frames of their
    prototypes. An explicit stack: real stages nest deeper than Python recurses.
    """
    cache = UsdGeom.XformCache(reading.time)
    root = reading.stage.GetPseudoRoot()
    stack = [_Step(child, np.eye(4), Frame.world()) for child in reversed(root.GetFilteredChildren(IN_WORLD))]
    while stack:
        step = stack.pop()
        prim = step.prim
        if prim.IsA(UsdShade.Material) or not _is_visible(reading, prim):
            continue
        if reading.render_pass and reading.render_pass.prunes(prim):
            continue
        local = _local_transform(reading, cache, step)
        purpose = _purpose(prim, step.purpose)
        mode = inherited_mode(prim, step.draw_mode) if reading.draw_modes else "default"
        if mode != "default" and applies(prim):
            if _is_included(reading, prim, purpose):
                yield Visit(prim, local, step.frame, mode)
            continue
        if prim.IsA(UsdGeom.PointInstancer):
            if not step.frame.instancers:
                reading.scene.frames[str(prim.GetPath())] = local
            if _is_included(reading, prim, purpose):
                prototypes = reading.attempt(prim, expand, UsdGeom.PointInstancer(prim), local, step.frame)
                for prototype, frame in reversed(prototypes or []):
                    stack.append(_Step(prototype, np.eye(4), frame, purpose, IN_PROTOTYPE, mode))
            continue
        if _is_included(reading, prim, purpose):
            if _is_drawable(prim):
                yield Visit(prim, local, step.frame)
            else:
                _name_undrawn(reading, prim)
        if not step.frame.instancers and prim.IsA(UsdGeom.Xformable) and not _is_drawable(prim):
            reading.scene.frames[str(prim.GetPath())] = local
        for child in reversed(_children(reading, prim, step.predicate)):
            stack.append(_Step(child, local, step.frame, purpose, step.predicate, mode))


def _is_drawable(prim: Usd.Prim) -> bool:
    return prim.IsA(UsdGeom.Gprim) or is_light(prim)


def _name_undrawn(reading: Reading, prim: Usd.Prim) -> None:
    """Remark on prims that renderers with more plug-ins would draw; their children are walked all the same."""
    name = prim.GetTypeName()
    if prim.IsA(UsdProc.GenerativeProcedural):
        reading.remark(prim, f"{name} is not drawn: nothing here generates what it stands for")
    elif name and prim.GetPrimTypeInfo().GetSchemaType() == Tf.Type.Unknown:
        reading.remark(prim, f"its type {name} is not known to USD here, and the prim itself is not drawn")


def _children(reading: Reading, prim: Usd.Prim, predicate: object) -> list[Usd.Prim]:
    """The prim's children; of levels of detail the default one alone."""
    children = prim.GetFilteredChildren(predicate)
    if not prim.HasAPI("LODRootAPI") or not children:
        return children
    index = int(reading.get(prim.GetAttribute("lod:default:index")) or 0)
    shown = children[min(max(index, 0), len(children) - 1)]
    reading.remark(prim, f"of its {len(children)} levels of detail {shown.GetName()}, the default, is drawn")
    return [shown]


def is_light(prim: Usd.Prim) -> bool:
    """Whether the prim is a UsdLux light; geometry that shines is not one."""
    return prim.HasAPI("LightAPI") and not prim.IsA(UsdGeom.Gprim)


def is_portal(prim: Usd.Prim) -> bool:
    """Whether the prim is a portal, which gives no light of its own."""
    return prim.GetTypeName() == "PortalLight"


def is_mesh_light(prim: Usd.Prim) -> bool:
    """Whether the prim is geometry that shines by MeshLightAPI, or LightAPI alone."""
    return prim.HasAPI("LightAPI") and prim.IsA(UsdGeom.Gprim)


def _is_visible(reading: Reading, prim: Usd.Prim) -> bool:
    attribute = prim.GetAttribute("visibility") if prim.IsA(UsdGeom.Imageable) else None
    return reading.get(attribute) != UsdGeom.Tokens.invisible


def _purpose(prim: Usd.Prim, inherited: UsdGeom.Imageable.PurposeInfo | None) -> object:
    imageable = UsdGeom.Imageable(prim)
    if not imageable:
        return inherited
    return imageable.ComputePurposeInfo(inherited) if inherited else imageable.ComputePurposeInfo()


def _is_included(reading: Reading, prim: Usd.Prim, purpose: UsdGeom.Imageable.PurposeInfo | None) -> bool:
    if reading.render_pass and reading.render_pass.hides(prim):
        return False
    return purpose is None or str(purpose.purpose) in reading.purposes


def _local_transform(reading: Reading, cache: UsdGeom.XformCache, step: _Step) -> np.ndarray:
    """(4, 4) from the prim to its frame. A transform that cannot be evaluated counts as none."""
    if not step.prim.IsA(UsdGeom.Xformable):
        return step.parent
    try:
        matrix, resets = cache.GetLocalTransformation(step.prim)
    except Tf.ErrorException as error:
        reading.remark(step.prim, f"its transform is ignored: {one_line(error)}")
        return step.parent
    matrix = np.array(matrix, np.float64)
    with np.errstate(invalid="ignore"):
        return matrix if resets else matrix @ step.parent
