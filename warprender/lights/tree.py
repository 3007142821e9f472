"""The tree over all lights that have a place: built level by level, each level in one pass over all lights.

Halves are split where the sum over both halves of power × orientation × size is least (the surface area orientation
heuristic of Conty Estevez and Kulla 2018), over 12 bins along each axis. Then every second level is left
out, so that a node has two to four children: a choice among four knows more of where the light is than two in turn.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from ..records import LightNode

_BINS = 12
#: Below this depth nodes are halved, so that a leaf's trail of two bits for four children fits into 64 bits.
_SPLIT_DEPTH = 32


@dataclass
class LightBounds:
    """Where lights are and where they emit, one row a leaf: a light, or a part of one; float64.

    Attributes:
        lower: (N, 3) of the boxes.
        upper: (N, 3) of the boxes.
        axis: (N, 3) unit axes of emission.
        spread: (N,) angle of full emission about the axis, radians.
        fade: (N,) angle over which it fades beyond.
        power: (N,) emitted power, above 0.
        two_sided: (N,) bool, whether as much leaves along the opposite of the axis.
        flat: (N,) bool, whether it emits by the cosine to its axis; else alike to all sides of its cone.
    """

    lower: np.ndarray
    upper: np.ndarray
    axis: np.ndarray
    spread: np.ndarray
    fade: np.ndarray
    power: np.ndarray
    two_sided: np.ndarray
    flat: np.ndarray

    def of(self, chosen: np.ndarray) -> LightBounds:
        """Some of the rows."""
        return LightBounds(*(getattr(self, field.name)[chosen] for field in fields(self)))

    @classmethod
    def joined(cls, parts: list[LightBounds]) -> LightBounds:
        """The rows of all parts, one after the other."""
        return cls(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(cls)))


def build(bounds: LightBounds) -> tuple[np.ndarray, np.ndarray]:
    """The tree.

    Args:
        bounds: N ≥ 1 leaves.

    Returns:
        Nodes, the root first, and (N,) uint64 trails: bits 2k and 2k + 1 number the child that the way to the leaf
        takes at depth k.
    """
    halves = _halves(bounds)
    kept, level, used = np.array([0]), 0, 1
    order, child, children = [kept], halves["child"].copy(), np.zeros(len(halves), np.int32)
    trails = np.zeros(len(halves), np.uint64)
    while True:
        parents = kept[halves["child"][kept] >= 0]
        if not len(parents):
            break
        slots = _grandchildren(halves["child"], parents)
        filled = slots >= 0
        counts = filled.sum(1)
        number = (np.cumsum(filled, 1) - 1)[filled].astype(np.uint64)
        kept = slots[filled]
        trails[kept] = np.repeat(trails[parents], counts) | number << np.uint64(2 * level)
        child[parents], children[parents] = used + np.cumsum(counts) - counts, counts
        order.append(kept)
        used += len(kept)
        level += 1
    halves["child"], halves["children"] = child, children
    leaves = np.flatnonzero(child < 0)
    rows = -1 - child[leaves]
    return halves[np.concatenate(order)], trails[leaves][np.argsort(rows)]


def _grandchildren(child: np.ndarray, parents: np.ndarray) -> np.ndarray:
    """(P, 4) children of each node's two, or where one of them is a leaf, that one and -1."""
    pair = child[parents][:, None] + (0, 1)
    below = child[pair]
    return np.stack([np.where(below < 0, pair, below), np.where(below < 0, -1, below + 1)], 2).reshape(-1, 4)


def _halves(bounds: LightBounds) -> np.ndarray:
    """The tree with two children each, neighbours, the first of which `child` names; -1 - row in a leaf."""
    count = len(bounds.power)
    nodes = np.zeros(2 * count - 1, LightNode.numpy_dtype())
    order = np.arange(count)
    starts, places, used = np.array([0]), np.array([0]), 1
    depth = 0
    while len(starts):
        _fill(nodes, places, bounds, order, starts)
        sizes = np.diff(np.append(starts, len(order)))
        leaf = sizes == 1
        nodes["child"][places[leaf]] = -1 - order[starts[leaf]]
        inner = np.repeat(~leaf, sizes)
        order, sizes, places = order[inner], sizes[~leaf], places[~leaf]
        if not len(order):
            break
        starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
        second = _second_half(bounds, order, starts, sizes, depth)
        segment = np.repeat(np.arange(len(sizes)), sizes)
        order = order[np.lexsort((second, segment))]
        nodes["child"][places] = used + 2 * np.arange(len(places))
        firsts = sizes - np.add.reduceat(second.astype(np.int64), starts)
        starts = np.stack([starts, starts + firsts], 1).reshape(-1)
        places = used + np.arange(2 * len(places))
        used += len(places)
        depth += 1
    return nodes


def _fill(nodes: np.ndarray, places: np.ndarray, bounds: LightBounds, order: np.ndarray, starts: np.ndarray) -> None:
    """Boxes, cones and powers of the nodes whose lights are the runs of `order` that begin at `starts`."""
    sizes = np.diff(np.append(starts, len(order)))
    nodes["lower"][places] = np.minimum.reduceat(bounds.lower[order], starts)
    nodes["upper"][places] = np.maximum.reduceat(bounds.upper[order], starts)
    nodes["power"][places] = np.add.reduceat(bounds.power[order], starts)
    axis = np.add.reduceat(bounds.axis[order], starts)
    length = np.linalg.norm(axis, axis=1)
    axis = np.where(length[:, None] > 1e-6 * sizes[:, None], axis / np.maximum(length, 1e-300)[:, None], (0, 0, 1))
    two_sided = np.maximum.reduceat(bounds.two_sided[order].astype(np.int32), starts)
    cosine = np.sum(bounds.axis[order] * np.repeat(axis, sizes, 0), 1)
    cosine = np.where(np.repeat(two_sided, sizes) > 0, np.abs(cosine), cosine)
    apart = np.arccos(np.clip(cosine, -1, 1)) + bounds.spread[order]
    flat = bounds.power[order] * bounds.flat[order]
    flats = np.add.reduceat(flat, starts)
    # A uniform cap of half angle θ has a mean direction of length (1 + cos θ) / 2.
    alike = np.add.reduceat(flat * cosine * (1 + np.cos(bounds.spread[order])) / 2, starts)
    nodes["round_share"][places] = 1 - flats / np.maximum(np.add.reduceat(bounds.power[order], starts), 1e-300)
    nodes["mean_cos"][places] = np.clip(alike / np.where(flats > 0, flats, 1.0), 0, 1)
    # A little wider than float64 says, against float32 on the device.
    spread = np.minimum(np.maximum.reduceat(apart, starts) + 1e-4, np.pi)
    nodes["axis"][places], nodes["two_sided"][places] = axis, two_sided
    nodes["cos_spread"][places] = np.cos(spread)
    nodes["cos_fade"][places] = np.cos(np.minimum(np.maximum.reduceat(bounds.fade[order], starts) + 1e-4, np.pi))


def _second_half(
    bounds: LightBounds, order: np.ndarray, starts: np.ndarray, sizes: np.ndarray, depth: int
) -> np.ndarray:
    """(len(order),) bool: which lights of each run go into its second child; both children get some."""
    runs = len(starts)
    segment = np.repeat(np.arange(runs), sizes)
    centre = (bounds.lower[order] + bounds.upper[order]) / 2
    low, high = np.minimum.reduceat(centre, starts), np.maximum.reduceat(centre, starts)
    extent = high - low
    rank = np.arange(len(order)) - starts[segment]
    halves = rank >= (sizes // 2)[segment]
    if depth >= _SPLIT_DEPTH:
        return halves
    scale = np.where(extent > 0, extent, 1.0)
    bin_of = np.minimum((centre - low[segment]) / scale[segment] * _BINS, _BINS - 1).astype(np.int64)
    cost = _split_costs(bounds, order, segment, bin_of, runs)
    # Thin slices look cheap along a short axis: weighed by how much longer the longest is.
    longest = extent.max(1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        cost = cost * np.where(extent > 0, longest / extent, np.inf)[:, :, None]
    cost = np.where(np.isnan(cost), np.inf, cost).reshape(runs, -1)
    best = cost.argmin(1)
    found = np.isfinite(cost[np.arange(runs), best])
    axis, cut = best // (_BINS - 1), best % (_BINS - 1)
    chosen = bin_of[np.arange(len(order)), axis[segment]] > cut[segment]
    return np.where(found[segment], chosen, halves)


def _split_costs(
    bounds: LightBounds, order: np.ndarray, segment: np.ndarray, bin_of: np.ndarray, runs: int
) -> np.ndarray:
    """(runs, 3, bins - 1) cost of cutting each run after each bin of each axis; inf where a side is empty."""
    cells = (segment[:, None] * 3 + np.arange(3)) * _BINS + bin_of
    shape = (runs, 3, _BINS)
    power, count = np.zeros(runs * 3 * _BINS), np.zeros(runs * 3 * _BINS)
    # The sum of the mean directions of the lights' cones says how far all of them spread together.
    spread = np.zeros((runs * 3 * _BINS, 3))
    lower, upper = np.full((runs * 3 * _BINS, 3), np.inf), np.full((runs * 3 * _BINS, 3), -np.inf)
    mean = bounds.axis[order] * ((1 + np.cos(bounds.spread[order])) / 2)[:, None]
    for axis in range(3):
        cell = cells[:, axis]
        power += np.bincount(cell, bounds.power[order], len(power))
        count += np.bincount(cell, minlength=len(power))
        for k in range(3):
            spread[:, k] += np.bincount(cell, mean[:, k], len(power))
        np.minimum.at(lower, cell, bounds.lower[order])
        np.maximum.at(upper, cell, bounds.upper[order])
    power, count, spread = power.reshape(shape), count.reshape(shape), spread.reshape(*shape, 3)
    lower, upper = lower.reshape(*shape, 3), upper.reshape(*shape, 3)
    first = _side_costs(power, count, spread, lower, upper)
    flipped = (slice(None), slice(None), slice(None, None, -1))
    second = _side_costs(power[flipped], count[flipped], spread[flipped], lower[flipped], upper[flipped])
    return first[:, :, :-1] + second[flipped][:, :, 1:]


def _side_costs(
    power: np.ndarray, count: np.ndarray, spread: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray:
    """Cost of the union of the bins up to each one; inf while it is empty."""
    power, count, spread = np.cumsum(power, 2), np.cumsum(count, 2), np.cumsum(spread, 2)
    lower, upper = np.minimum.accumulate(lower, 2), np.maximum.accumulate(upper, 2)
    filled = count > 0
    size = np.where(filled[..., None], upper - lower, 0.0)
    area = size[..., 0] * size[..., 1] + size[..., 1] * size[..., 2] + size[..., 2] * size[..., 0]
    # A uniform cap of half angle θ has a mean direction of length (1 + cos θ) / 2.
    length = np.linalg.norm(spread, axis=3) / np.maximum(count, 1)
    theta = np.arccos(np.clip(2 * length - 1, -1, 1))
    cost = power * (area + 1e-3 * np.sum(size * size, 3)) * _orientation(theta)
    return np.where(filled, cost, np.inf)


def _orientation(spread: np.ndarray) -> np.ndarray:
    """Solid angle of emission of a cone that fades over a right angle beyond `spread` (the paper's M_Ω)."""
    end = np.minimum(spread + np.pi / 2, np.pi)
    fading = 2 * end * np.sin(spread) - np.cos(spread - 2 * end) - 2 * spread * np.sin(spread) + np.cos(spread)
    return 2 * np.pi * (1 - np.cos(spread)) + np.pi / 2 * fading
