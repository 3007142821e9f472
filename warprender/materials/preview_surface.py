"""UsdPreviewSurface (specification 2.5, and 2.6 for `opacityMode`).

The specification adds its lobes up, which reflects more than arrives at grazing angles. A path tracer cannot: here
the diffuse part keeps the specification's value wherever the sum of directional albedos stays below 1, and is scaled
down to it elsewhere, at the viewer and at the light alike, so that it stays reciprocal. A clearcoat dims what lies
below it by its own directional albedo.

The specular lobe scatters once, as specified, and so loses what bounces between its facets: up to 60 % of a white
metal at roughness 1. With energy compensation that comes back as a second, wide lobe (Kulla and Conty, Revisiting
Physically Based Shading at Imageworks, 2017), which is reciprocal too. The clearcoat is not compensated.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import warp as wp

from ..color import LUMINANCE
from ..numerics import INV_PI, max_component
from ..records import (
    EVENT_ABSORB,
    EVENT_DELTA,
    EVENT_PASS,
    Bsdf,
    BsdfSample,
    BsdfValue,
    DeviceScene,
    Surface,
)
from ..sampling import cosine_hemisphere, cosine_hemisphere_pdf, ggx_visible_normal
from .albedo import SIZE, albedo_table, white_albedo
from .inputs import Color, Number, Varying, clamped, constant, least, row_of, values_function
from .material import BaseMaterial
from .microfacet import (
    SMALLEST_ALPHA,
    ggx_reflection,
    ggx_visible_pdf,
    is_perfect,
    schlick,
    schlick_weight,
)
from .scattering import scattered

#: Inputs in the order of their numbers; the mode is 1 for "presence". `normal` has the number of all kinds.
INPUTS = (
    "diffuseColor", "emissiveColor", "specularColor", "useSpecularWorkflow", "metallic", "roughness", "clearcoat",
    "clearcoatRoughness", "opacity", "opacityThreshold", "ior", "specularEdgeColor", "opacityMode",
)  # fmt: skip
_NUMBERS = {name: wp.constant(wp.int32(number)) for number, name in enumerate(INPUTS)}
DIFFUSE_COLOR = _NUMBERS["diffuseColor"]
EMISSIVE_COLOR = _NUMBERS["emissiveColor"]
SPECULAR_COLOR = _NUMBERS["specularColor"]
USE_SPECULAR_WORKFLOW = _NUMBERS["useSpecularWorkflow"]
METALLIC = _NUMBERS["metallic"]
ROUGHNESS = _NUMBERS["roughness"]
CLEARCOAT = _NUMBERS["clearcoat"]
CLEARCOAT_ROUGHNESS = _NUMBERS["clearcoatRoughness"]
OPACITY = _NUMBERS["opacity"]
OPACITY_THRESHOLD = _NUMBERS["opacityThreshold"]
IOR = _NUMBERS["ior"]
SPECULAR_EDGE_COLOR = _NUMBERS["specularEdgeColor"]
OPACITY_MODE = _NUMBERS["opacityMode"]
OPACITY_MODES = ("transparent", "presence")


@dataclass
class PreviewSurface(BaseMaterial):
    """UsdPreviewSurface 2.6; names and fallbacks as in the specification.

    Every input but the mode is a constant, a `Texture` or a `PrimvarReader`. `occlusion` is left out: a path tracer
    finds the occlusion itself.

    Attributes:
        diffuseColor: linear Rec.709 albedo.
        emissiveColor: emitted radiance.
        useSpecularWorkflow: 1 takes F0 from `specularColor`, 0 from `metallic`, `diffuseColor` and `ior`.
        specularColor: F0 in the specular workflow.
        metallic: 0 dielectric … 1 metal.
        roughness: its square is the GGX alpha.
        clearcoat: weight of a second, white specular lobe.
        clearcoatRoughness: roughness of that lobe.
        opacity: 1 opaque … 0 clear. Light that passes goes straight on, whatever `ior` says: the specification asks for
            transmission of roughness 0 beside the reflections, and a surface of this kind need not enclose anything.
            `Dielectric` refracts.
        opacityMode: "transparent" (the diffuse part fades, reflections stay) or "presence" (all fades).
        opacityThreshold: above 0, a cut-out: below it nothing is drawn, from it on the surface is opaque.
        ior: index of refraction; sets F0 of dielectrics and of the clearcoat, nothing else. Below 0 it is 0.
        normal: in the tangent frame of the texture coordinates; of any length.
        displacement: how far points move along the normal, in object units, when a stage or a mesh is taken into a
            scene (`displacement.displaced`).
        specularEdgeColor: F90 in the specular workflow, where the specification knows white alone; other surfaces that
            are drawn as this one have weights on it.
    """

    inputs = INPUTS

    diffuseColor: Color = (0.18, 0.18, 0.18)
    emissiveColor: Color = (0.0, 0.0, 0.0)
    useSpecularWorkflow: int | Varying = 0
    specularColor: Color = (0.0, 0.0, 0.0)
    metallic: Number = 0.0
    roughness: Number = 0.5
    clearcoat: Number = 0.0
    clearcoatRoughness: Number = 0.01
    opacity: Number = 1.0
    opacityMode: str = "transparent"
    opacityThreshold: Number = 0.0
    ior: Number = 1.5
    normal: Color = (0.0, 0.0, 1.0)
    displacement: Number = 0.0
    specularEdgeColor: Color = (1.0, 1.0, 1.0)

    def fault(self) -> str:
        """As of every material, and of the mode."""
        known = self.opacityMode in OPACITY_MODES
        return super().fault() or ("" if known else f"opacityMode is {self.opacityMode!r}, not one of {OPACITY_MODES}")

    def pack(self) -> np.ndarray:
        """Values by input number: (n, 3)."""
        rows = [constant(getattr(self, name)) for name in INPUTS[:-1]]
        return np.array([*rows, [float(self.opacityMode == "presence"), 0, 0]], np.float32)

    def passes_light(self) -> bool:
        """Whether rays may go straight through."""
        if isinstance(self.opacityThreshold, Varying):
            return True
        return least(self.opacity) < (self.opacityThreshold if self.opacityThreshold > 0 else 1.0)

    def is_cut_out(self) -> bool:
        """Whether it is either there or not, by a threshold."""
        return isinstance(self.opacityThreshold, Varying) or self.opacityThreshold > 0

    def largest_emission(self) -> float:
        """Upper bound on the luminance that is emitted; 1 where it varies."""
        if isinstance(self.emissiveColor, Varying):
            return 1.0
        return float(np.dot(self.emissiveColor, LUMINANCE))

    def lobes(self) -> tuple[str, ...]:
        """The diffuse part unless it is all metal, the specular lobe, and the clearcoat's."""
        metal = self.useSpecularWorkflow == 0 and self.metallic == 1.0
        black = not isinstance(self.diffuseColor, Varying) and np.max(self.diffuseColor) <= 0.0
        found = set() if metal or black else {"diffuse"}
        if not (metal and black):
            found |= _gloss_of(self.roughness)
        if isinstance(self.clearcoat, Varying) or self.clearcoat > 0.0:
            found |= {"clearcoat"} | _gloss_of(self.clearcoatRoughness)
        return tuple(sorted(found))

    def largest_albedo(self) -> float:
        """Upper bound on the reflected share of light, any direction and channel."""
        names = ("diffuseColor", "specularColor", "useSpecularWorkflow", "metallic", "roughness", "ior")
        if any(isinstance(getattr(self, name), Varying) for name in (*names, "clearcoat", "clearcoatRoughness")):
            return 1.0
        tint, f0 = np.array(self.diffuseColor), np.array(self.specularColor)
        edge = self.specularEdgeColor
        f90 = 1.0 if isinstance(edge, Varying) else np.clip(edge, 0.0, 1.0)
        ior = max(self.ior, 0.0)
        diffuse, coat_f0 = tint, ((1 - ior) / (1 + ior)) ** 2
        if not self.useSpecularWorkflow:
            f90 = 1 - self.metallic + tint * self.metallic
            f0 = f90 * (coat_f0 * (1 - self.metallic) + self.metallic)
            diffuse = tint * (1 - self.metallic)
        base = _gloss(self.roughness, f0, f90) + np.max(diffuse) * (1 - np.min(f0))
        coat = self.clearcoat * _gloss(self.clearcoatRoughness, coat_f0, 1.0)
        return float(min(1.0, coat + (1 - coat) * base))


def _gloss_of(roughness: Number) -> set[str]:
    """Whether a lobe of this roughness is perfect, or may be."""
    if isinstance(roughness, Varying):
        return {"glossy", "mirror"}
    return {"mirror"} if is_perfect(roughness) else {"glossy"}


def _gloss(roughness: float, f0: np.ndarray | float, f90: np.ndarray | float) -> float:
    """Largest directional albedo of a lobe; the two roughnesses of the table on either side bound it."""
    position = np.clip(roughness, 0.0, 1.0) * (SIZE - 1)
    white = albedo_table()[:, [int(position), int(np.ceil(position))], :2].reshape(-1, 2, 1)
    return float((f0 * (white[:, 0] - white[:, 1]) + f90 * white[:, 1]).max())


@cache
def prepare_function(features: tuple[str, ...]) -> wp.Function:
    """`prepare(scene, surface) -> Bsdf`: Fresnel ends, alphas and what is left of the diffuse part."""
    material_values = values_function(features)
    compensated = "energy compensation" in features

    @wp.func
    def prepare(scene: DeviceScene, surface: Surface) -> Bsdf:
        values = material_values(scene, surface)
        bsdf = Bsdf()
        opacity = wp.clamp(values[OPACITY, 0], 0.0, 1.0)
        presence = values[OPACITY_MODE, 0] > 0.5
        if values[OPACITY_THRESHOLD, 0] > 0.0:
            opacity = wp.where(values[OPACITY, 0] >= values[OPACITY_THRESHOLD, 0], 1.0, 0.0)
            presence = wp.bool(True)
        bsdf.pass_through = 1.0 - opacity
        bsdf.present = wp.where(presence, opacity, 1.0)
        if presence and opacity <= 0.0:
            return bsdf

        bsdf.emission = row_of(values, EMISSIVE_COLOR)
        ior = wp.max(values[IOR, 0], 0.0)
        r = (1.0 - ior) / (1.0 + ior)
        bsdf.coat_f0 = wp.min(r * r, 1.0)
        bsdf.f90 = clamped(row_of(values, SPECULAR_EDGE_COLOR))
        bsdf.diffuse = clamped(row_of(values, DIFFUSE_COLOR))
        bsdf.f0 = clamped(row_of(values, SPECULAR_COLOR))
        if values[USE_SPECULAR_WORKFLOW, 0] < 0.5:
            metallic = wp.clamp(values[METALLIC, 0], 0.0, 1.0)
            tint = wp.vec3(1.0, 1.0, 1.0) * (1.0 - metallic) + bsdf.diffuse * metallic
            bsdf.f0 = tint * (bsdf.coat_f0 * (1.0 - metallic) + metallic)
            bsdf.f90 = tint
            bsdf.diffuse = bsdf.diffuse * (1.0 - metallic)
        roughness = wp.clamp(values[ROUGHNESS, 0], 0.0, 1.0)
        bsdf.alpha = roughness * roughness
        bsdf.coat = wp.clamp(values[CLEARCOAT, 0], 0.0, 1.0)
        coat_roughness = wp.clamp(values[CLEARCOAT_ROUGHNESS, 0], 0.0, 1.0)
        bsdf.coat_alpha = coat_roughness * coat_roughness

        if wp.static(compensated):
            if scene.energy_compensation != 0:
                bsdf.multiple = multiple_scattering(scene, bsdf)
        bsdf.cover = 1.0
        if presence:
            bsdf.emission = bsdf.emission * opacity
        else:
            bsdf.cover = opacity
            bsdf.diffuse = bsdf.diffuse * opacity
        bsdf.pass_through = bsdf.pass_through * clear_share(scene, bsdf, surface, presence)
        return bsdf

    return prepare


@wp.func
def multiple_scattering(scene: DeviceScene, bsdf: Bsdf) -> wp.vec3:
    """Albedo of all later bounces between facets, as a share of what a first one of white facets loses."""
    if bsdf.alpha < SMALLEST_ALPHA:
        return wp.vec3(0.0, 0.0, 0.0)
    average = white_albedo(scene.albedo, 1.0, bsdf.alpha)[3]
    # Twice the mean of Schlick's (1 - cos)^5 weighted by the cosine is 1/21.
    fresnel = bsdf.f0 + (bsdf.f90 - bsdf.f0) / 21.0
    share = wp.cw_mul(fresnel, fresnel) * average
    ones = wp.vec3(1.0, 1.0, 1.0)
    return wp.cw_div(share, ones - fresnel * (1.0 - average))


@wp.func
def coat_fresnel(bsdf: Bsdf, cos_theta: float) -> float:
    """Reflectance of the clearcoat, its weight included."""
    return bsdf.coat * (bsdf.coat_f0 + (1.0 - bsdf.coat_f0) * schlick_weight(cos_theta))


@wp.func
def clear_share(scene: DeviceScene, bsdf: Bsdf, surface: Surface, presence: bool) -> float:
    """What is left for light to go straight through: all of it where the whole surface fades."""
    if presence or bsdf.pass_through <= 0.0:
        return 1.0
    cosine = wp.dot(surface.normal, surface.outgoing)
    reflected = max_component(specular_albedo(bsdf, white_albedo(scene.albedo, cosine, bsdf.alpha)))
    return wp.max(0.0, 1.0 - reflected) * (1.0 - coat_albedo(scene, bsdf, cosine))


@wp.func
def specular_albedo(bsdf: Bsdf, white: wp.vec4) -> wp.vec3:
    """Directional albedo of the specular lobe, later bounces between facets included."""
    return bsdf.f0 * (white[0] - white[1]) + bsdf.f90 * white[1] + bsdf.multiple * (1.0 - white[0])


@wp.func
def coat_albedo(scene: DeviceScene, bsdf: Bsdf, cosine: float) -> float:
    """Directional albedo of the clearcoat."""
    if bsdf.coat <= 0.0:
        return 0.0
    white = white_albedo(scene.albedo, cosine, bsdf.coat_alpha)
    return bsdf.coat * (bsdf.coat_f0 * (white[0] - white[1]) + white[1])


@wp.func
def diffuse_scale(bsdf: Bsdf, white: wp.vec4) -> float:
    """Factor at most 1 that keeps the albedos of all lobes, and what goes straight through, together at most 1."""
    ones = wp.vec3(1.0, 1.0, 1.0)
    passed = ones - bsdf.f0 * (1.0 - white[2]) - bsdf.f90 * white[2]
    diffuse = wp.cw_mul(bsdf.diffuse, wp.max(passed, wp.vec3(0.0, 0.0, 0.0)))
    left = wp.max(ones - specular_albedo(bsdf, white), wp.vec3(0.0, 0.0, 0.0)) * bsdf.cover
    scale = wp.float32(1.0)
    for c in range(3):
        if diffuse[c] > left[c]:
            scale = wp.min(scale, left[c] / diffuse[c])
    return scale


@wp.func
def lobe_probabilities(scene: DeviceScene, bsdf: Bsdf, wo: wp.vec3) -> wp.vec4:
    """Probability of sampling the cosine-weighted, specular, clearcoat and straight-through lobe: by their albedos."""
    white = white_albedo(scene.albedo, wo[2], bsdf.alpha)
    coat = coat_albedo(scene, bsdf, wo[2])
    below_coat = bsdf.present * (1.0 - coat)
    coat = bsdf.present * coat
    multiple = bsdf.multiple * (1.0 - white[0])
    specular = max_component(specular_albedo(bsdf, white) - multiple) * below_coat
    diffuse = (max_component(bsdf.diffuse) * diffuse_scale(bsdf, white) + max_component(multiple)) * below_coat
    total = diffuse + specular + coat + bsdf.pass_through
    if total <= 0.0:
        return wp.vec4(0.0, 0.0, 0.0, 0.0)
    return wp.vec4(diffuse / total, specular / total, coat / total, bsdf.pass_through / total)


@wp.func
def diffuse_lobe(bsdf: Bsdf, wi: wp.vec3, half_cos: float, white_o: wp.vec4, white_i: wp.vec4) -> wp.vec3:
    """F cos θ of the diffuse part, for the white albedos of both directions."""
    if max_component(bsdf.diffuse) <= 0.0:
        return wp.vec3(0.0, 0.0, 0.0)
    scale = wp.min(diffuse_scale(bsdf, white_o), diffuse_scale(bsdf, white_i))
    passed = wp.vec3(1.0, 1.0, 1.0) - schlick(bsdf.f0, bsdf.f90, half_cos)
    return wp.cw_mul(bsdf.diffuse, wp.max(passed, wp.vec3(0.0, 0.0, 0.0))) * (scale * INV_PI * wi[2])


@wp.func
def multiple_lobe(bsdf: Bsdf, wi: wp.vec3, white_o: wp.vec4, white_i: wp.vec4) -> wp.vec3:
    """F cos θ of what bounces more than once between facets (Kulla and Conty 2017)."""
    lost = wp.max(1.0 - white_o[0], 0.0) * wp.max(1.0 - white_i[0], 0.0)
    return bsdf.multiple * (lost * INV_PI * wi[2] / wp.max(1.0 - white_o[3], 1.0e-6))


@wp.func
def evaluate(scene: DeviceScene, bsdf: Bsdf, wo: wp.vec3, wi: wp.vec3) -> BsdfValue:
    """All lobes but the delta ones, with the pdf of `sample`."""
    value = BsdfValue()
    if wo[2] <= 0.0 or wi[2] <= 0.0:
        return value
    h = wo + wi
    length = wp.length(h)
    # Opposite directions have no half-vector (hard case S9).
    if length < 1.0e-6:
        return value
    h = h / length
    half_cos = wp.clamp(wp.dot(wo, h), 0.0, 1.0)
    probability = lobe_probabilities(scene, bsdf, wo)
    below_coat = bsdf.present * (1.0 - wp.max(coat_albedo(scene, bsdf, wo[2]), coat_albedo(scene, bsdf, wi[2])))
    white_o = white_albedo(scene.albedo, wo[2], bsdf.alpha)
    white_i = white_albedo(scene.albedo, wi[2], bsdf.alpha)
    value.diffuse = diffuse_lobe(bsdf, wi, half_cos, white_o, white_i) * below_coat
    value.pdf = probability[0] * cosine_hemisphere_pdf(wi[2])
    if bsdf.alpha >= SMALLEST_ALPHA:
        fresnel = schlick(bsdf.f0, bsdf.f90, half_cos)
        value.specular += fresnel * (below_coat * ggx_reflection(wo, wi, h, bsdf.alpha))
        value.specular += multiple_lobe(bsdf, wi, white_o, white_i) * below_coat
        value.pdf += probability[1] * ggx_visible_pdf(wo, h, bsdf.alpha)
    if bsdf.coat > 0.0 and bsdf.coat_alpha >= SMALLEST_ALPHA:
        white = bsdf.present * coat_fresnel(bsdf, half_cos) * ggx_reflection(wo, wi, h, bsdf.coat_alpha)
        value.specular += wp.vec3(white, white, white)
        value.pdf += probability[2] * ggx_visible_pdf(wo, h, bsdf.coat_alpha)
    return value


@wp.func
def mirror(bsdf: Bsdf, wo: wp.vec3, weight: wp.vec3, probability: float, stay: float) -> BsdfSample:
    """A delta reflection about the normal."""
    result = BsdfSample()
    result.stay = stay
    result.event = wp.where(probability > 0.0, EVENT_DELTA, EVENT_ABSORB)
    result.direction = wp.vec3(-wo[0], -wo[1], wo[2])
    result.specular = weight * (bsdf.present / probability)
    return result


@wp.func
def sample(scene: DeviceScene, bsdf: Bsdf, wo: wp.vec3, u: wp.vec2, lobe: float) -> BsdfSample:
    """Pick a lobe, sample it, and weigh by the pdf of all lobes that could have given the direction."""
    result = BsdfSample()
    probability = lobe_probabilities(scene, bsdf, wo)
    result.stay = 1.0 - probability[3]
    wi = wp.vec3(0.0, 0.0, 0.0)
    if lobe < probability[0]:
        wi = cosine_hemisphere(u)
    elif lobe < probability[0] + probability[1]:
        if bsdf.alpha < SMALLEST_ALPHA:
            below_coat = 1.0 - coat_albedo(scene, bsdf, wo[2])
            return mirror(bsdf, wo, schlick(bsdf.f0, bsdf.f90, wo[2]) * below_coat, probability[1], result.stay)
        h = ggx_visible_normal(wo, bsdf.alpha, u)
        wi = h * (2.0 * wp.dot(wo, h)) - wo
    elif lobe < probability[0] + probability[1] + probability[2]:
        if bsdf.coat_alpha < SMALLEST_ALPHA:
            return mirror(bsdf, wo, wp.vec3(coat_fresnel(bsdf, wo[2])), probability[2], result.stay)
        h = ggx_visible_normal(wo, bsdf.coat_alpha, u)
        wi = h * (2.0 * wp.dot(wo, h)) - wo
    elif probability[3] > 0.0:
        result.event = EVENT_PASS
        result.direction = -wo
        result.specular = wp.vec3(bsdf.pass_through / probability[3])
        return result
    return scattered(wi, evaluate(scene, bsdf, wo, wi), result.stay)
