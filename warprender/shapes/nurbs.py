"""Rational B-splines of any order: basis functions, curves as points, patches as meshes."""

from __future__ import annotations

import numpy as np

from .mesh import Mesh
from .primvar import Primvar

#: Samples for each knot span.
SAMPLES = 8


def parameters(knots: np.ndarray, order: int) -> np.ndarray:
    """(S,) parameters at which a spline is sampled: the same number in each span of its domain."""
    breaks = np.unique(knots[order - 1 : len(knots) - order + 1])
    inner = breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(SAMPLES) / SAMPLES
    return np.append(inner.reshape(-1), breaks[-1])


def basis(knots: np.ndarray, order: int, at: np.ndarray) -> np.ndarray:
    """Basis functions (S, n) at parameters (S,), by the recursion of Cox and de Boor.

    Args:
        knots: (n + order,) float64, ascending.
        order: degree plus one.
        at: parameters in the domain, its end included.
    """
    last = np.searchsorted(knots, knots[len(knots) - order], side="left") - 1
    span = np.minimum(np.searchsorted(knots, at, side="right") - 1, last)
    values = (span[:, None] == np.arange(len(knots) - 1)).astype(np.float64)
    for degree in range(1, order):
        rising = _ratio(at[:, None] - knots[: -degree - 1], knots[degree:-1] - knots[: -degree - 1])
        falling = _ratio(knots[degree + 1 :] - at[:, None], knots[degree + 1 :] - knots[1:-degree])
        values = rising * values[:, :-1] + falling * values[:, 1:]
    return values


def basis_slopes(knots: np.ndarray, order: int, at: np.ndarray) -> np.ndarray:
    """Derivatives (S, n) of the basis functions."""
    if order < 2:
        return np.zeros((len(at), len(knots) - order))
    lower = basis(knots[1:-1], order - 1, at)
    lower = np.pad(lower, ((0, 0), (1, 1)))
    degree = order - 1
    width = knots[degree:] - knots[:-degree]
    slopes = degree * _ratio(lower, np.broadcast_to(width, lower.shape))
    return slopes[:, :-1] - slopes[:, 1:]


class SplineCurves:
    """Rational B-spline curves, with what tubes and ribbons need of `Curves`.

    Attributes:
        curveVertexCounts: (C,) int64.
        lengths: (C,) samples of each curve.
        curve: (S,) curve of each sample.
        periodic: False; a curve that closes comes back to its start.
    """

    periodic = False

    def __init__(self, counts: np.ndarray, orders: np.ndarray, knots: list[np.ndarray], weights: np.ndarray) -> None:
        """Curves of (C,) points and orders, with the knots of each and the weights (N,) of all points."""
        self.curveVertexCounts, self._weights = counts, weights
        at = [parameters(k, int(order)) for k, order in zip(knots, orders, strict=True)]
        self.lengths = np.array([len(t) for t in at])
        self.curve = np.repeat(np.arange(len(at)), self.lengths)
        each = list(zip(knots, map(int, orders), at, strict=True))
        self._basis = [basis(*spline) for spline in each]
        self._slopes = [basis_slopes(*spline) for spline in each]

    def positions(self, values: np.ndarray) -> np.ndarray:
        """Vertex values (N, K) at the samples: (S, K)."""
        weights = self._weights[:, None]
        return self._summed(self._basis, values * weights) / self._summed(self._basis, weights)

    def tangents(self, points: np.ndarray) -> np.ndarray:
        """Derivatives (S, 3) at the samples, but for a positive factor."""
        weights = self._weights[:, None]
        slope = self._summed(self._slopes, points * weights)
        return slope - self.positions(points) * self._summed(self._slopes, weights)

    def _summed(self, matrices: list[np.ndarray], values: np.ndarray) -> np.ndarray:
        ends = np.cumsum(self.curveVertexCounts)
        starts = ends - self.curveVertexCounts
        return np.concatenate([m @ values[a:b] for m, a, b in zip(matrices, starts, ends, strict=True)])


def patch(
    points: np.ndarray,
    weights: np.ndarray,
    knots: tuple[np.ndarray, np.ndarray],
    orders: tuple[int, int],
) -> tuple[Mesh, np.ndarray]:
    """A tensor-product patch.

    Args:
        points: (V, U, 3) float64 control points.
        weights: (V, U) float64.
        knots: knots in U and in V.
        orders: orders in U and in V.

    Returns:
        The mesh, of one face, and the share (samples, V · U) that each control point has in each sample.
    """
    at = [parameters(k, order) for k, order in zip(knots, orders, strict=True)]
    bu, bv = (basis(k, order, t) for k, order, t in zip(knots, orders, at, strict=True))
    su, sv = (basis_slopes(k, order, t) for k, order, t in zip(knots, orders, at, strict=True))
    weighted = np.concatenate([points * weights[:, :, None], weights[:, :, None]], 2)

    def evaluate(v: np.ndarray, u: np.ndarray) -> np.ndarray:
        return np.einsum("av,bu,vuk->abk", v, u, weighted)

    value, along_u, along_v = evaluate(bv, bu), evaluate(bv, su), evaluate(sv, bu)
    position = value[..., :3] / value[..., 3:]
    # The quotient rule, but for a positive factor.
    du = along_u[..., :3] - position * along_u[..., 3:]
    dv = along_v[..., :3] - position * along_v[..., 3:]
    normal = np.cross(du, dv).reshape(-1, 3)

    rows, columns = position.shape[:2]
    number = np.arange(rows * columns).reshape(rows, columns)
    quads = [number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]]
    triangles = np.stack([quads[k] for k in (0, 1, 2, 0, 2, 3)], 2).reshape(-1, 3).astype(np.int32)
    corners = np.arange(triangles.size, dtype=np.int32).reshape(-1, 3)
    faces = np.zeros(len(triangles), np.int32)
    mesh = Mesh(position.reshape(-1, 3).astype(np.float32), triangles, faces, corners, Primvar(normal, "vertex"))
    share = np.einsum("av,bu,vu->abvu", bv, bu, weights).reshape(rows * columns, -1)
    return mesh, share / share.sum(1, keepdims=True)


def _ratio(above: np.ndarray, below: np.ndarray) -> np.ndarray:
    """Quotients, 0 where knots coincide."""
    below = np.broadcast_to(below, above.shape)
    return np.divide(above, below, out=np.zeros_like(above, dtype=np.float64), where=below > 0)
