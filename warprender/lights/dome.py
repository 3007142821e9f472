"""UsdLuxDomeLight without a texture."""

from __future__ import annotations
from dataclasses import dataclass
from .light import Light


@dataclass
class DomeLight(Light):
    """Light of one colour from every direction. `normalize` does not change it."""
