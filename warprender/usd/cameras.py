"""UsdGeomCamera."""

from __future__ import annotations

import numpy as np
from pxr import Tf, Usd, UsdGeom

from ..camera import Camera
from .reading import Reading, one_line
from .walk import IN_WORLD

#: Attributes that keep their name and unit.
NUMBERS = (
    "focalLength",
    "horizontalAperture",
    "verticalAperture",
    "horizontalApertureOffset",
    "verticalApertureOffset",
)
#: Likewise, of the depth of field.
LENS = ("fStop", "focusDistance")


def read_cameras(reading: Reading) -> None:
    """Every camera of the stage; a camera needs not be visible, nor of an included purpose."""
    cache = UsdGeom.XformCache(reading.time)
    for prim in Usd.PrimRange.Stage(reading.stage, IN_WORLD):
        if not prim.IsA(UsdGeom.Camera):
            continue
        try:
            reading.scene.cameras[str(prim.GetPath())] = read_camera(reading, UsdGeom.Camera(prim), cache)
        except (Tf.ErrorException, TypeError, ValueError) as error:
            reading.remark(prim, f"this camera cannot be read: {one_line(error)}")


def read_camera(reading: Reading, schema: UsdGeom.Camera, cache: UsdGeom.XformCache) -> Camera:
    """One camera prim."""
    prim = schema.GetPrim()
    return Camera(
        projection=str(reading.get(schema.GetProjectionAttr())),
        clippingRange=tuple(map(float, reading.get(schema.GetClippingRangeAttr()))),
        clippingPlanes=_clipping_planes(reading, schema),
        exposureScale=_exposure_scale(reading, schema),
        **_shutter(reading, schema),
        transform=np.array(cache.GetLocalToWorldTransform(prim), np.float64),
        **{name: float(reading.get(prim.GetAttribute(name))) for name in NUMBERS},
        **{name: _of_the_lens(reading, prim, name) for name in LENS},
    )


def _of_the_lens(reading: Reading, prim: Usd.Prim, name: str) -> float:
    """An attribute of the depth of field; a remark and 0, which is a pinhole, where it is no number."""
    value = float(reading.get(prim.GetAttribute(name)))
    if not np.isnan(value) and (name != "fStop" or np.isfinite(value)):
        return value
    reading.remark(prim, f"{name} is {value}; 0 is taken, a pinhole")
    return 0.0


def _clipping_planes(reading: Reading, schema: UsdGeom.Camera) -> tuple[tuple[float, ...], ...]:
    planes = np.array(reading.get(schema.GetClippingPlanesAttr()) or [], np.float64).reshape(-1, 4)
    finite = np.isfinite(planes).all(1)
    if not finite.all():
        reading.remark(schema.GetPrim(), f"{np.sum(~finite)} clippingPlanes are not finite and cut nothing")
    return tuple(map(tuple, planes[finite].tolist()))


def _shutter(reading: Reading, schema: UsdGeom.Camera) -> dict[str, float]:
    """When the shutter opens and closes; a remark and never where that makes no sense."""
    opens, closes = (float(reading.get(a)) for a in (schema.GetShutterOpenAttr(), schema.GetShutterCloseAttr()))
    if np.isfinite((opens, closes)).all() and opens <= closes:
        return {"shutterOpen": opens, "shutterClose": closes}
    reading.remark(schema.GetPrim(), f"shutter:open {opens} and shutter:close {closes} blur nothing")
    return {}


def _exposure_scale(reading: Reading, schema: UsdGeom.Camera) -> float:
    scale = float(schema.ComputeLinearExposureScale(reading.time))
    if np.isfinite(scale) and scale >= 0:
        return scale
    reading.remark(schema.GetPrim(), f"its exposure attributes give a scale of {scale}; 1 is taken")
    return 1.0
