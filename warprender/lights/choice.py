"""Which light next-event estimation aims at, with one pair of random numbers and a known probability.

Lights at infinity, and the tree of all others as one, are chosen by power; within the tree the way down goes by what
each of up to four children may send to the point (Conty Estevez and Kulla 2018; pbrt-v4 §12.6.3).
"""

from __future__ import annotations

import warp as wp

from ..records import BY_POWER, DeviceScene, LightNode, LightRecord

_LOW_BITS = wp.constant(wp.float64(2.0**-24))


#: Share of a node's importance that is the bound: what the places inside do not show is still found.
_BOUND_SHARE = wp.constant(wp.float32(0.2))
#: Nodes whose radius is this share of the distance are points.
_POINT = wp.constant(wp.float32(1.0e-4))


@wp.struct
class LightChoice:
    """A light, its leaf in the tree (-1 for lights at infinity) and the probability of both; index -1 where no light
    can reach the point.
    """

    index: wp.int32
    leaf: wp.int32
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
def bound_of(node: LightNode, p: wp.vec3, n: wp.vec3) -> float:
    """Bound on what the node's lights send to a surface at p with normal n, per power; 0 only where it is nothing.

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
        return 0.25 * falloff
    sin_box = sin_of(cos_box)
    direction = to_centre / wp.sqrt(square)

    # The least angle between a light's axis cone and the way to p.
    cos_axis = cos_to_axis(node, direction)
    cos_away = cos_of_rest(sin_of(cos_axis), cos_axis, sin_of(node.cos_spread), node.cos_spread)
    cos_leaving = cos_of_rest(sin_of(cos_away), cos_away, sin_box, cos_box)
    if cos_leaving <= node.cos_fade:
        return 0.0
    # And the least angle between the normal and the way to a light: nothing comes from below the horizon.
    cos_arriving = wp.float32(1.0)
    if wp.dot(n, n) > 0.0:
        cos_normal = wp.clamp(wp.dot(n, direction), -1.0, 1.0)
        cos_arriving = cos_of_rest(sin_of(cos_normal), cos_normal, sin_box, cos_box)
        if cos_arriving <= 0.0:
            return 0.0
    # The scale of `leaving_share`.
    most = wp.where(node.two_sided != 0, wp.float32(0.5), wp.float32(1.0)) * wp.max(cos_leaving, 1.0e-3)
    return (0.25 * node.round_share + (1.0 - node.round_share) * most) * cos_arriving * falloff


@wp.func
def cos_to_axis(node: LightNode, direction: wp.vec3) -> float:
    """Cosine of the angle between a node's axis and the way back along `direction`; the nearer side of two."""
    cosine = wp.clamp(-wp.dot(node.axis, direction), -1.0, 1.0)
    return wp.where(node.two_sided != 0, wp.abs(cosine), cosine)


@wp.func
def flat_share(mean_cos: float, cosine: float) -> float:
    """Mean of max(cos, 0) to flat lights whose normals have this mean along the axis, in a direction at this cosine.

    For spread normals the first two terms of the clamped cosine's expansion in spherical harmonics, which are exact
    over a half sphere of normals; from there to normals that are all alike a blend.
    """
    if mean_cos <= 0.5:
        return 0.25 + 0.5 * mean_cos * cosine
    alike = 2.0 * mean_cos - 1.0
    return (1.0 - alike) * 0.25 * (1.0 + cosine) + alike * wp.max(cosine, 0.0)


@wp.func
def leaving_share(node: LightNode, direction: wp.vec3) -> float:
    """Intensity of the node's lights back along `direction`, times π, per power: a sphere's is 1/4 all around."""
    if node.round_share >= 1.0 and node.cos_spread <= -1.0:
        return 0.25
    cos_axis = cos_to_axis(node, direction)
    cos_leaving = cos_of_rest(sin_of(cos_axis), cos_axis, sin_of(node.cos_spread), node.cos_spread)
    if cos_leaving <= node.cos_fade:
        return 0.0
    flat = flat_share(node.mean_cos, cos_axis)
    if node.two_sided != 0:
        flat = 0.5 * (flat + flat_share(node.mean_cos, -cos_axis))
    return 0.25 * node.round_share + (1.0 - node.round_share) * flat


@wp.func
def share_from(node: LightNode, n: wp.vec3, away: wp.vec3, least: float) -> float:
    """What lights of the node at this place away from the surface would send, per power."""
    square = wp.max(wp.dot(away, away), least)
    direction = away / wp.sqrt(square)
    cos_arriving = wp.float32(1.0)
    if wp.dot(n, n) > 0.0:
        cos_arriving = wp.dot(n, direction)
        if cos_arriving <= 0.0:
            return 0.0
    return leaving_share(node, direction) * cos_arriving / square


@wp.func
def importance(node: LightNode, p: wp.vec3, n: wp.vec3) -> float:
    """Roughly what the node's lights send to a surface at p with normal n; 0 only where they send nothing.

    Mostly the mean over four places, corners of a tetrahedron in the box, that integrate quadratic functions over it
    exactly. The bound alone takes all of a near box for as bright as its nearest corner: with it, and halves chosen
    in turn, ten thousand lamps over a floor had twice the noise of ten.
    """
    bound = bound_of(node, p, n)
    if bound <= 0.0:
        return 0.0
    middle = 0.5 * (node.lower + node.upper) - p
    half = 0.5 * (node.upper - node.lower)
    square = wp.dot(half, half)
    if square <= _POINT * _POINT * wp.dot(middle, middle):
        return node.power * bound
    # A place stands for a quarter of the box: it is not nearer than that part's own size.
    least = 0.05 * square
    s = half * 0.57735026919
    mean = share_from(node, n, middle + s, least)
    mean += share_from(node, n, middle + wp.vec3(s[0], -s[1], -s[2]), least)
    mean += share_from(node, n, middle + wp.vec3(-s[0], s[1], -s[2]), least)
    mean += share_from(node, n, middle + wp.vec3(-s[0], -s[1], s[2]), least)
    return node.power * (_BOUND_SHARE * bound + (1.0 - _BOUND_SHARE) * 0.25 * mean)


@wp.func
def children_importance(scene: DeviceScene, node: LightNode, p: wp.vec3, n: wp.vec3) -> wp.vec4d:
    """Importance of a node's two to four children; in float64 a faint one beside a strong one is not rounded away."""
    result = wp.vec4d()
    for k in range(node.children):
        child = scene.light_nodes[node.child + k]
        if scene.light_sampling == BY_POWER:
            result[k] = wp.float64(child.power)
        else:
            result[k] = wp.float64(importance(child, p, n))
    return result


@wp.func
def only_light(scene: DeviceScene) -> LightChoice:
    """What `choose_light` answers everywhere, where a scene has no more than one light to aim at; else index -1."""
    choice = LightChoice()
    choice.index = -1
    if scene.infinite_lights == 0 and scene.light_nodes.shape[0] == 1:
        choice.probability = scene.light_cdf[0]
        if choice.probability > 0.0:
            choice.leaf = -1 - scene.light_nodes[0].child
            choice.index = scene.light_leaves[choice.leaf].light
    return choice


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
    choice.leaf = -1
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
    node = scene.light_nodes[0]
    while node.children > 0:
        shares = children_importance(scene, node, p, n)
        total = shares[0] + shares[1] + shares[2] + shares[3]
        # So that a NaN ends the walk too: it has no child to go on to.
        if not (total > wp.float64(0.0)):
            return choice
        # Up to the last child that has a share: rounding must not choose one that has none.
        aim = u * total
        chosen = wp.int32(-1)
        low = wp.float64(0.0)
        for k in range(node.children):
            if shares[k] > wp.float64(0.0) and (chosen < 0 or aim >= low + shares[chosen]):
                if chosen >= 0:
                    low += shares[chosen]
                chosen = k
        u = wp.clamp((aim - low) / shares[chosen], wp.float64(0.0), wp.float64(1.0))
        choice.probability *= wp.float32(shares[chosen] / total)
        node = scene.light_nodes[node.child + chosen]
    choice.leaf = -1 - node.child
    choice.index = scene.light_leaves[choice.leaf].light
    return choice


@wp.func
def probability_of(scene: DeviceScene, p: wp.vec3, n: wp.vec3, light: LightRecord, leaf: int) -> float:
    """Probability with which `choose_light` chooses this light at p; in the tree, this leaf of it."""
    probability = light.choice
    if leaf < 0 or probability <= 0.0:
        return probability
    trail = scene.light_leaves[leaf].trail
    node = scene.light_nodes[0]
    while node.children > 0:
        shares = children_importance(scene, node, p, n)
        total = shares[0] + shares[1] + shares[2] + shares[3]
        if not (total > wp.float64(0.0)):
            return 0.0
        chosen = wp.int32(trail & wp.uint64(3))
        probability *= wp.float32(shares[chosen] / total)
        trail = trail >> wp.uint64(2)
        node = scene.light_nodes[node.child + chosen]
    return probability
