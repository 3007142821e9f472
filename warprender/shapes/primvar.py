"""Primvars: named values on a shape, interpolated over it as UsdGeomPrimvar says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Interpolations in the order of their ids on the device. `varying` is stored as `vertex`: they differ only
#: under subdivision, which happens before a mesh gets here.
INTERPOLATIONS = ("constant", "uniform", "vertex", "faceVarying")


@dataclass
class Primvar:
    """Values over a shape.

    Attributes:
        values: (K, C) float32, C from 1 to 4 components.
        interpolation: one of `INTERPOLATIONS`. K is 1 (constant), the number of faces (uniform), of points
            (vertex), or of face corners in `faceVertexIndices` order (faceVarying), unless `indices` is given.
        indices: (K,) int32 or None; with it, element k has the value `values[indices[k]]`.
    """

    values: np.ndarray
    interpolation: str = "constant"
    indices: np.ndarray | None = None

    def __post_init__(self) -> None:
        values = np.ascontiguousarray(self.values, np.float32)
        self.values = values.reshape(len(values), -1) if values.ndim != 2 else values
        if self.interpolation == "varying":
            self.interpolation = "vertex"
        if self.interpolation not in INTERPOLATIONS:
            raise ValueError(
                f"interpolation {self.interpolation!r} is not one of {', '.join(INTERPOLATIONS)}"
            )
        if self.indices is not None:
            self.indices = np.ascontiguousarray(self.indices, np.int32)

    def __len__(self) -> int:
        """Number of elements that the interpolation counts."""
        return len(self.values) if self.indices is None else len(self.indices)

    def expanded(self) -> np.ndarray:
        """The values with `indices` resolved: (K, C) float32."""
        return self.values if self.indices is None else self.values[self.indices]
