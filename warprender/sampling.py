"""Random numbers, and how they become points and directions, each with its probability density.

A number depends on (seed, pixel, sample, bounce, dimension) alone, so pictures do not depend on threads, tiles or
on stopping and resuming. Dimensions are a fixed enumeration: an effect that is compiled out shifts no number.
"""

from __future__ import annotations

import warp as wp

from .numerics import INV_PI, PI

#: Dimensions of a camera sample (bounce -1) and of each bounce. Each is a pair of numbers.
DIMENSION_PIXEL = wp.constant(wp.int32(0))
DIMENSION_LENS = wp.constant(wp.int32(1))
DIMENSION_TIME = wp.constant(wp.int32(2))
DIMENSION_BSDF = wp.constant(wp.int32(0))
DIMENSION_LOBE = wp.constant(wp.int32(1))
DIMENSION_LIGHT = wp.constant(wp.int32(2))
DIMENSION_LIGHT_CHOICE = wp.constant(wp.int32(3))

_DIMENSIONS_PER_BOUNCE = wp.constant(wp.int32(4))
_ONE_MINUS_EPSILON = wp.constant(wp.float32(1.0 - 2.0**-24))


@wp.func
def mix_bits(x: wp.uint64) -> wp.uint64:
    """SplitMix64's finaliser (Stafford's variant 13): a bijection of 64-bit words without visible structure."""
    x = (x ^ (x >> wp.uint64(30))) * wp.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> wp.uint64(27))) * wp.uint64(0x94D049BB133111EB)
    return x ^ (x >> wp.uint64(31))


@wp.func
def sample_key(seed: wp.uint32, pixel: wp.int32, sample: wp.int32) -> wp.uint64:
    """Key of one sample of one pixel; distinct (pixel, sample) never share a key under one seed."""
    word = (wp.uint64(wp.uint32(pixel)) << wp.uint64(32)) | wp.uint64(wp.uint32(sample))
    return mix_bits(mix_bits(word) + wp.uint64(seed) * wp.uint64(0x9E3779B97F4A7C15))


@wp.func
def random_pair(key: wp.uint64, bounce: wp.int32, dimension: wp.int32) -> wp.vec2:
    """Two independent numbers in [0, 1) for a sample's key; `bounce` counts from -1, the camera."""
    index = wp.uint64((bounce + 1) * _DIMENSIONS_PER_BOUNCE + dimension + 1)
    bits = mix_bits(key + index * wp.uint64(0x9E3779B97F4A7C15))
    # 24 bits each: the quotient is exact and never rounds to 1.
    first = wp.float32(wp.uint32(bits >> wp.uint64(40))) * 5.9604644775390625e-8
    second = wp.float32(wp.uint32((bits >> wp.uint64(8)) & wp.uint64(0xFFFFFF))) * 5.9604644775390625e-8
    return wp.vec2(first, second)


@wp.func
def unit_disk(u: wp.vec2) -> wp.vec2:
    """Uniform point of the unit disk, concentric (Shirley and Chiu 1997)."""
    x = 2.0 * u[0] - 1.0
    y = 2.0 * u[1] - 1.0
    if x == 0.0 and y == 0.0:
        return wp.vec2(0.0, 0.0)
    radius = x
    angle = 0.25 * PI * (y / wp.where(x == 0.0, 1.0, x))
    if wp.abs(y) >= wp.abs(x):
        radius = y
        angle = 0.5 * PI - 0.25 * PI * (x / wp.where(y == 0.0, 1.0, y))
    return wp.vec2(radius * wp.cos(angle), radius * wp.sin(angle))


@wp.func
def cosine_hemisphere(u: wp.vec2) -> wp.vec3:
    """Direction about +Z with density cos θ / π (Malley)."""
    p = unit_disk(u)
    return wp.vec3(p[0], p[1], wp.sqrt(wp.max(0.0, 1.0 - p[0] * p[0] - p[1] * p[1])))


@wp.func
def cosine_hemisphere_pdf(cos_theta: float) -> float:
    """Density of `cosine_hemisphere` per solid angle."""
    return wp.max(cos_theta, 0.0) * INV_PI


@wp.func
def one_minus_cos(sin2: float) -> float:
    """1 - sqrt(1 - sin²), without the cancellation that loses narrow cones."""
    return sin2 / (1.0 + wp.sqrt(wp.max(0.0, 1.0 - sin2)))


@wp.func
def uniform_cone(u: wp.vec2, cone: float) -> wp.vec3:
    """Uniform direction of the cone about +Z with 1 - cos(half angle) = `cone`; density 1 / (2 π cone)."""
    below = u[0] * cone
    sin_theta = wp.sqrt(wp.max(0.0, below * (2.0 - below)))
    phi = 2.0 * PI * u[1]
    return wp.vec3(sin_theta * wp.cos(phi), sin_theta * wp.sin(phi), 1.0 - below)


@wp.func
def ggx_visible_normal(wo: wp.vec3, alpha: float, u: wp.vec2) -> wp.vec3:
    """Normal seen from wo (unit, z ≥ 0), by spherical caps (Dupuy and Benyoub 2023)."""
    stretched = wp.normalize(wp.vec3(alpha * wo[0], alpha * wo[1], wo[2]))
    phi = 2.0 * PI * u[0]
    z = (1.0 - u[1]) * (1.0 + stretched[2]) - stretched[2]
    sin_theta = wp.sqrt(wp.clamp(1.0 - z * z, 0.0, 1.0))
    half = wp.vec3(sin_theta * wp.cos(phi), sin_theta * wp.sin(phi), z) + stretched
    return wp.normalize(wp.vec3(alpha * half[0], alpha * half[1], wp.max(half[2], 0.0)))


@wp.func
def power_heuristic(pdf: float, other: float) -> float:
    """Weight of the strategy with density `pdf` beside one with density `other` (Veach, β = 2)."""
    if pdf <= 0.0:
        return 0.0
    ratio = other / pdf
    return 1.0 / (1.0 + ratio * ratio)
