"""UsdRenderSettings and its products."""

from __future__ import annotations

import numpy as np
from pxr import Sdf, Usd, UsdRender

from ..camera import CONFORM_POLICIES
from ..scene import PictureSettings, RenderProduct, RenderSettings, SceneError
from .reading import Reading
from .render_vars import read_vars

#: What the picture's prims may say, by the names of the fields that keep it.
NAMES = (
    "pixelAspectRatio",
    "aspectRatioConformPolicy",
    "dataWindowNDC",
    "disableMotionBlur",
    "disableDepthOfField",
)

PURPOSES = ("default", "render", "proxy", "guide")

#: The schema's resolution, for products, which nothing else gives one.
RESOLUTION = (2048, 1080)


def read_settings(reading: Reading, path: str | None = None) -> RenderSettings:
    """The settings at `path`, else those that the stage names, else its only ones, else none.

    Raises:
        SceneError: `path` is no RenderSettings prim.
    """
    prim = _asked_prim(reading, path) if path else _settings_prim(reading)
    if not prim:
        return RenderSettings()
    settings = RenderSettings(path=str(prim.GetPath()))
    _read_picture(reading, prim, settings)
    settings.includedPurposes = _purposes(reading, prim)
    settings.materialBindingPurposes = _tokens(reading, prim, "materialBindingPurposes")
    space = prim.GetAttribute("renderingColorSpace")
    if space and reading.get(space) not in (None, "", "lin_rec709_scene", "lin_rec709"):
        reading.remark(prim, f"renderingColorSpace {reading.get(space)} is not drawn in; linear Rec.709 is")
    found = (_product(reading, settings, path) for path in _targets(prim, "products"))
    settings.products = tuple(product for product in found if product is not None)
    return settings


def _product(reading: Reading, settings: RenderSettings, path: Sdf.Path) -> RenderProduct | None:
    """One product with what it has from the settings; None, with a remark, for what is no picture."""
    prim = reading.stage.GetPrimAtPath(path)
    if not prim or not prim.IsA(UsdRender.Product):
        reading.remark(reading.stage.GetPrimAtPath(settings.path), f"its product {path} is no RenderProduct prim")
        return None
    kind = str(reading.get(prim.GetAttribute("productType")))
    if kind not in ("raster", "deepRaster"):
        reading.remark(prim, f"productType {kind} is not drawn")
        return None
    if kind == "deepRaster":
        reading.remark(prim, "productType deepRaster is drawn flat: one value a pixel")
    product = RenderProduct(str(path), settings.resolution or RESOLUTION, settings.camera)
    for name in NAMES:
        setattr(product, name, getattr(settings, name))
    _read_picture(reading, prim, product)
    product.productName = str(reading.get(prim.GetAttribute("productName")) or "")
    if not product.productName:
        product.productName = f"{prim.GetName()}.exr"
        reading.remark(prim, f"it has no productName; {product.productName} is taken")
    product.outputs = read_vars(reading, prim)
    return product


def _read_picture(reading: Reading, prim: Usd.Prim, settings: PictureSettings) -> None:
    """Put what is authored on the prim, and makes sense, over what `settings` holds."""
    settings.resolution = _resolution(reading, prim) or settings.resolution
    settings.camera = _camera(reading, prim) or settings.camera
    for name in NAMES:
        attribute = prim.GetAttribute(name)
        if not attribute.HasAuthoredValue():
            continue
        value = reading.get(attribute)
        if name == "dataWindowNDC":
            value = tuple(map(float, value))
        if _makes_sense(name, value):
            setattr(settings, name, type(getattr(settings, name))(value))
        else:
            reading.remark(prim, f"{name} {value} is ignored")
    motionless = prim.GetAttribute("instantaneousShutter")
    settings.disableMotionBlur = settings.disableMotionBlur or bool(motionless and reading.get(motionless))


def _makes_sense(name: str, value: object) -> bool:
    if name == "pixelAspectRatio":
        return 0.0 < value < np.inf
    if name == "aspectRatioConformPolicy":
        return value in CONFORM_POLICIES
    if name == "dataWindowNDC":
        return bool(np.isfinite(value).all()) and value[0] < value[2] and value[1] < value[3]
    return True


def _resolution(reading: Reading, prim: Usd.Prim) -> tuple[int, int] | None:
    attribute = prim.GetAttribute("resolution")
    if not attribute.HasAuthoredValue():
        return None
    width, height = reading.get(attribute)
    if width > 0 and height > 0:
        return int(width), int(height)
    reading.remark(prim, f"resolution {width} by {height} is ignored")
    return None


def _purposes(reading: Reading, prim: Usd.Prim) -> tuple[str, ...] | None:
    purposes = _tokens(reading, prim, "includedPurposes")
    unknown = [purpose for purpose in purposes or () if purpose not in PURPOSES]
    if unknown:
        reading.remark(prim, f"includedPurposes has {', '.join(unknown)}, which are no purposes")
        return tuple(purpose for purpose in purposes if purpose in PURPOSES)
    return purposes


def _tokens(reading: Reading, prim: Usd.Prim, name: str) -> tuple[str, ...] | None:
    attribute = prim.GetAttribute(name)
    value = reading.get(attribute) if attribute.HasAuthoredValue() else None
    return None if value is None else tuple(map(str, value))


def _asked_prim(reading: Reading, path: str) -> Usd.Prim:
    prim = reading.stage.GetPrimAtPath(path) if Sdf.Path.IsValidPathString(path) else None
    if not prim or not prim.IsA(UsdRender.Settings):
        raise SceneError(f"render settings {path}: there is no such RenderSettings prim")
    return prim


def _settings_prim(reading: Reading) -> Usd.Prim | None:
    stage = reading.stage
    path = stage.GetMetadata("renderSettingsPrimPath")
    if path:
        prim = stage.GetPrimAtPath(path) if Sdf.Path.IsValidPathString(path) else None
        if prim and prim.IsA(UsdRender.Settings):
            return prim
        reading.scene.warn(f"{reading.scene.source}: renderSettingsPrimPath {path} is no RenderSettings prim")
    found = [prim for prim in stage.Traverse() if prim.IsA(UsdRender.Settings)]
    return found[0] if len(found) == 1 else None


def _camera(reading: Reading, prim: Usd.Prim) -> str:
    targets = _targets(prim, "camera")
    if not targets:
        return ""
    path = str(targets[0])
    if path not in reading.scene.cameras:
        reading.remark(prim, f"its camera {path} does not exist")
        return ""
    return path


def _targets(prim: Usd.Prim, name: str) -> list[Sdf.Path]:
    relationship = prim.GetRelationship(name)
    return relationship.GetForwardedTargets() if relationship else []
