"""UsdLuxDistantLight."""

from __future__ import annotations
from dataclasses import dataclass
import numpy as np
from .light import Light


@dataclass
class DistantLight(Light):
    """Light from infinitely far away, of one radiance within a cone; its intensity defaults to 50000.

    Attributes:
        intensity: radiance; illuminance on a facing surface when normalised or when `angle` is 0.
        angle: full angle of the cone in degrees; 0 is a delta light.
        direction: where the light travels, in light space.
    """

    intensity: float = 50000.0
    angle: float = 0.53
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)

    def half_angle(self) -> float:
        """Half the cone's angle in radians, clamped to 0…π."""
        return float(np.clip(np.radians(self.angle) / 2.0, 0.0, np.pi))

    def size_factor(self) -> float:
        """Illuminance of a facing surface under radiance 1 (UsdLux: sizeFactor of a distant light)."""
        theta = self.half_angle()
        if theta == 0.0:
            return 1.0
        sin2 = np.sin(theta) ** 2
        return float(np.pi * (sin2 if theta <= np.pi / 2 else 2.0 - sin2))
