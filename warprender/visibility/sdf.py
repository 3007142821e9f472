"""Rays through a whole scene: the trees of triangles and quadrics, and signed distance functions beside them.

A signed distance function is traced by steps of its value over its Lipschitz bound, which cannot pass the surface
(Hart 1996); where it changes its sign between two steps, bisection finds the place.
"""

from __future__ import annotations

from functools import cache

import warp as wp

from ..numerics import INFINITY, linear_of, max_component, translation_of
from ..records import DeviceScene, Hit, Ray, SdfRecord, World
from ..shapes.sdf import distance_function
from .rays import device_functions, miss

#: Steps of one ray through one function, at most; what lies behind is not seen.
MOST_STEPS = wp.constant(wp.int32(4096))
#: Halvings of an interval, at most: as many as float32 can tell apart.
_HALVINGS = wp.constant(wp.int32(32))


@wp.func
def box_interval(lower: wp.vec3, upper: wp.vec3, origin: wp.vec3, direction: wp.vec3) -> wp.vec2:
    """Where a ray enters and leaves a box, t from 0 on; it enters behind where it leaves if it misses."""
    begin = wp.float32(0.0)
    end = INFINITY
    for axis in range(3):
        if direction[axis] == 0.0:
            if origin[axis] < lower[axis] or origin[axis] > upper[axis]:
                end = -1.0
        else:
            a = (lower[axis] - origin[axis]) / direction[axis]
            b = (upper[axis] - origin[axis]) / direction[axis]
            begin = wp.max(begin, wp.min(a, b))
            end = wp.min(end, wp.max(a, b))
    return wp.vec2(begin, end)


@wp.func
def is_there(world: World, instance: wp.int32) -> bool:
    """Whether rays may meet an instance: where members are listed, one of them."""
    if world.listed == 0:
        return True
    for k in range(world.first_member, world.last_member):
        if world.members[k] == instance:
            return True
    return False


@cache
def march_function(sdfs: tuple[wp.Function, ...]) -> wp.Function:
    """`march(sdf, origin, direction, after, t_max)`: where a ray first meets the surface behind `after`, or inf.

    The ray is in object space. The answer is on the near side of the surface and below `t_max`.
    """
    distance = distance_function(sdfs)

    @wp.func
    def march(sdf: SdfRecord, origin: wp.vec3, direction: wp.vec3, after: float, t_max: float) -> float:
        speed = wp.length(direction)
        if not speed > 0.0:
            return INFINITY
        interval = box_interval(sdf.lower, sdf.upper, origin, direction)
        t = wp.max(interval[0], after)
        end = wp.min(interval[1], t_max)
        if not t < end:
            return INFINITY
        value = distance(sdf, origin + direction * t)
        inside = value < 0.0
        reach = max_component(wp.abs(origin))
        for _ in range(MOST_STEPS):
            smallest = wp.max(sdf.precision, (reach + t * speed) * wp.static(2.0**-22))
            following = wp.min(t + wp.max(wp.abs(value) / sdf.lipschitz, smallest) / speed, end)
            if not following > t:
                return INFINITY
            value = distance(sdf, origin + direction * following)
            if not wp.isfinite(value):
                return INFINITY
            if (value < 0.0) != inside:
                near = t
                far = following
                for _halving in range(_HALVINGS):
                    middle = 0.5 * (near + far)
                    if middle <= near or middle >= far:
                        break
                    if (distance(sdf, origin + direction * middle) < 0.0) != inside:
                        far = middle
                    else:
                        near = middle
                return near
            t = following
            if t >= end:
                return INFINITY
        return INFINITY

    return march


@cache
def ray_functions(
    sdfs: tuple[wp.Function, ...] = (), accuracy: str = "watertight"
) -> tuple[wp.Function, wp.Function, wp.Function]:
    """`closest(scene, ray)`, `closest_after(scene, ray, hit)` and `occluded(scene, ray)`.

    Args:
        sdfs: the signed distance functions that occur; without any these are the functions of `rays`.
        accuracy: of rays against triangles, "watertight" or "fast"; see `rays.world_functions`.
    """
    tree_closest, tree_closest_after, tree_occluded = device_functions(accuracy)
    if not sdfs:
        return tree_closest, tree_closest_after, tree_occluded
    march = march_function(sdfs)

    @wp.func
    def nearer(scene: DeviceScene, ray: Ray, after: Hit, found: Hit) -> Hit:
        """`found`, or what signed distance functions have behind `after` and before it."""
        result = found
        for i in range(scene.sdf_instances.shape[0]):
            number = scene.sdf_instances[i]
            placed = scene.world.instances[number]
            sdf = scene.sdfs[scene.geometries[placed.geometry].sdf]
            origin = linear_of(placed.to_object) * (ray.origin - translation_of(placed.to_world))
            # Without a length where it is not drawn.
            direction = linear_of(placed.to_object) * ray.direction
            begin = wp.max(after.t, 0.0)
            if after.t >= 0.0 and number <= after.instance:
                # Past the crossing that was answered, or that comes before it in the order.
                smallest = wp.max(sdf.precision, max_component(wp.abs(origin)) * wp.static(2.0**-22))
                begin = after.t + smallest / wp.length(direction) + after.t * wp.static(2.0**-22)
            t = INFINITY
            if is_there(scene.world, number):
                t = march(sdf, origin, direction, begin, wp.min(ray.t_max, result.t))
            if t < INFINITY:
                result = miss()
                result.t = t
                result.instance = number
                result.face = 0
        return result

    @wp.func
    def closest(scene: DeviceScene, ray: Ray) -> Hit:
        start = miss()
        start.t = -1.0
        return nearer(scene, ray, start, tree_closest(scene, ray))

    @wp.func
    def closest_after(scene: DeviceScene, ray: Ray, hit: Hit) -> Hit:
        return nearer(scene, ray, hit, tree_closest_after(scene, ray, hit))

    @wp.func
    def occluded(scene: DeviceScene, ray: Ray) -> bool:
        if tree_occluded(scene, ray):
            return True
        start = miss()
        start.t = -1.0
        return nearer(scene, ray, start, miss()).instance >= 0

    return closest, closest_after, occluded
