"""UsdVolVolume: fields that are level sets in NanoVDB files, drawn as solids."""

from __future__ import annotations

import numpy as np
import warp as wp
from pxr import Sdf as Paths
from pxr import Usd, UsdVol

from ..shapes import Sdf
from ..shapes.volume import FOG, LEVEL_SET, dense, grid_class
from .primvars import SINGLE, read_primvars
from .reading import Reading, asset_bytes


def read_volume(reading: Reading, prim: Usd.Prim) -> Sdf | None:
    """The solid of the first field that is a level set; None, with a remark that says why, where none is."""
    fields = UsdVol.Volume(prim).GetFieldPaths()
    faults = [] if fields else ["it has no field"]
    for name, path in sorted(fields.items()):
        try:
            values, bounds = _level_set(reading, reading.stage.GetPrimAtPath(path))
        except ValueError as error:
            faults.append(f"field {name}: {error}")
            continue
        solid = Sdf(values=values, bounds=bounds, primvars=read_primvars(reading, prim, SINGLE))
        if fault := solid.fault():
            faults.append(f"field {name}: {fault}")
            continue
        return solid
    reading.remark(prim, f"Volume is not drawn yet: {'; '.join(faults)}")
    return None


def _level_set(reading: Reading, field: Usd.Prim) -> tuple[np.ndarray, np.ndarray]:
    """Values and bounds of a field, in the volume's space.

    Raises:
        ValueError: it is no level set, or cannot be read.
    """
    kind = field.GetTypeName() if field else "nothing"
    if kind != "OpenVDBAsset":
        raise ValueError(f"{kind} is not read, an OpenVDBAsset of a .nvdb file is")
    asset = UsdVol.OpenVDBAsset(field)
    file = reading.get(asset.GetFilePathAttr())
    path = (file.resolvedPath or file.path) if isinstance(file, Paths.AssetPath) else ""
    if not path.endswith((".nvdb", ".nvdb]")):
        raise ValueError(
            f"{path or 'no file'}: only NanoVDB files (.nvdb) are read; nanovdb_convert makes them of .vdb"
        )
    stated = reading.get(asset.GetFieldClassAttr())
    volume = _grid(path, reading.get(asset.GetFieldNameAttr()), reading.get(asset.GetFieldIndexAttr()))
    found = {"levelSet": LEVEL_SET, "fogVolume": FOG}.get(str(stated), grid_class(volume))
    try:
        values, bounds = dense(volume)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    if found == FOG or not (values < 0).any() or not (values > 0).any():
        raise ValueError(f"{path}: it is no level set, with negative values inside; fog is not drawn")
    return values, bounds


def _grid(path: str, name: str | None, index: int | None) -> wp.Volume:
    """The grid of a file with a name, and among those of one name with an index; the first of all without a name."""
    try:
        volume = wp.Volume.load_from_nvdb(asset_bytes(path), device="cpu")
    except Exception as error:
        raise ValueError(f"{path}: {error}") from None
    names, number = [], int(index or 0)
    while volume is not None:
        found = volume.get_grid_info().name
        names.append(found)
        if name in (None, "", found) and names.count(found) > number:
            return volume
        volume = volume.load_next_grid()
    raise ValueError(f"{path}: there is no grid {name!r}; there is {', '.join(map(repr, dict.fromkeys(names)))}")
