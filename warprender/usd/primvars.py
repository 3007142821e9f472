"""Primvars of a prim: values, interpolation and indices, checked against the shape that they lie on."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from pxr import Usd, UsdGeom

from ..shapes import Primvar
from .reading import Reading, shared_prim

#: Elements of a shape without faces: every interpolation counts one.
SINGLE = {name: 1 for name in ("constant", "uniform", "vertex", "varying", "faceVarying")}


def read_primvars(reading: Reading, prim: Usd.Prim, sizes: Mapping[str, int]) -> dict[str, Primvar]:
    """The primvars that shading needs and whose interpolation has a size here, inherited ones included.

    Args:
        reading: the reading in progress.
        prim: the shape.
        sizes: number of elements by interpolation.
    """
    found = {}
    api = UsdGeom.PrimvarsAPI(prim)
    for name, components in reading.primvars.items():
        source = api.FindPrimvarWithInheritance(name)
        if source and str(source.GetInterpolation()) in sizes:
            primvar = read_primvar(reading, prim, source, sizes, components)
            if primvar is not None:
                found[name] = primvar
    return found


def read_primvar(
    reading: Reading, prim: Usd.Prim, source: UsdGeom.Primvar, sizes: Mapping[str, int], components: int | None
) -> Primvar | None:
    """One primvar, or None, with a remark, where its values do not fit the shape."""
    value = source.Get(reading.time)
    if value is None or np.size(value) == 0:
        return None
    indices = source.GetIndices(reading.time) if source.IsIndexed() else None
    indices = np.array(indices, np.int64) if indices is not None and len(indices) else None
    name = str(source.GetName())
    return checked(reading, prim, name, value, str(source.GetInterpolation()), indices, sizes, components)


def read_builtin(
    reading: Reading, prim: Usd.Prim, name: str, sizes: Mapping[str, int], components: int
) -> Primvar | None:
    """An attribute that counts as a primvar, such as normals or widths; `primvars:name` beats `name`."""
    primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar(name)
    if primvar and primvar.HasValue():
        return read_primvar(reading, prim, primvar, sizes, components)
    attribute = prim.GetAttribute(name)
    values = reading.get(attribute)
    if values is None or not np.size(values):
        return None
    interpolation = attribute.GetMetadata("interpolation") or "vertex"
    if np.size(values) == components:
        # Stages give one width for all and leave the interpolation at its default.
        interpolation = "constant"
    return checked(reading, prim, name, values, interpolation, None, sizes, components)


def checked(
    reading: Reading,
    prim: Usd.Prim,
    name: str,
    value: object,
    interpolation: str,
    indices: np.ndarray | None,
    sizes: Mapping[str, int],
    components: int | None,
) -> Primvar | None:
    """A `Primvar` if the values fit; too many are cut off, too few or bad ones ignored, with a remark.

    `components` None takes what the primvar has, up to four.
    """
    values = np.asarray(value)
    if components is None:
        components = values.shape[1] if values.ndim == 2 else 1
        if values.ndim > 2 or not 1 <= components <= 4:
            reading.remark(prim, f"{name} is ignored: a {type(value).__name__} is not one to four numbers")
            return None
    if values.dtype.kind not in "fiu" or values.size % components:
        reading.remark(prim, f"{name} is ignored: its values have not {components} components")
        return None
    values = values.astype(np.float32).reshape(-1, components)
    if not np.isfinite(values).all():
        reading.remark(prim, f"{name} has values that are not finite; 0 is taken")
        values = np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
    if indices is not None and (indices.min() < 0 or indices.max() >= len(values)):
        reading.remark(prim, f"{name} is ignored: it has indices outside 0…{len(values) - 1}")
        return None
    expected = sizes.get(interpolation)
    count = len(values) if indices is None else len(indices)
    if expected is None or count < expected:
        reading.remark(prim, f"{name} is ignored: {count} values with {interpolation} interpolation")
        return None
    if count > expected:
        # A shape without faces takes the first value of any interpolation, and so says nothing.
        if sizes is not SINGLE and interpolation != "constant":
            reading.remark(prim, f"{name} has {count} values where {interpolation} takes {expected}")
        values, indices = (values[:expected], None) if indices is None else (values, indices[:expected])
    return Primvar(values, "constant" if sizes is SINGLE else interpolation, indices)


def inherited_from(reading: Reading, prim: Usd.Prim) -> tuple[str, ...]:
    """Paths of the attributes that an instance inherits primvars from: what may differ between two instances."""
    if not prim.IsInstanceProxy():
        return ()
    api = UsdGeom.PrimvarsAPI(prim)
    paths = []
    for name in reading.primvars:
        primvar = api.FindPrimvarWithInheritance(name)
        owner = primvar.GetAttr().GetPrim() if primvar else None
        if owner and owner != prim:
            paths.append(f"{shared_prim(owner).GetPath()}.{name}")
    return tuple(paths)
