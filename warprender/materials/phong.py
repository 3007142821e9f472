"""Phong's reflection model (Phong, Illumination for Computer Generated Pictures, 1975), as in the lecture:

I = Σ_L (k_a + k_d (l·n) + k_s (r·v)^α) L, where r is the direction l to the light, reflected about the normal n.

L is what a light sends to a surface that faces it: the irradiance of a sun, the radiance of an area light, integrated.
There is no π in it, and a surface may reflect more than arrives. So `path`, in which light goes on from surface to
surface, takes f cos θ = (k_d (l·n) + k_s (r·v)^α) / π: k_d is a Lambert albedo there, k_a, which stands for light from
other surfaces, is left out, and where k_d + 2 k_s / (α + 1), which bounds the reflected share, is above 1 all is
divided by it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import warp as wp

from ..numerics import INV_PI, from_frame, max_component, tangent_of
from ..records import Bsdf, BsdfSample, BsdfValue, DeviceScene, Surface
from ..sampling import cosine_hemisphere, cosine_hemisphere_pdf
from .inputs import Color, Number, Varying, row_of, values_function
from .material import BaseMaterial
from .scattering import scattered

#: Inputs in the order of their numbers; `normal` has the number of all kinds.
INPUTS = ("ambientColor", "diffuseColor", "specularColor", "exponent")
AMBIENT, DIFFUSE, SPECULAR, EXPONENT = (wp.constant(wp.int32(number)) for number in range(4))

#: Exponents are taken up to this; float32 cannot resolve a narrower highlight.
LARGEST_EXPONENT = wp.constant(wp.float32(1.0e7))


@dataclass
class Phong(BaseMaterial):
    """Phong's reflection model; in USD the shader id `warprender:Phong`, with these inputs.

    Every input is a constant, a `Texture` or a `PrimvarReader`. Transports that add up lights one by one ("local",
    "direct") draw the formula as it is, with the ambient part of visible lights in "direct"; see the module
    for "path".

    Attributes:
        ambientColor: k_a, reflected of each light wherever it is.
        diffuseColor: k_d.
        specularColor: k_s.
        exponent: α, from 0 to 1e7.
        normal: in the tangent frame of the texture coordinates; of any length.
    """

    inputs = INPUTS

    ambientColor: Color = (0.0, 0.0, 0.0)
    diffuseColor: Color = (0.18, 0.18, 0.18)
    specularColor: Color = (0.0, 0.0, 0.0)
    exponent: Number = 32.0
    normal: Color = (0.0, 0.0, 1.0)

    def lobes(self) -> tuple[str, ...]:
        """The diffuse part, and the highlight."""
        named = {"diffuse": self.diffuseColor, "glossy": self.specularColor}
        return tuple(name for name, color in named.items() if isinstance(color, Varying) or np.max(color) > 0)

    def largest_albedo(self) -> float:
        """Upper bound on the share of light that "path" reflects, any direction and channel."""
        if any(isinstance(value, Varying) for value in (self.diffuseColor, self.specularColor, self.exponent)):
            return 1.0
        lobe = np.maximum(self.specularColor, 0.0) * 2.0 / (np.clip(self.exponent, 0.0, None) + 1.0)
        return float(min(1.0, np.max(np.maximum(self.diffuseColor, 0.0) + lobe)))


@cache
def prepare_function(features: tuple[str, ...]) -> wp.Function:
    """`prepare(scene, surface) -> Bsdf`: k_d, k_s as `diffuse`, `f0`, α as `alpha`, the factor on both as `coat`."""
    material_values = values_function(features)

    @wp.func
    def prepare(scene: DeviceScene, surface: Surface) -> Bsdf:
        values = material_values(scene, surface)
        none = wp.vec3(0.0, 0.0, 0.0)
        bsdf = Bsdf()
        bsdf.present = 1.0
        bsdf.diffuse = wp.max(row_of(values, DIFFUSE), none)
        bsdf.f0 = wp.max(row_of(values, SPECULAR), none)
        bsdf.alpha = wp.clamp(values[EXPONENT, 0], 0.0, LARGEST_EXPONENT)
        bsdf.coat = 1.0
        if scene.local_reflection != 0:
            bsdf.ambient = wp.max(row_of(values, AMBIENT), none)
        else:
            bsdf.coat = INV_PI / wp.max(1.0, max_component(bsdf.diffuse + bsdf.f0 * (2.0 / (bsdf.alpha + 1.0))))
        return bsdf

    return prepare


@wp.func
def diffuse_probability(bsdf: Bsdf) -> float:
    """Probability of drawing a direction for the diffuse part; 1 where nothing is reflected."""
    diffuse = max_component(bsdf.diffuse)
    specular = max_component(bsdf.f0) * 2.0 / (bsdf.alpha + 1.0)
    return wp.where(specular > 0.0, diffuse / (diffuse + specular), 1.0)


@wp.func
def evaluate(scene: DeviceScene, bsdf: Bsdf, wo: wp.vec3, wi: wp.vec3) -> BsdfValue:
    """The formula without its ambient part."""
    value = BsdfValue()
    if wi[2] > 0.0 and wo[2] > 0.0:
        # r·v = l·(v reflected about n).
        lobe = wp.pow(wp.max(wi[2] * wo[2] - wi[0] * wo[0] - wi[1] * wo[1], 0.0), bsdf.alpha)
        value.diffuse = bsdf.diffuse * (bsdf.coat * wi[2])
        value.specular = bsdf.f0 * (bsdf.coat * lobe)
        p = diffuse_probability(bsdf)
        value.pdf = p * cosine_hemisphere_pdf(wi[2]) + (1.0 - p) * lobe * (bsdf.alpha + 1.0) * (0.5 * INV_PI)
    return value


@wp.func
def sample(scene: DeviceScene, bsdf: Bsdf, wo: wp.vec3, u: wp.vec2, lobe: float) -> BsdfSample:
    """Cosine-weighted, or about the mirror direction with density (α + 1) / 2π cos^α (Lafortune and Willems 1994)."""
    wi = cosine_hemisphere(u)
    if lobe >= diffuse_probability(bsdf):
        # 1 - cos² = 1 - exp(x), without the cancellation of narrow highlights.
        x = 2.0 * wp.log(1.0 - u[0]) / (bsdf.alpha + 1.0)
        square = wp.where(x > -1.0e-3, -x * (1.0 + 0.5 * x), 1.0 - wp.exp(x))
        sine = wp.sqrt(wp.clamp(square, 0.0, 1.0))
        phi = 2.0 * wp.pi * u[1]
        about = wp.vec3(sine * wp.cos(phi), sine * wp.sin(phi), wp.sqrt(wp.max(0.0, 1.0 - sine * sine)))
        mirrored = wp.vec3(-wo[0], -wo[1], wo[2])
        wi = from_frame(tangent_of(mirrored), mirrored, about)
    return scattered(wi, evaluate(scene, bsdf, wo, wi), 1.0)
