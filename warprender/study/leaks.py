"""What fast rays lose on a stage's own triangles, and what time they take beside watertight ones."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..plan import RAY_ACCURACIES
from ..scene import Scene
from ..shapes.mesh import Mesh
from ..upload_shapes import drawable_triangles
from ..visibility.rays import RayCaster

_RAYS = 50_000
_ROUNDS = 5
#: Share of a distance that rounding may set two answers apart.
_SAME = 1e-3


@dataclass(frozen=True)
class Leaks:
    """Rays of which watertight ones found a triangle, and fast ones none, or one behind it.

    Attributes:
        mesh: prim whose triangles were asked: the one with the most.
        triangles: of it.
        rays: aimed at each kind of place, and hitting it.
        vertices: rays at vertices that were lost.
        edges: rays at edges that were lost.
        faces: rays at the insides of triangles that were lost.
        time: of fast rays over that of watertight ones, for all of these; processor time, median of rounds in turn.
        watertight_speed: watertight rays a second, on the CPU of one thread.
    """

    mesh: str
    triangles: int
    rays: int
    vertices: int
    edges: int
    faces: int
    time: float
    watertight_speed: float

    def words(self) -> str:
        """One sentence for people."""
        return (
            f"On the {self.triangles} triangles of {self.mesh}, of {self.rays} rays each, fast ones lost "
            f"{self.vertices} aimed at vertices, {self.edges} at edges and {self.faces} at the insides of triangles "
            f"that watertight ones hit, and took {self.time:.2f} times as long."
        )


def measure_leaks(scene: Scene, device: str = "cpu", rays: int = _RAYS) -> Leaks | None:
    """Aim rays at the scene's largest mesh from around it; None where there is no mesh.

    Rays that watertight ones miss are not counted: they pass by the mesh's border.
    """
    drawn = {path: _drawn(p.shape) for path, p in scene.placements.items() if isinstance(p.shape, Mesh)}
    path = max(drawn, key=lambda p: len(drawn[p]), default=None)
    if path is None or not len(drawn[path]):
        return None
    points, triangles = np.asarray(scene.placements[path].shape.host_points(), np.float32), drawn[path]
    rng = np.random.default_rng(0)
    corners = points[triangles[rng.integers(len(triangles), size=rays)]].astype(np.float64)
    weights = np.stack([_weights(rng, rays, corners_used) for corners_used in (1, 2, 3)])
    targets = np.einsum("knc,ncd->knd", weights, corners).reshape(-1, 3)
    origins = (targets + _around(rng, corners, len(targets))).astype(np.float32)
    directions = (targets - origins).astype(np.float32)
    casters = [RayCaster(points, triangles, accuracy=a, device=device, threads=1) for a in RAY_ACCURACIES]
    watertight, fast = (caster.closest(origins, directions) for caster in casters)
    t, other = watertight.t.numpy(), fast.t.numpy()
    lost = ((watertight.face.numpy() >= 0) & ~(other <= t * (1 + _SAME))).reshape(3, -1).sum(1)
    seconds = np.array([[_seconds(caster, origins, directions) for caster in casters] for _ in range(_ROUNDS)])
    ratio = float(np.median(seconds[:, 1] / seconds[:, 0]))
    speed = len(targets) / float(np.median(seconds[:, 0]))
    return Leaks(path, len(triangles), rays, *(int(n) for n in lost), ratio, speed)


def _drawn(mesh: Mesh) -> np.ndarray:
    """(T, 3) the triangles that rays can meet."""
    return mesh.triangles[drawable_triangles(mesh)[1]]


def _weights(rng: np.random.Generator, rays: int, corners: int) -> np.ndarray:
    """(N, 3) barycentrics of points at one corner, on an edge of two, or inside, uniform."""
    drawn = np.zeros((rays, 3))
    drawn[:, :corners] = rng.dirichlet(np.ones(corners), rays)
    return rng.permuted(drawn, axis=1)


def _around(rng: np.random.Generator, corners: np.ndarray, count: int) -> np.ndarray:
    """(count, 3) offsets to origins half the mesh's size away, on any side."""
    low, high = corners.min((0, 1)), corners.max((0, 1))
    direction = rng.standard_normal((count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return 0.5 * np.linalg.norm(high - low) * direction


def _seconds(caster: RayCaster, origins: np.ndarray, directions: np.ndarray) -> float:
    clock = time.process_time if caster.device.is_cpu else time.perf_counter
    start = clock()
    caster.closest(origins, directions)
    wp.synchronize_device(caster.device)
    return clock() - start
