"""UsdLux lights."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from pxr import Usd, UsdLux

from ..lights import DiskLight, DistantLight, DomeLight, Light, RectLight, SphereLight
from .reading import Reading

#: Prim type to the light that draws it. Without a texture the two dome schemas are one light.
KINDS: dict[str, type[Light]] = {
    "SphereLight": SphereLight,
    "RectLight": RectLight,
    "DiskLight": DiskLight,
    "DistantLight": DistantLight,
    "DomeLight": DomeLight,
    "DomeLight_1": DomeLight,
}

#: Fields that are no UsdLux inputs: the walk and the schema decide them.
NOT_INPUTS = ("transform", "direction")

#: Half-angle in degrees from which a cone cuts nothing off, for lights that emit to one side only.
OPEN_CONE = {"RectLight": 90.0, "DiskLight": 90.0}


def read_light(reading: Reading, prim: Usd.Prim) -> Light | None:
    """A light prim without its transform; None, with a remark, where it cannot be drawn."""
    kind = KINDS.get(prim.GetTypeName())
    if kind is None:
        reading.remark(prim, f"{prim.GetTypeName()} is not drawn yet")
        return None
    light = kind()
    for field in fields(kind):
        if field.name in NOT_INPUTS:
            continue
        value = _input(reading, prim, field.name)
        if value is not None:
            setattr(light, field.name, _converted(value, getattr(light, field.name)))
    if not all(np.isfinite(np.asarray(getattr(light, f.name), np.float64)).all() for f in fields(kind)):
        reading.remark(prim, "it has inputs that are not finite and is not drawn")
        return None
    _remark_unread(reading, prim)
    return light


def _input(reading: Reading, prim: Usd.Prim, name: str) -> object:
    """An authored input, under its name of today or without the prefix as in stages before 21.02."""
    for attribute in (prim.GetAttribute(f"inputs:{name}"), prim.GetAttribute(name)):
        if attribute and attribute.HasAuthoredValue():
            return reading.get(attribute)
    return None


def _converted(value: object, default: object) -> object:
    if isinstance(default, tuple):
        return tuple(float(v) for v in value)
    return type(default)(value)


def _remark_unread(reading: Reading, prim: Usd.Prim) -> None:
    """Remarks on what is authored, would change the picture, and is not drawn yet."""
    unread = [name for name, effective in _unread(reading, prim) if effective]
    for name in unread:
        reading.remark(prim, f"{name} is not drawn yet")


def _unread(reading: Reading, prim: Usd.Prim) -> list[tuple[str, bool]]:
    def value(name: str, default: float) -> float:
        found = _input(reading, prim, name)
        return default if found is None else found

    shaped = prim.HasAPI("ShapingAPI")
    shadowed = prim.HasAPI("ShadowAPI")
    open_cone = OPEN_CONE.get(prim.GetTypeName(), 180.0)
    api = UsdLux.LightAPI(prim)
    return [
        ("texture:file", bool(_asset(value("texture:file", "")))),
        ("shaping:ies:file", bool(_asset(value("shaping:ies:file", "")))),
        ("shaping:focus", value("shaping:focus", 0.0) > 0),
        ("shaping:cone", value("shaping:cone:angle", 90.0 if shaped else 180.0) < open_cone),
        ("shadow:enable", shadowed and not value("shadow:enable", True)),
        ("shadow:color", shadowed and any(value("shadow:color", ()))),
        ("shadow:distance", shadowed and value("shadow:distance", -1.0) >= 0),
        ("light:filters", bool(api.GetFiltersRel().GetTargets())),
        ("collection:lightLink", _excludes(api.GetLightLinkCollectionAPI())),
        ("collection:shadowLink", _excludes(api.GetShadowLinkCollectionAPI())),
        ("portals", bool(prim.GetRelationship("portals") and prim.GetRelationship("portals").GetTargets())),
    ]


def _asset(value: object) -> str:
    return getattr(value, "path", "") or ""


def _excludes(collection: Usd.CollectionAPI) -> bool:
    """Whether a linking collection leaves anything of the stage out."""
    root = collection.GetIncludeRootAttr()
    expression = collection.GetMembershipExpressionAttr()
    return bool(
        collection.GetExcludesRel().GetTargets()
        or (root and root.HasAuthoredValue() and not root.Get())
        or (expression and expression.HasAuthoredValue())
    )
