"""Materials: one kind, one file. `MATERIALS` is the list of kinds; a new one is a file and a line here."""

from .display_color import DisplayColor
from .preview_surface import PreviewSurface

Material = DisplayColor | PreviewSurface

#: Material kinds in the order of their ids on the device.
MATERIALS = (DisplayColor, PreviewSurface)

__all__ = ["MATERIALS", "DisplayColor", "Material", "PreviewSurface"]
