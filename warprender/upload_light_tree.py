"""The light tree of a scene: bounds of its lights, leaves, and the probability of each light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .lights import Light
from .lights.tree import LightBounds, build
from .records import LightLeaf, LightNode
from .upload_glow import GlowLeaves, GlowTables


def bounds_of(
    members: list[tuple[str, Light, int]], rows: np.ndarray, power: np.ndarray, boxes: np.ndarray
) -> LightBounds:
    """Where each light is and where it emits to, relative to the origin.

    Args:
        members: path, light and instance (-1 for none) of each light.
        rows: (L,) their records.
        power: (L,) their power.
        boxes: (instances, 2, 3) where geometry is.
    """
    linear, middle = rows["linear"].astype(np.float64), rows["position"].astype(np.float64)
    half = np.array([light.half_extent() for _, light, _ in members]).reshape(-1, 3)
    reach = np.einsum("kij,kj->ki", np.abs(linear), half)
    lower, upper = middle - reach, middle + reach
    for i, (_, _, instance) in enumerate(members):
        if instance >= 0:
            lower[i], upper[i] = boxes[instance]
    cones = [light.emission_cone() for _, light, _ in members]
    axis = np.einsum("kij,kj->ki", linear, np.array([cone[0] for cone in cones]).reshape(-1, 3))
    axis = axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-300)
    spread, fade = np.array([cone[1:] for cone in cones]).reshape(-1, 2).T
    return LightBounds(lower, upper, axis, spread, fade, power, np.zeros(len(power), bool), spread == 0.0)


def light_tree(
    rows: np.ndarray, bounds: LightBounds, infinite: np.ndarray, own_leaves: dict[int, GlowLeaves], glow: GlowTables
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Build the tree over the lights that have a place, and set the probability and leaf of each light's record.

    Args:
        rows: (L,) `LightRecord`; `choice` and `leaf` are filled in.
        bounds: of each light.
        infinite: (L,) bool, the lights at infinity.
        own_leaves: leaves of the lights made of triangles, by number.
        glow: their tables; the leaves of faces become numbers among all leaves.

    Returns:
        Leaves, nodes, and the cumulative distribution over the infinite lights and, last, the tree.
    """
    placed = np.flatnonzero(~infinite & (bounds.power > 0))
    powers = np.append(bounds.power[infinite], bounds.power[placed].sum())
    chosen = powers > 0
    share = np.zeros(len(powers))
    if chosen.any():
        # Half by power, half alike: no light in the scene is left to starve beside a strong one.
        share = np.where(chosen, 0.5 * powers / powers.sum() + 0.5 / chosen.sum(), 0.0)
    rows["choice"][infinite], rows["choice"][placed] = share[:-1], share[-1]
    cdf = np.cumsum(share)
    if chosen.any():
        cdf[np.flatnonzero(chosen)[-1] :] = 1.0
    leaves, nodes = np.zeros(0, LightLeaf.numpy_dtype()), np.zeros(0, LightNode.numpy_dtype())
    if len(placed):
        leaves, parts = _leaves(rows, bounds, placed, own_leaves, glow)
        nodes, leaves["trail"] = build(parts)
    return leaves, nodes, cdf.astype(np.float32)


def _leaves(
    rows: np.ndarray, bounds: LightBounds, placed: np.ndarray, own_leaves: dict[int, GlowLeaves], glow: GlowTables
) -> tuple[np.ndarray, LightBounds]:
    """A leaf for each light, many for one of triangles, whose faces' leaves are numbered on."""
    alone = np.array([number for number in placed if number not in own_leaves], int)
    leaves = np.zeros(len(alone), LightLeaf.numpy_dtype())
    leaves["light"], rows["leaf"][alone] = alone, np.arange(len(alone))
    parts, used = [bounds.of(alone)], len(alone)
    records = [leaves]
    offsets = {}
    for number in placed:
        if number not in own_leaves:
            continue
        own = own_leaves[number]
        leaves = np.zeros(len(own.area), LightLeaf.numpy_dtype())
        leaves["light"], leaves["first"], leaves["count"], leaves["area"] = number, own.first, own.count, own.area
        records.append(leaves)
        share = bounds.power[number] / own.bounds.power.sum()
        parts.append(replace(own.bounds, power=own.bounds.power * share))
        offsets[own.first_face] = used
        used += len(leaves)
    glow.number_faces(offsets)
    return np.concatenate(records), LightBounds.joined(parts)
