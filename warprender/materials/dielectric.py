"""Glass, water and other clear dielectrics: reflection and refraction at a smooth or rough boundary.

Smooth boundaries have two delta lobes, split by the exact Fresnel term. Rough ones are Walter et al. 2007 (Microfacet
Models for Refraction through Rough Surfaces) with GGX and visible normals; reflection is masked by the
height-correlated Smith term, transmission by the product of both sides' terms, as there.

The side of the authored normal is vacuum, the other side the medium: every surface is a boundary to vacuum, whatever
encloses it. Radiance is scaled by 1/eta² where it crosses (pbrt-v4 §9.5.2): these are values for paths from the camera,
and f(b, a) = ior² f(a, b) for a outside and b inside.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import warp as wp

from ..numerics import max_component
from ..records import (
    EVENT_ABSORB,
    EVENT_DELTA,
    Bsdf,
    BsdfSample,
    BsdfValue,
    DeviceScene,
    Surface,
)
from ..sampling import ggx_visible_normal
from .fresnel import fresnel_dielectric, refracted, thin_sheet
from .inputs import Color, Number, Varying, clamped, row_of, values_function
from .material import BaseMaterial
from .microfacet import SMALLEST_ALPHA, ggx_density, ggx_visible_pdf, is_perfect, smith_length
from .scattering import scattered

#: Inputs in the order of their numbers. `normal` has the number of all kinds.
INPUTS = (
    "ior", "roughness", "specularColor", "transmissionColor", "attenuationColor", "attenuationDistance", "thinWalled",
)  # fmt: skip
_NUMBERS = {name: wp.constant(wp.int32(number)) for number, name in enumerate(INPUTS)}
IOR = _NUMBERS["ior"]
ROUGHNESS = _NUMBERS["roughness"]
SPECULAR_COLOR = _NUMBERS["specularColor"]
TRANSMISSION_COLOR = _NUMBERS["transmissionColor"]
ATTENUATION_COLOR = _NUMBERS["attenuationColor"]
ATTENUATION_DISTANCE = _NUMBERS["attenuationDistance"]
THIN_WALLED = _NUMBERS["thinWalled"]

#: Indices of refraction beyond these are taken as these.
_SMALLEST_IOR = wp.constant(wp.float32(0.01))
_LARGEST_IOR = wp.constant(wp.float32(100.0))
#: Below this alpha times |eta - 1| the refracted lobe is narrower than float32 can tell its half-vectors apart.
_SMALLEST_SPREAD = wp.constant(wp.float32(1.0e-5))


@dataclass
class Dielectric(BaseMaterial):
    """A clear boundary that reflects and refracts. Shader id `warprender:Dielectric`.

    Every input is a constant, a `Texture` or a `PrimvarReader`. The medium is on the side that the authored normal
    points away from: shapes should be closed, and their orientation right. An open sheet is `thinWalled`.

    Attributes:
        ior: index of refraction inside over that outside, 0.01 … 100.
        roughness: its square is the GGX alpha; 0 is smooth.
        specularColor: factor of what is reflected.
        transmissionColor: factor of what crosses the surface, each time.
        attenuationColor: what is left of white light after `attenuationDistance` inside (Beer's law), as in glTF's
            KHR_materials_volume. Not for thin walls.
        attenuationDistance: in scene units; inf absorbs nothing.
        thinWalled: 1 is a sheet with both its faces: it is not bent but spread by its roughness, alike from both sides.
        normal: in the tangent frame of the texture coordinates; of any length.
    """

    inputs = INPUTS

    ior: Number = 1.5
    roughness: Number = 0.0
    specularColor: Color = (1.0, 1.0, 1.0)
    transmissionColor: Color = (1.0, 1.0, 1.0)
    attenuationColor: Color = (1.0, 1.0, 1.0)
    attenuationDistance: Number = float("inf")
    thinWalled: int | Varying = 0
    normal: Color = (0.0, 0.0, 1.0)

    def lobes(self) -> tuple[str, ...]:
        """Reflection and transmission, both smooth or both rough; either where that varies or is near the limit."""
        if isinstance(self.roughness, Varying):
            return ("glossy", "mirror", "refraction", "rough refraction")
        if is_perfect(self.roughness):
            return ("mirror", "refraction")
        bends = 0.0 if isinstance(self.ior, Varying) else abs(self.ior - 1.0) / max(self.ior, 1.0)
        sure = self.roughness**2 * bends > 2.0 * float(_SMALLEST_SPREAD)
        return ("glossy", "rough refraction") if sure else ("glossy", "mirror", "refraction", "rough refraction")

    def largest_albedo(self) -> float:
        """Upper bound on the reflected and transmitted share of light, any direction and channel."""
        colors = (self.specularColor, self.transmissionColor)
        if any(isinstance(color, Varying) for color in colors):
            return 1.0
        return float(np.clip(np.max(colors), 0.0, 1.0))


@cache
def prepare_function(features: tuple[str, ...]) -> wp.Function:
    """`prepare(scene, surface) -> Bsdf`: eta as seen from the viewer's side, alpha, colours and absorption."""
    material_values = values_function(features)

    @wp.func
    def prepare(scene: DeviceScene, surface: Surface) -> Bsdf:
        values = material_values(scene, surface)
        bsdf = Bsdf()
        bsdf.present = 1.0
        bsdf.thin = wp.where(values[THIN_WALLED, 0] > 0.5, 1, 0)
        bsdf.eta = wp.clamp(values[IOR, 0], _SMALLEST_IOR, _LARGEST_IOR)
        if surface.front == 0 and bsdf.thin == 0:
            bsdf.eta = 1.0 / bsdf.eta
        roughness = wp.clamp(values[ROUGHNESS, 0], 0.0, 1.0)
        bsdf.alpha = roughness * roughness
        if bsdf.alpha < SMALLEST_ALPHA or (bsdf.thin == 0 and bsdf.alpha * wp.abs(bsdf.eta - 1.0) < _SMALLEST_SPREAD):
            bsdf.alpha = 0.0
        bsdf.f90 = clamped(row_of(values, SPECULAR_COLOR))
        bsdf.f0 = bsdf.f90 * reflectance(bsdf, 1.0)
        bsdf.transmission = clamped(row_of(values, TRANSMISSION_COLOR))
        if values[ATTENUATION_DISTANCE, 0] > 0.0 and bsdf.thin == 0:
            left = clamped(row_of(values, ATTENUATION_COLOR))
            for c in range(3):
                bsdf.absorption[c] = -wp.log(wp.max(left[c], 1.0e-30)) / values[ATTENUATION_DISTANCE, 0]
        return bsdf

    return prepare


@wp.func
def reflectance(bsdf: Bsdf, cosine: float) -> float:
    """Reflected share of light at this cosine, of the boundary or of the thin sheet."""
    reflected = fresnel_dielectric(cosine, bsdf.eta)
    if bsdf.thin != 0:
        return thin_sheet(reflected)
    return reflected


@wp.func
def reflection_chance(bsdf: Bsdf, reflected: float) -> float:
    """Probability of sampling reflection where this share is reflected: by what both colours leave."""
    reflection = reflected * max_component(bsdf.f90)
    total = reflection + (1.0 - reflected) * max_component(bsdf.transmission)
    return wp.where(total > 0.0, reflection / total, 1.0)


@wp.func
def radiance_scale(bsdf: Bsdf) -> float:
    """Factor of radiance that crosses: 1/eta², for it spreads over another solid angle; 1 through a thin sheet."""
    return wp.where(bsdf.thin != 0, 1.0, 1.0 / (bsdf.eta * bsdf.eta))


@wp.func
def beyond(bsdf: Bsdf, wo: wp.vec3, h: wp.vec3) -> wp.vec3:
    """Where light from wo goes on behind a facet of normal h: refracted, or through a sheet the mirrored reflection."""
    if bsdf.thin != 0:
        mirrored = h * (2.0 * wp.dot(wo, h)) - wo
        return wp.vec3(mirrored[0], mirrored[1], -mirrored[2])
    return refracted(wo, h, bsdf.eta)


@wp.func
def facet_value(bsdf: Bsdf, wo: wp.vec3, wi: wp.vec3, h: wp.vec3) -> BsdfValue:
    """F · |cos θ| and pdf for facets of normal h, which turn wo into wi."""
    value = BsdfValue()
    cosine = wp.dot(wo, h)
    reflected = reflectance(bsdf, cosine)
    chance = reflection_chance(bsdf, reflected)
    length_o = smith_length(wo, bsdf.alpha)
    length_i = smith_length(wi, bsdf.alpha)
    if wi[2] > 0.0 or bsdf.thin != 0:
        z = wp.abs(wi[2])
        density = ggx_visible_pdf(wo, h, bsdf.alpha)
        # Correlated masking of both directions over that of wo alone, which the density has.
        masked = density * z * (wo[2] + length_o) / (wo[2] * length_i + z * length_o)
        if wi[2] > 0.0:
            value.specular = bsdf.f90 * (reflected * masked)
            value.pdf = chance * density
        else:
            value.specular = bsdf.transmission * ((1.0 - reflected) * masked)
            value.pdf = (1.0 - chance) * density
        return value
    towards = wp.dot(wi, h)
    spread = towards + cosine / bsdf.eta
    density = 2.0 * ggx_density(h, bsdf.alpha) * cosine / (wo[2] + length_o) * wp.abs(towards) / (spread * spread)
    masked = density * 2.0 * wp.abs(wi[2]) / (wp.abs(wi[2]) + length_i)
    value.specular = bsdf.transmission * ((1.0 - reflected) * masked * radiance_scale(bsdf))
    value.pdf = (1.0 - chance) * density
    return value


@wp.func
def evaluate(scene: DeviceScene, bsdf: Bsdf, wo: wp.vec3, wi: wp.vec3) -> BsdfValue:
    """The rough lobes on both sides, with the pdf of `sample`."""
    value = BsdfValue()
    if bsdf.alpha <= 0.0 or wo[2] <= 0.0 or wi[2] == 0.0:
        return value
    h = wo + wi
    if wi[2] < 0.0:
        if bsdf.thin != 0:
            h = wo + wp.vec3(wi[0], wi[1], -wi[2])
        else:
            h = wo + wi * bsdf.eta
    length = wp.length(h)
    # Opposite directions have no half-vector (hard case S9).
    if length < 1.0e-6:
        return value
    h = h * (wp.where(h[2] < 0.0, -1.0, 1.0) / length)
    # Facets that either direction sees from behind do nothing.
    if wp.dot(wo, h) <= 0.0 or (wi[2] < 0.0 and bsdf.thin == 0 and wp.dot(wi, h) >= 0.0):
        return value
    return facet_value(bsdf, wo, wi, h)


@wp.func
def sample_smooth(bsdf: Bsdf, wo: wp.vec3, lobe: float) -> BsdfSample:
    """A delta reflection or refraction."""
    result = BsdfSample()
    result.stay = 1.0
    result.event = EVENT_DELTA
    reflected = reflectance(bsdf, wo[2])
    chance = reflection_chance(bsdf, reflected)
    if lobe < chance:
        result.direction = wp.vec3(-wo[0], -wo[1], wo[2])
        result.specular = bsdf.f90 * (reflected / chance)
        return result
    result.direction = beyond(bsdf, wo, wp.vec3(0.0, 0.0, 1.0))
    result.specular = bsdf.transmission * ((1.0 - reflected) / (1.0 - chance) * radiance_scale(bsdf))
    if result.direction[2] >= 0.0:
        result.event = EVENT_ABSORB
    return result


@wp.func
def sample(scene: DeviceScene, bsdf: Bsdf, wo: wp.vec3, u: wp.vec2, lobe: float) -> BsdfSample:
    """Pick a visible facet, and reflect or refract about it by its Fresnel term."""
    if bsdf.alpha <= 0.0:
        return sample_smooth(bsdf, wo, lobe)
    result = BsdfSample()
    result.stay = 1.0
    h = ggx_visible_normal(wo, bsdf.alpha, u)
    cosine = wp.dot(wo, h)
    if wo[2] <= 0.0 or cosine <= 0.0:
        return result
    wi = h * (2.0 * cosine) - wo
    reflects = lobe < reflection_chance(bsdf, reflectance(bsdf, cosine))
    if not reflects:
        wi = beyond(bsdf, wo, h)
    # What a facet sends to the wrong side of the surface would meet another one: single scattering ends there.
    if wi[2] == 0.0 or (wi[2] > 0.0) != reflects:
        return result
    return scattered(wi, facet_value(bsdf, wo, wi, h), 1.0)
