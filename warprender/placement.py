"""Shapes in their places: what a scene is made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .errors import SceneError
from .given import plain_array, shown
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
        if self.instance_ids is None:
            self.instance_ids = np.full(len(self.transforms), -1, np.int32)

    def __setattr__(self, name: str, value: object) -> None:
        """Assign; other `transforms` may be one matrix, or more or fewer, which are then numbered anew.

        Raises:
            SceneError: the transforms are no matrices.
        """
        if name == "transforms":
            value = _matrices(self.path, value)
            ids = self.__dict__.get("instance_ids")
            if ids is not None and len(ids) != len(value):
                numbered = len(ids) > 0 and bool((ids >= 0).all())
                self.instance_ids = (
                    np.arange(len(value), dtype=np.int32) if numbered else np.full(len(value), -1, np.int32)
                )
        super().__setattr__(name, value)

    def fault(self) -> str:
        """Which field does not go with the transforms, in a few words; "" where all do."""
        count = len(self.transforms)
        if isinstance(self.visible, bool) and len(self.instance_ids) == count:
            return ""
        for name, shapes in (("visible", ((), (count,))), ("instance_ids", ((count,),))):
            if np.shape(getattr(self, name)) not in shapes:
                return f"{name} has the shape {np.shape(getattr(self, name))}, but there are {count} transforms"
        return ""


def _matrices(path: str, values: object) -> np.ndarray:
    """(K, 4, 4) float64 from one or several matrices."""
    array = plain_array(values)
    if array.shape == (0,):
        return np.zeros((0, 4, 4))
    if array.dtype.kind not in "fiu" or array.ndim not in (2, 3) or array.shape[-2:] != (4, 4):
        raise SceneError(f"{path}: its transforms are {shown(values)}, not (K, 4, 4) numbers")
    array = np.asarray(array, np.float64)
    return array if array.ndim == 3 else array[None]


def materials_of(placement: Placement) -> list[str]:
    """Keys of the materials that a placement shows: its own, and those of its shape's faces."""
    return [placement.material, *getattr(placement.shape, "face_materials", {})]


def copies_of(placement: Placement) -> np.ndarray:
    """(K,) numbers of the copies: those of the instancer, or where there is none, from 0 on."""
    ids = placement.instance_ids
    return ids if (ids >= 0).all() else np.arange(len(ids))
