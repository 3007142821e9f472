"""Shading normals that follow points as a simulation writes them, computed on the device."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..launch import launch
from ..numerics import INFINITY, is_finite, max_component, safe_normalize
from ..records import PrimvarRecord
from .mesh import SMOOTH, Mesh
from .normals import same_rows
from .primvar import INTERPOLATIONS, Primvar

#: Normals that are worth another thread.
_CHUNK = 2048
#: Interpolations whose normals can follow: one normal for the whole shape cannot.
FOLLOWING = ("uniform", "vertex", "varying", "faceVarying")


class LiveNormals:
    """The normals of one mesh on a device, and which corners of its triangles share each of them.

    A normal is the mean over those corners of what their triangles make of it, weighted as Max has it ("Weights for
    computing vertex normals from facet normals", 1999), so that the vertices of a mesh inscribed in a sphere have the
    sphere's own normals. A smooth normal is each triangle's own. An authored one goes along with its triangle's
    deformation: its components along the edges are those of a covector, and across it the triangle is taken to
    stretch as the root of its area does. Where points are at rest it is the authored one to the bit.

    Attributes:
        record: the device's record of the normals.
    """

    def __init__(self, mesh: Mesh, drawn: np.ndarray, device: str | wp.Device) -> None:
        """For the triangles `drawn` (T,) bool of a mesh."""
        triangles = mesh.triangles[drawn]
        corners = triangles.reshape(-1)
        self.record = PrimvarRecord()
        self.record.width = 3
        if isinstance(mesh.normals, str):
            group, count = corners, len(mesh.stored)
            self.record.interpolation = INTERPOLATIONS.index("vertex")
            authored, rest = np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32)
        else:
            group, authored = _shared_normals(mesh, drawn)
            count, rest = len(authored), mesh.rest
            self.record.interpolation = INTERPOLATIONS.index("faceVarying")
            self.record.indices = wp.array(group.astype(np.int32), dtype=wp.int32, device=device)
        starts = np.concatenate([[0], np.cumsum(np.bincount(group, minlength=count))])
        self._starts = wp.array(starts.astype(np.int32), dtype=wp.int32, device=device)
        # For each corner its own point, and the next two of its triangle.
        around = np.stack([triangles, np.roll(triangles, -1, 1), np.roll(triangles, -2, 1)], -1).reshape(-1, 3)
        around = np.ascontiguousarray(around[np.argsort(group, kind="stable")], np.int32)
        self._around = wp.array(around, dtype=wp.vec3i, device=device)
        self._authored = wp.array(authored, dtype=wp.vec3, device=device)
        self._rest = wp.array(rest, dtype=wp.vec3, device=device)
        self._normals = wp.zeros(count, dtype=wp.vec3, device=device)
        self.record.values = self._normals.view(wp.float32).flatten()

    def follow(self, points: wp.array) -> None:
        """Compute the normals for points (N,) of `wp.vec3` as they are now."""
        inputs = [points, self._starts, self._around, self._authored, self._rest, self._normals]
        launch(_follow, len(self._normals), inputs, self._normals.device, smallest_chunk=_CHUNK)


class WrittenNormals:
    """Normals that the simulation writes, one for each point: read in place where that can be, else copied.

    Attributes:
        record: the device's record of them.
        copied: whether they are a copy, which follows when it is told.
    """

    def __init__(self, normals: wp.array, count: int, device: str) -> None:
        """For `count` points on a device.

        Raises:
            ValueError: there are not as many normals, or they are not of `wp.vec3`.
        """
        if normals.dtype != wp.vec3 or normals.shape != (count,):
            raise ValueError(
                f"its normals are an array {normals.shape} of {normals.dtype.__name__}, not ({count},) of wp.vec3"
            )
        in_place = normals.device == wp.get_device(device) and normals.is_contiguous
        self._source, self._normals = normals, normals if in_place else wp.empty(count, dtype=wp.vec3, device=device)
        self.copied = not in_place
        self.record = PrimvarRecord()
        self.record.interpolation, self.record.width = INTERPOLATIONS.index("vertex"), 3
        self.record.values = self._normals.view(wp.float32).flatten()

    def follow(self, points: wp.array) -> None:
        """See the normals as they are now."""
        if self.copied:
            wp.copy(self._normals, self._source)


def can_follow(mesh: Mesh) -> bool:
    """Whether the mesh's normals are to be computed from its points: smooth ones, and authored ones that may follow."""
    if isinstance(mesh.normals, Primvar):
        return mesh.rest is not None and mesh.normals_follow and mesh.normals.interpolation in FOLLOWING
    return isinstance(mesh.normals, str) and mesh.normals == SMOOTH


def _shared_normals(mesh: Mesh, drawn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The normals that corners share, as (3 T,) number for each corner and (G, 3) values.

    Corners share one where they had the same place at rest and the same authored normal: hard edges stay hard, and
    seams of texture coordinates, where points are there twice, stay smooth. Normals of faces are shared by a face.
    """
    elements = {"faceVarying": mesh.corners, "uniform": np.repeat(mesh.faces[:, None], 3, 1)}
    elements = elements.get(mesh.normals.interpolation, mesh.triangles)[drawn].reshape(-1)
    normals = mesh.normals.expanded()[elements]
    if mesh.normals.interpolation == "uniform":
        places = elements[:, None].astype(np.float32)
    else:
        places = mesh.rest[mesh.triangles[drawn].reshape(-1)]
    first, group = same_rows(np.concatenate([places, normals], 1))
    # In the order of the triangles: neighbours read what is near in memory.
    order = np.argsort(first)
    number = np.empty_like(order)
    number[order] = np.arange(len(order))
    return number[group], normals[first[order]]


@wp.func
def _unit_of(edge: wp.vec3) -> float:
    """A scale at which the edge has a length about 1; 1 for an edge that has none."""
    largest = max_component(wp.abs(edge))
    return wp.where(largest > 0.0 and largest < INFINITY, 1.0 / largest, 1.0)


@wp.func
def _carried(normal: wp.vec3, a0: wp.vec3, b0: wp.vec3, a: wp.vec3, b: wp.vec3, across: wp.vec3) -> wp.vec3:
    """What becomes of an authored normal at a corner with edges a0 and b0 when these become a and b; of any length.

    The components along the edges are those of a covector, n · a0 = n' · a; across, the triangle stretches as the
    root of its area does. `across` is a × b.
    """
    across0 = wp.cross(a0, b0)
    stretched = wp.sqrt(wp.sqrt(wp.dot(across, across) / wp.dot(across0, across0)))
    carried = wp.cross(b, across) * wp.dot(a0, normal) + wp.cross(across, a) * wp.dot(b0, normal)
    return carried + across * (wp.dot(across0, normal) * stretched)


@wp.kernel(module="unique", enable_backward=False)
def _follow(
    first: wp.int32,
    points: wp.array(dtype=wp.vec3),
    starts: wp.array(dtype=wp.int32),
    around: wp.array(dtype=wp.vec3i),
    authored: wp.array(dtype=wp.vec3),
    rest: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
):
    i = first + wp.tid()
    smooth = authored.shape[0] == 0
    normal = wp.vec3(0.0, 0.0, 0.0)
    if not smooth:
        normal = authored[i]
    at_rest = not smooth
    total = wp.vec3(0.0, 0.0, 0.0)
    unit = wp.float32(0.0)
    unit0 = wp.float32(1.0)
    for entry in range(starts[i], starts[i + 1]):
        corner = around[entry]
        k = corner[0]
        k1 = corner[1]
        k2 = corner[2]
        p = points[k]
        if at_rest:
            at_rest = p == rest[k] and points[k1] == rest[k1] and points[k2] == rest[k2]
        if unit == 0.0:
            # Products of lengths must not leave float32's range: edges are taken in units of one of them.
            unit = _unit_of(points[k1] - p)
            if not smooth:
                unit0 = _unit_of(rest[k1] - rest[k])
        a = (points[k1] - p) * unit
        b = (points[k2] - p) * unit
        across = wp.cross(a, b)
        share = across
        if not smooth:
            share = _carried(normal, (rest[k1] - rest[k]) * unit0, (rest[k2] - rest[k]) * unit0, a, b, across)
            share *= wp.sqrt(wp.dot(across, across) / wp.dot(share, share))
        # Max: (a × b) / (|a|² |b|²).
        share /= wp.dot(a, a) * wp.dot(b, b)
        if is_finite(share):
            total += share
    direction = safe_normalize(total)
    if at_rest or (not smooth and direction == wp.vec3(0.0, 0.0, 0.0)):
        normals[i] = normal
    elif smooth:
        normals[i] = direction
    else:
        # Interpolation weighs normals by their lengths: these stay as authored.
        normals[i] = direction * wp.length(normal)
