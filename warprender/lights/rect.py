"""UsdLuxRectLight."""

from __future__ import annotations
from dataclasses import dataclass
import numpy as np
from .light import Light, linear_part


@dataclass
class RectLight(Light):
    """A rectangle in the local XY plane, centred, that emits towards local -Z.

    Attributes:
        width: along local X.
        height: along local Y.
    """

    width: float = 1.0
    height: float = 1.0

    def size_factor(self) -> float:
        """World area."""
        x, y, _ = linear_part(self.transform)
        return float(np.linalg.norm(np.cross(x * self.width, y * self.height)))
