"""Materials: one kind, one file. `MATERIALS` is the list of kinds; a new one is a file and a line here."""

from .dielectric import Dielectric
from .display_color import DisplayColor
from .phong import Phong
from .preview_surface import PreviewSurface

Material = DisplayColor | PreviewSurface | Dielectric | Phong

#: Material kinds in the order of their ids on the device.
MATERIALS = (DisplayColor, PreviewSurface, Dielectric, Phong)
#: Those that send light on beyond the surface in other directions than straight through.
TRANSMITTING = (Dielectric,)

__all__ = ["MATERIALS", "TRANSMITTING", "Dielectric", "DisplayColor", "Material", "Phong", "PreviewSurface"]
