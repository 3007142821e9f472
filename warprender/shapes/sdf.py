"""Solids given by a signed distance function: negative inside, positive outside (Hart 1996, Sphere Tracing)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np
import warp as wp

from ..given import is_number, plain_array, shown
from ..numerics import GAMMA_7, max_component
from ..records import DeviceScene, SdfRecord
from ..watched import Watched
from .local_surface import LocalSurface
from .primvar import Primvar

#: `Sdf.precision` of bounded functions that set none, as a share of the diagonal of their bounds.
RELATIVE_PRECISION = 2.0**-16
#: A gradient smaller than this is taken as this where errors of the distance become errors of the place.
_SMALLEST_SLOPE = wp.constant(wp.float32(0.05))


@dataclass
class Sdf(Watched):
    """A solid where a function of the place is negative.

    Rays advance by the distance over `lipschitz`, which cannot step over the surface, and by `precision` at least.

    Attributes:
        function: `wp.func` of a `wp.vec3` in object space, or of that and `parameters` as a `wp.vec4`, that returns a
            float; None where `values` are given.
        bounds: (2, 3) lower and upper corner in object space of where the function is asked; inf has no end. What
            reaches over them is cut off, without a lid.
        lipschitz: the function changes by no more than this times the way: 1 for true distances. Too small a number
            lets rays step through thin parts.
        precision: thinner parts than this may be missed, in object space; None takes 2^-16 of the bounds' diagonal.
        parameters: up to four numbers for `function`, as the time: changing them compiles nothing.
        values: (X, Y, Z) float32 distances at the points of a grid from corner to corner of the bounds, at least two
            along each axis, with trilinear interpolation between; `lipschitz` then follows from them.
        primvars: name to `Primvar`; only the first value is used.
    """

    function: wp.Function | None = None
    bounds: np.ndarray | Sequence = ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
    lipschitz: float = 1.0
    precision: float | None = None
    parameters: Sequence[float] = (0.0, 0.0, 0.0, 0.0)
    values: np.ndarray | None = None
    primvars: dict[str, Primvar] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.bounds = np.asarray(self.bounds, np.float64)
        if self.values is not None:
            self.values = np.ascontiguousarray(self.values, np.float32)

    def fault(self) -> str:
        """What keeps it from being drawn, in words, or ""."""
        if self.bounds.shape != (2, 3) or not (self.bounds[0] < self.bounds[1]).all():
            return "bounds are not a lower and an upper corner"
        for name in ("lipschitz", "precision"):
            value = getattr(self, name)
            if not (value is None and name == "precision") and not (is_number(value) and 0 < value < np.inf):
                return f"{name} is {shown(value)}, not a number above 0"
        parameters = plain_array(self.parameters)
        if parameters.ndim != 1 or len(parameters) > 4 or not all(map(is_number, parameters)):
            return f"parameters are {shown(self.parameters)}, not up to four numbers"
        if not np.isfinite(parameters.astype(np.float64)).all():
            return f"parameters are {shown(self.parameters)}, not all finite"
        if self.values is not None:
            return self._fault_of_values()
        if not isinstance(self.function, wp.Function) or len(self.function.input_types) not in (1, 2):
            return "the distance is not a wp.func of a vec3, or of a vec3 and a vec4"
        kinds = tuple(self.function.input_types.values())
        if kinds not in ((wp.vec3,), (wp.vec3, wp.vec4)):
            return "the distance is not a wp.func of a vec3, or of a vec3 and a vec4"
        if self.precision is None and not np.isfinite(self.bounds).all():
            return "bounds without an end need a precision"
        return ""

    def _fault_of_values(self) -> str:
        if self.values.ndim != 3 or min(self.values.shape) < 2:
            return f"values have the shape {self.values.shape}, not (X, Y, Z) of at least two each"
        if not np.isfinite(self.values).all():
            return "values are not all finite"
        return "" if np.isfinite(self.bounds).all() else "values need finite bounds"

    def kernel_function(self) -> wp.Function:
        """`distance(sdf, p)` for kernels; the same function for equal ones."""
        return sampled_distance if self.values is not None else _adapted(self.function)

    def record(self, device: str) -> SdfRecord:
        """The device's record; `function` is still to be set."""
        record = SdfRecord()
        record.lower, record.upper = wp.vec3(*self.bounds[0]), wp.vec3(*self.bounds[1])
        record.lipschitz = sampled_lipschitz(self.values, self.bounds) if self.values is not None else self.lipschitz
        record.precision = self.precision or float(np.linalg.norm(self.bounds[1] - self.bounds[0])) * RELATIVE_PRECISION
        record.parameters = wp.vec4(*self.parameters, *[0.0] * (4 - len(self.parameters)))
        values = np.zeros((0, 0, 0), np.float32) if self.values is None else self.values
        record.values = wp.array(values, dtype=wp.float32, device=device)
        return record


def sampled_lipschitz(values: np.ndarray, bounds: np.ndarray) -> float:
    """The largest slope of trilinear interpolation, at most: a component of its gradient in a cell lies between the
    slopes along the four edges of that direction.
    """
    spacing = (bounds[1] - bounds[0]) / (np.array(values.shape) - 1)
    squares = np.zeros(np.array(values.shape) - 1)
    for axis in range(3):
        slope = np.abs(np.diff(values.astype(np.float64), axis=axis)) / spacing[axis]
        for other in {0, 1, 2} - {axis}:
            slope = np.maximum(slope.take(range(slope.shape[other] - 1), other), np.delete(slope, 0, other))
        squares += slope**2
    return float(max(np.sqrt(squares.max()), 1e-30))


@cache
def _adapted(function: wp.Function) -> wp.Function:
    """A user's function as one of a record and a place."""
    if len(function.input_types) == 2:

        @wp.func
        def distance(sdf: SdfRecord, p: wp.vec3) -> float:
            return function(p, sdf.parameters)

    else:

        @wp.func
        def distance(sdf: SdfRecord, p: wp.vec3) -> float:
            return function(p)

    return distance


@wp.func
def sampled_distance(sdf: SdfRecord, p: wp.vec3) -> float:
    """Trilinear interpolation of the samples; the nearest place in the grid for places outside."""
    cells = wp.vec3(
        wp.float32(sdf.values.shape[0] - 1), wp.float32(sdf.values.shape[1] - 1), wp.float32(sdf.values.shape[2] - 1)
    )
    cell = wp.vec3i()
    weight = wp.vec3()
    for axis in range(3):
        x = (p[axis] - sdf.lower[axis]) / (sdf.upper[axis] - sdf.lower[axis]) * cells[axis]
        x = wp.clamp(x, 0.0, cells[axis])
        cell[axis] = wp.min(wp.int32(x), wp.int32(cells[axis]) - 1)
        weight[axis] = x - wp.float32(cell[axis])
    total = wp.float32(0.0)
    for corner in range(8):
        i = corner & 1
        j = (corner >> 1) & 1
        k = corner >> 2
        share = wp.where(i == 1, weight[0], 1.0 - weight[0])
        share = share * wp.where(j == 1, weight[1], 1.0 - weight[1])
        share = share * wp.where(k == 1, weight[2], 1.0 - weight[2])
        total += share * sdf.values[cell[0] + i, cell[1] + j, cell[2] + k]
    return total


@cache
def distance_function(sdfs: tuple[wp.Function, ...]) -> wp.Function:
    """`distance(sdf, p)` that asks the function of the record's number; a chain of closures, see CONTRIBUTING.md."""
    distance = sdfs[0]
    for number in range(1, len(sdfs)):
        distance = _link(number, sdfs[number], distance)
    return distance


def _link(number: int, function: wp.Function, rest: wp.Function) -> wp.Function:
    @wp.func
    def distance(sdf: SdfRecord, p: wp.vec3) -> float:
        if sdf.function == wp.static(number):
            return function(sdf, p)
        return rest(sdf, p)

    return distance


@cache
def sdf_surface_function(sdfs: tuple[wp.Function, ...]) -> wp.Function:
    """`sdf_surface(scene, number, origin, direction, t) -> LocalSurface` of a hit on `scene.sdfs[number]`."""
    distance = distance_function(sdfs)

    @wp.func
    def sdf_surface(scene: DeviceScene, number: int, origin: wp.vec3, direction: wp.vec3, t: float) -> LocalSurface:
        sdf = scene.sdfs[number]
        p = origin + direction * t
        # The gradient by four differences over a tetrahedron's corners (Quilez).
        h = wp.max(8.0 * sdf.precision, max_component(wp.abs(p)) * wp.static(2.0**-12))
        a = wp.vec3(1.0, -1.0, -1.0)
        b = wp.vec3(-1.0, -1.0, 1.0)
        c = wp.vec3(-1.0, 1.0, -1.0)
        d = wp.vec3(1.0, 1.0, 1.0)
        gradient = a * distance(sdf, p + a * h) + b * distance(sdf, p + b * h)
        gradient += c * distance(sdf, p + c * h) + d * distance(sdf, p + d * h)
        gradient = gradient / (4.0 * h)
        slope = wp.length(gradient)
        local = LocalSurface()
        local.geometric_normal = -direction
        if slope > 0.0 and wp.isfinite(slope):
            local.geometric_normal = gradient / slope
        else:
            slope = wp.float32(1.0)
        local.normal = local.geometric_normal
        # One step of Newton's method takes away what rounding of the ray's length has left.
        value = distance(sdf, p)
        step = value / wp.max(slope, _SMALLEST_SLOPE)
        if wp.abs(step) < 4.0 * h:
            p -= local.geometric_normal * step
        rest = wp.abs(distance(sdf, p))
        if not wp.isfinite(rest):
            rest = h
        noise = (1.0 + sdf.lipschitz) * max_component(wp.abs(p)) * GAMMA_7
        local.position = p
        error = (2.0 * rest + noise) / wp.clamp(slope, _SMALLEST_SLOPE, 1.0)
        local.error = wp.vec3(error, error, error)
        return local

    return sdf_surface
