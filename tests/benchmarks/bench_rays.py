"""Rays a second: warprender, wp.mesh_query_ray and Embree's robust mode, interleaved, on the same rays.

    python tests/benchmarks/bench_rays.py [--meshes 100k,1m] [--threads 1,2] [--rounds 5]

Meshes and rays are those of a closed "cave": a bumpy ball inside a bumpy shell, rays from the gap between, so
that a miss is a leak. Primary rays are a pinhole camera's in scanline order; bounce rays start at random
surface points with cosine-distributed directions; "any" asks only whether anything lies within distance 1.

One-thread figures are CPU time, so that other work on the machine disturbs them less; with more threads it is
wall time. Embree is measured through the embreex wheel (one ray per call of rtcIntersect1, one thread) where
it can be imported; EMBREEX names a folder of site-packages to find it in.
"""

import argparse
import os
import sys
import time

import numpy as np
import warp as wp
from bumpy_balls import bumpy

from warprender.visibility.rays import RayCaster

SIZES = {"1k": 6, "100k": 65, "1m": 204}  # quads along a cube's edge: 864, 101,400 and 998,784 triangles


def cave(n):
    """Points and faces of the closed gap."""
    inner, faces = bumpy(n, 1.0, 0.25, 1)
    outer, _ = bumpy(n, 4.0, 0.15, 2)
    points = np.concatenate([inner, outer]).astype(np.float32)
    return points, np.concatenate([faces, faces[:, ::-1] + len(inner)]).astype(np.int32)


def primary_rays(side=1000):
    """A pinhole camera in the gap, scanline order."""
    x, y = np.meshgrid((np.arange(side) + 0.5) / side - 0.5, 0.5 - (np.arange(side) + 0.5) / side)
    d = np.stack([1.5 * x, np.ones_like(x), 1.5 * y], -1).reshape(-1, 3)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return np.tile(np.float32([0, -2.2, 0.4]), (len(d), 1)), d.astype(np.float32)


def bounce_rays(points, faces, count=1_000_000):
    """Cosine-distributed rays from area-weighted points, 1e-4 off the surface."""
    rng = np.random.default_rng(3)
    p = points[faces].astype(np.float64)
    g = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    area = np.linalg.norm(g, axis=1)
    pick = rng.choice(len(faces), count, p=area / area.sum())
    n = g[pick] / area[pick][:, None]
    a, b = np.sqrt(rng.random((count, 1))), rng.random((count, 1))
    p = p[pick]
    o = (1 - a) * p[:, 0] + a * (1 - b) * p[:, 1] + a * b * p[:, 2] + 1e-4 * n
    z = rng.normal(size=(count, 3))
    d = n + 0.999 * z / np.linalg.norm(z, axis=1, keepdims=True)
    return o.astype(np.float32), (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)


def embree_scene(points, faces):
    """An embreex scene in robust mode, or None where embreex cannot be imported."""
    sys.path.append(os.environ.get("EMBREEX", ""))
    try:
        from embreex import rtcore_scene
        from embreex.mesh_construction import TriangleMesh
    except ImportError:
        return None
    scene = rtcore_scene.EmbreeScene(robust=True)
    TriangleMesh(scene, points, faces)
    scene.run(points[:1].copy(), points[:1].copy())
    return scene


def seconds(call, clock):
    """Duration of one call."""
    start = clock()
    call()
    return clock() - start


def best(calls, rounds, clock):
    """Shortest duration of each call, the calls taking turns."""
    times = [[seconds(call, clock) for call in calls] for _ in range(rounds)]
    return np.min(times, axis=0)


def bench_mesh(name, threads, rounds):
    """Print one mesh's rows."""
    points, faces = cave(SIZES[name])
    p, f = (
        wp.array(points, dtype=wp.vec3, device="cpu"),
        wp.array(faces.ravel(), dtype=wp.int32, device="cpu"),
    )
    clock = time.process_time if threads == 1 else time.perf_counter
    ours = RayCaster(p, f, threads=threads)
    fast = RayCaster(p, f, accuracy="fast", threads=threads)
    mesh = wp.Mesh(p, f)
    embree = embree_scene(points, faces) if threads == 1 else None
    build = best([lambda: RayCaster(p, f, threads=threads), lambda: wp.Mesh(p, f)], rounds, clock) * 1e3
    refit = best([ours.refit, mesh.refit], rounds, clock) * 1e3
    print(
        f"{name} {len(faces)} triangles, {threads} threads: build ms {build[0]:.1f}, Warp {build[1]:.1f};",
        end=" ",
    )
    print(f"refit ms {refit[0]:.2f}, Warp {refit[1]:.2f}; together {build[0] + refit[0]:.1f}", end=" ")
    print(f"= {(build[0] + refit[0]) / (build[1] + refit[1]):.2f} x Warp")
    kinds = {"primary": primary_rays(), "bounce": bounce_rays(points, faces)}
    for kind, rays in kinds.items():
        o, d = (wp.array(r, dtype=wp.vec3, device="cpu") for r in rays)
        leaks = [int((c.closest(o, d).face.numpy() < 0).sum()) for c in (ours, fast)]
        for query in ("closest", "any"):
            if query == "closest":
                calls = [lambda c=c, o=o, d=d: c.closest(o, d) for c in (ours, fast)]
            else:
                calls = [lambda c=c, o=o, d=d: c.occluded(o, d, t_max=1.0) for c in (ours, fast)]
            if embree and query == "closest":
                calls.append(lambda rays=rays: embree.run(*rays, query="INTERSECT"))
            rate = len(rays[0]) / best(calls, rounds, clock) * 1e-6
            row = f"  {kind:8} {query:8} ours {rate[0]:6.2f}"
            row += f"  mesh_query_ray {rate[1]:6.2f} ({rate[0] / rate[1]:.1f} x)"
            if len(rate) > 2:
                row += f"  Embree robust {rate[2]:6.2f} ({rate[0] / rate[2]:.2f} x)"
            print(row + (f"  misses {leaks[0]}, {leaks[1]}" if query == "closest" else ""), flush=True)


def main():
    """Run all meshes with all thread counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--meshes", default="100k,1m")
    parser.add_argument("--threads", default="1,2")
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    print("Mrays/s, best of", options.rounds)
    for name in options.meshes.split(","):
        for threads in map(int, options.threads.split(",")):
            bench_mesh(name, threads, options.rounds)


if __name__ == "__main__":
    main()
