"""UsdLuxDiskLight."""

from __future__ import annotations
from dataclasses import dataclass
import numpy as np
from .light import Light, linear_part


@dataclass
class DiskLight(Light):
    """A disk in the local XY plane, centred, that emits towards local -Z.

    Attributes:
        radius: in light space.
    """

    radius: float = 0.5

    def size_factor(self) -> float:
        """World area of the ellipse."""
        x, y, _ = linear_part(self.transform) * self.radius
        return float(np.pi * np.linalg.norm(np.cross(x, y)))
