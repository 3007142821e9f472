"""Materials: one kind, one file. `MATERIALS` is the list of kinds; a new one is a file and a line here."""

from .display_color import DisplayColor
from .phong import Phong
from .preview_surface import PreviewSurface

Material = DisplayColor | PreviewSurface | Phong

#: Material kinds in the order of their ids on the device.
MATERIALS = (DisplayColor, PreviewSurface, Phong)

__all__ = ["MATERIALS", "DisplayColor", "Material", "Phong", "PreviewSurface"]
