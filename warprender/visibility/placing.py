"""Where instances are: matrices from rest or from poses, their inverses, and the boxes that hold what rays may meet.

One kernel does it for the first picture and for every later one, so that what has moved has the bits of what was put
there at once. It works in float64 and rounds once.
"""

from __future__ import annotations

import warp as wp

from ..launch import launch
from ..numerics import mat34, mat34d
from ..records import NOT_DRAWN, Instance

#: γ(8) of float32: how far rounding of the matrices may move a point, relative to the terms that it is a sum of.
_GAMMA_8 = 8.0 * 2.0**-24 / (1.0 - 8.0 * 2.0**-24)
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
    launch(_place_instances, len(rest.shape), arguments, placed.instances.device)


@wp.func
def linear_of_wide(m: mat34d) -> wp.mat33d:
    """The linear part."""
    return wp.mat33d(m[0, 0], m[0, 1], m[0, 2], m[1, 0], m[1, 1], m[1, 2], m[2, 0], m[2, 1], m[2, 2])


@wp.func
def moved_by(pose: wp.transformd, offset: mat34d) -> mat34d:
    """Pose ∘ offset; a quaternion of any length counts as its direction, one of none gives NaN."""
    q = wp.transform_get_rotation(pose)
    s = wp.float64(1.0) / wp.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    x = q[0] * s
    y = q[1] * s
    z = q[2] * s
    w = q[3] * s
    one = wp.float64(1.0)
    two = wp.float64(2.0)
    turn = wp.mat33d(
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
    p = wp.transform_get_translation(pose)
    out = mat34d()
    for i in range(3):
        for j in range(4):
            out[i, j] = turn[i, 0] * offset[0, j] + turn[i, 1] * offset[1, j] + turn[i, 2] * offset[2, j]
        out[i, 3] += p[i]
    return out


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
    largest = wp.float64(0.0)
    for i in range(3):
        total = wp.float64(0.0)
        for j in range(3):
            for k in range(3):
                total += wp.abs(a[i, j]) * wp.abs(b[j, k])
        largest = wp.max(largest, total)
    return largest


@wp.kernel(enable_backward=False, module="unique")
def _place_instances(
    first: wp.int32, rest: Rest, attachments: Attachments, shapes: Shapes, origin: wp.vec3d, placed: Placed
):
    i = first + wp.tid()
    shape = rest.shape[i]
    where = rest.to_world[i]
    body = body_of(attachments, i)
    if body >= 0:
        where = moved_by(attachments.poses[attachments.bodies[body]], attachments.offsets[body])
    # How far an error of the object-space position of a ray reaches in the world: |W| |M|. A body may turn any way,
    # and may be posed later.
    reach = wp.float64(0.0)
    if attachments.first.shape[0] > 0:
        for k in range(attachments.first[i], attachments.first[i + 1]):
            offset = linear_of_wide(attachments.offsets[k])
            reach = wp.max(reach, wp.float64(wp.static(_ROTATIONS)) * row_sum(offset, wp.inverse(offset)))
    linear = linear_of_wide(where)
    determinant = wp.determinant(linear)
    inverse = wp.inverse(linear)
    place = Instance()
    place.geometry = shape
    sound = rest.shown[i] != 0 and determinant != wp.float64(0.0)
    for a in range(3):
        where[a, 3] -= origin[a]
    for a in range(3):
        back = wp.float64(0.0)
        for b in range(3):
            place.to_world[a, b] = wp.float32(where[a, b])
            place.to_object[a, b] = wp.float32(inverse[a, b])
            back -= inverse[a, b] * where[b, 3]
        place.to_world[a, 3] = wp.float32(where[a, 3])
        place.to_object[a, 3] = wp.float32(back)
        for b in range(4):
            sound = sound and wp.isfinite(place.to_world[a, b]) and wp.isfinite(place.to_object[a, b])
    if not sound:
        nowhere = Instance()
        nowhere.geometry = shape
        nowhere.placed = wp.static(NOT_DRAWN)
        placed.instances[i] = nowhere
        placed.lowers[i] = wp.vec3()
        placed.uppers[i] = wp.vec3()
        placed.drawn[i] = 0
        placed.reach[i] = finite_reach(reach)
        return

    scale = shapes.scales[shape]
    unscaled = place.to_object
    place.to_object = unscaled * scale
    place.placed = 0
    for a in range(3):
        for b in range(4):
            if place.to_object[a, b] != _eye[a, b]:
                place.placed = 1
    placed.instances[i] = place

    if body < 0 and place.placed != 0:
        reach = wp.max(reach, row_sum(linear, inverse))
    placed.reach[i] = finite_reach(reach)
    lo = shapes.lowers[shape]
    hi = shapes.uppers[shape]
    if lo[0] > hi[0]:
        at = wp.vec3(place.to_world[0, 3], place.to_world[1, 3], place.to_world[2, 3])
        placed.lowers[i] = at
        placed.uppers[i] = at
        placed.drawn[i] = 0
        return
    placed.drawn[i] = 1
    lower, upper = placed_box(place.to_world, unscaled, lo, hi)
    if place.placed == 0:
        lower = lo
        upper = hi
    placed.lowers[i] = lower
    placed.uppers[i] = upper


@wp.func
def placed_box(w: mat34, m: mat34, lo: wp.vec3, hi: wp.vec3):
    """World box of an object-space box, grown by all that the roundings of either matrix may move its points."""
    lower = wp.vec3(w[0, 3], w[1, 3], w[2, 3])
    upper = lower
    reach = wp.vec3(0.0)
    for a in range(3):
        for b in range(3):
            x = w[a, b] * lo[b]
            y = w[a, b] * hi[b]
            lower[a] += wp.min(x, y)
            upper[a] += wp.max(x, y)
    far = wp.max(wp.abs(lower), wp.abs(upper))
    for b in range(3):
        error = wp.max(wp.abs(lo[b]), wp.abs(hi[b])) + wp.abs(m[b, 3])
        for c in range(3):
            error += wp.abs(m[b, c]) * far[c]
        for a in range(3):
            reach[a] += wp.abs(w[a, b]) * error
    grow = (reach + far) * wp.static(_GAMMA_8)
    return lower - grow, upper + grow
