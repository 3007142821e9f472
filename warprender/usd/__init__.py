"""OpenUSD stages in: the only part of warprender, with the command line, that imports `pxr`."""

from ..framing import auto_camera, choose_camera, placement_bounds
from .load import LEVELS, load
from .stage import parse_variants

__all__ = ["LEVELS", "auto_camera", "choose_camera", "load", "parse_variants", "placement_bounds"]
