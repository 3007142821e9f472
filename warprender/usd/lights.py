"""UsdLux lights: kinds, inputs, textures. What their further schemas say is read in `light_apis`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import fields, replace

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdLux

from .. import images
from ..color import srgb_decode
from ..lights import (
    CylinderLight,
    DiskLight,
    DistantLight,
    DomeLight,
    Light,
    LightTexture,
    MeshLight,
    PortalLight,
    RectLight,
    Shadow,
    Shaping,
    SphereLight,
)
from ..lights.environment import FORMATS, to_latlong
from ..lights.light import MOST_SIZE, MOST_STRENGTH
from ..lights.mesh import SYNC_MODES
from .light_apis import asset_path, light_input, read_links, read_shadow, read_shaping
from .reading import Reading

#: Prim type to the light that draws it.
KINDS: dict[str, type[Light]] = {
    "SphereLight": SphereLight,
    "RectLight": RectLight,
    "DiskLight": DiskLight,
    "CylinderLight": CylinderLight,
    "DistantLight": DistantLight,
    "DomeLight": DomeLight,
    "DomeLight_1": DomeLight,
    "GeometryLight": MeshLight,
}


def read_light(reading: Reading, prim: Usd.Prim) -> Light | None:
    """A light prim without its transform; None, with a remark, where it cannot be drawn."""
    kind = KINDS.get(prim.GetTypeName())
    if kind is None:
        reading.remark(prim, f"{prim.GetTypeName()} is not drawn yet")
        return None
    light = _with_inputs(reading, prim, kind())
    if light is None:
        return None
    if isinstance(light, DomeLight):
        light.poleAxis = _pole_axis(reading, prim)
        light.portals = tuple(_portals(reading, prim))
    if isinstance(light, DomeLight | RectLight):
        light.texture = _texture(reading, prim)
    return light


def read_mesh_light(reading: Reading, prim: Usd.Prim, path: str, double_sided: bool) -> MeshLight | None:
    """The light that a mesh is by MeshLightAPI; None, with a remark, where it cannot be drawn.

    Args:
        reading: the reading in progress.
        prim: the mesh.
        path: its placement's path in the scene.
        double_sided: whether both its sides emit.
    """
    light = _with_inputs(reading, prim, MeshLight(prim=path, bothSides=double_sided))
    if light is not None:
        mode = str(reading.get(prim.GetAttribute("light:materialSyncMode")) or SYNC_MODES[0])
        if mode not in SYNC_MODES:
            reading.remark(prim, f"materialSyncMode {mode} is not one of {', '.join(SYNC_MODES)}")
            mode = SYNC_MODES[0]
        light.materialSyncMode = mode
    return light


def geometry_light_targets(reading: Reading, prim: Usd.Prim) -> list[str]:
    """Paths of the placements that a GeometryLight makes shine."""
    geometry = prim.GetRelationship("geometry")
    targets = geometry.GetForwardedTargets() if geometry else []
    return [path for path, source in reading.placed.items() if any(source[0].HasPrefix(t) for t in targets)]


def _with_inputs(reading: Reading, prim: Usd.Prim, light: Light) -> Light | None:
    """The light with its authored inputs and its further schemas; None, with a remark, where a value is no number."""
    values = {}
    for field in fields(light):
        default = getattr(light, field.name)
        if isinstance(default, bool | int | float | tuple) and field.name != "area":
            value = light_input(reading, prim, field.name)
            if value is not None:
                values[field.name] = _converted(value, default)
    if not all(np.isfinite(np.asarray(value, np.float64)).all() for value in values.values()):
        reading.remark(prim, "it has inputs that are not finite and is not drawn")
        return None
    changed = replace(light, **values)
    if max(map(abs, changed.size())) > MOST_SIZE:
        reading.remark(prim, "it is too large for float32 and is not drawn")
        return None
    strength = changed.strength()
    if not abs(strength) <= MOST_STRENGTH:
        reading.remark(prim, f"its intensity and exposure make {strength:g}, too much for float32, and it is not drawn")
        return None
    if UsdLux.LightAPI(prim).GetFiltersRel().GetTargets():
        reading.remark(prim, "light:filters is not drawn yet")
    unlit, unshadowed = read_links(reading, prim)
    shaping = light.shaping if isinstance(light, DomeLight) else read_shaping(reading, prim)
    shadow = read_shadow(reading, prim)
    if not _finite(shaping) or not _finite(shadow):
        reading.remark(prim, "its shaping or shadow has values that are not finite and is left out")
        shaping, shadow = Shaping(), Shadow()
    return replace(light, **values, shaping=shaping, shadow=shadow, unlit=unlit, unshadowed=unshadowed)


def _finite(schema: Shaping | Shadow) -> bool:
    values = [getattr(schema, field.name) for field in fields(schema)]
    return all(
        np.isfinite(np.asarray(v, np.float64)).all() for v in values if isinstance(v, bool | int | float | tuple)
    )


def _converted(value: object, default: object) -> object:
    if isinstance(default, tuple):
        return tuple(float(v) for v in value)
    return type(default)(value)


def _pole_axis(reading: Reading, prim: Usd.Prim) -> str:
    """Where the top of a dome's picture is: Y for the older schema, and as DomeLight_1 says."""
    axis = str(reading.get(prim.GetAttribute("poleAxis")) or "Y")
    return str(UsdGeom.GetStageUpAxis(reading.stage)) if axis == "scene" else axis


def _portals(reading: Reading, prim: Usd.Prim) -> Iterator[PortalLight]:
    """The openings that a dome names by its relationship `portals`."""
    relationship = prim.GetRelationship("portals")
    for path in relationship.GetForwardedTargets() if relationship else ():
        target = reading.stage.GetPrimAtPath(path)
        if not target or target.GetTypeName() != "PortalLight":
            reading.remark(prim, f"{path}, which it names as a portal, is not a PortalLight")
            continue
        reading.portals.add(path)
        sizes = {name: light_input(reading, target, name) for name in ("width", "height")}
        transform = UsdGeom.Xformable(target).ComputeLocalToWorldTransform(reading.time)
        values = {name: float(value) for name, value in sizes.items() if value is not None}
        portal = PortalLight(**values, transform=np.array(transform, np.float64))
        if np.isfinite([portal.width, portal.height]).all() and np.isfinite(portal.transform).all():
            yield portal
        else:
            reading.remark(target, "it has inputs that are not finite and does nothing")


def remark_on_portals(reading: Reading, prims: Iterable[Usd.Prim]) -> None:
    """Remark on portals that no dome names, and on what is authored on one that cannot have an effect."""
    for prim in prims:
        if prim.GetPath() not in reading.portals:
            reading.remark(prim, "no dome names it in its portals: it does nothing")
        for name in ("intensity", "exposure", "color", "diffuse", "specular"):
            if light_input(reading, prim, name) is not None:
                reading.remark(prim, f"a portal guides the sampling of its dome and has no {name} of its own")


def _texture(reading: Reading, prim: Usd.Prim) -> LightTexture | None:
    """The light's picture; None without one, with a remark where there should be one."""
    asset = light_input(reading, prim, "texture:file")
    path = asset_path(asset) if isinstance(asset, Sdf.AssetPath) else ""
    if not path:
        return None
    form = str(light_input(reading, prim, "texture:format") or "automatic")
    if prim.GetTypeName() == "RectLight":
        form = "latlong"
    elif form not in FORMATS:
        reading.remark(prim, f"texture:format {form} is not one of {', '.join(FORMATS)}; latlong is taken")
        form = "latlong"
    key = (path, form)
    if key not in reading.light_textures:
        try:
            reading.light_textures[key] = LightTexture.of(to_latlong(_texels(path), form))
        except ValueError as error:
            reading.remark(prim, f"it is drawn without its texture: {error}")
            reading.light_textures[key] = None
    return reading.light_textures[key]


def _texels(path: str) -> np.ndarray:
    """(H, W, 3) float32 linear texels of a picture: 8-bit values are on the sRGB curve, all others as they are."""
    pixels = images.read_picture(path).pixels
    values = pixels[..., :3] if pixels.shape[2] >= 3 else np.repeat(pixels[..., :1], 3, 2)
    if pixels.dtype == np.uint8:
        return srgb_decode(values / 255.0).astype(np.float32)
    largest = np.iinfo(pixels.dtype).max if pixels.dtype == np.uint16 else 1.0
    return values.astype(np.float32) / np.float32(largest)
