"""UsdGeomCamera: its window, and the rays through it."""

from __future__ import annotations
from dataclasses import dataclass, field
import numpy as np


@dataclass
class Camera:
    """UsdGeomCamera, names, units and defaults as in the schema; looks down local -Z, +Y up.

    Attributes:
        projection: "perspective" or "orthographic".
        focalLength, horizontalAperture, verticalAperture, horizontalApertureOffset,
        verticalApertureOffset: tenths of a scene unit.
        clippingRange: distances along -Z in scene units.
        fStop: 0 is a pinhole.
        focusDistance: in scene units.
        exposureScale: multiplies the picture (`UsdGeomCamera.ComputeLinearExposureScale`).
        transform: (4, 4) float64 camera-to-world matrix for row vectors.
    """

    projection: str = "perspective"
    focalLength: float = 50.0
    horizontalAperture: float = 20.955
    verticalAperture: float = 15.2908
    horizontalApertureOffset: float = 0.0
    verticalApertureOffset: float = 0.0
    clippingRange: tuple[float, float] = (1.0, 1.0e6)
    fStop: float = 0.0
    focusDistance: float = 0.0
    exposureScale: float = 1.0
    transform: np.ndarray = field(default_factory=lambda: np.eye(4))
