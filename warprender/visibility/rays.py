"""Rays against triangles: watertight, and as Warp has it.

``RayCaster`` is the batch interface. ``scene_closest`` and ``scene_occluded`` are the same walk for use
inside kernels, over a ``World`` of instances (see ``world_tree.WorldTree``).
"""

import warnings
from collections import namedtuple
from functools import cache

import numpy as np
import warp as wp

from ..launch import launch
from ..numerics import GAMMA_7, max_component
from ..records import DeviceScene, Hit, Ray, World
from . import native
from .native import HitBatch, RayBatch, WideTree
from .trees import MeshTree
from .world_tree import WorldTree

Hits = namedtuple("Hits", ("t", "face", "u", "v"))


@wp.func
def miss() -> Hit:
    """The hit of a ray that meets nothing."""
    hit = Hit()
    hit.t = wp.inf
    hit.instance = -1
    hit.face = -1
    return hit


@cache
def world_functions(accuracy: str = "watertight") -> tuple[wp.Function, wp.Function, wp.Function]:
    """`closest(world, ray)`, `closest_after(world, ray, after)` and `occluded(world, ray)`; see `scene_closest`.

    Args:
        accuracy: "watertight", or "fast": `wp.mesh_query_ray` for each mesh, which leaks. Its rays that go on behind
            a hit begin a little beyond it.
    """
    native_closest, native_occluded = native.scene_functions("#define WR_FAST\n" if accuracy == "fast" else "")

    @wp.func
    def closest_after(world: World, ray: Ray, after: Hit) -> Hit:
        bits = native_closest(world, ray.origin, ray.direction, ray.t_max, after.t, after.instance, after.face)
        hit = Hit()
        hit.t = wp.cast(bits[0], wp.float32)
        hit.instance = bits[1]
        hit.face = bits[2]
        hit.u = wp.cast(bits[3], wp.float32)
        hit.v = wp.cast(bits[4], wp.float32)
        return hit

    @wp.func
    def closest(world: World, ray: Ray) -> Hit:
        start = Hit()
        start.t = -1.0
        start.instance = -1
        start.face = -1
        return closest_after(world, ray, start)

    @wp.func
    def occluded(world: World, ray: Ray) -> bool:
        return native_occluded(world, ray.origin, ray.direction, ray.t_max)

    return closest, closest_after, occluded


#: For kernels. `scene_closest(world, ray)`: the hit with the smallest (t, instance, face), `0 <= t < ray.t_max`.
#: `scene_closest_after(world, ray, after)`: the first one strictly behind another in that order, for cut-outs.
#: `scene_occluded(world, ray)`: whether anything is hit. All watertight.
scene_closest, scene_closest_after, scene_occluded = world_functions()


@cache
def device_functions(accuracy: str = "watertight") -> tuple[wp.Function, wp.Function, wp.Function]:
    """`closest(scene, ray)`, `closest_after(scene, ray, hit)` and `occluded(scene, ray)` of a `DeviceScene`.

    A ray through an edge hits the triangles on both sides of it, at distances that rounding sets apart: for
    `closest_after`, hits of one instance that are nearer to each other than that are one crossing.
    """
    world_closest, world_closest_after, world_occluded = world_functions(accuracy)

    @wp.func
    def closest(scene: DeviceScene, ray: Ray) -> Hit:
        return world_closest(scene.world, ray)

    @wp.func
    def closest_after(scene: DeviceScene, ray: Ray, hit: Hit) -> Hit:
        crossing = (max_component(wp.abs(ray.origin)) + hit.t * wp.length(ray.direction)) * GAMMA_7
        following = world_closest_after(scene.world, ray, hit)
        while following.instance == hit.instance and (following.t - hit.t) * wp.length(ray.direction) <= crossing:
            following = world_closest_after(scene.world, ray, following)
        return following

    @wp.func
    def occluded(scene: DeviceScene, ray: Ray) -> bool:
        return world_occluded(scene.world, ray)

    return closest, closest_after, occluded


class RayCaster:
    """Closest and any hits of rays with one triangle mesh.

    ``accuracy="watertight"``: no ray slips between two triangles that share an edge or a vertex, at any
    scale or position (Woop, Benthin, Wald 2013; Ize 2013). Among equal t the smallest face id is reported,
    whatever the tree. On the CPU, rays that run nearly alike share one walk, and others take turns.

    ``accuracy="fast"`` is ``wp.mesh_query_ray`` as it comes. It leaks: of 5.4 million rays aimed at vertices
    of closed meshes 83,198 escape (1.5 %), of as many aimed at edges 29,542 (0.5 %), of random ones 1; and it
    may report the outer of two nested shells. On the CPU it is also the slower of the two.

    Args:
        points: (N, 3) float32 vertices; numpy, or a wp.array of wp.vec3, which is used in place.
        indices: (F, 3) or (3 F,) ints.
        accuracy: "watertight" or "fast".
        device: Warp device, default that of ``points`` or the current one.
        threads: CPU threads, default all cores.

    Attributes:
        dropped_faces: Faces left out because a vertex is repeated or not finite. Ids of the others stay.

    Raises:
        ValueError: Wrong shapes, an index out of range, an index count that is no multiple of 3.
    """

    def __init__(
        self,
        points: np.ndarray | wp.array,
        indices: np.ndarray | wp.array,
        accuracy: str = "watertight",
        device: str | wp.Device | None = None,
        threads: int | None = None,
    ) -> None:
        if accuracy not in ("watertight", "fast"):
            raise ValueError(f'accuracy must be "watertight" or "fast", not {accuracy!r}')
        if accuracy == "watertight" and not native.SUPPORTED:
            warnings.warn(
                f"Warp {wp.__version__} is not the version that watertight rays were checked with: "
                "using wp.mesh_query_ray, which leaks at edges and vertices",
                stacklevel=2,
            )
            accuracy = "fast"
        self.accuracy = accuracy
        self.device = points.device if isinstance(points, wp.array) and device is None else wp.get_device(device)
        self.threads = threads
        self._source = points
        self.points = _vectors(points, "points", self.device)
        self.indices = _face_indices(indices, len(self.points), self.device)
        self._build()

    @property
    def dropped_faces(self) -> int:
        """Faces left out because a vertex is repeated or not finite, as of the last build or refit."""
        return self._tree.dropped

    def closest(
        self,
        origins: np.ndarray | wp.array,
        directions: np.ndarray | wp.array,
        t_max: float | np.ndarray | wp.array = np.inf,
        after: Hits | None = None,
    ) -> Hits:
        """The first hit of each ray.

        Args:
            origins: (N, 3) float32, numpy or wp.array.
            directions: (N, 3) float32 of any length but zero. Rays with a zero or non-finite direction or
                origin miss, and so does one so short that t is beyond float32.
            t_max: Scalar or (N,): only ``0 <= t < t_max`` counts.
            after: Hits of an earlier call: report what follows each of them in the order of (t, face).
                Watertight only.

        Returns:
            Named tuple of wp.arrays (N,): ``t`` float32 in units of the direction's length, inf on a miss;
            ``face`` int32, -1 on a miss; ``u`` and ``v`` float32, the weights of the face's vertices 1 and 2.

        Raises:
            ValueError: Shapes that do not match, or ``after`` with ``accuracy="fast"``.
        """
        rays = self._rays(origins, directions, t_max, after)
        count = len(rays.origins)
        hits = Hits(*(wp.empty(count, dtype=d, device=self.device) for d in (float, wp.int32, float, float)))
        if after is not None and self.accuracy == "fast":
            raise ValueError('after needs accuracy="watertight"')
        self._launch(_CLOSEST, rays, hits)
        return hits

    def occluded(
        self,
        origins: np.ndarray | wp.array,
        directions: np.ndarray | wp.array,
        t_max: float | np.ndarray | wp.array = np.inf,
    ) -> wp.array:
        """Whether each ray hits anything.

        Args:
            origins: As for ``closest``.
            directions: As for ``closest``.
            t_max: As for ``closest``.

        Returns:
            wp.array (N,) of bool.

        Raises:
            ValueError: Shapes that do not match.
        """
        rays = self._rays(origins, directions, t_max)
        out = wp.empty(len(rays.origins), dtype=wp.bool, device=self.device)
        self._launch(_OCCLUDED, rays, out)
        return out

    def refit(self) -> None:
        """Follow points that were changed in place, by numpy or on the device; builds again when that pays."""
        fresh = _vectors(self._source, "points", self.device)
        if fresh.ptr != self.points.ptr:
            self.points.assign(fresh)
        self._tree.refit()
        self._place()

    def _build(self):
        wide = self.device.is_cpu and self.accuracy == "watertight"
        self._tree = MeshTree(self.points, self.indices, wide=wide, threads=self.threads)
        self._place()

    def _place(self):
        if self.accuracy == "watertight" and not self.device.is_cpu:
            self._world = WorldTree([self._tree], [0], np.eye(4)[None], self.device)

    def _rays(self, origins, directions, t_max, after=None):
        origins = _vectors(origins, "origins", self.device)
        directions = _vectors(directions, "directions", self.device)
        if len(origins) != len(directions):
            raise ValueError(f"{len(origins)} origins, but {len(directions)} directions")
        count, (t, face) = len(origins), (-1.0, -1) if after is None else (after.t, after.face)
        rays = RayBatch()
        rays.origins, rays.directions = origins, directions
        rays.t_max = _per_ray(t_max, "t_max", wp.float32, count, self.device)
        rays.t_after = _per_ray(t, "after.t", wp.float32, count, self.device)
        rays.face_after = _per_ray(face, "after.face", wp.int32, count, self.device)
        return rays

    def _launch(self, kernels, rays, outputs):
        count, record = len(rays.origins), self._tree.geometry()
        results = _hit_batch(outputs) if isinstance(outputs, Hits) else outputs
        if self.accuracy == "fast" and self._tree.mesh is not None:
            arguments = [self._tree.mesh.id, self._tree.scale, rays, results]
            launch(kernels.fast, count, arguments, self.device, self.threads)
        elif self.accuracy == "watertight" and not self.device.is_cpu:
            launch(kernels.cuda, count, [self._world.world, rays, results], self.device)
        elif self.accuracy == "watertight" and record.nodes != 0:
            tree = WideTree()
            tree.nodes, tree.blocks = record.nodes, record.blocks
            tree.cached, tree.scale = self._tree.cached, self._tree.scale
            items = -(-count // native.RAYS_PER_ITEM)
            launch(kernels.wide, items, [count, tree, rays, results], self.device, self.threads, smallest_chunk=4)
        else:
            _fill_misses(outputs)


def _hit_batch(hits):
    """The kernels' view of the arrays of `Hits`."""
    batch = HitBatch()
    batch.t, batch.face, batch.u, batch.v = hits
    return batch


# ---------------------------------------------------------------- arguments


def _vectors(values, name, device):
    """(N,) wp.vec3 on the device; a view of what is given wherever possible."""
    if isinstance(values, wp.array):
        if values.dtype == wp.vec3 and values.ndim == 1:
            return values.to(device).contiguous()
        if values.dtype == wp.float32 and values.ndim == 2 and values.shape[1] == 3:
            return values.to(device).contiguous().view(wp.vec3).flatten()
        raise ValueError(f"{name} must be (N, 3) float32 or (N,) wp.vec3, not {values.shape} {values.dtype.__name__}")
    values = np.ascontiguousarray(values, np.float32)
    if values.size == 0:
        return wp.empty(0, dtype=wp.vec3, device=device)
    if values.ndim != 2 or values.shape[1] != 3:
        raise ValueError(f"{name} must have shape (N, 3), not {values.shape}")
    return wp.array(values, dtype=wp.vec3, device=device, copy=False)


def _face_indices(indices, vertices, device):
    """(3 F,) wp.int32 on the device, all in range."""
    host = indices.numpy() if isinstance(indices, wp.array) else np.asarray(indices)
    if host.size == 0:
        return wp.empty(0, dtype=wp.int32, device=device)
    if not np.issubdtype(host.dtype, np.integer):
        raise ValueError(f"indices must be integers, not {host.dtype}")
    if host.size % 3 or (host.ndim > 1 and host.shape[-1] != 3):
        raise ValueError(f"indices must be (F, 3) or a multiple of 3 in a row, not {host.shape}")
    low, high = int(host.min()), int(host.max())
    if low < 0 or high >= vertices:
        raise ValueError(f"index {low if low < 0 else high} is out of range: there are {vertices} points")
    if isinstance(indices, wp.array) and indices.dtype == wp.int32:
        return indices.to(device).contiguous().flatten()
    return wp.array(np.ascontiguousarray(host, np.int32).reshape(-1), dtype=wp.int32, device=device)


def _per_ray(values, name, dtype, count, device):
    """(count,) or, for a scalar, (1,) of the given type."""
    if isinstance(values, wp.array):
        values = values.to(device).contiguous()
        if values.shape == (count,) and values.dtype == dtype:
            return values
        raise ValueError(f"{name} must be a scalar or ({count},) {dtype.__name__}, not {values.shape}")
    host = np.asarray(values, np.float32 if dtype == wp.float32 else np.int32)
    if host.ndim == 0:
        host = host.reshape(1)
    elif host.shape != (count,):
        raise ValueError(f"{name} must be a scalar or have shape ({count},), not {host.shape}")
    return wp.array(host, dtype=dtype, device=device)


def _fill_misses(outputs):
    if not isinstance(outputs, Hits):
        outputs.zero_()
        return
    outputs.t.fill_(np.inf)
    outputs.face.fill_(-1)
    outputs.u.zero_()
    outputs.v.zero_()


# ---------------------------------------------------------------- kernels


@wp.kernel(enable_backward=False, module="unique")
def _closest_wide(first: wp.int32, count: wp.int32, tree: WideTree, rays: RayBatch, hits: HitBatch):
    begin = (first + wp.tid()) * wp.static(native.RAYS_PER_ITEM)
    end = wp.min(begin + wp.static(native.RAYS_PER_ITEM), count)
    native.closest_batch(tree, rays, begin, end, hits)


@wp.kernel(enable_backward=False, module="unique")
def _occluded_wide(first: wp.int32, count: wp.int32, tree: WideTree, rays: RayBatch, occluded: wp.array(dtype=wp.bool)):
    begin = (first + wp.tid()) * wp.static(native.RAYS_PER_ITEM)
    end = wp.min(begin + wp.static(native.RAYS_PER_ITEM), count)
    native.occluded_batch(tree, rays, begin, end, occluded)


@wp.func
def _own(values: wp.array(dtype=wp.float32), i: wp.int32) -> wp.float32:
    if values.shape[0] == 1:
        return values[0]
    return values[i]


@wp.kernel(enable_backward=False, module="unique")
def _closest_cuda(first: wp.int32, world: World, rays: RayBatch, hits: HitBatch):
    i = first + wp.tid()
    after = Hit()
    after.t = _own(rays.t_after, i)
    after.face = rays.face_after[wp.min(i, rays.face_after.shape[0] - 1)]
    hit = scene_closest_after(world, Ray(rays.origins[i], rays.directions[i], _own(rays.t_max, i)), after)
    hits.t[i] = hit.t
    hits.face[i] = hit.face
    hits.u[i] = hit.u
    hits.v[i] = hit.v


@wp.kernel(enable_backward=False, module="unique")
def _occluded_cuda(first: wp.int32, world: World, rays: RayBatch, occluded: wp.array(dtype=wp.bool)):
    i = first + wp.tid()
    occluded[i] = scene_occluded(world, Ray(rays.origins[i], rays.directions[i], _own(rays.t_max, i)))


@wp.kernel(enable_backward=False, module="unique")
def _closest_fast(first: wp.int32, mesh: wp.uint64, scale: wp.float32, rays: RayBatch, hits: HitBatch):
    i = first + wp.tid()
    hits.t[i] = wp.inf
    hits.face[i] = -1
    hits.u[i] = 0.0
    hits.v[i] = 0.0
    query = wp.mesh_query_ray(mesh, rays.origins[i] * scale, rays.directions[i] * scale, _own(rays.t_max, i))
    if query.result:
        hits.t[i] = query.t
        hits.face[i] = query.face
        # Warp's u and v weigh vertices 0 and 1
        hits.u[i] = query.v
        hits.v[i] = 1.0 - query.u - query.v


@wp.kernel(enable_backward=False, module="unique")
def _occluded_fast(
    first: wp.int32, mesh: wp.uint64, scale: wp.float32, rays: RayBatch, occluded: wp.array(dtype=wp.bool)
):
    i = first + wp.tid()
    origin = rays.origins[i] * scale
    direction = rays.directions[i] * scale
    occluded[i] = wp.mesh_query_ray_anyhit(mesh, origin, direction, _own(rays.t_max, i))


_Kernels = namedtuple("_Kernels", ("wide", "cuda", "fast"))
_CLOSEST = _Kernels(_closest_wide, _closest_cuda, _closest_fast)
_OCCLUDED = _Kernels(_occluded_wide, _occluded_cuda, _occluded_fast)
