"""GGX microfacets with height-correlated Smith shadowing (Walter et al. 2007; Heitz 2014), isotropic.

Directions are unit vectors of the shading frame, z along the normal. Vector forms: nothing cancels as alpha → 0.
"""

from __future__ import annotations

import numpy as np
import warp as wp

from ..numerics import PI

#: Below this alpha a lobe is a delta lobe: a float32 half-vector no longer resolves it.
SMALLEST_ALPHA = wp.constant(wp.float32(1.0e-4))


def is_perfect(roughness: float) -> bool:
    """Whether a lobe of this roughness is a delta lobe, in the float32 arithmetic of kernels."""
    clipped = np.float32(np.clip(roughness, 0.0, 1.0))
    return bool(clipped * clipped < np.float32(float(SMALLEST_ALPHA)))


@wp.func
def ggx_density(h: wp.vec3, alpha: float) -> float:
    """D(h)."""
    x = h[0] / alpha
    y = h[1] / alpha
    s = x * x + y * y + h[2] * h[2]
    return 1.0 / (PI * alpha * alpha * s * s)


@wp.func
def smith_length(w: wp.vec3, alpha: float) -> float:
    """√(z² + α² (x² + y²)), the part of Smith's G that depends on one direction."""
    return wp.sqrt(w[2] * w[2] + alpha * alpha * (w[0] * w[0] + w[1] * w[1]))


@wp.func
def ggx_visible_pdf(wo: wp.vec3, h: wp.vec3, alpha: float) -> float:
    """Density per solid angle of reflecting wo about a sampled visible normal h: G1(wo) D(h) / (4 wo.z)."""
    return 0.5 * ggx_density(h, alpha) / (wo[2] + smith_length(wo, alpha))


@wp.func
def ggx_reflection(wo: wp.vec3, wi: wp.vec3, h: wp.vec3, alpha: float) -> float:
    """D G2 / (4 wo.z), that is f cos θ without Fresnel."""
    masking = wo[2] * smith_length(wi, alpha) + wi[2] * smith_length(wo, alpha)
    if masking <= 0.0:
        return 0.0
    return 0.5 * ggx_density(h, alpha) * wi[2] / masking


@wp.func
def schlick_weight(cos_theta: float) -> float:
    """(1 - cos θ)⁵."""
    m = wp.clamp(1.0 - cos_theta, 0.0, 1.0)
    m2 = m * m
    return m2 * m2 * m


@wp.func
def schlick(f0: wp.vec3, f90: wp.vec3, cos_theta: float) -> wp.vec3:
    """Fresnel reflectance by Schlick's approximation."""
    return f0 + (f90 - f0) * schlick_weight(cos_theta)
