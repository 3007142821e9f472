"""The camera light: what usdrecord adds to a stage without lights."""

from __future__ import annotations
from dataclasses import dataclass
from .light import Light


@dataclass
class CameraLight(Light):
    """A point at the camera without falloff: a facing white Lambert surface reads 1 at any distance."""
