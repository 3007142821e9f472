"""Points on surfaces with bounds of their rounding error, and ray origins that clear those bounds.

No constant epsilon: an origin moves by the error bound of its own hit and is then rounded away from the
surface (pbrt-v4, sections 6.8.4 to 6.8.6). All bounds are absolute, one per axis, in the frame of their
point.
"""

import warp as wp

mat34 = wp.types.matrix(shape=(3, 4), dtype=wp.float32)

_UNIT = 2.0**-24  # unit roundoff of float32


def gamma(n: int) -> float:
    """Bound of the relative error of n roundings in a row (Higham; pbrt-v4 section 6.8.1)."""
    return n * _UNIT / (1.0 - n * _UNIT)


_GAMMA3, _GAMMA5, _GAMMA7 = gamma(3), gamma(5), gamma(7)


@wp.func
def next_up(x: wp.float32) -> wp.float32:
    """The smallest float32 above a finite x."""
    bits = wp.cast(x, wp.int32)
    if x == 0.0:
        bits = 1
    elif x > 0.0:
        bits += 1
    else:
        bits -= 1
    return wp.cast(bits, wp.float32)


@wp.func
def triangle_point(p0: wp.vec3, p1: wp.vec3, p2: wp.vec3, u: wp.float32, v: wp.float32):
    """The point with weights u of p1 and v of p2, and its error bound (pbrt-v4 section 6.8.5).

    About eight times closer to the plane than origin + t * direction.
    """
    a = (1.0 - u - v) * p0
    b = u * p1
    c = v * p2
    return a + b + c, (wp.abs(a) + wp.abs(b) + wp.abs(c)) * wp.static(_GAMMA7)


@wp.func
def sphere_point(radius: wp.float32, p: wp.vec3):
    """A point near a sphere about the origin put back on it, and its error bound (pbrt-v4 section 6.8.5)."""
    q = p * (radius / wp.length(p))
    return q, wp.abs(q) * wp.static(_GAMMA5)


@wp.func
def place_point(to_world: mat34, to_object: mat34, p: wp.vec3, error: wp.vec3):
    """A point of an instance in the world, and the bound within which rays meet its surface there.

    Two transforms round: this one, which places the point (pbrt-v4 section 6.8.6), and the one that takes
    rays back to object space, whose matrix is itself a rounded inverse.
    """
    q = wp.vec3()
    bound = wp.vec3()
    for i in range(3):
        q[i] = to_world[i, 3]
        bound[i] = wp.abs(to_world[i, 3]) * wp.static(_GAMMA3)
        for j in range(3):
            term = to_world[i, j] * p[j]
            q[i] += term
            bound[i] += wp.abs(term) * wp.static(_GAMMA3) + wp.abs(to_world[i, j]) * error[j] * wp.static(
                1.0 + _GAMMA3
            )
    for j in range(3):
        back = wp.abs(to_object[j, 3])
        for k in range(3):
            back += wp.abs(to_object[j, k] * q[k])
        for i in range(3):
            bound[i] += wp.abs(to_world[i, j]) * back * wp.static(_GAMMA5)
    return q, bound


@wp.func
def offset_origin(p: wp.vec3, error: wp.vec3, normal: wp.vec3, direction: wp.vec3) -> wp.vec3:
    """A ray origin beside p on the side that direction leaves to, clear of p's error box (pbrt-v4 section
    6.8.6).

    Args:
        p: The point.
        error: Its error bound.
        normal: The surface's geometric normal, unit, either side.
        direction: Where the ray goes; only its side matters.
    """
    side = normal
    if wp.dot(direction, normal) < 0.0:
        side = -normal
    q = p + side * wp.dot(wp.abs(normal), error)
    for i in range(3):
        # away even where the bound is zero: on a plane through the origin
        if side[i] > 0.0:
            q[i] = next_up(q[i])
        elif side[i] < 0.0:
            q[i] = -next_up(-q[i])
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

    Both ends are offset (pbrt-v4, ``SpawnRayTo``). A zero q_normal leaves the far end as it is, for point
    lights.
    """
    origin = offset_origin(p, p_error, p_normal, q - p)
    end = offset_origin(q, q_error, q_normal, origin - q)
    return origin, end - origin
