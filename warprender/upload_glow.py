"""Triangles that glow as leaves of the light tree: their order, areas and bounds, light by light."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .lights.tree import LightBounds

#: Leaves for triangles in the tree, about: beyond, neighbours share a leaf.
MOST_LEAVES = 2**16


@dataclass
class GlowTables:
    """What is collected over all lights made of triangles, as `DeviceScene` holds it.

    Attributes:
        each: triangles to a leaf, at least.
        triangles: faces in the order of leaves, one array a light.
        cdf: cumulative areas of each leaf's triangles, likewise.
        leaf_of_face: number of the leaf among the light's own by face, -1 for those that emit nothing.
    """

    each: int = 1
    triangles: list[np.ndarray] = field(default_factory=list)
    cdf: list[np.ndarray] = field(default_factory=list)
    leaf_of_face: list[np.ndarray] = field(default_factory=list)

    def add(self, corners: np.ndarray, normals: np.ndarray, emission: np.ndarray, both_sides: bool) -> GlowLeaves:
        """Take the triangles of one light.

        Args:
            corners: (T, 3, 3) in the world, relative to the scene's origin, float64.
            normals: (T, 3) on the side that emits, any length.
            emission: (T,) luminance, 0 where it emits nothing.
            both_sides: whether both sides emit and are aimed at.
        """
        double = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        areas = np.linalg.norm(double, axis=1) / 2
        chosen = np.flatnonzero((areas > 0) & (emission > 0) & np.isfinite(areas))
        first, first_face = sum(map(len, self.triangles)), sum(map(len, self.leaf_of_face))
        leaf_of_face = np.full(len(corners), -1)
        self.leaf_of_face.append(leaf_of_face)
        if not len(chosen):
            return GlowLeaves(first_face, np.zeros(0, int), np.zeros(0, int), np.zeros(0), None, 0.0)
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = normals / np.where(lengths > 0, lengths, 1.0)
        if self.each > 1:
            chosen = chosen[_neighbours_in_order(corners[chosen].mean(1), normals[chosen])]
        starts = np.arange(0, len(chosen), self.each)
        counts = np.diff(np.append(starts, len(chosen)))
        leaf = np.repeat(np.arange(len(starts)), counts)
        leaf_of_face[chosen] = leaf
        area = np.add.reduceat(areas[chosen], starts)
        sums = np.cumsum(areas[chosen])
        sums -= np.repeat(sums[starts] - areas[chosen][starts], counts)
        cdf = sums / np.repeat(area, counts)
        cdf[starts + counts - 1] = 1.0
        self.triangles.append(chosen)
        self.cdf.append(cdf)
        power = np.add.reduceat((areas * emission)[chosen], starts)
        bounds = _bounds(corners[chosen], normals[chosen], starts, leaf, power, both_sides)
        return GlowLeaves(first_face, first + starts, counts, area, bounds, float(power.sum()))

    def number_faces(self, offsets: dict[int, int]) -> None:
        """Make the leaves of faces numbers among all leaves; -1 where the light is not aimed at.

        `offsets` are the numbers of lights' first leaves, by where their faces begin.
        """
        first_face = 0
        for faces in self.leaf_of_face:
            if len(faces):
                offset = offsets.get(first_face)
                faces[:] = np.where(faces >= 0, faces + offset, -1) if offset is not None else -1
            first_face += len(faces)


@dataclass
class GlowLeaves:
    """The leaves of one light.

    Attributes:
        first_face: where its part of `leaf_of_face` begins.
        first: (L,) where each leaf's triangles begin.
        count: (L,) how many they are.
        area: (L,) their world area.
        bounds: of each leaf, its power for a light of radiance 1; None where there is no leaf.
        emitted: area by emission, summed.
    """

    first_face: int
    first: np.ndarray
    count: np.ndarray
    area: np.ndarray
    bounds: LightBounds | None
    emitted: float


def outside_of(corners: np.ndarray, triangles: np.ndarray) -> int:
    """Which side of a triangle mesh is its outside: 1 that of the normals, -1 the other, 0 where it is not closed.

    Args:
        corners: (T, 3, 3) places of the triangles' corners.
        triangles: (T, 3) the points' numbers: neighbours share two.
    """
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]).astype(np.int64)
    count = int(edges.max(initial=0)) + 1
    forth, back = edges @ (count, 1), edges @ (1, count)
    forth.sort()
    back.sort()
    if len(forth) == 0 or (np.diff(forth) == 0).any() or not np.array_equal(forth, back):
        return 0
    a, b, c = np.moveaxis(corners - corners[0, 0], 1, 0)
    return int(np.sign(np.sum(a * np.cross(b, c))))


def _bounds(
    corners: np.ndarray, normals: np.ndarray, starts: np.ndarray, leaf: np.ndarray, power: np.ndarray, both_sides: bool
) -> LightBounds:
    """Boxes and cones of runs of triangles."""
    # A rounded corner is still inside.
    margin = np.abs(corners).max() * 2.0**-22
    lower = np.minimum.reduceat(corners.min(1), starts) - margin
    upper = np.maximum.reduceat(corners.max(1), starts) + margin
    if both_sides:
        # Of the two sides the one whose largest component is positive, so that parallel triangles have one axis.
        largest = np.take_along_axis(normals, np.abs(normals).argmax(1)[:, None], 1)
        normals = normals * np.where(largest < 0, -1.0, 1.0)
    axis = np.add.reduceat(normals, starts)
    length = np.linalg.norm(axis, axis=1, keepdims=True)
    axis = np.where(length > 1e-6, axis / np.where(length > 0, length, 1.0), normals[starts])
    spread = np.maximum.reduceat(np.arccos(np.clip(np.sum(normals * axis[leaf], 1), -1, 1)), starts)
    fade, sides = np.full(len(starts), np.pi / 2), np.full(len(starts), both_sides)
    power = power * np.pi * (2.0 if both_sides else 1.0)
    return LightBounds(lower, upper, axis, spread, fade, power, sides, np.ones(len(starts), bool))


def _neighbours_in_order(centres: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(T,) order along a Morton curve, triangles that face into one octant together."""
    low, high = centres.min(0), centres.max(0)
    cells = ((centres - low) / np.where(high > low, high - low, 1.0) * 1023).astype(np.int64)
    code = ((normals > 0) @ np.array([1, 2, 4])) << 30
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")
