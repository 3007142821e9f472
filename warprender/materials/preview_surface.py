"""UsdPreviewSurface (specification 2.5, and 2.6 for `opacityMode`) with constant inputs.

The specification adds its lobes up, which reflects more than arrives at grazing angles. A path tracer cannot: here
the diffuse part keeps the specification's value wherever the sum of directional albedos stays below 1, and is scaled
down to it elsewhere, at the viewer and at the light alike, so that it stays reciprocal. A clearcoat dims what lies
below it by its own directional albedo.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..numerics import INV_PI, max_component
from ..records import (
    EVENT_ABSORB,
    EVENT_DELTA,
    EVENT_PASS,
    EVENT_SCATTER,
    Bsdf,
    BsdfSample,
    BsdfValue,
    DeviceScene,
    Surface,
)
from ..sampling import cosine_hemisphere, cosine_hemisphere_pdf, ggx_visible_normal
from .albedo import SIZE, albedo_table, white_albedo
from .microfacet import (
    SMALLEST_ALPHA,
    ggx_reflection,
    ggx_visible_pdf,
    schlick,
    schlick_weight,
)

DIFFUSE_COLOR = wp.constant(wp.int32(0))
EMISSIVE_COLOR = wp.constant(wp.int32(1))
SPECULAR_COLOR = wp.constant(wp.int32(2))
WORKFLOW_METALLIC_IOR = wp.constant(wp.int32(3))
ROUGHNESS_COAT = wp.constant(wp.int32(4))
OPACITY_THRESHOLD_PRESENCE = wp.constant(wp.int32(5))


@dataclass
class PreviewSurface:
    """UsdPreviewSurface 2.6 with constant inputs; names and fallbacks as in the specification.

    Attributes:
        diffuseColor: linear Rec.709 albedo.
        emissiveColor: emitted radiance.
        useSpecularWorkflow: 1 takes F0 from `specularColor`, 0 from `metallic`, `diffuseColor` and `ior`.
        specularColor: F0 in the specular workflow.
        metallic: 0 dielectric … 1 metal.
        roughness: its square is the GGX alpha.
        clearcoat: weight of a second, white specular lobe.
        clearcoatRoughness: roughness of that lobe.
        opacity: 1 opaque … 0 clear.
        opacityMode: "transparent" (the diffuse part fades, reflections stay) or "presence" (all fades).
        opacityThreshold: above 0, a cut-out: below it nothing is drawn, from it on the surface is opaque.
        ior: index of refraction; sets F0 of dielectrics and of the clearcoat. Light goes straight through.
    """

    diffuseColor: tuple[float, float, float] = (0.18, 0.18, 0.18)
    emissiveColor: tuple[float, float, float] = (0.0, 0.0, 0.0)
    useSpecularWorkflow: int = 0
    specularColor: tuple[float, float, float] = (0.0, 0.0, 0.0)
    metallic: float = 0.0
    roughness: float = 0.5
    clearcoat: float = 0.0
    clearcoatRoughness: float = 0.01
    opacity: float = 1.0
    opacityMode: str = "transparent"
    opacityThreshold: float = 0.0
    ior: float = 1.5

    def pack(self) -> np.ndarray:
        """Values by input number: (n, 3)."""
        presence = float(self.opacityMode == "presence")
        roughness, coat_roughness = np.clip([self.roughness, self.clearcoatRoughness], 0.0, 1.0)
        return np.array(
            [
                self.diffuseColor,
                self.emissiveColor,
                self.specularColor,
                [self.useSpecularWorkflow, self.metallic, self.ior],
                [roughness, self.clearcoat, coat_roughness],
                [self.opacity, self.opacityThreshold, presence],
            ],
            np.float32,
        )

    def passes_light(self) -> bool:
        """Whether rays may go straight through."""
        return self.opacity < max(self.opacityThreshold, 1.0 if self.opacityThreshold <= 0 else 0.0)

    def largest_albedo(self) -> float:
        """Upper bound on the reflected share of light, any direction and channel."""
        tint, f0, f90 = np.array(self.diffuseColor), np.array(self.specularColor), 1.0
        diffuse, coat_f0 = tint, ((1 - self.ior) / (1 + self.ior)) ** 2
        if not self.useSpecularWorkflow:
            f90 = 1 - self.metallic + tint * self.metallic
            f0 = f90 * (coat_f0 * (1 - self.metallic) + self.metallic)
            diffuse = tint * (1 - self.metallic)
        base = _gloss(self.roughness, f0, f90) + np.max(diffuse) * (1 - np.min(f0))
        coat = self.clearcoat * _gloss(self.clearcoatRoughness, coat_f0, 1.0)
        return float(min(1.0, coat + (1 - coat) * base))


def _gloss(roughness: float, f0: np.ndarray | float, f90: np.ndarray | float) -> float:
    """Largest directional albedo of a lobe; the two roughnesses of the table on either side bound it."""
    position = np.clip(roughness, 0.0, 1.0) * (SIZE - 1)
    white = albedo_table()[:, [int(position), int(np.ceil(position))], :2].reshape(-1, 2, 1)
    return float((f0 * (white[:, 0] - white[:, 1]) + f90 * white[:, 1]).max())


@wp.func
def prepare(scene: DeviceScene, surface: Surface) -> Bsdf:
    """Fresnel ends, alphas and what is left of the diffuse part."""
    material = surface.material
    diffuse = scene.materials[material].values[DIFFUSE_COLOR]
    workflow = scene.materials[material].values[WORKFLOW_METALLIC_IOR]
    roughness = scene.materials[material].values[ROUGHNESS_COAT]
    opacity_inputs = scene.materials[material].values[OPACITY_THRESHOLD_PRESENCE]

    bsdf = Bsdf()
    bsdf.emission = scene.materials[material].values[EMISSIVE_COLOR]
    r = (1.0 - workflow[2]) / (1.0 + workflow[2])
    bsdf.coat_f0 = r * r
    bsdf.f0 = scene.materials[material].values[SPECULAR_COLOR]
    bsdf.f90 = wp.vec3(1.0, 1.0, 1.0)
    bsdf.diffuse = diffuse
    if workflow[0] < 0.5:
        metallic = wp.clamp(workflow[1], 0.0, 1.0)
        tint = wp.vec3(1.0, 1.0, 1.0) * (1.0 - metallic) + diffuse * metallic
        bsdf.f0 = tint * (bsdf.coat_f0 * (1.0 - metallic) + metallic)
        bsdf.f90 = tint
        bsdf.diffuse = diffuse * (1.0 - metallic)
    bsdf.alpha = roughness[0] * roughness[0]
    bsdf.coat = wp.clamp(roughness[1], 0.0, 1.0)
    bsdf.coat_alpha = roughness[2] * roughness[2]

    opacity = wp.clamp(opacity_inputs[0], 0.0, 1.0)
    if opacity_inputs[1] > 0.0:
        opacity = wp.where(opacity >= opacity_inputs[1], 1.0, 0.0)
    bsdf.pass_through = 1.0 - opacity
    bsdf.present = 1.0
    presence = opacity_inputs[2] > 0.5 or opacity_inputs[1] > 0.0
    if presence:
        bsdf.present = opacity
        bsdf.emission = bsdf.emission * opacity
    else:
        bsdf.diffuse = bsdf.diffuse * opacity
    bsdf.pass_through = bsdf.pass_through * clear_share(scene, bsdf, surface, presence)
    return bsdf


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
def specular_albedo(bsdf: Bsdf, white: wp.vec3) -> wp.vec3:
    """Directional albedo of the specular lobe."""
    return bsdf.f0 * (white[0] - white[1]) + bsdf.f90 * white[1]


@wp.func
def coat_albedo(scene: DeviceScene, bsdf: Bsdf, cosine: float) -> float:
    """Directional albedo of the clearcoat."""
    if bsdf.coat <= 0.0:
        return 0.0
    white = white_albedo(scene.albedo, cosine, bsdf.coat_alpha)
    return bsdf.coat * (bsdf.coat_f0 * (white[0] - white[1]) + white[1])


@wp.func
def diffuse_scale(bsdf: Bsdf, white: wp.vec3) -> float:
    """Factor at most 1 that keeps diffuse and specular albedo together at most 1."""
    ones = wp.vec3(1.0, 1.0, 1.0)
    passed = ones - bsdf.f0 * (1.0 - white[2]) - bsdf.f90 * white[2]
    diffuse = wp.cw_mul(bsdf.diffuse, wp.max(passed, wp.vec3(0.0, 0.0, 0.0)))
    left = wp.max(ones - specular_albedo(bsdf, white), wp.vec3(0.0, 0.0, 0.0))
    scale = wp.float32(1.0)
    for c in range(3):
        if diffuse[c] > left[c]:
            scale = wp.min(scale, left[c] / diffuse[c])
    return scale


@wp.func
def lobe_probabilities(scene: DeviceScene, bsdf: Bsdf, wo: wp.vec3) -> wp.vec4:
    """Probability of sampling the diffuse, specular, clearcoat and straight-through lobe: by their albedos."""
    white = white_albedo(scene.albedo, wo[2], bsdf.alpha)
    coat = coat_albedo(scene, bsdf, wo[2])
    below_coat = bsdf.present * (1.0 - coat)
    coat = bsdf.present * coat
    specular = max_component(specular_albedo(bsdf, white)) * below_coat
    diffuse = max_component(bsdf.diffuse) * diffuse_scale(bsdf, white) * below_coat
    total = diffuse + specular + coat + bsdf.pass_through
    if total <= 0.0:
        return wp.vec4(0.0, 0.0, 0.0, 0.0)
    return wp.vec4(diffuse / total, specular / total, coat / total, bsdf.pass_through / total)


@wp.func
def diffuse_lobe(scene: DeviceScene, bsdf: Bsdf, wo: wp.vec3, wi: wp.vec3, half_cos: float) -> wp.vec3:
    """F cos θ of the diffuse part."""
    if max_component(bsdf.diffuse) <= 0.0:
        return wp.vec3(0.0, 0.0, 0.0)
    scale = wp.min(
        diffuse_scale(bsdf, white_albedo(scene.albedo, wo[2], bsdf.alpha)),
        diffuse_scale(bsdf, white_albedo(scene.albedo, wi[2], bsdf.alpha)),
    )
    passed = wp.vec3(1.0, 1.0, 1.0) - schlick(bsdf.f0, bsdf.f90, half_cos)
    return wp.cw_mul(bsdf.diffuse, wp.max(passed, wp.vec3(0.0, 0.0, 0.0))) * (scale * INV_PI * wi[2])


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
    value.diffuse = diffuse_lobe(scene, bsdf, wo, wi, half_cos) * below_coat
    value.pdf = probability[0] * cosine_hemisphere_pdf(wi[2])
    if bsdf.alpha >= SMALLEST_ALPHA:
        fresnel = schlick(bsdf.f0, bsdf.f90, half_cos)
        value.specular += fresnel * (below_coat * ggx_reflection(wo, wi, h, bsdf.alpha))
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
    value = evaluate(scene, bsdf, wo, wi)
    if value.pdf > 0.0:
        result.event = EVENT_SCATTER
        result.direction = wi
        result.diffuse = value.diffuse / value.pdf
        result.specular = value.specular / value.pdf
        result.pdf = value.pdf
    return result
