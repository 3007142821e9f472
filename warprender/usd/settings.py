"""UsdRenderSettings."""

from __future__ import annotations

from pxr import Sdf, Usd, UsdRender

from ..scene import RenderSettings, SceneError
from .reading import Reading


def read_settings(reading: Reading, path: str | None = None) -> None:
    """The settings at `path`, else those that the stage names, else its only ones, into `scene.settings`.

    Raises:
        SceneError: `path` is no RenderSettings prim.
    """
    prim = _asked_prim(reading, path) if path else _settings_prim(reading)
    if not prim:
        return
    schema = UsdRender.Settings(prim)
    settings = RenderSettings(path=str(prim.GetPath()))
    resolution = schema.GetResolutionAttr()
    if resolution.HasAuthoredValue():
        width, height = reading.get(resolution)
        if width > 0 and height > 0:
            settings.resolution = (int(width), int(height))
        else:
            reading.remark(prim, f"resolution {width} by {height} is ignored")
    settings.camera = _camera(reading, schema)
    settings.pixelAspectRatio = float(reading.get(schema.GetPixelAspectRatioAttr()))
    settings.aspectRatioConformPolicy = str(reading.get(schema.GetAspectRatioConformPolicyAttr()))
    reading.scene.settings = settings


def _asked_prim(reading: Reading, path: str) -> Usd.Prim:
    prim = reading.stage.GetPrimAtPath(path) if Sdf.Path.IsValidPathString(path) else None
    if not prim or not prim.IsA(UsdRender.Settings):
        raise SceneError(f"render settings {path}: there is no such RenderSettings prim")
    return prim


def _settings_prim(reading: Reading) -> Usd.Prim | None:
    stage = reading.stage
    path = stage.GetMetadata("renderSettingsPrimPath")
    if path:
        prim = stage.GetPrimAtPath(path)
        if prim and prim.IsA(UsdRender.Settings):
            return prim
        reading.scene.warn(f"{reading.scene.source}: renderSettingsPrimPath {path} is no RenderSettings prim")
    found = [prim for prim in stage.Traverse() if prim.IsA(UsdRender.Settings)]
    return found[0] if len(found) == 1 else None


def _camera(reading: Reading, schema: UsdRender.Settings) -> str:
    targets = schema.GetCameraRel().GetForwardedTargets()
    if not targets:
        return ""
    path = str(targets[0])
    if path not in reading.scene.cameras:
        reading.remark(schema.GetPrim(), f"its camera {path} does not exist")
        return ""
    return path
