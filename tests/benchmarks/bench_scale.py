"""Large stages: a million instances of a 1k-triangle mesh, and five million triangles in fifty meshes.

    python tests/benchmarks/bench_scale.py [--case instances|triangles] [--width 1280] [--samples 1]

Each case writes its stage to a temporary folder, then reads and renders it in a process of its own: CPU seconds (of
all threads) and seconds to read the stage, to build (upload, trees) and to render, and the largest memory that the
process had after each step. The kernels are compiled before by a small stage of the same kinds, which is not counted.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from bumpy_balls import bumpy

INSTANCES, MESHES = 1_000_000, 50
SIDES = {"instances": 10, "triangles": 92}


def define_mesh(stage, path, n, seed):
    """A bumpy ball of 12 n² triangles, without subdivision."""
    from pxr import UsdGeom

    points, triangles = bumpy(n, 0.4, 0.2, seed)
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(points.astype(np.float32))
    mesh.CreateFaceVertexIndicesAttr(triangles.reshape(-1).astype(np.int32))
    mesh.CreateFaceVertexCountsAttr(np.full(len(triangles), 3, np.int32))
    mesh.CreateSubdivisionSchemeAttr("none")
    return mesh


def write_stage(path, case, count):
    """A grid of `count` balls in the plane y = 0 under a sun: copies of one, or each a mesh of its own."""
    from pxr import Gf, Usd, UsdGeom, UsdLux

    stage = Usd.Stage.CreateNew(str(path))
    side = int(np.ceil(np.sqrt(count)))
    place = np.stack([np.arange(count) % side, np.zeros(count), np.arange(count) // side], 1) - [side / 2, 0, side / 2]
    if case == "instances":
        instancer = UsdGeom.PointInstancer.Define(stage, "/balls")
        define_mesh(stage, "/balls/ball", SIDES[case], 1)
        instancer.CreatePrototypesRel().AddTarget("/balls/ball")
        instancer.CreateProtoIndicesAttr(np.zeros(count, np.int32))
        instancer.CreatePositionsAttr(place.astype(np.float32))
    else:
        for i in range(count):
            mesh = define_mesh(stage, f"/ball{i}", SIDES[case], i)
            UsdGeom.XformCommonAPI(mesh).SetTranslate(Gf.Vec3d(*place[i].tolist()))
    sun = UsdLux.DistantLight.Define(stage, "/sun")
    UsdGeom.XformCommonAPI(sun).SetRotate(Gf.Vec3f(-50, 30, 0))
    camera = UsdGeom.Camera.Define(stage, "/main_cam")
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.01, 1e6))
    UsdGeom.XformCommonAPI(camera).SetTranslate(Gf.Vec3d(0, 0.25 * side, 0.6 * side))
    UsdGeom.XformCommonAPI(camera).SetRotate(Gf.Vec3f(-25, 0, 0))
    stage.Save()


def peak():
    """The largest resident memory of this process so far, in MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def step(name, work):
    """Do the work and print what it took; returns its result."""
    wall, cpu = time.perf_counter(), time.process_time()
    result = work()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    print(f"| {name} | {cpu:.2f} | {wall:.2f} | {peak():.0f} |", flush=True)
    return result


def measure(path, small, width, samples, picture):
    """Read, build and render one stage; prints seconds and MiB of each step."""
    import warp as wp

    import warprender as wr

    wp.config.log_level = wp.LOG_WARNING
    size = (width, width * 9 // 16)
    wr.render(wr.load(small), (8, 8), samples=1)
    print(f"| start | | | {peak():.0f} |")
    scene = step("read", lambda: wr.load(path))
    renderer = step("build", lambda: wr.Renderer(scene, resolution=size))
    frame = step(f"render, {size[0]}x{size[1]}, {samples} samples", lambda: renderer.render(samples=samples))
    if picture:
        frame.save(picture)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--case", choices=tuple(SIDES), action="append")
    parser.add_argument("--width", type=int, default=1280)
    parser.add_argument("--samples", type=int, default=1)
    parser.add_argument("--pictures", help="folder to save the pictures in")
    parser.add_argument("--measure", nargs=2, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.measure:
        picture = Path(args.pictures) / f"{args.case[0]}.png" if args.pictures else None
        measure(*args.measure, args.width, args.samples, picture)
        return
    for case in args.case or SIDES:
        with tempfile.TemporaryDirectory() as folder:
            stages = [f"{folder}/{name}.usdc" for name in ("large", "small")]
            counts = (INSTANCES, 4) if case == "instances" else (MESHES, 2)
            for stage, count in zip(stages, counts, strict=True):
                write_stage(stage, case, count)
            triangles = 12 * SIDES[case] ** 2
            print(f"\n{case}: {counts[0]:,} of {triangles:,} triangles\n")
            print("| step | CPU seconds | seconds | peak MiB |\n|---|---|---|---|", flush=True)
            command = [sys.executable, __file__, "--case", case, "--measure", *stages]
            command += ["--width", str(args.width), "--samples", str(args.samples)]
            subprocess.run(command + (["--pictures", args.pictures] if args.pictures else []), check=True)


if __name__ == "__main__":
    main()
