"""UsdGeom's intrinsic shapes: spheres as quadrics, the others as meshes that look round."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pxr import Usd

from ..shapes import Mesh, Sphere
from ..shapes.flat import cube, plane
from ..shapes.revolved import capsule, cone, cylinder
from .primvars import SINGLE, read_primvars
from .reading import Reading

#: Prim type to the attributes that make its shape and the function that makes it of them.
KINDS: dict[str, tuple[tuple[str, ...], Callable[..., Mesh | Sphere]]] = {
    "Sphere": (("radius",), Sphere),
    "Cube": (("size",), cube),
    "Cylinder": (("height", "radius", "axis"), lambda h, r, axis: cylinder(h, r, r, axis)),
    "Cylinder_1": (("height", "radiusBottom", "radiusTop", "axis"), cylinder),
    "Cone": (("height", "radius", "axis"), cone),
    "Capsule": (("height", "radius", "axis"), lambda h, r, axis: capsule(h, r, r, axis)),
    "Capsule_1": (("height", "radiusBottom", "radiusTop", "axis"), capsule),
    "Plane": (("width", "length", "axis", "doubleSided"), plane),
}

#: Elements that primvars may count on, by interpolation: those of Hydra's cube; a round shape takes one value.
SIZES = {"Cube": {"constant": 1, "uniform": 6, "vertex": 8, "varying": 8, "faceVarying": 24}}


def read_gprim(reading: Reading, prim: Usd.Prim) -> Mesh | Sphere | None:
    """An intrinsic shape, or None where it has no extent; prims that look alike share one."""
    names, build = KINDS[prim.GetTypeName()]
    values = tuple(reading.get(prim.GetAttribute(name)) for name in names)
    sizes = [v for v in values if isinstance(v, float)]
    if not np.isfinite(sizes).all() or min(sizes) < 0:
        stated = ", ".join(f"{name} {value}" for name, value in zip(names, values, strict=True))
        reading.remark(prim, f"it is not drawn with {stated}")
        return None
    if max(sizes) == 0:
        return None
    primvars = read_primvars(reading, prim, SIZES.get(prim.GetTypeName(), SINGLE))
    looks = ((name, p.interpolation, p.expanded().tobytes()) for name, p in primvars.items())
    key = (prim.GetTypeName(), values, tuple(looks))
    if key not in reading.shapes:
        shape = build(*values)
        shape.primvars.update(primvars)
        reading.shapes[key] = shape
    return reading.shapes[key]
