"""UsdGeomMesh as a subdivision surface."""

from __future__ import annotations

import numpy as np
from pxr import UsdGeom

from ..shapes import Mesh, Primvar
from ..shapes.subdivision import Cage, Subdivision
from .reading import Reading
from .topology import Topology

#: Attributes of UsdGeomMesh that are lists of a cage, and those that are names.
LISTS = ("creaseIndices", "creaseLengths", "creaseSharpnesses", "cornerIndices", "cornerSharpnesses")
NAMES = (
    "subdivisionScheme",
    "interpolateBoundary",
    "faceVaryingLinearInterpolation",
    "triangleSubdivisionRule",
)


def subdivide(
    reading: Reading,
    schema: UsdGeom.Mesh,
    topology: Topology,
    points: np.ndarray,
    primvars: dict[str, Primvar],
) -> Mesh | None:
    """The surface of a mesh at the level of the reading; None, with a remark, where its scheme refuses it."""
    prim = schema.GetPrim()
    faces, corners = _usable(topology, is_left_handed(reading, schema))
    cage = Cage(
        len(points),
        topology.counts[faces],
        topology.indices[corners],
        holes=np.flatnonzero(np.isin(faces, topology.holes)),
        **{name: str(reading.get(prim.GetAttribute(name))) for name in NAMES},
        **{name: np.array(reading.get(prim.GetAttribute(name)) or []) for name in LISTS},
    )
    surface = reading.surfaces.get(str(prim.GetPath()))
    if surface is None or surface.cage != cage:
        try:
            surface = Subdivision(cage, reading.level)
        except ValueError as error:
            reading.remark(prim, f"its cage is drawn: {error}")
            return None
        reading.surfaces[str(prim.GetPath())] = surface
    carried = {name: _rearranged(primvar, corners) for name, primvar in primvars.items()}
    mesh = surface.mesh(points, carried)
    mesh.faces = faces[mesh.faces].astype(np.int32)
    return mesh


def is_left_handed(reading: Reading, schema: UsdGeom.Mesh) -> bool:
    """Whether the outside of the faces is where they turn clockwise."""
    return reading.get(schema.GetOrientationAttr()) == UsdGeom.Tokens.leftHanded


def _usable(topology: Topology, left_handed: bool) -> tuple[np.ndarray, np.ndarray]:
    """Faces (K,) that subdivision can work with, and their corners counter-clockwise, as authored indices."""
    usable = topology.counts >= 3
    usable[topology.broken] = False
    ends = np.cumsum(topology.counts)
    corners = np.arange(len(topology.indices))
    if left_handed:
        corners = np.repeat(2 * ends - topology.counts - 1, topology.counts) - corners
    return np.flatnonzero(usable), corners[np.repeat(usable, topology.counts)]


def _rearranged(primvar: Primvar, corners: np.ndarray) -> Primvar:
    """A primvar of the authored mesh for the chosen corners."""
    if primvar.interpolation != "faceVarying":
        return primvar
    indices = corners if primvar.indices is None else primvar.indices[corners]
    return Primvar(primvar.values, "faceVarying", indices)
