"""What UsdLux lights say beyond their own inputs: ShapingAPI, ShadowAPI, and the collections of linking."""

from __future__ import annotations

from pxr import Sdf, Usd, UsdLux

from ..lights import IesProfile, Shadow, Shaping
from .reading import Reading, asset_bytes


def light_input(reading: Reading, prim: Usd.Prim, name: str) -> object:
    """An authored input, under its name of today or, with a remark, without the prefix as in stages before 21.05.

    A few, such as `treatAsPoint`, never had the prefix: the prim's schema names them as they are.
    """
    for attribute in (prim.GetAttribute(f"inputs:{name}"), prim.GetAttribute(name)):
        if attribute and attribute.HasAuthoredValue():
            named = prim.GetPrimDefinition().GetPropertyNames()
            if not attribute.GetName().startswith("inputs:") and name not in named:
                reading.remark(
                    prim, "its inputs have the names of before OpenUSD 21.05, without inputs:; they are taken"
                )
            return reading.get(attribute)
    return None


def asset_path(value: Sdf.AssetPath | None) -> str:
    """Where an asset lies; the path as written where nothing is found; "" for none."""
    return (value.resolvedPath or value.path) if value is not None else ""


def read_shaping(reading: Reading, prim: Usd.Prim) -> Shaping:
    """The prim's shaping. The schema's cone of 90 degrees counts where the schema is applied or the cone authored."""
    values = {
        "focus": light_input(reading, prim, "shaping:focus"),
        "focusTint": light_input(reading, prim, "shaping:focusTint"),
        "coneAngle": light_input(reading, prim, "shaping:cone:angle"),
        "coneSoftness": light_input(reading, prim, "shaping:cone:softness"),
        "iesAngleScale": light_input(reading, prim, "shaping:ies:angleScale"),
        "iesNormalize": light_input(reading, prim, "shaping:ies:normalize"),
        "iesProfile": _profile(reading, prim),
    }
    if values["coneAngle"] is None and prim.HasAPI("ShapingAPI"):
        values["coneAngle"] = 90.0
    return Shaping(**_authored(values))


def read_shadow(reading: Reading, prim: Usd.Prim) -> Shadow:
    """The prim's shadow controls, which count where ShadowAPI is applied."""
    if not prim.HasAPI("ShadowAPI"):
        return Shadow()
    names = ("enable", "color", "distance", "falloff", "falloffGamma")
    return Shadow(**_authored({name: light_input(reading, prim, f"shadow:{name}") for name in names}))


def read_links(reading: Reading, prim: Usd.Prim) -> tuple[frozenset[str], frozenset[str]]:
    """Placements that the light does not shine on, and those that cast no shadow of it."""
    api = UsdLux.LightAPI(prim)
    return (
        _left_out(reading, api.GetLightLinkCollectionAPI()),
        _left_out(reading, api.GetShadowLinkCollectionAPI()),
    )


def _authored(values: dict[str, object]) -> dict[str, object]:
    """The values that there are; colours as tuples."""
    found = {name: value for name, value in values.items() if value is not None}
    return {name: tuple(map(float, v)) if name in ("color", "focusTint") else v for name, v in found.items()}


def _left_out(reading: Reading, collection: Usd.CollectionAPI) -> frozenset[str]:
    """Placements that are not members. Copies of a prototype are members where it and its instancers are."""
    if not restricts(collection):
        return frozenset()
    query = collection.ComputeMembershipQuery()
    return frozenset(
        placement
        for placement, paths in reading.placed.items()
        if not all(query.IsPathIncluded(path) for path in paths)
    )


def restricts(collection: Usd.CollectionAPI) -> bool:
    """Whether anything is authored that could leave a prim of the stage out."""
    root = collection.GetIncludeRootAttr()
    expression = collection.GetMembershipExpressionAttr()
    return bool(
        collection.GetExcludesRel().GetTargets()
        or (root and root.HasAuthoredValue() and not root.Get())
        or (expression and expression.HasAuthoredValue())
    )


def _profile(reading: Reading, prim: Usd.Prim) -> IesProfile | None:
    """The photometric profile; None without one, with a remark where there should be one."""
    asset = light_input(reading, prim, "shaping:ies:file")
    path = asset_path(asset) if isinstance(asset, Sdf.AssetPath) else ""
    if not path:
        return None
    if path not in reading.profiles:
        try:
            reading.profiles[path] = IesProfile.parse(asset_bytes(path).decode("latin-1"))
        except ValueError as error:
            reading.remark(prim, f"it is drawn without its profile: {path}: {error}")
            reading.profiles[path] = None
    return reading.profiles[path]
