"""A triangle that glows, seen from a point: sampled uniform in solid angle, by area where that is tiny.

The solid angle is Van Oosterom and Strackee's (1983). Directions are drawn in the form of Peters (2021, "BRDF
importance sampling for polygonal lights", §4): a corner is moved along its edge until the triangle has the share u of
the solid angle, then a point of the arc to it is drawn. It needs no angles between planes, which have lost all digits
of small triangles. Where Arvo (1995) says the same, his form does not keep them.
"""

from __future__ import annotations

import warp as wp

from ..numerics import linear_of, safe_normalize, translation_of
from ..records import Instance
from ..shapes.mesh import triangle_normal

#: Below this solid angle the arcs have too few digits in float32.
_LEAST = wp.constant(wp.float32(3.0e-4))


@wp.struct
class SeenTriangle:
    """A placed triangle relative to a point: corner `a`, edges from it, the product of the edges, and directions to
    the corners with what the closed forms need of them.

    `area2` is twice the area; `volume` the determinant of the directions; `solid_angle` 0 where it is too small.
    """

    a: wp.vec3
    ab: wp.vec3
    ac: wp.vec3
    product: wp.vec3
    area2: wp.float32
    to_a: wp.vec3
    to_b: wp.vec3
    to_c: wp.vec3
    volume: wp.float32
    solid_angle: wp.float32


@wp.struct
class DrawnPoint:
    """A point of a triangle: weights u of b and v of c, the way to it, and its density per solid angle (0: none)."""

    u: wp.float32
    v: wp.float32
    way: wp.vec3
    pdf: wp.float32


@wp.func
def seen_triangle(placed: Instance, p0: wp.vec3, p1: wp.vec3, p2: wp.vec3, p: wp.vec3) -> SeenTriangle:
    """A triangle of an instance as seen from p."""
    t = SeenTriangle()
    linear = linear_of(placed.to_world)
    t.a = linear * p0 + (translation_of(placed.to_world) - p)
    t.ab = linear * (p1 - p0)
    t.ac = linear * (p2 - p0)
    t.product = wp.cross(t.ab, t.ac)
    t.area2 = wp.length(t.product)
    b = t.a + t.ab
    c = t.a + t.ac
    la = wp.length(t.a)
    lb = wp.length(b)
    lc = wp.length(c)
    if la <= 0.0 or lb <= 0.0 or lc <= 0.0:
        return t
    t.to_a = t.a / la
    t.to_b = b / lb
    t.to_c = c / lc
    # From the edges, which small triangles keep their digits in.
    t.volume = wp.abs(wp.dot(t.to_a, t.product)) / (lb * lc)
    below = 1.0 + wp.dot(t.to_a, t.to_b) + wp.dot(t.to_a, t.to_c) + wp.dot(t.to_b, t.to_c)
    solid_angle = 2.0 * wp.atan2(t.volume, below)
    if solid_angle >= _LEAST:
        t.solid_angle = solid_angle
    return t


@wp.func
def density_of(t: SeenTriangle, way: wp.vec3) -> float:
    """Density per solid angle of `draw_point` at a point this way away; 0 where the triangle is seen edge-on."""
    if t.solid_angle > 0.0:
        return 1.0 / t.solid_angle
    square = wp.dot(way, way)
    facing = wp.abs(wp.dot(t.product, way))
    if facing <= 0.0:
        return 0.0
    # distance² / (cos · area)
    return 2.0 * square * wp.sqrt(square) / facing


@wp.func
def direction_in(t: SeenTriangle, u: wp.vec2) -> wp.vec3:
    """Direction uniform in the triangle's solid angle."""
    angle = 0.5 * t.solid_angle * u[0]
    s = wp.sin(angle)
    # Halfway between corner a and the corner moved along a c.
    along_a = t.volume * wp.cos(angle) - (wp.dot(t.to_a, t.to_c) + wp.dot(t.to_b, t.to_c)) * s
    along_c = (1.0 + wp.dot(t.to_a, t.to_b)) * s
    halfway = t.to_a * along_a + t.to_c * along_c
    moved = t.to_c
    square = wp.dot(halfway, halfway)
    if square > 0.0:
        moved = halfway * (2.0 * wp.dot(t.to_a, halfway) / square) - t.to_a
    # Uniform in the cosine to b: 1 - cos from the difference, which does not cancel, nor does what is square to b.
    apart = moved - t.to_b
    whole = wp.min(0.5 * wp.dot(apart, apart), 2.0)
    part = u[1] * whole
    across = safe_normalize(apart + t.to_b * whole)
    return t.to_b * (1.0 - part) + across * wp.sqrt(part * (2.0 - part))


@wp.func
def draw_point(t: SeenTriangle, u: wp.vec2) -> DrawnPoint:
    """A point of the triangle."""
    point = DrawnPoint()
    # Uniform in area (Turk 1990).
    root = wp.sqrt(u[0])
    point.u = root * (1.0 - u[1])
    point.v = root * u[1]
    if t.solid_angle > 0.0:
        d = direction_in(t, u)
        # Where the direction meets the triangle (Möller and Trumbore 1997), held inside.
        cross = wp.cross(d, t.ac)
        determinant = wp.dot(t.ab, cross)
        if determinant == 0.0:
            return point
        point.u = wp.clamp(-wp.dot(t.a, cross) / determinant, 0.0, 1.0)
        point.v = wp.clamp(-wp.dot(d, wp.cross(t.a, t.ab)) / determinant, 0.0, 1.0 - point.u)
    point.way = t.a + t.ab * point.u + t.ac * point.v
    point.pdf = density_of(t, point.way)
    return point


@wp.func
def side_of(placed: Instance, p0: wp.vec3, p1: wp.vec3, p2: wp.vec3, way: wp.vec3) -> float:
    """Above 0 where the way to the triangle comes from the side of its normal."""
    return -wp.dot(wp.transpose(linear_of(placed.to_object)) * triangle_normal(p0, p1, p2), way)
