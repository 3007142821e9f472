"""Materials: one kind, one file. `MATERIALS` is the list of kinds; a new one is a file and a line here."""

from .brdf_table import BrdfTable
from .dielectric import Dielectric
from .display_color import DisplayColor
from .measured_brdf import MeasuredBRDF
from .phong import Phong
from .preview_surface import PreviewSurface

Material = DisplayColor | PreviewSurface | MeasuredBRDF | Dielectric | Phong

#: Material kinds in the order of their ids on the device.
MATERIALS = (DisplayColor, PreviewSurface, MeasuredBRDF, Dielectric, Phong)
#: Those that send light on beyond the surface in other directions than straight through.
TRANSMITTING = (Dielectric,)

__all__ = [
    "MATERIALS",
    "TRANSMITTING",
    "BrdfTable",
    "Dielectric",
    "DisplayColor",
    "Material",
    "MeasuredBRDF",
    "Phong",
    "PreviewSurface",
]
