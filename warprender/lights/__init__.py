"""Lights: one kind, one file. `LIGHTS` is the list of kinds; a new one is a file, a line here and one in `dispatch`."""

from .camera import CameraLight
from .cylinder import CylinderLight
from .disk import DiskLight
from .distant import DistantLight
from .dome import DomeLight
from .environment import LightTexture
from .glowing_sphere import GlowingSphere
from .ies import IesProfile
from .light import Light
from .mesh import MeshLight
from .portal import PortalLight
from .rect import RectLight
from .shadow import Shadow
from .shaping import Shaping
from .sphere import SphereLight

#: Light kinds.
LIGHTS = (
    SphereLight,
    RectLight,
    DiskLight,
    CylinderLight,
    DistantLight,
    DomeLight,
    CameraLight,
    MeshLight,
    GlowingSphere,
)

__all__ = [
    "LIGHTS",
    "CameraLight",
    "CylinderLight",
    "DiskLight",
    "DistantLight",
    "DomeLight",
    "GlowingSphere",
    "IesProfile",
    "Light",
    "LightTexture",
    "MeshLight",
    "PortalLight",
    "RectLight",
    "Shadow",
    "Shaping",
    "SphereLight",
]
