"""A cloth falls on a sphere: simulated by kernels of this file, its points drawn where they are written.

A depth camera looks from above at each step; a picture of the end is path traced.

python examples/falling_cloth.py --out cloth.png
"""

import argparse
import resource

import numpy as np
import warp as wp

import warprender as wr

N, SIZE, RADIUS, HEIGHT = 48, 2.4, 0.6, 0.9  # points along an edge, edge, sphere, where the cloth starts
STEPS, SUBSTEPS, DT, GRAVITY, GAP = 150, 12, 1.0 / 720.0, 9.81, 0.01
FREE = 13  # steps in which nothing is met yet
EYE = 4.0


@wp.kernel
def fall(points: wp.array(dtype=wp.vec3), speeds: wp.array(dtype=wp.vec3), before: wp.array(dtype=wp.vec3)):
    """A step of free fall, speed first."""
    i = wp.tid()
    before[i] = points[i]
    speeds[i] += wp.vec3(0.0, -GRAVITY * DT, 0.0)
    points[i] += speeds[i] * DT


@wp.kernel
def settle(points: wp.array(dtype=wp.vec3), speeds: wp.array(dtype=wp.vec3), before: wp.array(dtype=wp.vec3)):
    """Speeds are what became of the points, less a little drag."""
    i = wp.tid()
    speeds[i] = (points[i] - before[i]) * (0.998 / DT)


@wp.func
def pull(p: wp.vec3, q: wp.vec3, rest: float) -> wp.vec3:
    """How far p has to go, if q goes as far, for them to be `rest` apart."""
    d = q - p
    length = wp.length(d)
    return d * (0.5 * (length - rest) / length)


@wp.kernel
def hold(points: wp.array(dtype=wp.vec3), out: wp.array(dtype=wp.vec3), rest: float):
    """One Jacobi step towards the lengths of threads, diagonals and double threads; then out of sphere and floor."""
    i = wp.tid()
    row = i / N
    column = i % N
    p = points[i]
    total = wp.vec3()
    count = float(0.0)  # noqa: UP018 (a variable to Warp)
    for a in range(-2, 3):
        for b in range(-2, 3):
            near = (wp.abs(a) <= 1 and wp.abs(b) <= 1 and a * a + b * b > 0) or (a * b == 0 and wp.abs(a + b) == 2)
            r = row + a
            c = column + b
            if near and r >= 0 and r < N and c >= 0 and c < N:
                total += pull(p, points[r * N + c], rest * wp.sqrt(float(a * a + b * b)))
                count += 1.0
    p += total * (1.6 / count)
    distance = wp.length(p)
    if distance < RADIUS + GAP:
        p = p * ((RADIUS + GAP) / distance)
    if p[1] < -RADIUS + GAP:
        p = wp.vec3(p[0], -RADIUS + GAP, p[2])
    out[i] = p


def build() -> tuple[wr.Scene, wp.array]:
    """A sphere on a floor and a square of cloth above, with the array that the cloth's points are read from."""
    scene = wr.Scene()
    x, z = np.meshgrid(np.linspace(-SIZE / 2, SIZE / 2, N), np.linspace(-SIZE / 2, SIZE / 2, N))
    start = np.stack([x, np.full_like(x, HEIGHT), z], -1).reshape(-1, 3).astype(np.float32)
    points = wp.array(start, dtype=wp.vec3)
    n = np.arange(N * N).reshape(N, N)
    quads = np.stack([n[:-1, :-1], n[1:, :-1], n[1:, 1:], n[:-1, 1:]], -1).reshape(-1, 4)
    scene.add_sphere("/sphere", RADIUS, color=(0.2, 0.25, 0.3))
    scene.add_mesh("/cloth", points, quads, normals="smooth", color=(0.75, 0.16, 0.1))
    floor = np.array([(-20, 0, 20), (20, 0, 20), (20, 0, -20), (-20, 0, -20)], np.float32)
    scene.add_mesh("/floor", floor, [[0, 1, 2, 3]], pose=(0, -RADIUS, 0, 0, 0, 0, 1), color=(0.5, 0.5, 0.5))
    scene.add_light(wr.DistantLight(intensity=2.5, angle=3.0, normalize=True), "/sun", (0, 0, 0, -0.48, 0.3, 0.1, 0.82))
    scene.add_light(wr.DomeLight(intensity=0.35), "/sky")
    return scene, points


def sphere_depth(size: int, fov: float) -> np.ndarray:
    """Depth (H, W) of the bare sphere below the camera, inf beside it: a closed form."""
    scale = np.tan(np.radians(fov) / 2) / (size / 2)
    x, y = np.meshgrid(*[(np.arange(size) + 0.5 - size / 2) * scale] * 2)
    a, half = x**2 + y**2 + 1, EYE  # |o + t d|² = R², o straight above, d = (x, y, 1)
    root = half**2 - a * (EYE**2 - RADIUS**2)
    return np.where(root >= 0, (half - np.sqrt(np.maximum(root, 0))) / a, np.inf)


def main() -> None:
    parser = argparse.ArgumentParser(description="Drop a cloth on a sphere under a depth camera.")
    parser.add_argument("--out", default="cloth.png", help="picture of the end (default: cloth.png)")
    parser.add_argument("--samples", type=int, default=64, help="a pixel of the picture (default: 64)")
    parser.add_argument("--width", type=int, default=480, help="of the picture (default: 480)")
    args = parser.parse_args()

    scene, points = build()
    before, scratch, speeds = wp.clone(points), wp.empty_like(points), wp.zeros_like(points)
    camera = wr.CameraSensor(scene, 64, 64, fov=40, outputs=("cameraDepth", "primId"))
    half = np.sqrt(0.5)
    above = wp.array([[0, EYE, 0, -half, 0, 0, half]], dtype=wp.transformf)  # looks down
    bare, memory, places = sphere_depth(64, 40), [], set()
    for step in range(STEPS):
        for _ in range(SUBSTEPS):
            wp.launch(fall, N * N, [points, speeds, before])
            if step >= FREE:
                for source, target in ((points, scratch), (scratch, points)):
                    wp.launch(hold, N * N, [source, target, SIZE / (N - 1)])
                wp.launch(settle, N * N, [points, speeds, before])
        seen = camera.update(above)
        depth = seen.numpy("cameraDepth")[0]
        places.add((seen.cameraDepth.ptr, points.ptr))
        memory.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
        if step < FREE:
            # After n substeps it has fallen g dt² (1 + 2 + … + n).
            n = (step + 1) * SUBSTEPS
            expected = EYE - HEIGHT + GRAVITY * DT**2 * n * (n + 1) / 2
            assert np.abs(depth[16:48, 16:48] - expected).max() < 1e-4, "the cloth falls as Galilei says"
        # Each point is outside the sphere; a chord between two of them is a little nearer.
        thread = 1.5 * SIZE / (N - 1)
        assert (depth <= bare - GAP + thread**2 / RADIUS).all(), "nowhere is the sphere seen through the cloth"

    place = points.numpy()
    assert scene.meshes["/cloth"].points is points and len(places) == 1, "no array was made anew"
    assert memory[-1] - memory[STEPS // 2] < 2048, "memory stands still: less than 2 MB in 75 steps"
    assert np.linalg.norm(place, axis=1).min() > RADIUS + 0.99 * GAP and place[:, 1].min() > -RADIUS
    hanging = (np.abs(np.linalg.norm(place, axis=1) - RADIUS - GAP) < 0.005).mean()
    assert hanging > 0.1, "it came to lie on the sphere"

    # The same scene, seen from the side by path tracing.
    eye = wr.Camera(horizontalAperture=24, verticalAperture=16, focalLength=40, clippingRange=(0.1, 100.0))
    pose = (0.0, 1.35, 4.4, -0.17, 0.0, 0.0, 0.985)
    scene.add_camera("/eye", eye, pose)
    frame = wr.render(scene, samples=args.samples, camera="/eye", resolution=(args.width, args.width * 2 // 3))
    frame.save(args.out)
    print(
        f"{hanging:.0%} of the cloth lies on the sphere; {STEPS} refits, memory +{memory[-1] - memory[STEPS // 2]} kB"
    )


if __name__ == "__main__":
    main()
