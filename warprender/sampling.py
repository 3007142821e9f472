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
DIMENSION_BSDF = wp.constant(wp.int32(0))
DIMENSION_LOBE = wp.constant(wp.int32(1))
DIMENSION_LIGHT = wp.constant(wp.int32(2))
DIMENSION_LIGHT_CHOICE = wp.constant(wp.int32(3))

_DIMENSIONS_PER_BOUNCE = wp.constant(wp.int32(4))
_GOLDEN = wp.constant(wp.uint64(0x9E3779B97F4A7C15))

#: Independent sequences that a pixel's Sobol points come from.
REPLICATES = wp.constant(2)
#: Sums of a pixel's samples that a film keeps apart: those of even number are of one sequence, the others of the other.
PARTS = wp.constant(4)


@wp.func
def mix_bits(x: wp.uint64) -> wp.uint64:
    """SplitMix64's finaliser (Stafford's variant 13): a bijection of 64-bit words without visible structure."""
    x = (x ^ (x >> wp.uint64(30))) * wp.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> wp.uint64(27))) * wp.uint64(0x94D049BB133111EB)
    return x ^ (x >> wp.uint64(31))


@wp.struct
class SampleStream:
    """The numbers of one sample of one pixel: a key, and for Sobol points the index in the pixel's sequence."""

    pixel: wp.int32
    key: wp.uint64
    index: wp.uint32
    sobol: wp.int32


@wp.func
def sample_stream(seed: wp.uint32, pixel: wp.int32, sample: wp.int32, sobol: wp.int32) -> SampleStream:
    """The stream of a sample; distinct (pixel, sample) never share one under one seed.

    A pixel's Sobol points are `REPLICATES` independently scrambled sequences that take turns: how far their means
    lie apart tells the error, which the spread of single samples overstates.
    """
    stream = SampleStream()
    stream.pixel = pixel
    number = sample
    if sobol != 0:
        stream.sobol = 1
        stream.index = wp.uint32(sample) / wp.uint32(REPLICATES)
        number = sample % REPLICATES
    word = (wp.uint64(wp.uint32(pixel)) << wp.uint64(32)) | wp.uint64(wp.uint32(number))
    stream.key = mix_bits(mix_bits(word) + wp.uint64(seed) * _GOLDEN)
    return stream


@wp.func
def branch(stream: SampleStream, number: wp.int32) -> SampleStream:
    """A stream of the same sample for one of several things that are sampled alike; number 0 has the stream itself."""
    result = SampleStream()
    result.pixel = stream.pixel
    result.key = stream.key
    result.index = stream.index
    result.sobol = stream.sobol
    if number != 0:
        result.key = mix_bits(stream.key + wp.uint64(wp.uint32(number)))
    return result


@wp.func
def random_pair(stream: SampleStream, bounce: wp.int32, dimension: wp.int32) -> wp.vec2:
    """Two numbers in [0, 1), for Sobol points well spread over a pixel's samples; bounces count from -1, the camera."""
    index = wp.uint64((bounce + 1) * _DIMENSIONS_PER_BOUNCE + dimension + 1)
    bits = mix_bits(stream.key + index * _GOLDEN)
    first = wp.uint32(bits >> wp.uint64(32))
    second = wp.uint32(bits & wp.uint64(0xFFFFFFFF))
    if stream.sobol != 0:
        return owen_sobol(stream.index, first, second)
    return wp.vec2(to_unit(first), to_unit(second))


@wp.func
def to_unit(bits: wp.uint32) -> float:
    """The upper 24 bits as a number in [0, 1): exact, so that it never rounds to 1."""
    return wp.float32(bits >> wp.uint32(8)) * 5.9604644775390625e-8


@wp.func_native(
    """
#ifdef __CUDA_ARCH__
    return __brev(x);
#else
    return __builtin_bitreverse32(x);
#endif
"""
)
def reverse_bits(x: wp.uint32) -> wp.uint32:
    """The 32 bits in the opposite order."""
    ...


@wp.func
def permute_low_to_high(x: wp.uint32, seed: wp.uint32) -> wp.uint32:
    """Hash in which each bit depends on lower bits alone: an Owen scramble of the reversed word.

    Laine and Karras 2011, with the constants that Vegdahl found to scramble best.
    """
    x = x ^ (x * wp.uint32(0x3D20ADEA))
    x = x + seed
    x = x * ((seed >> wp.uint32(16)) | wp.uint32(1))
    x = x ^ (x * wp.uint32(0x05526C56))
    return x ^ (x * wp.uint32(0x53A22864))


@wp.func
def pascal_bits(x: wp.uint32) -> wp.uint32:
    """Product with Pascal's triangle mod 2: the second Sobol dimension, bits reversed."""
    x = x ^ (x >> wp.uint32(16))
    x = x ^ ((x >> wp.uint32(8)) & wp.uint32(0x00FF00FF))
    x = x ^ ((x >> wp.uint32(4)) & wp.uint32(0x0F0F0F0F))
    x = x ^ ((x >> wp.uint32(2)) & wp.uint32(0x33333333))
    return x ^ ((x >> wp.uint32(1)) & wp.uint32(0x55555555))


@wp.func
def owen_sobol(index: wp.uint32, shuffle: wp.uint32, scramble: wp.uint32) -> wp.vec2:
    """Point of a shuffled, Owen-scrambled (0, 2)-sequence (Burley, JCGT 9(4), 2020).

    The first 2^k points, and each following 2^k, put one in every box of 2^-a by 2^(a - k).
    """
    number = reverse_bits(permute_low_to_high(reverse_bits(index), shuffle))
    x = reverse_bits(permute_low_to_high(number, scramble))
    y = reverse_bits(permute_low_to_high(pascal_bits(number), scramble * wp.uint32(0x2C1B3C6D) + shuffle))
    return wp.vec2(to_unit(x), to_unit(y))


@wp.func
def sin_cos(x: float) -> wp.vec2:
    """Sine and cosine of an angle in -π/4 … π/4, each within 1e-7 (the polynomials of Moshier's Cephes library).

    A third of the time of the general functions, which first bring the angle there.
    """
    s = x * x
    sine = x + x * s * (-1.6666654611e-1 + s * (8.3321608736e-3 - s * 1.9515295891e-4))
    cosine = 1.0 - 0.5 * s + s * s * (4.166664568298827e-2 + s * (-1.388731625493765e-3 + s * 2.443315711809948e-5))
    return wp.vec2(sine, cosine)


@wp.func
def unit_disk(u: wp.vec2) -> wp.vec2:
    """Uniform point of the unit disk, concentric (Shirley and Chiu 1997)."""
    x = 2.0 * u[0] - 1.0
    y = 2.0 * u[1] - 1.0
    if wp.abs(x) > wp.abs(y):
        turn = sin_cos(0.25 * PI * (y / x))
        return wp.vec2(x * turn[1], x * turn[0])
    turn = sin_cos(0.25 * PI * (x / wp.where(y == 0.0, 1.0, y)))
    return wp.vec2(y * turn[0], y * turn[1])


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
def interval_of(cdf: wp.array(dtype=wp.float32), u: float) -> int:
    """Number of the interval of a cumulative distribution, from 0 to 1, in which u lies."""
    low = wp.int32(0)
    high = cdf.shape[0] - 2
    while low < high:
        middle = (low + high) // 2
        if u < cdf[middle + 1]:
            high = middle
        else:
            low = middle + 1
    return low


@wp.func
def share_of(low: float, high: float, x: float) -> float:
    """Where x lies between two entries of a cumulative distribution: 0 to 1."""
    if high <= low:
        return 0.5
    return wp.clamp((x - low) / (high - low), 0.0, 1.0)


@wp.func
def power_heuristic(pdf: float, other: float) -> float:
    """Weight of the strategy with density `pdf` beside one with density `other` (Veach, β = 2)."""
    if pdf <= 0.0:
        return 0.0
    ratio = other / pdf
    return 1.0 / (1.0 + ratio * ratio)
