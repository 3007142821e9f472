"""Render OpenUSD stages with NVIDIA Warp kernels, on the CPU and on CUDA with the same code.

    import warprender as wr

    scene = wr.load("scenes_usd/cornell_box.usda")
    frame = wr.render(scene, resolution=(512, 512), samples=64)
    frame.save("cornell.png")

What there is, by what it is for; `help(warprender.Scene)` and so on say what goes in and comes out:

    stages         load, StageReader (several times of one stage), SceneError (what is wrong, in one line)
    scenes         Scene: add_mesh, add_sphere, add_sdf, add_instances, add_light, add_camera, set_poses; Camera
    pictures       render (one), Renderer (many of one scene), Frame (the arrays, `save`), RenderPlan
    materials      PreviewSurface, DisplayColor, Dielectric, Phong, MeasuredBRDF; Texture and PrimvarReader for inputs
    lights         Light (what all have), SphereLight, RectLight, DiskLight, CylinderLight, DistantLight, DomeLight,
                   PortalLight, MeshLight, CameraLight; Shaping, Shadow, IesProfile, LightTexture
    in a loop      CameraSensor (many views, on the device), LidarSensor, from_newton (a Newton model)
    measured BRDFs measure_brdf, BrdfTable
    without scenes RayCaster (rays against one mesh), rasterize, Raster, interpolate
    test suites    warprender.testing.assert_images_agree

Lengths are scene units, angles degrees, colours linear Rec.709; matrices are for row vectors, poses are position and
quaternion xyzw; row 0 of a picture is its top row; cameras look and lights emit towards their -Z.

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
        Light,
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
    from .visibility.attributes import interpolate
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
    "Light": "lights",
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
    "interpolate": "visibility.attributes",
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
    "Light",
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
    "interpolate",
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
