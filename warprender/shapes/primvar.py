"""Primvars: named values on a shape, interpolated over it as UsdGeomPrimvar says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from ..records import DeviceScene, PrimvarRecord, Surface

#: Interpolations in the order of their ids on the device. `varying` goes there as `vertex`: they differ only
#: under subdivision and along curves, which become meshes before.
INTERPOLATIONS = ("constant", "uniform", "vertex", "faceVarying", "instance")


@dataclass
class Primvar:
    """Values over a shape.

    Attributes:
        values: (K, C) float32, C from 1 to 4 components.
        interpolation: one of `INTERPOLATIONS` or `varying`. K is 1 (constant), the number of faces (uniform), of points
            (vertex), or of corners in `faceVertexIndices` order (faceVarying), unless `indices` is given. `instance`
            has a value for each copy under an instancer: instance id i takes number i modulo K.
        indices: (K,) int32 or None; with it, element k has the value `values[indices[k]]`.
    """

    values: np.ndarray
    interpolation: str = "constant"
    indices: np.ndarray | None = None

    def __post_init__(self) -> None:
        values = np.ascontiguousarray(self.values, np.float32)
        self.values = values.reshape(len(values), -1) if values.ndim != 2 else values
        if self.interpolation not in (*INTERPOLATIONS, "varying"):
            raise ValueError(f"interpolation {self.interpolation!r} is not one of {', '.join(INTERPOLATIONS)}")
        if self.indices is not None:
            self.indices = np.ascontiguousarray(self.indices, np.int32)

    def __len__(self) -> int:
        """Number of elements that the interpolation counts."""
        return len(self.values) if self.indices is None else len(self.indices)

    def expanded(self) -> np.ndarray:
        """The values with `indices` resolved: (K, C) float32."""
        return self.values if self.indices is None else self.values[self.indices]

    def mapped(self, matrix: Sequence[Sequence[float]]) -> Primvar:
        """The primvar of matrix · (value, 1), matrix (R, C + 1); missing components are 0, further ones are left out.

        Interpolation is linear: to map the values is to map what is interpolated between them.
        """
        weights = np.array(matrix, np.float64)
        values = np.zeros((len(self.values), weights.shape[1] - 1))
        values[:, : self.values.shape[1]] = self.values[:, : values.shape[1]]
        return replace(self, values=values @ weights[:, :-1].T + weights[:, -1])

    def upload(self, corners: np.ndarray, device: str) -> PrimvarRecord:
        """The device's record of it, for triangles whose vertices are the authored face corners (T, 3)."""
        record = PrimvarRecord()
        record.interpolation = INTERPOLATIONS.index("vertex" if self.interpolation == "varying" else self.interpolation)
        record.width = self.values.shape[1]
        values = self.values
        if self.interpolation == "faceVarying":
            indices = corners.reshape(-1) if self.indices is None else self.indices[corners.reshape(-1)]
            record.indices = wp.array(indices, dtype=wp.int32, device=device)
        elif self.indices is not None:
            values = self.expanded()
        record.values = wp.array(values.reshape(-1), dtype=wp.float32, device=device)
        return record


def absent_primvar() -> PrimvarRecord:
    """The record of a primvar that a shape does not have."""
    record = PrimvarRecord()
    record.interpolation = -1
    return record


@wp.func
def value_at(primvar: PrimvarRecord, index: int) -> wp.vec4:
    """Value number `index`, missing components 0."""
    # One expression a width: a loop would fill the vector in memory, and wait for it to come back.
    width = primvar.width
    first = index * width
    if width == 3:
        return wp.vec4(primvar.values[first], primvar.values[first + 1], primvar.values[first + 2], 0.0)
    if width == 1:
        return wp.vec4(primvar.values[first], 0.0, 0.0, 0.0)
    if width == 2:
        return wp.vec4(primvar.values[first], primvar.values[first + 1], 0.0, 0.0)
    return wp.vec4(
        primvar.values[first], primvar.values[first + 1], primvar.values[first + 2], primvar.values[first + 3]
    )


@wp.func
def corner_values(primvar: PrimvarRecord, triangle: int, vertices: wp.vec3i) -> wp.vec3i:
    """Numbers of the values at the corners of a triangle with these point indices, for interpolations 2 and 3."""
    if primvar.interpolation == 3:
        return wp.vec3i(
            primvar.indices[3 * triangle],
            primvar.indices[3 * triangle + 1],
            primvar.indices[3 * triangle + 2],
        )
    return vertices


@wp.func
def triangle_vertices(scene: DeviceScene, surface: Surface) -> wp.vec3i:
    """Point indices of the triangle that a surface lies on."""
    triangle = surface.hit.face
    return wp.vec3i(
        scene.geometries[surface.geometry].indices[3 * triangle],
        scene.geometries[surface.geometry].indices[3 * triangle + 1],
        scene.geometries[surface.geometry].indices[3 * triangle + 2],
    )


@wp.func
def interpolate(primvar: PrimvarRecord, face: int, triangle: int, vertices: wp.vec3i, u: float, v: float) -> wp.vec4:
    """Value at the barycentrics (1 - u - v, u, v) of a triangle with these point indices, cut from `face`."""
    if primvar.interpolation == 0:
        return value_at(primvar, 0)
    if primvar.interpolation == 1:
        return value_at(primvar, face)
    corner = corner_values(primvar, triangle, vertices)
    a = value_at(primvar, corner[0])
    return a + (value_at(primvar, corner[1]) - a) * u + (value_at(primvar, corner[2]) - a) * v


@wp.func
def primvar_at(scene: DeviceScene, surface: Surface, slot: int, fallback: wp.vec4) -> wp.vec4:
    """The primvar in a slot of the scene at a surface; `fallback` where the shape does not have it."""
    index = surface.geometry * scene.primvar_count + slot
    interpolation = scene.primvars[index].interpolation
    if interpolation < 0:
        return fallback
    if interpolation == 0:
        return value_at(scene.primvars[index], 0)
    if interpolation == 4:
        count = scene.primvars[index].values.shape[0] / scene.primvars[index].width
        return value_at(scene.primvars[index], scene.instances[surface.hit.instance].instance_id % count)
    triangle = surface.hit.face
    vertices = triangle_vertices(scene, surface)
    face = scene.geometries[surface.geometry].faces[triangle]
    return interpolate(scene.primvars[index], face, triangle, vertices, surface.hit.u, surface.hit.v)
