"""Arithmetic with known error: products, frames, hit points and the origins of the rays that leave them.

u = 2^-24 is half the distance from 1 to the next float32; γ(n) = n u / (1 - n u) bounds the relative error of n
rounded operations (Higham, Accuracy and Stability of Numerical Algorithms, §3.1; pbrt-v4 §6.8.1).
"""

from __future__ import annotations

import warp as wp

mat34 = wp.types.matrix(shape=(3, 4), dtype=wp.float32)
mat34d = wp.types.matrix(shape=(3, 4), dtype=wp.float64)

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
    # Comparisons with NaN are false; on the CPU `wp.isfinite` is a call.
    return wp.abs(v[0]) < INFINITY and wp.abs(v[1]) < INFINITY and wp.abs(v[2]) < INFINITY


@wp.func
def max_component(v: wp.vec3) -> float:
    """The largest of the three components."""
    return wp.max(v[0], wp.max(v[1], v[2]))


@wp.func
def linear_of(m: mat34) -> wp.mat33:
    """The linear part of an affine matrix for column vectors."""
    return wp.mat33(m[0, 0], m[0, 1], m[0, 2], m[1, 0], m[1, 1], m[1, 2], m[2, 0], m[2, 1], m[2, 2])


@wp.func
def translation_of(m: mat34) -> wp.vec3:
    """Where an affine matrix for column vectors takes the origin."""
    return wp.vec3(m[0, 3], m[1, 3], m[2, 3])


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
def next_up(x: wp.float32) -> wp.float32:
    """The smallest float32 above a finite x."""
    # The sum makes -0 into 0.
    bits = wp.cast(x + 0.0, wp.int32)
    bits += wp.where(bits >= 0, 1, -1)
    return wp.cast(bits, wp.float32)


@wp.func
def triangle_point(p0: wp.vec3, p1: wp.vec3, p2: wp.vec3, u: wp.float32, v: wp.float32):
    """The point with weights u of p1 and v of p2, and its error bound (pbrt-v4 section 6.8.5).

    About eight times closer to the plane than origin + t * direction.
    """
    a = (1.0 - u - v) * p0
    b = u * p1
    c = v * p2
    return a + b + c, (wp.abs(a) + wp.abs(b) + wp.abs(c)) * GAMMA_7


@wp.func
def sphere_point(radius: wp.float32, p: wp.vec3):
    """A point near a sphere about the origin put back on it, and its error bound (pbrt-v4 section 6.8.5)."""
    q = p * (radius / wp.length(p))
    return q, wp.abs(q) * GAMMA_5


@wp.func
def placed_point(to_world: mat34, p: wp.vec3) -> wp.vec3:
    """A point of an instance in the world."""
    q = wp.vec3()
    for i in range(3):
        q[i] = to_world[i, 3] + to_world[i, 0] * p[0] + to_world[i, 1] * p[1] + to_world[i, 2] * p[2]
    return q


@wp.func
def place_point(to_world: mat34, to_object: mat34, p: wp.vec3, error: wp.vec3):
    """A point of an instance in the world, and the bound within which rays meet its surface there.

    Two transforms round: this one, which places the point (pbrt-v4 section 6.8.6), and the one that takes rays back
    to object space, whose matrix is itself a rounded inverse.
    """
    q = placed_point(to_world, p)
    bound = wp.vec3()
    for i in range(3):
        bound[i] = wp.abs(to_world[i, 3]) * GAMMA_3
        for j in range(3):
            bound[i] += wp.abs(to_world[i, j] * p[j]) * GAMMA_3 + wp.abs(to_world[i, j]) * error[j] * (1.0 + GAMMA_3)
    for j in range(3):
        back = wp.abs(to_object[j, 3])
        for k in range(3):
            back += wp.abs(to_object[j, k] * q[k])
        for i in range(3):
            bound[i] += wp.abs(to_world[i, j]) * back * GAMMA_5
    return q, bound


@wp.func
def move_point(translation: wp.vec3, back: wp.vec3, p: wp.vec3, error: wp.vec3):
    """`place_point` for matrices that only move points, there by `translation` and back by `back`: the same bits."""
    q = translation + p
    bound = (wp.abs(translation) + wp.abs(p)) * GAMMA_3 + error * (1.0 + GAMMA_3)
    return q, bound + (wp.abs(back) + wp.abs(q)) * GAMMA_5


@wp.func
def offset_origin(p: wp.vec3, error: wp.vec3, normal: wp.vec3, direction: wp.vec3) -> wp.vec3:
    """A ray origin beside p on the side that direction leaves to, clear of p's error box (pbrt-v4 section 6.8.6).

    It moves by no less than the box's longest side: a plane through the origin has no error across it, but the rays
    that come back to it have.

    Args:
        p: The point.
        error: Its error bound.
        normal: The surface's geometric normal, unit, either side.
        direction: Where the ray goes; only its side matters.
    """
    side = normal
    if wp.dot(direction, normal) < 0.0:
        side = -normal
    q = p + side * wp.max(wp.dot(wp.abs(normal), error), max_component(error))
    for i in range(3):
        # Both neighbours, and no branch: which side it is changes from ray to ray.
        q[i] = wp.where(side[i] > 0.0, next_up(q[i]), wp.where(side[i] < 0.0, -next_up(-q[i]), q[i]))
    return q


@wp.func
def spawn_between(
    p: wp.vec3,
    p_error: wp.vec3,
    p_normal: wp.vec3,
    q: wp.vec3,
    q_error: wp.vec3,
    q_normal: wp.vec3,
):
    """Origin and direction of a shadow ray from p to q; with ``t_max`` 1 it meets neither's own surface.

    Both ends are offset (pbrt-v4, ``SpawnRayTo``). A zero q_normal leaves the far end as it is, for point lights.
    """
    origin = offset_origin(p, p_error, p_normal, q - p)
    end = offset_origin(q, q_error, q_normal, origin - q)
    return origin, end - origin
