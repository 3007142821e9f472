"""Render OpenUSD stages with NVIDIA Warp kernels, on the CPU and on CUDA with the same code.

    import warprender as wr

    scene = wr.load("scenes_usd/cornell_box.usda")
    frame = wr.render(scene, resolution=(512, 512), samples=64)
    frame.save("cornell.png")

Names are imported when they are first used, so that the command line answers at once.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .camera import Camera
    from .frame import Frame
    from .gonioreflectometer import measure_brdf
    from .lights import (
        CameraLight,
        CylinderLight,
        DiskLight,
        DistantLight,
        DomeLight,
        IesProfile,
        LightTexture,
        MeshLight,
        PortalLight,
        RectLight,
        Shadow,
        Shaping,
        SphereLight,
    )
    from .materials import BrdfTable, Dielectric, DisplayColor, MeasuredBRDF, Phong, PreviewSurface
    from .newton import from_newton
    from .plan import RenderPlan
    from .renderer import Renderer, render
    from .scene import Scene, SceneError
    from .sensors import CameraSensor, LidarSensor
    from .textures import PrimvarReader, Texture
    from .usd import StageReader, load
    from .visibility.raster import Raster, rasterize
    from .visibility.rays import RayCaster

__version__ = "0.1.0"

#: Public name to the module that it lives in.
_HOMES = {
    "BrdfTable": "materials",
    "Camera": "camera",
    "CameraLight": "lights",
    "CameraSensor": "sensors",
    "CylinderLight": "lights",
    "Dielectric": "materials",
    "DiskLight": "lights",
    "DisplayColor": "materials",
    "DistantLight": "lights",
    "DomeLight": "lights",
    "Frame": "frame",
    "IesProfile": "lights",
    "LidarSensor": "sensors",
    "LightTexture": "lights",
    "MeasuredBRDF": "materials",
    "MeshLight": "lights",
    "Phong": "materials",
    "PortalLight": "lights",
    "PreviewSurface": "materials",
    "PrimvarReader": "textures",
    "Raster": "visibility.raster",
    "RayCaster": "visibility.rays",
    "RectLight": "lights",
    "RenderPlan": "plan",
    "Renderer": "renderer",
    "Scene": "scene",
    "SceneError": "scene",
    "Shadow": "lights",
    "Shaping": "lights",
    "SphereLight": "lights",
    "StageReader": "usd",
    "Texture": "textures",
    "from_newton": "newton",
    "load": "usd",
    "measure_brdf": "gonioreflectometer",
    "rasterize": "visibility.raster",
    "render": "renderer",
}

__all__ = [
    "BrdfTable",
    "Camera",
    "CameraLight",
    "CameraSensor",
    "CylinderLight",
    "Dielectric",
    "DiskLight",
    "DisplayColor",
    "DistantLight",
    "DomeLight",
    "Frame",
    "IesProfile",
    "LidarSensor",
    "LightTexture",
    "MeasuredBRDF",
    "MeshLight",
    "Phong",
    "PortalLight",
    "PreviewSurface",
    "PrimvarReader",
    "Raster",
    "RayCaster",
    "RectLight",
    "RenderPlan",
    "Renderer",
    "Scene",
    "SceneError",
    "Shadow",
    "Shaping",
    "SphereLight",
    "StageReader",
    "Texture",
    "from_newton",
    "load",
    "measure_brdf",
    "rasterize",
    "render",
]


def __getattr__(name: str) -> object:
    if name == "testing":
        return import_module(".testing", __name__)
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*globals(), *_HOMES]
