"""The first hit of the ray through each pixel's centre, in one buffer, whoever finds it: rays or the rasterizer."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Protocol

import numpy as np
import warp as wp

from ..camera import camera_ray_function
from ..launch import launch_pixels
from ..records import CameraRecord, DeviceScene, GeometryRecord, Hit
from ..shapes import SHAPES, Sdf, Sphere
from .raster import DrawList, Raster, Triangles
from .rays import miss
from .sdf import ray_functions

#: Pixels from their centres that points may lie at, as reconstruction filters ask.
FARTHEST_OFFSET = 2.0


class FirstHits(Protocol):
    """A way to find first hits."""

    def find(self, threads: int | None = None) -> wp.array2d(dtype=Hit):
        """(H, W) hits, row 0 at the top. The array is overwritten by the next call."""


class RayHits:
    """First hits by one ray a pixel."""

    def __init__(
        self,
        scene: DeviceScene,
        camera: CameraRecord,
        effects: tuple[str, ...],
        device: str,
        sdfs: tuple[wp.Function, ...] = (),
    ) -> None:
        """`effects` are the camera's, by name; `sdfs` the signed distance functions that occur."""
        self._kernel = _ray_kernel(effects, sdfs)
        self._scene, self._camera = scene, camera
        self._hits = wp.empty((camera.height, camera.width), Hit, device=device)

    def find(self, threads: int | None = None) -> wp.array2d(dtype=Hit):
        """See `FirstHits`."""
        arguments = [self._scene, self._camera, self._hits]
        launch_pixels(self._kernel, self._camera.width, self._camera.height, arguments, self._hits.device, threads)
        return self._hits


class RasterHits:
    """First hits by the rasterizer: triangles by their edges, and rays where other shapes may be.

    Points go to clip space by one float64 matrix, of the same float32 placement that rays meet, and are rounded once.
    Raster and rays therefore differ only at centres within 2^-24 of the picture's width of an edge, and where surfaces
    are equally deep as float32.
    """

    def __init__(
        self,
        scene: DeviceScene,
        geometries: Sequence[GeometryRecord],
        bounds: np.ndarray,
        camera: CameraRecord,
        effects: tuple[str, ...],
        device: str,
        painter: bool = False,
        sdfs: tuple[wp.Function, ...] = (),
    ) -> None:
        """For a scene at rest.

        Args:
            scene: the scene on its device.
            geometries: the host's copies of `scene.geometries`.
            bounds: (2, 3) float64 box of everything placed, in the scene's coordinates.
            camera: a pinhole or an orthographic camera without clipping planes.
            effects: the camera's, by name.
            device: of the scene.
            painter: draw by the painter's algorithm, without a depth buffer.
            sdfs: the signed distance functions that occur; rays find them.

        Raises:
            ValueError: more triangles than int32 can number.
        """
        instances = scene.instances.numpy()
        placed = np.zeros((len(instances), 4, 4))
        placed[:, :3, :3], placed[:, :3, 3], placed[:, 3, 3] = instances["linear"], instances["translation"], 1.0
        to_clip = clip_matrix(camera, bounds)
        self._scene, self._camera = scene, camera
        self._draws = DrawList([_triangles(g, device) for g in geometries], instances["geometry"], device)
        self._to_clip, self._placed, self._offset = to_clip, placed, None
        self._seen: Raster | None = None
        self._draw = self._draws.paint if painter else self._draws.rasterize
        corners = _boxes_for_rays(scene, geometries)[instances["geometry"]]
        rayed = corners[:, 0, 0] < corners[:, 1, 0]
        boxes = pixel_boxes(camera, to_clip, placed[rayed], corners[rayed])
        by_ray = np.zeros((camera.height, camera.width), np.uint8)
        for left, top, right, bottom in boxes:
            by_ray[top:bottom, left:right] = 1
        self._by_ray = wp.array(by_ray, dtype=wp.uint8, device=device)
        self._hits = wp.empty((camera.height, camera.width), Hit, device=device)
        self._kernel = _raster_kernel(effects, bool(len(boxes)), sdfs)

    def find(self, threads: int | None = None, offset: tuple[float, float] = (0.0, 0.0)) -> wp.array2d(dtype=Hit):
        """See `FirstHits`; of the rays through points that lie `offset` pixels from the centres, to the right and down.

        `offset` is at most `FARTHEST_OFFSET` either way.
        """
        if offset != self._offset:
            self._draws.matrices.assign(_moved(self._to_clip, self._camera, offset) @ self._placed)
            self._offset = offset
        self._seen = seen = self._draw(self._camera.width, self._camera.height, threads, into=self._seen)
        arguments = [self._scene, self._camera, self._draws.first_face, seen.face, seen.u, seen.v, self._by_ray]
        size = self._camera.width, self._camera.height
        arguments = [*arguments, wp.vec2(*offset), self._hits]
        launch_pixels(self._kernel, *size, arguments, self._hits.device, threads)
        return self._hits


def _moved(to_clip: np.ndarray, camera: CameraRecord, offset: tuple[float, float]) -> np.ndarray:
    """The clip matrix under which pixel centres lie where points at this offset from them lay before."""
    shift = np.eye(4)
    shift[0, 3], shift[1, 3] = -2.0 * offset[0] / camera.width, 2.0 * offset[1] / camera.height
    return shift @ to_clip


def clip_matrix(camera: CameraRecord, bounds: np.ndarray) -> np.ndarray:
    """(4, 4) float64, from the scene's coordinates to clip space, for column vectors.

    Depth z / w runs from -1 on the near plane to 0 at infinity (perspective), where float32 is as fine as the depth
    itself, or to 1 behind the last of `bounds` (orthographic). The far plane is left to whoever reads the hits: what is
    behind it hides nothing.
    """
    rotation = np.array(camera.rotation, np.float64).reshape(3, 3)
    position = np.array(camera.position, np.float64)
    view = np.eye(4)
    view[:3, :3], view[:3, 3] = rotation.T, -rotation.T @ position
    left, bottom, right, top = np.array(camera.window, np.float64)
    x, y = (right + left) / (right - left), (top + bottom) / (top - bottom)
    projection = np.zeros((4, 4))
    projection[0, 0], projection[1, 1] = 2 / (right - left), 2 / (top - bottom)
    if camera.orthographic:
        corners = np.stack(np.meshgrid(*np.asarray(bounds, np.float64).T, indexing="ij"), -1).reshape(-1, 3)
        farthest = (-(corners @ view[2, :3]) - view[2, 3]).max()
        depth = max(1.01 * (farthest - camera.near), 1e-6 * abs(camera.near), 1e-30)
        projection[0, 3], projection[1, 3] = -x, -y
        projection[2, 2:] = -2 / depth, -2 * camera.near / depth - 1
        projection[3, 3] = 1
    else:
        projection[0, 2], projection[1, 2] = x, y
        projection[2, 3] = -camera.near
        projection[3, 2] = -1
    return projection @ view


def _boxes_for_rays(scene: DeviceScene, geometries: Sequence[GeometryRecord]) -> np.ndarray:
    """(G, 2, 3) object boxes of the geometries that only rays find, empty ones of the others."""
    boxes = np.zeros((len(geometries), 2, 3))
    sdfs = scene.sdfs.numpy()
    for box, geometry in zip(boxes, geometries, strict=True):
        if SHAPES[geometry.kind] is Sphere:
            box[:] = [[-geometry.radius], [geometry.radius]]
        elif SHAPES[geometry.kind] is Sdf:
            box[:] = sdfs["lower"][geometry.sdf], sdfs["upper"][geometry.sdf]
    return boxes


def pixel_boxes(camera: CameraRecord, to_clip: np.ndarray, placed: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(S, 4) int left, top, right, bottom of the pixels that may see what lies in each box.

    Args:
        camera: the camera.
        to_clip: (4, 4) of `clip_matrix`.
        placed: (S, 4, 4) object-to-scene matrices for column vectors.
        corners: (S, 2, 3) lower and upper corners in object space; inf has no end.
    """
    size = np.array([camera.width, camera.height])
    sides = np.stack(np.meshgrid(*[(0, 1)] * 3, indexing="ij"), -1).reshape(-1, 3)
    eight = np.stack([corners[:, sides[:, axis], axis] for axis in range(3)] + [np.ones((len(corners), 8))], -1)
    with np.errstate(all="ignore"):
        clip = np.einsum("sij,skj->ski", to_clip @ placed, eight)
        before_eye = (clip[..., 3] > 0).all(1) & np.isfinite(corners).all((1, 2))
        pixels = (clip[..., :2] / clip[..., 3:] * (0.5, -0.5) + 0.5) * size
    margin = 1 + FARTHEST_OFFSET
    low = np.where(before_eye[:, None], np.floor(pixels.min(1) - margin), 0)
    high = np.where(before_eye[:, None], np.ceil(pixels.max(1) + margin), size)
    return np.concatenate([np.clip(low, 0, size), np.clip(high, 0, size)], 1).astype(int)


def _triangles(geometry: GeometryRecord, device: str) -> Triangles:
    """The geometry's triangles; none of a sphere's."""
    triangles = Triangles()
    triangles.points = geometry.points if geometry.points is not None else wp.empty(0, wp.vec3, device=device)
    triangles.indices = geometry.indices if geometry.indices is not None else wp.empty(0, wp.int32, device=device)
    return triangles


@cache
def _ray_kernel(effects: tuple[str, ...], sdfs: tuple[wp.Function, ...]) -> wp.Kernel:
    camera_ray = camera_ray_function(effects)
    closest, _, _ = ray_functions(sdfs)

    @wp.kernel(module="unique", enable_backward=False)
    def ray_hits(
        first: wp.int32, columns: wp.int32, scene: DeviceScene, camera: CameraRecord, hits: wp.array2d(dtype=Hit)
    ):
        begin = (first + wp.tid()) * columns
        y = begin // camera.width
        for x in range(begin - y * camera.width, begin - y * camera.width + columns):
            ray = camera_ray(camera, wp.float32(x) + 0.5, wp.float32(y) + 0.5, wp.vec2(0.5, 0.5))
            hits[y, x] = closest(scene, ray)

    return ray_hits


@wp.func
def draw_of(first_face: wp.array(dtype=wp.int32), face: wp.int32) -> wp.int32:
    """The last draw whose first face is not behind `face`."""
    low = wp.int32(0)
    high = first_face.shape[0] - 1
    while low < high:
        middle = (low + high + 1) // 2
        if first_face[middle] <= face:
            low = middle
        else:
            high = middle - 1
    return low


@cache
def _raster_kernel(effects: tuple[str, ...], by_rays: bool, sdfs: tuple[wp.Function, ...]) -> wp.Kernel:
    """`by_rays`: whether there are pixels that rays look into."""
    camera_ray = camera_ray_function(effects)
    closest, _, _ = ray_functions(sdfs)

    @wp.kernel(module="unique", enable_backward=False)
    def raster_hits(
        first: wp.int32,
        columns: wp.int32,
        scene: DeviceScene,
        camera: CameraRecord,
        first_face: wp.array(dtype=wp.int32),
        face: wp.array2d(dtype=wp.int32),
        u: wp.array2d(dtype=wp.float32),
        v: wp.array2d(dtype=wp.float32),
        by_ray: wp.array2d(dtype=wp.uint8),
        offset: wp.vec2,
        hits: wp.array2d(dtype=Hit),
    ):
        begin = (first + wp.tid()) * columns
        y = begin // camera.width
        for x in range(begin - y * camera.width, begin - y * camera.width + columns):
            hit = miss()
            px = wp.float32(x) + 0.5 + offset[0]
            py = wp.float32(y) + 0.5 + offset[1]
            if wp.static(by_rays):
                if by_ray[y, x] != wp.uint8(0):
                    hit = closest(scene, camera_ray(camera, px, py, wp.vec2(0.5, 0.5)))
            if face[y, x] >= 0 and by_ray[y, x] == wp.uint8(0):
                ray = camera_ray(camera, px, py, wp.vec2(0.5, 0.5))
                instance = draw_of(first_face, face[y, x])
                triangle = face[y, x] - first_face[instance]
                geometry = scene.instances[instance].geometry
                i = scene.geometries[geometry].indices[3 * triangle]
                j = scene.geometries[geometry].indices[3 * triangle + 1]
                k = scene.geometries[geometry].indices[3 * triangle + 2]
                p0 = scene.geometries[geometry].points[i]
                p1 = scene.geometries[geometry].points[j]
                p2 = scene.geometries[geometry].points[k]
                p = p0 + (p1 - p0) * u[y, x] + (p2 - p0) * v[y, x]
                p = scene.instances[instance].linear * p + scene.instances[instance].translation
                t = wp.max(wp.dot(p - ray.origin, ray.direction), 0.0)
                if t < ray.t_max:
                    hit.t = t
                    hit.instance = instance
                    hit.face = triangle
                    hit.u = u[y, x]
                    hit.v = v[y, x]
            hits[y, x] = hit

    return raster_hits
