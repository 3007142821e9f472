"""Materials: one kind, one file. `MATERIALS` is the list of kinds; a new one is a file and a line here."""

from .brdf_table import BrdfTable
from .display_color import DisplayColor
from .measured_brdf import MeasuredBRDF
from .preview_surface import PreviewSurface

Material = DisplayColor | PreviewSurface | MeasuredBRDF

#: Material kinds in the order of their ids on the device.
MATERIALS = (DisplayColor, PreviewSurface, MeasuredBRDF)

__all__ = ["MATERIALS", "BrdfTable", "DisplayColor", "Material", "MeasuredBRDF", "PreviewSurface"]
