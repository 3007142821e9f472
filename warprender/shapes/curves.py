"""UsdGeomBasisCurves: spans, and samples along them, for all curves of a prim at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

#: Samples for each cubic span.
SAMPLES = 8

#: Cubic bases: rows are the weights of the four control points for 1, t, t², t³.
BASES = {
    "bezier": np.array([[1, 0, 0, 0], [-3, 3, 0, 0], [3, -6, 3, 0], [-1, 3, -3, 1]], float),
    "bspline": np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]], float) / 6,
    "catmullRom": np.array([[0, 2, 0, 0], [-1, 0, 1, 0], [2, -5, 4, -1], [-1, 3, -3, 1]], float) / 2,
}

#: A linear span in the same form, between the two control points in the middle.
LINEAR = np.array([[0, 1, 0, 0], [0, -1, 1, 0], [0, 0, 0, 0], [0, 0, 0, 0]], float)


@dataclass
class Curves:
    """Curves without their points; attributes as in UsdGeomBasisCurves.

    Attributes:
        curveVertexCounts: (C,) int64; curves too short for a span are left out.
        type: "linear" or "cubic".
        basis: one of `BASES`.
        wrap: "nonperiodic", "periodic" or "pinned".
    """

    curveVertexCounts: np.ndarray
    type: str = "cubic"
    basis: str = "bezier"
    wrap: str = "nonperiodic"

    @cached_property
    def periodic(self) -> bool:
        """Whether curves close; Bézier curves do if their points come in threes, and are open otherwise."""
        in_threes = self.type == "linear" or self.basis != "bezier" or not (self.curveVertexCounts % 3).any()
        return self.wrap == "periodic" and in_threes

    @cached_property
    def spans(self) -> np.ndarray:
        """(C,) number of spans of each curve."""
        counts = self.curveVertexCounts
        if self.type == "linear":
            spans = np.where(self.periodic & (counts >= 3), counts, counts - 1)
        elif self.basis == "bezier":
            spans = counts // 3 if self.periodic else (counts - 1) // 3
        elif self.periodic:
            spans = np.where(counts >= 3, counts, 0)
        else:
            spans = counts - 1 if self._pinned else counts - 3
        return np.maximum(spans, 0)

    @cached_property
    def per_span(self) -> int:
        """Samples of each span."""
        return 1 if self.type == "linear" else SAMPLES

    @cached_property
    def lengths(self) -> np.ndarray:
        """(C,) samples of each curve: the end of the last span too, unless the curve is closed."""
        return np.where(self.spans > 0, self.spans * self.per_span + (not self.periodic), 0)

    @cached_property
    def curve(self) -> np.ndarray:
        """(S,) curve of each sample."""
        return np.repeat(np.arange(len(self.lengths)), self.lengths)

    @cached_property
    def varying_counts(self) -> np.ndarray:
        """(C,) varying values of each curve: one for each end of a span."""
        return np.where(self.spans > 0, self.spans + (not self.periodic), 0)

    def positions(self, values: np.ndarray) -> np.ndarray:
        """Vertex values (N, K) at the samples: (S, K)."""
        return self._evaluate(values, self._parameter[:, None] ** np.arange(4))

    def tangents(self, points: np.ndarray) -> np.ndarray:
        """Derivatives (S, 3) at the samples; on linear curves, the mean of the directions on both sides."""
        if self.type == "linear":
            return self._linear_tangents(points)
        powers = self._parameter[:, None] ** np.array([0, 0, 1, 2]) * np.arange(4)
        return self._evaluate(points, powers)

    def varying(self, values: np.ndarray) -> np.ndarray:
        """Varying values (V, K) at the samples, linear along each span: (S, K)."""
        first = np.cumsum(self.varying_counts) - self.varying_counts
        count = self.varying_counts[self.curve]
        a = first[self.curve] + self._span
        b = first[self.curve] + (self._span + 1) % np.maximum(count, 1)
        t = self._parameter[:, None]
        return values[a] * (1 - t) + values[b] * t

    @cached_property
    def _pinned(self) -> bool:
        return self.wrap == "pinned" and self.type == "cubic" and self.basis != "bezier"

    @cached_property
    def _local(self) -> np.ndarray:
        """(S,) number of each sample on its curve."""
        return np.arange(len(self.curve)) - (np.cumsum(self.lengths) - self.lengths)[self.curve]

    @cached_property
    def _span(self) -> np.ndarray:
        """(S,) span of each sample on its curve."""
        return np.minimum(self._local // self.per_span, self.spans[self.curve] - 1)

    @cached_property
    def _parameter(self) -> np.ndarray:
        """(S,) t in [0, 1] of each sample on its span."""
        return (self._local - self._span * self.per_span) / self.per_span

    @cached_property
    def _control(self) -> np.ndarray:
        """(S, 4) control points of each sample as numbers on its curve, -1 and n outside pinned curves."""
        step = 3 if self.type == "cubic" and self.basis == "bezier" else 1
        offset = -1 if self.type == "linear" or self._pinned else 0
        return self._span[:, None] * step + offset + np.arange(4)

    def _evaluate(self, values: np.ndarray, powers: np.ndarray) -> np.ndarray:
        basis = LINEAR if self.type == "linear" else BASES[self.basis]
        weights = powers @ basis
        first = (np.cumsum(self.curveVertexCounts) - self.curveVertexCounts)[self.curve]
        count = self.curveVertexCounts[self.curve]
        result = np.zeros((len(self.curve), values.shape[1]))
        for k in range(4):
            number = self._control[:, k]
            inside = first + (number % count if self.periodic else np.clip(number, 0, count - 1))
            value = values[inside]
            if self._pinned:
                # The phantom point beyond an end mirrors the second point about it.
                ends = np.flatnonzero((number < 0) | (number >= count))
                second = first[ends] + np.where(number[ends] < 0, 1, count[ends] - 2)
                value[ends] = 2 * value[ends] - values[second]
            result += weights[:, k : k + 1] * value
        return result

    def _linear_tangents(self, points: np.ndarray) -> np.ndarray:
        at = self.positions(points)
        start = (np.cumsum(self.lengths) - self.lengths)[self.curve]
        last = start + self.lengths[self.curve] - 1
        here = np.arange(len(at))
        following, previous = here + 1, here - 1
        ends, starts = here == last, here == start
        following[ends] = start[ends] if self.periodic else here[ends]
        previous[starts] = last[starts] if self.periodic else here[starts]
        forward, backward = unit(at[following] - at), unit(at - at[previous])
        return forward + backward


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors (S, 3) at length 1, those of no length unchanged."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)
