"""Render OpenUSD stages with NVIDIA Warp kernels, on the CPU and on CUDA with the same code.

import warprender as wr

scene = wr.load("scenes_usd/cornell_box.usda")
frame = wr.render(scene, resolution=(512, 512), samples=64)
frame.save("cornell.png")
"""

from .camera import Camera
from .frame import Frame
from .lights import CameraLight, DiskLight, DistantLight, DomeLight, RectLight, SphereLight
from .materials import DisplayColor, PreviewSurface
from .plan import RenderPlan
from .renderer import Renderer, render
from .scene import Scene, SceneError
from .usd import load

__version__ = "0.1.0"

__all__ = [
    "Camera",
    "CameraLight",
    "DiskLight",
    "DisplayColor",
    "DistantLight",
    "DomeLight",
    "Frame",
    "PreviewSurface",
    "RectLight",
    "RenderPlan",
    "Renderer",
    "Scene",
    "SceneError",
    "SphereLight",
    "load",
    "render",
]
