"""What following a moving scene costs, and a small frame: milliseconds a step on the CPU, split by part.

    python tests/benchmarks/bench_moving.py [--frames 10000]

With `--frames` also a long run: memory and time at its beginning and end, and whether the first picture of a scene at
rest and the last are the same.
"""

import argparse
import resource
import sys
import time
from pathlib import Path

import numpy as np
import warp as wp

sys.path.insert(0, str(Path(__file__).parents[1]))
import scenes

import warprender as wr

CAMERA = scenes.camera((0.3, -2.0, 7.0))


def sheet(side):
    """Points (side², 3) of a square grid and its triangles."""
    x, y = np.meshgrid(np.linspace(-2, 2, side), np.linspace(-2, 2, side), indexing="ij")
    number = np.arange(side * side).reshape(side, side)
    a, b, c, d = (n.ravel() for n in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return np.stack([x, y, 0 * x], -1).reshape(-1, 3).astype(np.float32), faces


def milliseconds(function, count=50):
    """Median over calls, after one that is not counted."""
    function()
    times = []
    for _ in range(count):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return 1e3 * float(np.median(times))


def report(name, parts):
    print(f"{name:34}" + "".join(f"{part} {value:7.3f} ms   " for part, value in parts.items()))


def moving_mesh():
    """A mesh of 100,489 vertices, all written at each step."""
    points, faces = sheet(317)
    scene = wr.Scene()
    scene.add_mesh("/sheet", wp.array(points, dtype=wp.vec3), faces)
    renderer = wr.Renderer(scene, CAMERA, (32, 32), outputs="cameraDepth", visibility="rays")
    upload = renderer._live.upload
    assert scene.meshes["/sheet"].points is not None  # handed out: it may have been written
    report(
        f"mesh, {len(points)} vertices",
        {
            "refit": milliseconds(upload.parts[0].tree.refit),
            "bounds": milliseconds(lambda: upload.world.refit([0])),
            "update in all": milliseconds(renderer.update),
            "rebuild": milliseconds(upload.parts[0].tree.build, 5),
        },
    )


def moving_bodies(count=1000):
    """Rigid bodies, all posed at each step from an array on the device."""
    rng = np.random.default_rng(1)
    scene = wr.Scene()
    points, faces = scenes.icosphere(1)
    poses = np.concatenate([rng.uniform(-3, 3, (count, 3)), rng.normal(size=(count, 4))], 1).astype(np.float32)
    for i in range(count):
        scene.add_mesh(f"/body{i}", (points * 0.1).astype(np.float32), faces)
    renderer = wr.Renderer(scene, CAMERA, (32, 32), outputs="cameraDepth", visibility="rays")
    upload, ids = renderer._live.upload, scene.ids([f"/body{i}" for i in range(count)])
    device = wp.array(poses, dtype=wp.transformf)
    scene.set_poses(ids, device)
    renderer.update()

    def step():
        scene.set_poses(ids, device)
        renderer.update()

    world = upload.world
    report(
        f"{count} rigid bodies",
        {
            "upload": milliseconds(lambda: scene.set_poses(ids, device)),
            "bounds": milliseconds(world._place),
            "refit": milliseconds(lambda: world.refit()) - milliseconds(world._place),
            "update in all": milliseconds(step),
        },
    )


def small_frames():
    """Frames of 32 × 32 pixels: what a frame costs that has next to nothing to draw."""
    for outputs in ("cameraDepth", ("cameraDepth", "normal", "primId")):
        for visibility in ("rays", "raster"):
            scene = wr.Scene()
            points, faces = scenes.icosphere(2)
            scene.add_mesh("/ball", points.astype(np.float32), faces)
            renderer = wr.Renderer(scene, CAMERA, (32, 32), outputs=outputs, visibility=visibility, threads=1)
            whole = milliseconds(renderer.render, 500)
            kernels = milliseconds(lambda r=renderer: r._first_hits.find(1), 500)
            count = 1 if isinstance(outputs, str) else len(outputs)
            report(f"32×32, {count} outputs, {visibility}", {"frame": whole, "of it first hits": kernels})


def memory():
    """Bytes that the process holds now."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def long_run(frames):
    """A moving scene for many frames, at rest in the first and the last."""
    for visibility in ("rays", "raster"):
        scene = wr.Scene()
        points, faces = sheet(33)
        scene.add_mesh("/sheet", points, faces)
        scene.add_sphere("/ball", 0.5)
        renderer = wr.Renderer(scene, CAMERA, (32, 32), outputs=("cameraDepth", "normal"), visibility=visibility)
        ids, array = scene.ids("/ball"), scene.meshes["/sheet"].points
        first = renderer.render().numpy("normal").copy()
        rest, seen, spent = np.zeros((1, 7), np.float32), [], []
        rest[0, 6] = 1.0
        for step in range(frames):
            start = time.perf_counter()
            wave = points.copy()
            wave[:, 2] = 0.2 * np.sin(3 * points[:, 0] + 0.1 * step) * (step + 1 < frames)
            array.assign(wave)
            pose = rest + np.float32([[0, 0, np.sin(0.1 * step) * (step + 1 < frames), 0, 0, 0, 0]])
            scene.set_poses(ids, wp.array(pose, dtype=wp.transformf))
            renderer.update()
            frame = renderer.render()
            spent.append(time.perf_counter() - start)
            if step % max(1, frames // 10) == frames // 20:
                seen.append(memory())
        same = np.array_equal(first, frame.numpy("normal"))
        tenth = max(1, frames // 10)
        early, late = np.median(spent[tenth : 2 * tenth]), np.median(spent[-tenth:])
        print(
            f"{frames} frames by {visibility}: memory {seen[-1] / seen[1]:.4f} of what it was after a tenth, "
            f"time {late / early:.3f} ({1e3 * late:.2f} ms a frame), first and last alike: {same}"
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=0, help="frames of the long run")
    arguments = parser.parse_args()
    moving_mesh()
    moving_bodies()
    small_frames()
    if arguments.frames:
        long_run(arguments.frames)
