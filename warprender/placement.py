"""Shapes in their places: what a scene is made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .shapes import Mesh, Sdf, Sphere
from .watched import Watched


@dataclass
class Placement(Watched):
    """A shape drawn one or many times with one material: a prim, or a prim under an instancer.

    Attributes:
        path: prim path; names the prim in warnings and ids.
        shape: the geometry, stored once however often it is placed.
        transforms: (K, 4, 4) float64 object-to-world matrices for row vectors, as in USD: p' = p M. A renderer makes
            them read-only: to move the prim by the host, assign others.
        material: key into `Scene.materials`; "" for `Scene.materials[""]`, the display colour.
        instance_ids: (K,) int32, UsdGeomPointInstancer index of each copy, -1 where there is no instancer.
        visible: whether it is drawn, for all copies or (K,) for each.
        semantic: what it is, as "car", from the semantic labels of its prim or of those above; "" where nothing says.
    """

    path: str
    shape: Mesh | Sphere | Sdf
    transforms: np.ndarray
    material: str = ""
    instance_ids: np.ndarray | None = None
    visible: bool | np.ndarray = True
    semantic: str = ""

    def __post_init__(self) -> None:
        self.transforms = np.asarray(self.transforms, np.float64).reshape(-1, 4, 4)
        if self.instance_ids is None:
            self.instance_ids = np.full(len(self.transforms), -1, np.int32)


def materials_of(placement: Placement) -> list[str]:
    """Keys of the materials that a placement shows: its own, and those of its shape's faces."""
    return [placement.material, *getattr(placement.shape, "face_materials", {})]


def copies_of(placement: Placement) -> np.ndarray:
    """(K,) numbers of the copies: those of the instancer, or where there is none, from 0 on."""
    ids = placement.instance_ids
    return ids if (ids >= 0).all() else np.arange(len(ids))
