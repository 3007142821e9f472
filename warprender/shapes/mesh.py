"""UsdGeomMesh as triangles: polygons cut once at load, with the way back to the authored faces."""

from __future__ import annotations

from dataclasses import dataclass, field

import mapbox_earcut
import numpy as np
import warp as wp

from ..numerics import max_component, triangle_point
from ..records import DeviceScene, Hit
from ..watched import Watched
from .local_surface import LocalSurface
from .normals import vertex_normals
from .primvar import Primvar, interpolate

#: `Mesh.normals` that are computed from the points as they are, on the device.
SMOOTH = "smooth"
#: Attributes of a mesh that say nothing of what it is made of.
POINTS = ("stored", "handed_out", "rest")


#: Triangles with sides between these have normals that float32 holds with room to spare.
_SMALL, _LARGE = wp.constant(wp.float32(1e-6)), wp.constant(wp.float32(1e6))


@dataclass
class Mesh(Watched):
    """A triangle mesh that remembers the polygons that it was cut from.

    Attributes:
        points: (N, 3) float32 in object space: a numpy array until a renderer has uploaded it, from then on the
            `wp.array(dtype=wp.vec3)` that it reads. Written in place, it is followed by `Renderer.update`.
        triangles: (T, 3) int32 indices into `points`. The geometric normal is (p1 - p0) × (p2 - p0).
        faces: (T,) int32, the authored face that each triangle belongs to.
        corners: (T, 3) int32, the authored face corner (index into `faceVertexIndices`) of each vertex.
        normals: shading normals in object space: a `Primvar`, a `wp.array(dtype=wp.vec3)` of one for each point
            that is read in place, `SMOOTH` for those of the points as they are, or None for flat shading.
        primvars: name to `Primvar`, in terms of the authored faces, points and corners.
        face_materials: material path to the (K,) int32 authored faces that it covers (GeomSubset).
        double_sided: as authored. Both sides are drawn either way.
        normals_follow: whether authored normals go along with points that are written in place.
    """

    points: np.ndarray
    triangles: np.ndarray
    faces: np.ndarray
    corners: np.ndarray
    normals: Primvar | wp.array | str | None = None
    primvars: dict[str, Primvar] = field(default_factory=dict)
    face_materials: dict[str, np.ndarray] = field(default_factory=dict)
    double_sided: bool = False
    normals_follow: bool = True

    def __setattr__(self, name: str, value: object) -> None:
        super().__setattr__(name, value)
        if name == "normals":
            _remember_rest(self)

    def host_normals(self) -> Primvar | None:
        """The normals on the host, as they are authored or follow from the points as they are now."""
        if isinstance(self.normals, wp.array):
            return Primvar(self.normals.numpy().astype(np.float32), "vertex")
        if isinstance(self.normals, str):
            return Primvar(vertex_normals(self.host_points(), self.triangles), "vertex")
        return self.normals

    def host_points(self) -> np.ndarray:
        """(N, 3) float32 points on the host."""
        return self.stored.numpy() if isinstance(self.stored, wp.array) else np.asarray(self.stored, np.float32)

    @classmethod
    def from_polygons(
        cls,
        points: np.ndarray,
        face_vertex_counts: np.ndarray,
        face_vertex_indices: np.ndarray,
        *,
        left_handed: bool = False,
        hole_faces: np.ndarray | None = None,
        **fields,
    ) -> Mesh:
        """Cut polygons into triangles.

        Args:
            points: (N, 3) float32.
            face_vertex_counts: (F,) int.
            face_vertex_indices: (sum of counts,) int.
            left_handed: UsdGeomMesh `orientation`; the winding of every triangle is turned round.
            hole_faces: faces that are not drawn (`holeIndices`).
            **fields: the remaining attributes.
        """
        triangles, faces, corners = triangulate(points, face_vertex_counts, face_vertex_indices, hole_faces)
        if left_handed:
            triangles, corners = triangles[:, ::-1].copy(), corners[:, ::-1].copy()
        return cls(points, triangles, faces, corners, **fields)


def _hand_out(mesh: Mesh) -> np.ndarray | wp.array:
    if not mesh.handed_out:
        mesh.handed_out = True
        _remember_rest(mesh)
    return mesh.stored


def _take(mesh: Mesh, points: np.ndarray | wp.array) -> None:
    mesh.stored = points
    mesh.handed_out = isinstance(points, wp.array)
    _remember_rest(mesh)


def _remember_rest(mesh: Mesh) -> None:
    """Keep the points that authored normals belong to, once somebody may write into them."""
    written = mesh.handed_out and isinstance(mesh.normals, Primvar)
    # Not by assignment: what the scene shows has not changed.
    mesh.__dict__["rest"] = mesh.host_points().copy() if written else None


# Whoever has been given the points may write into them: `handed_out` says which meshes may have moved. The renderer
# itself reads `stored`.
Mesh.points = property(_hand_out, _take)


def triangulate(
    points: np.ndarray,
    face_vertex_counts: np.ndarray,
    face_vertex_indices: np.ndarray,
    hole_faces: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut polygons into triangles: fans where a polygon is convex, earcut where it is not.

    Args:
        points: (N, 3) float.
        face_vertex_counts: (F,) int; faces of fewer than three corners draw nothing.
        face_vertex_indices: (sum of counts,) int, all in range of `points`.
        hole_faces: faces to leave out.

    Returns:
        triangles (T, 3), faces (T,), corners (T, 3), all int32, in the order of the faces.
    """
    counts = np.asarray(face_vertex_counts, np.int64)
    indices = np.asarray(face_vertex_indices, np.int64)
    points = np.asarray(points, np.float64)
    first = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64) if len(counts) else counts
    drawn = counts >= 3
    if hole_faces is not None and len(hole_faces):
        holes = np.asarray(hole_faces, np.int64)
        drawn[holes[(holes >= 0) & (holes < len(counts))]] = False

    pieces = []
    for size in np.unique(counts[drawn]):
        faces = np.flatnonzero(drawn & (counts == size))
        fan = np.stack([np.zeros(size - 2, int), np.arange(1, size - 1), np.arange(2, size)], 1)
        # A concave quad is convex as seen from one end of its other diagonal.
        for start in range(2 if size == 4 else 1):
            corners = first[faces, None] + (np.arange(size) + start) % size
            convex = np.ones(len(faces), bool) if size == 3 else _is_convex_fan(points[indices[corners]])
            pieces.append((np.repeat(faces[convex], size - 2), corners[convex][:, fan].reshape(-1, 3)))
            faces = faces[~convex]
        for face in faces:
            ring = first[face] + np.arange(size)
            cut = _cut_ears(points[indices[ring]])
            pieces.append((np.full(len(cut), face), ring[cut]))
    pieces = [piece for piece in pieces if len(piece[0])]
    if not pieces:
        return np.zeros((0, 3), np.int32), np.zeros(0, np.int32), np.zeros((0, 3), np.int32)

    faces = np.concatenate([p[0] for p in pieces])
    corners = np.concatenate([p[1] for p in pieces])
    if len(pieces) > 1:
        order = np.argsort(faces, kind="stable")
        faces, corners = faces[order], corners[order]
    return indices[corners].astype(np.int32), faces.astype(np.int32), corners.astype(np.int32)


def _is_convex_fan(rings: np.ndarray) -> np.ndarray:
    """Whether every triangle fanned from the first corner faces as its polygon does: (F, n, 3) → (F,) bool."""
    edges = rings[:, 1:] - rings[:, :1]
    facing = np.cross(edges[:, :-1], edges[:, 1:])
    return (np.einsum("ftk,fk->ft", facing, facing.sum(1)) >= 0).all(1)


def _cut_ears(ring: np.ndarray) -> np.ndarray:
    """Triangles (T, 3) into a concave polygon (n, 3), cut in the plane of its Newell normal.

    A fan from the first corner where the polygon has no area to speak of (earcut finds no ear there).
    """
    centred = ring - ring.mean(0)
    normal = np.cross(centred, np.roll(centred, -1, 0)).sum(0)
    axis = int(np.argmax(np.abs(normal)))
    plane = np.delete(centred, axis, 1)
    cut = mapbox_earcut.triangulate_float64(np.ascontiguousarray(plane), np.array([len(ring)], np.uint32))
    triangles = np.asarray(cut, np.int64).reshape(-1, 3)
    if not len(triangles):
        steps = np.arange(1, len(ring) - 1)
        return np.stack([np.zeros_like(steps), steps, steps + 1], 1)
    a, b, c = (plane[triangles[:, k]] for k in range(3))
    area = _cross_2d(b - a, c - a)
    u, v = plane, np.roll(plane, -1, 0)
    flipped = np.sign(area) != np.sign(_cross_2d(u, v).sum())
    triangles[flipped] = triangles[flipped][:, ::-1]
    return triangles


def _cross_2d(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


@wp.func
def mesh_surface(scene: DeviceScene, geometry: int, hit: Hit) -> LocalSurface:
    """The hit point from its barycentrics: eight times nearer to the triangle than origin + t direction."""
    # The record is read where it is: a copy of it costs more than the arithmetic.
    i = scene.geometries[geometry].indices[3 * hit.face]
    j = scene.geometries[geometry].indices[3 * hit.face + 1]
    k = scene.geometries[geometry].indices[3 * hit.face + 2]
    p0 = scene.geometries[geometry].points[i]
    p1 = scene.geometries[geometry].points[j]
    p2 = scene.geometries[geometry].points[k]
    position, error = triangle_point(p0, p1, p2, hit.u, hit.v)
    local = LocalSurface()
    local.position = position
    local.error = error
    local.geometric_normal = triangle_normal(p0, p1, p2)
    local.normal = local.geometric_normal
    local.face = scene.geometries[geometry].faces[hit.face]
    if scene.geometries[geometry].normals.interpolation >= 0:
        vertices = wp.vec3i(i, j, k)
        n = interpolate(scene.geometries[geometry].normals, local.face, hit.face, vertices, hit.u, hit.v)
        local.normal = wp.vec3(n[0], n[1], n[2])
    return local


@wp.func
def triangle_normal(p0: wp.vec3, p1: wp.vec3, p2: wp.vec3) -> wp.vec3:
    """Direction of (p1 - p0) × (p2 - p0), computed at a scale where products neither underflow nor overflow."""
    a = p1 - p0
    b = p2 - p0
    largest = wp.max(max_component(wp.abs(a)), max_component(wp.abs(b)))
    if largest > _SMALL and largest < _LARGE:
        return wp.cross(a, b)
    if largest == 0.0:
        return wp.vec3(0.0, 0.0, 0.0)
    return wp.cross(a / largest, b / largest)
