"""Lights: one kind, one file. `LIGHTS` is the list of kinds; a new one is a file and a line here."""

from .camera import CameraLight
from .disk import DiskLight
from .distant import DistantLight
from .dome import DomeLight
from .light import Light
from .rect import RectLight
from .sphere import SphereLight

#: Light kinds in the order of their ids on the device.
LIGHTS = (SphereLight, RectLight, DiskLight, DistantLight, DomeLight, CameraLight)

__all__ = [
    "LIGHTS",
    "CameraLight",
    "DiskLight",
    "DistantLight",
    "DomeLight",
    "Light",
    "RectLight",
    "SphereLight",
]
