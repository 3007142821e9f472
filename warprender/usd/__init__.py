"""OpenUSD stages in: the only part of warprender, with the command line, that imports `pxr`."""

from ..framing import auto_camera, choose_camera, placement_bounds
from .load import LEVELS, StageReader, load

__all__ = ["LEVELS", "StageReader", "auto_camera", "choose_camera", "load", "placement_bounds"]
