"""Which light next-event estimation aims at, with one pair of random numbers and a known probability.

Lights at infinity, and the tree of all others as one, are chosen by power; within the tree the way down goes by what
each half may send to the point (Conty Estevez and Kulla 2018; pbrt-v4 §12.6.3).
"""

from __future__ import annotations

import warp as wp

from ..records import DeviceScene, LightNode, LightRecord

_LOW_BITS = wp.constant(wp.float64(2.0**-24))


@wp.struct
class LightChoice:
    """A light and the probability of its choice; index -1 where no light can reach the point."""

    index: wp.int32
    probability: wp.float32


@wp.func
def cos_of_rest(sin_a: float, cos_a: float, sin_b: float, cos_b: float) -> float:
    """Cosine of a - b, 1 where b is the larger angle; both in 0…π."""
    if cos_a > cos_b:
        return 1.0
    return cos_a * cos_b + sin_a * sin_b


@wp.func
def sin_of(cosine: float) -> float:
    """Sine of an angle in 0…π."""
    return wp.sqrt(wp.max(0.0, (1.0 - cosine) * (1.0 + cosine)))


@wp.func
def mean_inverse_square(node: LightNode, p: wp.vec3, radius: float) -> float:
    """Roughly the mean of 1 / distance² over the box: exact for lights spread over a disk about the nearest point.

    With the distance to the centre alone, ten thousand lamps over a floor needed four times the samples.
    """
    middle = 0.5 * (node.lower + node.upper)
    half = 0.5 * (node.upper - node.lower)
    away = wp.abs(p - middle)
    outside = wp.max(away - half, wp.vec3(0.0, 0.0, 0.0))
    far = away + half
    furthest = wp.max(wp.dot(far, far), 1.0e-30)
    # From within, as if from a hundredth of the size away.
    nearest = wp.max(wp.dot(outside, outside), 1.0e-4 * radius * radius)
    ratio = furthest / wp.max(nearest, 1.0e-30)
    if ratio < 1.01:
        return 1.0 / furthest
    return wp.log(ratio) / (furthest - nearest)


@wp.func
def importance(node: LightNode, p: wp.vec3, n: wp.vec3) -> float:
    """Bound on what the node's lights send to a surface at p with normal n; 0 only where they send nothing.

    A surface that takes light from both sides has no normal: zero.
    """
    radius = 0.5 * wp.length(node.upper - node.lower)
    to_centre = 0.5 * (node.lower + node.upper) - p
    square = wp.dot(to_centre, to_centre)
    # Half the angle that the node's sphere fills, seen from p; everything from within.
    cos_box = wp.float32(-1.0)
    if square > radius * radius:
        cos_box = wp.sqrt(1.0 - radius * radius / square)
    falloff = mean_inverse_square(node, p, radius)
    if square <= 0.0:
        return node.power * falloff
    sin_box = sin_of(cos_box)
    direction = to_centre / wp.sqrt(square)

    # The least angle between a light's axis cone and the way to p.
    cos_axis = wp.clamp(-wp.dot(node.axis, direction), -1.0, 1.0)
    cos_away = cos_of_rest(sin_of(cos_axis), cos_axis, sin_of(node.cos_spread), node.cos_spread)
    cos_leaving = cos_of_rest(sin_of(cos_away), cos_away, sin_box, cos_box)
    if cos_leaving <= node.cos_fade:
        return 0.0
    if wp.dot(n, n) == 0.0:
        return node.power * wp.max(cos_leaving, 1.0e-3) * falloff
    # And the least angle between the normal and the way to a light: nothing comes from below the horizon.
    cos_normal = wp.clamp(wp.dot(n, direction), -1.0, 1.0)
    cos_arriving = cos_of_rest(sin_of(cos_normal), cos_normal, sin_box, cos_box)
    if cos_arriving <= 0.0:
        return 0.0
    return node.power * wp.max(cos_leaving, 1.0e-3) * cos_arriving * falloff


@wp.func
def share_of_first(first: float, second: float) -> wp.float64:
    """Probability of the first of two children; in float64 a faint one beside a strong one is not rounded to none."""
    return wp.float64(first) / (wp.float64(first) + wp.float64(second))


@wp.func
def choose_light(scene: DeviceScene, p: wp.vec3, n: wp.vec3, u: wp.vec2) -> LightChoice:
    """A light for a surface at p with normal n."""
    low = wp.int32(0)
    high = scene.infinite_lights
    while low < high:
        middle = (low + high) // 2
        if u[0] < scene.light_cdf[middle]:
            high = middle
        else:
            low = middle + 1
    before = wp.float32(0.0)
    if low > 0:
        before = scene.light_cdf[low - 1]
    choice = LightChoice()
    choice.probability = scene.light_cdf[low] - before
    choice.index = scene.finite_lights + low
    if choice.probability <= 0.0:
        choice.index = -1
        return choice
    if low < scene.infinite_lights:
        return choice
    # 48 bits: each level of the tree takes some, and a light chosen once in a million times needs them.
    place = wp.float64(u[0]) - wp.float64(before) + wp.float64(u[1]) * _LOW_BITS
    rest = place / wp.float64(choice.probability)
    return choose_in_tree(scene, p, n, rest, choice.probability)


@wp.func
def choose_in_tree(scene: DeviceScene, p: wp.vec3, n: wp.vec3, u: wp.float64, probability: float) -> LightChoice:
    """The way down the tree by u in [0, 1); the choice's probability starts from that of the tree."""
    choice = LightChoice()
    choice.index = -1
    choice.probability = probability
    child = scene.light_nodes[0].child
    while child >= 0:
        first = importance(scene.light_nodes[child], p, n)
        second = importance(scene.light_nodes[child + 1], p, n)
        if first + second <= 0.0:
            return choice
        share = share_of_first(first, second)
        if u < share:
            u = u / share
            choice.probability *= wp.float32(share)
        else:
            u = (u - share) / (wp.float64(1.0) - share)
            choice.probability *= wp.float32(wp.float64(1.0) - share)
            child += 1
        child = scene.light_nodes[child].child
    choice.index = -1 - child
    return choice


@wp.func
def probability_of(scene: DeviceScene, p: wp.vec3, n: wp.vec3, light: LightRecord, in_tree: bool) -> float:
    """Probability with which `choose_light` chooses this light at p."""
    probability = light.choice
    if not in_tree or probability <= 0.0:
        return probability
    trail = light.trail
    child = scene.light_nodes[0].child
    while child >= 0:
        first = importance(scene.light_nodes[child], p, n)
        second = importance(scene.light_nodes[child + 1], p, n)
        if first + second <= 0.0:
            return 0.0
        share = share_of_first(first, second)
        if (trail & wp.uint64(1)) == wp.uint64(0):
            probability *= wp.float32(share)
        else:
            probability *= wp.float32(wp.float64(1.0) - share)
            child += 1
        trail = trail >> wp.uint64(1)
        child = scene.light_nodes[child].child
    return probability
