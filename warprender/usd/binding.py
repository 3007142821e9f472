"""Which material a prim is drawn with: direct and collection bindings, their strength, and purposes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from pxr import Usd, UsdGeom, UsdShade

from ..materials.inputs import Number, Varying
from ..scene import RenderSettings
from .materials import read_material
from .reading import Reading, shared_prim

#: Binding purposes in the order of preference; each falls back to the bindings for all purposes. A material
#: of the first purpose that cannot be drawn gives way to one of the next.
PURPOSES = ("full", "preview")


def binding_purposes(settings: RenderSettings) -> tuple[str, ...]:
    """The settings' purposes; after "full" comes "preview" in any case, for full materials that cannot be drawn."""
    if not settings.materialBindingPurposes:
        return PURPOSES
    named = tuple(purpose for purpose in settings.materialBindingPurposes if purpose)
    if not named:
        return ("",)
    return (*named, "preview") if "full" in named and "preview" not in named else named


class Bindings:
    """Materials of many prims, resolved in one go, each material read once."""

    def __init__(self, reading: Reading) -> None:
        self._reading = reading
        self._keys: dict[object, str] = {}
        self._reads: dict[object, str] = {}

    def resolve(self, prims: Sequence[Usd.Prim]) -> None:
        """Resolve the bindings of shapes and of their subsets."""
        prims = list({prim.GetPath(): prim for prim in prims}.values())
        prims += [subset.GetPrim() for prim in prims for subset in material_subsets(prim)]
        undecided = prims
        for purpose in binding_purposes(self._reading.scene.settings):
            materials, _ = UsdShade.MaterialBindingAPI.ComputeBoundMaterials(undecided, purpose)
            for prim, material in zip(undecided, materials, strict=True):
                self._keys[prim.GetPath()] = self._key(material) if material else ""
            undecided = [prim for prim in undecided if not self._keys[prim.GetPath()]]
            if not undecided:
                return

    def key(self, prim: Usd.Prim) -> str:
        """The prim's key into `Scene.materials`, "" where nothing is bound that can be drawn."""
        return self._keys[prim.GetPath()]

    def subset_keys(self, prim: Usd.Prim) -> tuple[str, ...]:
        """Materials of the prim itself and of its subsets in order, () without subsets."""
        subsets = [self.key(subset.GetPrim()) for subset in material_subsets(prim)]
        return (self.key(prim), *subsets) if subsets else ()

    def displacements(self, keys: Iterable[str]) -> dict[str, Number]:
        """Displacement by material key, of those of the keys whose material displaces."""
        found = {key: getattr(self._reading.scene.materials.get(key), "displacement", 0.0) for key in keys}
        return {key: value for key, value in found.items() if isinstance(value, Varying) or value != 0.0}

    def face_materials(self, prim: Usd.Prim, faces: int) -> dict[str, np.ndarray]:
        """Material key to the faces that a GeomSubset gives it; a face belongs to its first subset.

        Args:
            prim: a mesh.
            faces: its number of faces.
        """
        covered = np.zeros(faces, bool)
        found: dict[str, list[np.ndarray]] = {}
        own = self.key(prim)
        for subset in material_subsets(prim):
            indices = np.array(self._reading.get(subset.GetIndicesAttr()) or [], np.int64)
            valid = (indices >= 0) & (indices < faces)
            if not valid.all():
                message = f"{np.sum(~valid)} indices are outside 0…{faces - 1}"
                self._reading.remark(subset.GetPrim(), message)
            indices = np.unique(indices[valid])
            indices = indices[~covered[indices]]
            covered[indices] = True
            key = self.key(subset.GetPrim())
            if key != own and len(indices):
                found.setdefault(key, []).append(indices.astype(np.int32))
        return {key: np.concatenate(pieces) for key, pieces in found.items()}

    def _key(self, material: UsdShade.Material) -> str:
        prim = material.GetPrim()
        source = shared_prim(prim).GetPath()
        if source not in self._reads:
            result = self._reading.attempt(prim, read_material, material)
            self._reads[source] = str(prim.GetPath()) if result is not None else ""
            if result is not None:
                self._reading.scene.materials[str(prim.GetPath())] = result
        return self._reads[source]


def material_subsets(prim: Usd.Prim) -> list[UsdGeom.Subset]:
    """The face subsets of a mesh that carry materials."""
    if not prim.IsA(UsdGeom.Mesh):
        return []
    subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
    return [s for s in subsets if s.GetElementTypeAttr().Get() == UsdGeom.Tokens.face]
