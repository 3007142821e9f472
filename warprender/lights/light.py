"""What every UsdLux light has in common: emission, and its place in the world."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..color import blackbody_tint


@dataclass
class Light:
    """UsdLuxLightAPI, names, units and defaults as in the schema.

    Attributes:
        color: linear Rec.709.
        intensity: radiance of the light at normal incidence for intensity 1, exposure 0, white, not normalised.
        exposure: a power of two on `intensity`.
        normalize: divide by the light's area in the world (or its solid angle), so that size keeps power.
        diffuse: multiplies the light's effect on diffuse reflection.
        specular: multiplies the light's effect on specular reflection.
        enableColorTemperature: tint by `colorTemperature`.
        colorTemperature: kelvin.
        transform: (4, 4) float64 light-to-world matrix for row vectors; lights emit towards local -Z.
    """

    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    intensity: float = 1.0
    exposure: float = 0.0
    normalize: bool = False
    diffuse: float = 1.0
    specular: float = 1.0
    enableColorTemperature: bool = False
    colorTemperature: float = 6500.0
    transform: np.ndarray = field(default_factory=lambda: np.eye(4))

    def size_factor(self) -> float:
        """What `normalize` divides by; a light without a size answers 1."""
        return 1.0

    def radiance(self) -> np.ndarray:
        """Emitted radiance (3,) float64, linear Rec.709; all-zero where an input is not finite."""
        value = np.asarray(self.color, np.float64) * self.intensity * 2.0**self.exposure
        if self.enableColorTemperature:
            value = value * blackbody_tint(self.colorTemperature)
        if self.normalize:
            size = self.size_factor()
            value = value / size if size > 0 else np.zeros(3)
        return value if np.isfinite(value).all() else np.zeros(3)


def linear_part(transform: np.ndarray) -> np.ndarray:
    """Rows are the world vectors of the local axes: (3, 3) of a row-vector matrix."""
    return np.asarray(transform, np.float64)[:3, :3]
