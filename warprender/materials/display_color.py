"""What a prim looks like that no material is bound to: Lambert reflection of its displayColor."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import warp as wp

from ..numerics import INV_PI, max_component
from ..records import (
    EVENT_ABSORB,
    EVENT_PASS,
    EVENT_SCATTER,
    Bsdf,
    BsdfSample,
    BsdfValue,
    DeviceScene,
    Surface,
)
from ..sampling import cosine_hemisphere, cosine_hemisphere_pdf
from ..shapes.primvar import primvar_at
from .material import BaseMaterial

COLOR = wp.constant(wp.int32(0))
OPACITY = wp.constant(wp.int32(1))


@dataclass
class DisplayColor(BaseMaterial):
    """Lambert reflection of `primvars:displayColor`, present to the degree `primvars:displayOpacity`.

    Attributes:
        color: linear Rec.709 where the prim has no displayColor.
        opacity: where the prim has no displayOpacity.
    """

    color: tuple[float, float, float] = (0.18, 0.18, 0.18)
    opacity: float = 1.0

    def pack(self) -> np.ndarray:
        """Values by input number: (n, 3)."""
        return np.array([self.color, [self.opacity, 0, 0]], np.float32)

    def passes_light(self) -> bool:
        """Whether rays may go straight through."""
        return self.opacity < 1.0

    def lobes(self) -> tuple[str, ...]:
        """Lambert's alone."""
        return ("diffuse",)

    def largest_albedo(self) -> float:
        """Upper bound on the reflected share of light, any direction and channel."""
        return max(self.color)


@cache
def prepare_function(features: tuple[str, ...]) -> wp.Function:
    """`prepare(scene, surface) -> Bsdf`, the same for all features."""
    return prepare


@wp.func
def prepare(scene: DeviceScene, surface: Surface) -> Bsdf:
    """Look the primvars up."""
    color = scene.materials[surface.material].values[COLOR]
    opacity = scene.materials[surface.material].values[OPACITY][0]
    if scene.display_color >= 0:
        authored = primvar_at(scene, surface, scene.display_color, wp.vec4(color[0], color[1], color[2], 0.0))
        color = wp.vec3(authored[0], authored[1], authored[2])
    if scene.display_opacity >= 0:
        opacity = primvar_at(scene, surface, scene.display_opacity, wp.vec4(opacity, 0.0, 0.0, 0.0))[0]
    opacity = wp.clamp(opacity, 0.0, 1.0)
    bsdf = Bsdf()
    bsdf.diffuse = color * opacity
    bsdf.present = 1.0
    bsdf.pass_through = 1.0 - opacity
    return bsdf


@wp.func
def scatter_probability(bsdf: Bsdf) -> float:
    """Probability of scattering rather than going straight through."""
    reflected = max_component(bsdf.diffuse)
    return wp.where(bsdf.pass_through > 0.0, reflected / (reflected + bsdf.pass_through), 1.0)


@wp.func
def evaluate(scene: DeviceScene, bsdf: Bsdf, wo: wp.vec3, wi: wp.vec3) -> BsdfValue:
    """Lambert: f cos θ = albedo cos θ / π."""
    value = BsdfValue()
    if wi[2] > 0.0 and wo[2] > 0.0:
        value.diffuse = bsdf.diffuse * (INV_PI * wi[2])
        value.pdf = scatter_probability(bsdf) * cosine_hemisphere_pdf(wi[2])
    return value


@wp.func
def sample(scene: DeviceScene, bsdf: Bsdf, wo: wp.vec3, u: wp.vec2, lobe: float) -> BsdfSample:
    """Cosine-weighted, or straight through."""
    result = BsdfSample()
    p = scatter_probability(bsdf)
    result.stay = p
    if lobe >= p:
        result.event = EVENT_PASS
        result.direction = -wo
        result.specular = wp.vec3(bsdf.pass_through / (1.0 - p))
        return result
    wi = cosine_hemisphere(u)
    result.event = wp.where(wi[2] > 0.0 and p > 0.0, EVENT_SCATTER, EVENT_ABSORB)
    result.direction = wi
    result.diffuse = bsdf.diffuse / p
    result.pdf = p * cosine_hemisphere_pdf(wi[2])
    return result
