"""Arithmetic with known error: products, frames, hit points and the origins of the rays that leave them.

u = 2^-24 is half the distance from 1 to the next float32; γ(n) = n u / (1 - n u) bounds the relative error of n
rounded operations (Higham, Accuracy and Stability of Numerical Algorithms, §3.1; pbrt-v4 §6.8.1).
"""

from __future__ import annotations

import warp as wp

PI = wp.constant(wp.float32(3.14159265358979323846))
INV_PI = wp.constant(wp.float32(0.31830988618379067154))
INFINITY = wp.constant(wp.float32(float("inf")))

_UNIT_ROUNDOFF = 2.0**-24


def gamma(n: int) -> float:
    """γ(n), the bound on the relative error of n rounded float32 operations."""
    return n * _UNIT_ROUNDOFF / (1.0 - n * _UNIT_ROUNDOFF)


GAMMA_3 = wp.constant(wp.float32(gamma(3)))
GAMMA_5 = wp.constant(wp.float32(gamma(5)))
GAMMA_7 = wp.constant(wp.float32(gamma(7)))

#: Below this squared length a direction's components are so close to float32's underflow that its length is lost.
_TINY_SQUARED = wp.constant(wp.float32(1.0e-30))
_HUGE_SQUARED = wp.constant(wp.float32(1.0e30))


@wp.func
def is_finite(v: wp.vec3) -> bool:
    """Whether all three components are numbers below infinity."""
    return wp.isfinite(v[0]) and wp.isfinite(v[1]) and wp.isfinite(v[2])


@wp.func
def max_component(v: wp.vec3) -> float:
    """The largest of the three components."""
    return wp.max(v[0], wp.max(v[1], v[2]))


@wp.func
def safe_normalize(v: wp.vec3) -> wp.vec3:
    """Unit vector of v at any scale that float32 can hold; zero when v is zero or not finite.

    `wp.normalize` underflows to zero below lengths of 1e-23 and overflows above 1e19.
    """
    squared = wp.dot(v, v)
    if squared > _TINY_SQUARED and squared < _HUGE_SQUARED:
        return v / wp.sqrt(squared)
    largest = max_component(wp.abs(v))
    if not is_finite(v) or largest == 0.0:
        return wp.vec3(0.0, 0.0, 0.0)
    scaled = wp.vec3(v[0] / largest, v[1] / largest, v[2] / largest)
    return scaled / wp.length(scaled)


@wp.func
def tangent_of(n: wp.vec3) -> wp.vec3:
    """First tangent of an orthonormal frame about the unit vector n (Duff et al., JCGT 6(1), 2017)."""
    sign = wp.float32(1.0)
    if n[2] < 0.0:
        sign = wp.float32(-1.0)
    a = -1.0 / (sign + n[2])
    return wp.vec3(1.0 + sign * n[0] * n[0] * a, sign * n[0] * n[1] * a, -sign * n[0])


@wp.func
def to_frame(tangent: wp.vec3, n: wp.vec3, v: wp.vec3) -> wp.vec3:
    """World vector v in the frame (tangent, n × tangent, n)."""
    return wp.vec3(wp.dot(v, tangent), wp.dot(v, wp.cross(n, tangent)), wp.dot(v, n))


@wp.func
def from_frame(tangent: wp.vec3, n: wp.vec3, v: wp.vec3) -> wp.vec3:
    """World vector of v, given in the frame (tangent, n × tangent, n)."""
    return tangent * v[0] + wp.cross(n, tangent) * v[1] + n * v[2]


@wp.func
def abs_mul(m: wp.mat33, v: wp.vec3) -> wp.vec3:
    """|M| |v|, element by element: how far errors in v reach through M."""
    return wp.vec3(
        wp.abs(m[0, 0] * v[0]) + wp.abs(m[0, 1] * v[1]) + wp.abs(m[0, 2] * v[2]),
        wp.abs(m[1, 0] * v[0]) + wp.abs(m[1, 1] * v[1]) + wp.abs(m[1, 2] * v[2]),
        wp.abs(m[2, 0] * v[0]) + wp.abs(m[2, 1] * v[1]) + wp.abs(m[2, 2] * v[2]),
    )


@wp.func
def transformed_point_error(linear: wp.mat33, translation: wp.vec3, p: wp.vec3, error: wp.vec3) -> wp.vec3:
    """Bound on the error of linear p + translation, p known to ± error (pbrt-v4 §6.8.3)."""
    rounding = abs_mul(linear, p) + wp.abs(translation)
    return abs_mul(linear, error) * (1.0 + GAMMA_3) + rounding * GAMMA_3


@wp.func
def next_float(x: float, direction: float) -> float:
    """The float32 next to x towards +infinity (direction > 0) or -infinity (direction < 0)."""
    if direction == 0.0 or not wp.isfinite(x):
        return x
    if x == 0.0:
        return wp.sign(direction) * 1.401298464324817e-45
    bits = wp.cast(x, wp.int32)
    if (direction > 0.0) == (x > 0.0):
        bits = bits + 1
    else:
        bits = bits - 1
    return wp.cast(bits, wp.float32)


@wp.func
def offset_origin(p: wp.vec3, error: wp.vec3, n: wp.vec3, direction: wp.vec3) -> wp.vec3:
    """Origin of a ray that leaves the surface at p ± error with normal n, on the side of `direction`.

    The box of the error bound is pushed wholly off the tangent plane and rounded away from it (pbrt-v4 §6.8.6), but
    no less than its longest side: a plane through the origin has no error across, and rays in it have along it.
    """
    reach = wp.max(wp.dot(wp.abs(n), error), max_component(error))
    offset = n * reach
    if wp.dot(direction, n) < 0.0:
        offset = -offset
    return wp.vec3(
        next_float(p[0] + offset[0], offset[0]),
        next_float(p[1] + offset[1], offset[1]),
        next_float(p[2] + offset[2], offset[2]),
    )
