"""What every UsdLux light has in common: emission, shaping, shadows, links, and its place in the world."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np
import warp as wp

from ..color import LUMINANCE, blackbody_tint
from ..given import fault_of_fields, fault_of_matrix, shown
from ..numerics import INFINITY
from ..records import LightRecord, LightSample
from ..watched import Watched
from .shadow import Shadow
from .shaping import Shaping

#: Radiance beyond it is none: it leaves room for products in float32.
MOST_STRENGTH = 1e30
#: A longer light has a square that float32 does not hold.
MOST_SIZE = 1e18
#: Rounding may put a point at the rim of a cone of light this much outside of it, in radians.
_RIM = 0.01


@dataclass
class Light(Watched):
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
        shaping: how emission depends on its direction.
        shadow: how much of its shadows it shows.
        unlit: paths of prims that it does not shine on.
        unshadowed: paths of prims that do not cast shadows of it.
        visible: whether it gives light.
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
    shaping: Shaping = field(default_factory=Shaping)
    shadow: Shadow = field(default_factory=Shadow)
    unlit: frozenset[str] = frozenset()
    unshadowed: frozenset[str] = frozenset()
    visible: bool = True

    #: Whether it is infinitely far away, or else has no place in the tree of lights.
    infinite = False

    def fault(self) -> str:
        """What is wrong with its fields, in a few words; "" for a good light."""
        for name, kind in (("shaping", Shaping), ("shadow", Shadow)):
            if not isinstance(getattr(self, name), kind):
                return f"{name} is {shown(getattr(self, name))}, not a {kind.__name__}"
        for part in (self, self.shaping, self.shadow):
            if fault := fault_of_fields(part):
                return fault
        for name in ("unlit", "unshadowed"):
            if not isinstance(getattr(self, name), Collection) or isinstance(getattr(self, name), str):
                return f"{name} is {shown(getattr(self, name))}, not a set of prim paths"
        if fault := fault_of_matrix("transform", self.transform):
            return fault
        if max(map(abs, self.size())) > MOST_SIZE:
            return "it is too large for float32"
        if not abs(self.strength()) <= MOST_STRENGTH:
            return f"intensity and exposure make {self.strength():g}, too much for float32"
        return ""

    def size_factor(self) -> float:
        """What `normalize` divides by; a light without a size answers 1."""
        return 1.0

    def strength(self) -> float:
        """Intensity * 2**exposure; inf or NaN where that is no number."""
        # NumPy's power: Python's raises an error where the result is too large.
        with np.errstate(over="ignore", invalid="ignore"):
            return float(self.intensity * np.float64(2.0) ** self.exposure)

    def radiance(self) -> np.ndarray:
        """Emitted radiance (3,) float64, linear Rec.709, before shaping and texture; 0 where no number or too large."""
        value = np.asarray(self.color, np.float64) * self.strength()
        if self.enableColorTemperature:
            value = value * blackbody_tint(self.colorTemperature)
        if self.normalize:
            size = self.size_factor()
            value = value / size if size > 0 else np.zeros(3)
        value = value * self.shaping.profile_scale()
        return value if (np.abs(value) <= MOST_STRENGTH).all() else np.zeros(3)

    def brightness(self) -> float:
        """Luminance of the radiance, by which lights are chosen; that of a negative light is its size."""
        return float(np.abs(self.radiance()) @ LUMINANCE)

    def kind(self) -> str:
        """Name of the device functions that draw it."""
        return type(self).__name__

    def size(self) -> tuple[float, float, float]:
        """The kind's own sizes, as its device functions read them from `LightRecord.size`."""
        return (0.0, 0.0, 0.0)

    def half_extent(self) -> tuple[float, float, float]:
        """Half the size of its box about the light's origin, in light space."""
        return (0.0, 0.0, 0.0)

    def power(self, scene_radius: float) -> float:
        """Emitted power of a grey light, roughly; 0 keeps next-event estimation from choosing the light."""
        return self.brightness() * np.pi * self.size_factor() * self.profile_mean()

    def is_delta(self) -> bool:
        """Whether no ray meets it by chance, as a point or a direction without a size."""
        return False

    def profile_mean(self) -> float:
        """Mean of the photometric profile over all directions, 1 without one."""
        profile = self.shaping.iesProfile
        return profile.power() / (4 * np.pi) if profile is not None else 1.0

    def emission_cone(self) -> tuple[np.ndarray, float, float]:
        """Axis in light space, angle of full emission about it, and angle over which it fades beyond, in radians."""
        cut = self._cut(np.pi)
        return np.array([0.0, 0.0, -1.0]), cut, np.pi / 2 if cut == np.pi else _RIM

    def _cut(self, widest: float) -> float:
        """Angle in the world from the light's axis beyond which its cone cuts all emission; at most `widest`."""
        cut = self.shaping.cone()[1]
        if cut >= widest:
            return widest
        linear = linear_part(self.transform)
        scale2 = np.sum(linear * linear) / 3
        if not np.allclose(linear @ linear.T, scale2 * np.eye(3), atol=1e-4 * scale2):
            return widest
        return cut

    def local_to_world(self) -> np.ndarray:
        """(3, 3) linear part for row vectors, that the device inverts; flat lights mend their normal here."""
        return linear_part(self.transform)

    def effects(self) -> tuple[str, ...]:
        """Names of what it needs compiled beyond its kind."""
        shadows = () if self.shadow.is_plain() and not self.unshadowed else ("shadows",)
        return (*self.shaping.effects(), *shadows, *(("linking",) if self.unlit else ()))


def linear_part(transform: np.ndarray) -> np.ndarray:
    """Rows are the world vectors of the local axes: (3, 3) of a row-vector matrix."""
    return np.asarray(transform, np.float64)[:3, :3]


def forwards(light: Light) -> tuple[np.ndarray, float, float]:
    """Cone of emission of a flat light."""
    cut = light._cut(np.pi / 2)
    return np.array([0.0, 0.0, -1.0]), 0.0, cut if cut == np.pi / 2 else cut + _RIM


def flat_to_world(transform: np.ndarray) -> np.ndarray:
    """Linear part of a light in its XY plane, with z made normal to it, on the authored side.

    A scale of 0 along z, or shear towards it, changes nothing about a flat light. The normal keeps the authored
    height, by which shaping measures its angles, where there is one.
    """
    x, y, z = linear_part(transform)
    normal = np.cross(x, y)
    area = np.linalg.norm(normal)
    if area == 0.0:
        return np.zeros((3, 3))
    normal = normal / area
    height = z @ normal
    return np.stack([x, y, normal * (height if height != 0.0 else np.sqrt(area))])


@wp.func
def point_to_light(light: LightRecord, p: wp.vec3) -> wp.vec3:
    """World point in light space."""
    return light.inverse * (p - light.position)


@wp.func
def local_sample(light: LightRecord, direction: wp.vec3, distance: float, pdf: float) -> LightSample:
    """World sample from a unit direction, distance and pdf in light space.

    Solid angle changes by |det M| / |M d|³ from the direction d to the direction M d.
    """
    result = no_light()
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
    result = no_light()
    result.direction = direction
    result.distance = INFINITY
    result.radiance = radiance
    result.pdf = pdf
    return result


@wp.func
def no_light() -> LightSample:
    """The sample where there is no light."""
    result = LightSample()
    result.hit.instance = -1
    return result
