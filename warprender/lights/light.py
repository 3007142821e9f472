"""What every UsdLux light has in common: emission, and its place in the world."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import warp as wp

from ..color import LUMINANCE, blackbody_tint
from ..numerics import INFINITY
from ..records import LightRecord, LightSample


@dataclass
class Light:
    """UsdLuxLightAPI, names, units and defaults as in the schema.

    Attributes:
        color: linear Rec.709, multiplies `intensity`.
        intensity: emitted radiance, in the unit of the picture: a surface of the light itself would read
            intensity * 2**exposure * color, unless `normalize` is on.
        exposure: a power of two on `intensity`.
        normalize: divide by the light's area in the world (or its solid angle), so that size keeps power.
        diffuse: multiplies the light's effect on diffuse reflection.
        specular: multiplies the light's effect on specular reflection.
        enableColorTemperature: tint by `colorTemperature`.
        colorTemperature: kelvin; 6500 is near white.
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

    def size(self) -> tuple[float, float, float]:
        """The kind's own sizes, as its device functions read them from `LightRecord.size`."""
        return (0.0, 0.0, 0.0)

    def power(self, scene_radius: float) -> float:
        """Emitted power of a grey light, roughly; 0 keeps next-event estimation from choosing the light."""
        return float(self.radiance() @ LUMINANCE) * np.pi * self.size_factor()

    def local_to_world(self) -> np.ndarray:
        """(3, 3) linear part for row vectors, that the device inverts; flat lights mend their normal here."""
        return linear_part(self.transform)


def linear_part(transform: np.ndarray) -> np.ndarray:
    """Rows are the world vectors of the local axes: (3, 3) of a row-vector matrix."""
    return np.asarray(transform, np.float64)[:3, :3]


def flat_to_world(transform: np.ndarray) -> np.ndarray:
    """Linear part of a light in its XY plane, with z replaced by the unit normal on the authored side.

    A scale of 0 along z, or shear towards it, changes nothing about a flat light.
    """
    x, y, z = linear_part(transform)
    normal = np.cross(x, y)
    length = np.linalg.norm(normal)
    if length == 0.0:
        return np.zeros((3, 3))
    normal = normal / length
    return np.stack([x, y, -normal if z @ normal < 0 else normal])


@wp.func
def point_to_light(light: LightRecord, p: wp.vec3) -> wp.vec3:
    """World point in light space."""
    return light.inverse * (p - light.position)


@wp.func
def local_sample(light: LightRecord, direction: wp.vec3, distance: float, pdf: float) -> LightSample:
    """World sample from a unit direction, distance and pdf in light space.

    Solid angle changes by |det M| / |M d|³ from the direction d to the direction M d.
    """
    result = LightSample()
    world = light.linear * direction
    stretch = wp.length(world)
    if pdf > 0.0 and stretch > 0.0:
        result.direction = world / stretch
        result.distance = distance * stretch
        result.radiance = light.radiance
        result.pdf = pdf * stretch * stretch * stretch / light.determinant
    return result


@wp.func
def infinite_sample(direction: wp.vec3, radiance: wp.vec3, pdf: float) -> LightSample:
    """Sample of a light at infinity."""
    result = LightSample()
    result.direction = direction
    result.distance = INFINITY
    result.radiance = radiance
    result.pdf = pdf
    return result
