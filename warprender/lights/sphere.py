"""UsdLuxSphereLight."""

from __future__ import annotations
from dataclasses import dataclass
import numpy as np
from .light import Light, linear_part


@dataclass
class SphereLight(Light):
    """A sphere about the local origin that emits outwards.

    Attributes:
        radius: in light space.
        treatAsPoint: may be sampled as a point of the same power.
    """

    radius: float = 0.5
    treatAsPoint: bool = False

    def size_factor(self) -> float:
        """World area of the ellipsoid, by the approximation that the UsdLux guide names (Thomsen)."""
        a, b, c = np.linalg.norm(linear_part(self.transform), axis=1) * self.radius
        p = 1.6
        return 4.0 * np.pi * (((a * b) ** p + (a * c) ** p + (b * c) ** p) / 3.0) ** (1.0 / p)
