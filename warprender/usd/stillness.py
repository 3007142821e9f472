"""Which shapes are the same at every time."""

from __future__ import annotations

from pxr import Usd, UsdGeom

from ..shapes import Mesh, Sphere
from .binding import material_subsets
from .reading import Reading
from .skeletons import Skin

#: Attributes that move or hide a prim and leave its shape alone.
NOT_SHAPE = ("xformOp", "visibility")


def still_shapes(reading: Reading) -> dict[tuple, Mesh | Sphere | None]:
    """The shapes of a reading that another one of the same stage may take over, whatever its time."""
    return {
        key: shape
        for key, shape in reading.shapes.items()
        if key not in reading.sources or is_still(reading, *reading.sources[key])
    }


def is_still(reading: Reading, prim: Usd.Prim, skin: Skin | None) -> bool:
    """Whether nothing that the prim's shape depends on has time samples: its own, its subsets', inherited primvars."""
    if skin and skin.skeleton.GetAnimQuery():
        return False
    prims = [prim, *(subset.GetPrim() for subset in material_subsets(prim))]
    if any(_varies(attribute) for p in prims for attribute in p.GetAuthoredAttributes()):
        return False
    api = UsdGeom.PrimvarsAPI(prim)
    inherited = (api.FindPrimvarWithInheritance(name) for name in reading.primvars)
    return not any(primvar.ValueMightBeTimeVarying() for primvar in inherited if primvar)


def _varies(attribute: Usd.Attribute) -> bool:
    return attribute.ValueMightBeTimeVarying() and not attribute.GetName().startswith(NOT_SHAPE)
