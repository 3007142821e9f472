"""Where instances are: matrices from rest or from poses, their inverses, and the boxes that hold what rays may meet.

One kernel does it for the first picture and for every later one, so that what has moved has the bits of what was put
there at once. It works in float64 and rounds once.
"""

from __future__ import annotations

import warp as wp

from ..launch import launch
from ..numerics import gamma, linear_of, mat34, mat34d, translation_of
from ..records import MOVED, NOT_DRAWN, Instance

#: γ(12) of float32: how far rounding of the matrices, and of the box itself by its middle and half, may move a point,
#: relative to the terms that it is a sum of.
_GAMMA = gamma(12)
#: Instances that are worth another thread.
_CHUNK = 1024
#: |R| |Rᵀ| of a rotation has no row sum above it.
_ROTATIONS = 3.0

_eye = wp.constant(mat34(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0))


@wp.struct
class Shapes:
    """Of each shape (G,): its box in object space, inverted where there is nothing, and the scale of its tree."""

    lowers: wp.array(dtype=wp.vec3)
    uppers: wp.array(dtype=wp.vec3)
    scales: wp.array(dtype=wp.float32)


@wp.struct
class Attachments:
    """What may move instances. Instance i hangs on the bodies from number `first[i]` up to `first[i + 1]`, the
    nearest first, of which the first that has been posed counts; `first` is empty where nothing moves.

    `offsets` (A,) are from the instance's object space to the body's frame. `poses` and `posed` (B,) are the bodies'.
    """

    first: wp.array(dtype=wp.int32)
    bodies: wp.array(dtype=wp.int32)
    offsets: wp.array(dtype=mat34d)
    poses: wp.array(dtype=wp.transformd)
    posed: wp.array(dtype=wp.int32)


@wp.struct
class Rest:
    """Of each instance (I,): its shape, its place in the world unless a body moves it, and whether it is shown."""

    shape: wp.array(dtype=wp.int32)
    to_world: wp.array(dtype=mat34d)
    shown: wp.array(dtype=wp.int32)


@wp.struct
class Placed:
    """Where instances are (I,): records, world boxes, whether there is anything in the box, and how far an error of an
    object-space position may reach in the world, per unit.
    """

    instances: wp.array(dtype=Instance)
    lowers: wp.array(dtype=wp.vec3)
    uppers: wp.array(dtype=wp.vec3)
    drawn: wp.array(dtype=wp.int32)
    reach: wp.array(dtype=wp.float32)


def launch_placing(rest: Rest, attachments: Attachments, shapes: Shapes, origin: wp.vec3d, placed: Placed) -> None:
    """Fill `placed` for all instances; positions become relative to `origin`."""
    arguments = [rest, attachments, shapes, origin, placed]
    launch(_place_instances, len(rest.shape), arguments, placed.instances.device, smallest_chunk=_CHUNK)


@wp.func
def linear_of_wide(m: mat34d) -> wp.mat33d:
    """The linear part."""
    return wp.mat33d(m[0, 0], m[0, 1], m[0, 2], m[1, 0], m[1, 1], m[1, 2], m[2, 0], m[2, 1], m[2, 2])


@wp.func
def translation_of_wide(m: mat34d) -> wp.vec3d:
    """Where the origin goes."""
    return wp.vec3d(m[0, 3], m[1, 3], m[2, 3])


@wp.func
def rotation_of(pose: wp.transformd) -> wp.mat33d:
    """A quaternion of any length counts as its direction, one of none gives NaN."""
    q = wp.transform_get_rotation(pose)
    s = wp.float64(1.0) / wp.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    x = q[0] * s
    y = q[1] * s
    z = q[2] * s
    w = q[3] * s
    one = wp.float64(1.0)
    two = wp.float64(2.0)
    return wp.mat33d(
        one - two * (y * y + z * z),
        two * (x * y - z * w),
        two * (x * z + y * w),
        two * (x * y + z * w),
        one - two * (x * x + z * z),
        two * (y * z - x * w),
        two * (x * z - y * w),
        two * (y * z + x * w),
        one - two * (x * x + y * y),
    )


@wp.func
def single(linear: wp.mat33d, translation: wp.vec3d) -> mat34:
    """Both parts rounded to float32."""
    a = wp.mat33(linear)
    t = wp.vec3(translation)
    return mat34(a[0, 0], a[0, 1], a[0, 2], t[0], a[1, 0], a[1, 1], a[1, 2], t[1], a[2, 0], a[2, 1], a[2, 2], t[2])


@wp.func
def all_finite(m: mat34) -> bool:
    """Whether all entries are numbers below infinity: what is not, stays when it is multiplied by 0."""
    sum = wp.float32(0.0)
    for a in range(3):
        sum += m[a, 0] * 0.0 + m[a, 1] * 0.0 + m[a, 2] * 0.0 + m[a, 3] * 0.0
    return sum == 0.0


@wp.func
def body_of(attachments: Attachments, i: wp.int32) -> wp.int32:
    """Number of the attachment that moves instance i, -1 where none does."""
    if attachments.first.shape[0] == 0:
        return -1
    for k in range(attachments.first[i], attachments.first[i + 1]):
        if attachments.posed[attachments.bodies[k]] != 0:
            return k
    return -1


@wp.func
def finite_reach(reach: wp.float64) -> wp.float32:
    """As float32; 0 for what no transform gives."""
    return wp.where(wp.isfinite(wp.float32(reach)), wp.float32(reach), 0.0)


@wp.func
def row_sum(a: wp.mat33d, b: wp.mat33d) -> wp.float64:
    """The largest row sum of |a| |b|."""
    sums = wp.vec3d()
    for k in range(3):
        row = wp.abs(b[k])
        sums += wp.abs(wp.vec3d(a[0, k], a[1, k], a[2, k])) * (row[0] + row[1] + row[2])
    return wp.max(sums)


@wp.kernel(enable_backward=False, module="unique")
def _place_instances(
    first: wp.int32, rest: Rest, attachments: Attachments, shapes: Shapes, origin: wp.vec3d, placed: Placed
):
    i = first + wp.tid()
    shape = rest.shape[i]
    body = body_of(attachments, i)
    linear = linear_of_wide(rest.to_world[i])
    translation = translation_of_wide(rest.to_world[i])
    if body >= 0:
        pose = attachments.poses[attachments.bodies[body]]
        turn = rotation_of(pose)
        linear = turn * linear_of_wide(attachments.offsets[body])
        translation = turn * translation_of_wide(attachments.offsets[body]) + wp.transform_get_translation(pose)
    translation = translation - origin
    # How far an error of the object-space position of a ray reaches in the world: |W| |M|. A body may turn any way,
    # and may be posed later.
    reach = wp.float64(0.0)
    if attachments.first.shape[0] > 0:
        for k in range(attachments.first[i], attachments.first[i + 1]):
            offset = linear_of_wide(attachments.offsets[k])
            reach = wp.max(reach, wp.float64(wp.static(_ROTATIONS)) * row_sum(offset, wp.inverse(offset)))
    inverse = wp.inverse(linear)
    place = Instance()
    place.geometry = shape
    place.to_world = single(linear, translation)
    unscaled = single(inverse, -(inverse * translation))
    place.to_object = unscaled * shapes.scales[shape]
    place.placed = wp.where(place.to_object == _eye, 0, 1)
    if place.placed != 0 and linear_of(place.to_object) == linear_of(_eye):
        place.placed = wp.static(MOVED)
    sound = wp.determinant(linear) != wp.float64(0.0) and all_finite(place.to_world) and all_finite(unscaled)
    if rest.shown[i] == 0 or not sound:
        place.to_world = mat34()
        place.to_object = mat34()
        place.placed = wp.static(NOT_DRAWN)
    elif body < 0 and place.placed != 0:
        reach = wp.max(reach, row_sum(linear, inverse))
    lower = translation_of(place.to_world)
    upper = lower
    lo = shapes.lowers[shape]
    hi = shapes.uppers[shape]
    drawn = place.placed != wp.static(NOT_DRAWN) and lo[0] <= hi[0]
    if drawn:
        lower = lo
        upper = hi
        if place.placed != 0:
            lower, upper = placed_box(place.to_world, unscaled, lo, hi)
    placed.instances[i] = place
    placed.lowers[i] = lower
    placed.uppers[i] = upper
    placed.drawn[i] = wp.int32(drawn)
    placed.reach[i] = finite_reach(reach)


@wp.func
def magnitudes(m: wp.mat33) -> wp.mat33:
    """Of each entry."""
    return wp.matrix_from_rows(wp.abs(m[0]), wp.abs(m[1]), wp.abs(m[2]))


@wp.func
def placed_box(w: mat34, m: mat34, lo: wp.vec3, hi: wp.vec3):
    """World box of an object-space box, grown by all that the roundings of either matrix may move its points."""
    linear = linear_of(w)
    stretch = magnitudes(linear)
    most = wp.max(wp.abs(lo), wp.abs(hi))
    middle = linear * (lo * 0.5 + hi * 0.5) + translation_of(w)
    half = stretch * (hi * 0.5 - lo * 0.5)
    lower = middle - half
    upper = middle + half
    far = stretch * most + wp.abs(translation_of(w))
    error = most + wp.abs(translation_of(m)) + magnitudes(linear_of(m)) * far
    grow = (stretch * error + far) * wp.static(_GAMMA)
    return lower - grow, upper + grow
