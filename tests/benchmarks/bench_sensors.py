"""Sensors against the cameras of Newton and MuJoCo Warp: milliseconds a frame, in one interleaved run.

    python tests/benchmarks/bench_sensors.py PEERS [--reps 20] [--processor]

PEERS is a folder with `warp_rays.py`, whose `terrain` is the scene. Needs newton and mujoco-warp; ours takes two
threads, theirs one by design. Ratios count: whatever else the machine does goes into all of them alike. On a busy
machine two threads wait for it longer than one: there --processor compares processor time, with one thread each.
"""

import argparse
import cProfile
import pstats
import sys
import time

import mujoco
import mujoco_warp as mjw
import newton
import numpy as np
import warp as wp
from newton.sensors import SensorCamera

import warprender as wr

FOV = 2 * np.arctan(0.75)
LIGHT = np.array([-0.3, -0.9, -0.2])


def sun():
    """Our light, which travels as theirs does."""
    return wr.DistantLight(intensity=np.pi, angle=0.0, normalize=True, direction=tuple(LIGHT))


def ours(scene, size, outputs, worlds=None, **options):
    sensor = wr.CameraSensor(scene, size, size, fov=float(np.degrees(FOV)), outputs=outputs, worlds=worlds, **options)
    return lambda poses: sensor.update(poses)


def theirs(model, size, views, shadows, worlds=None):
    state, camera = model.state(), SensorCamera(model)
    camera.create_default_light(enable_shadows=True, direction=wp.vec3(*LIGHT))
    rays = SensorCamera.compute_camera_rays_pinhole(size, size, camera_fov=FOV, device="cpu")
    config = SensorCamera.RenderConfig(enable_shadows=shadows, enable_backface_culling=False)
    worlds = wp.array(np.zeros(views) if worlds is None else worlds, dtype=int)
    color, depth = camera.allocate_image_color(views, size, size), camera.allocate_image_depth(views, size, size)

    def frame(poses):
        camera.update(
            state, poses, rays, render_config=config, world_indices=worlds, color_image=color, depth_image=depth
        )

    return frame


def batch(places, size, shadows):
    """MuJoCo Warp's batch renderer: worlds of spheres and boxes at `places` (W, B, 3), over a floor."""
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=[3, 3, 0.1], quat=[np.sqrt(0.5), -np.sqrt(0.5), 0, 0]
    )
    for body in range(places.shape[1]):
        kind = mujoco.mjtGeom.mjGEOM_SPHERE if body % 2 else mujoco.mjtGeom.mjGEOM_BOX
        spec.worldbody.add_body(mocap=True).add_geom(type=kind, size=[0.2, 0.2, 0.2])
    spec.worldbody.add_light(type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, dir=LIGHT, castshadow=True)
    camera = spec.worldbody.add_camera(pos=[0.0, 1.0, 2.4], quat=[0.9848, -0.1736, 0, 0], fovy=float(np.degrees(FOV)))
    camera.resolution = [size, size]
    host = spec.compile()
    state = mujoco.MjData(host)
    mujoco.mj_forward(host, state)
    model, data = mjw.put_model(host), mjw.put_data(host, state, nworld=len(places))
    everything = data.geom_xpos.numpy()
    everything[:, 1:] = places
    data.geom_xpos.assign(everything)
    context = mjw.create_render_context(
        host, len(places), (size, size), True, True, False, use_shadows=shadows, enable_backface_culling=False
    )

    def frame(poses):
        mjw.refit_bvh(model, data, context)
        mjw.render(model, data, context)

    frame(None)
    assert 0.2 < (context.depth_data.numpy() > 0).mean() <= 1.0
    return frame


def compare(title, poses, peers, ways, reps, clock):
    """Milliseconds of each, best and median of frames that take turns, and how many times ours go into each peer's."""
    candidates = {**peers, **ways}
    times = {name: [] for name in candidates}
    for frame in candidates.values():
        frame(poses)
        frame(poses)
    for _ in range(reps):
        for name, frame in candidates.items():
            start = clock()
            frame(poses)
            times[name].append(clock() - start)
    for name, values in times.items():
        line = f"{title:34} {name:14} {1e3 * np.min(values):8.2f} ms best {1e3 * np.median(values):8.2f} ms median"
        for peer in peers if name in ways else ():
            best, middle = np.min(times[peer]) / np.min(values), np.median(np.divide(times[peer], values))
            line += f"   {peer} / it: {best:.2f} best, {middle:.2f} median"
        print(line, flush=True)


def terrain_scene(points, faces):
    scene = wr.Scene()
    scene.add_mesh("/terrain", points, faces, color=(0.7, 0.7, 0.7))
    scene.add_light(sun())
    builder = newton.ModelBuilder(up_axis=newton.Axis.Y)
    builder.add_shape_mesh(body=-1, mesh=newton.Mesh(points, faces.reshape(-1), compute_inertia=False))
    return scene, builder.finalize(device="cpu")


def world_scene(count, bodies=6):
    """Worlds of spheres and boxes at one place, over a floor that all share; ours, Newton's, and where bodies are."""
    rng = np.random.default_rng(4)
    scene, main = wr.Scene(), newton.ModelBuilder(up_axis=newton.Axis.Y)
    scene.add_light(sun())
    corners = np.array([(-3, 0, 3), (3, 0, 3), (3, 0, -3), (-3, 0, -3)], np.float32)
    scene.add_mesh("/floor", corners, [[0, 1, 2, 3]])
    main.add_shape_mesh(body=-1, mesh=newton.Mesh(corners, np.array([0, 1, 2, 0, 2, 3]), compute_inertia=False))
    box = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32) * 0.2
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    scene.add_mesh("/box", box, quads)
    scene.placements["/box"].visible = False
    places = np.zeros((count, bodies, 3))
    for world in range(count):
        one = newton.ModelBuilder(up_axis=newton.Axis.Y)
        for body in range(bodies):
            place = (*rng.uniform(-0.8, 0.8, 1), rng.uniform(0.2, 0.9), *rng.uniform(-0.8, 0.8, 1), 0, 0, 0, 1)
            places[world, body] = place[:3]
            if body % 2:
                scene.add_sphere(f"/world{world}/body{body}", 0.2, pose=place)
                one.add_shape_sphere(body=-1, radius=0.2, xform=wp.transform(place[:3], wp.quat_identity()))
            else:
                path = f"/world{world}/body{body}"
                scene.add_instances(path, "/box", np.array([place]))
                one.add_shape_box(body=-1, hx=0.2, hy=0.2, hz=0.2, xform=wp.transform(place[:3], wp.quat_identity()))
        main.add_world(one)
    return scene, main.finalize(device="cpu"), places


def small_frames():
    """A picture of 32 × 32 pixels, and what of it is Python: all but the kernels."""
    scene = wr.Scene()
    scene.add_mesh("/box", np.eye(3, dtype=np.float32), [[0, 1, 2]])
    pose = wp.array([[0, 0, 3, 0, 0, 0, 1]], dtype=wp.transformf)
    for visibility in ("rays", "raster"):
        sensor = wr.CameraSensor(
            scene, 32, 32, fov=60, outputs=("color", "cameraDepth"), visibility=visibility, threads=1
        )
        sensor.update(pose)
        whole, kernel = [], []
        for _ in range(400):
            start = time.perf_counter()
            sensor.update(pose)
            whole.append(time.perf_counter() - start)
            start = time.perf_counter()
            sensor._batch.draw(sensor._batch._request.worlds)
            kernel.append(time.perf_counter() - start)
        whole, kernel = 1e3 * np.median(whole), 1e3 * np.median(kernel)
        print(f"32x32 by {visibility:7} {whole:.3f} ms, of which drawing {kernel:.3f} ms")
    profile = cProfile.Profile()
    profile.runcall(lambda: [sensor.update(pose) for _ in range(300)])
    pstats.Stats(profile).sort_stats("tottime").print_stats(12)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("peers")
    parser.add_argument("--reps", type=int, default=20)
    parser.add_argument("--processor", action="store_true", help="compare processor time, of one thread each")
    args = parser.parse_args()
    clock, threads = (time.process_time, 1) if args.processor else (time.perf_counter, 2)
    sys.path.insert(0, args.peers)
    from warp_rays import terrain

    wp.config.log_level = 30
    outputs = ("color", "cameraDepth")
    scene, model = terrain_scene(*terrain(100_000))
    pose = wp.array([[0.0, 0.6, 1.9, 0, 0, 0, 1]], dtype=wp.transformf)
    for transport, shadows in (("local", False), ("direct", True)):
        options = {"transport": transport, "threads": threads}
        ways = {way: ours(scene, 512, outputs, visibility=way, **options) for way in ("raster", "rays")}
        title = "512x512, colour, depth" + ", shadow" * shadows
        compare(title, pose, {"newton": theirs(model, 512, 1, shadows)}, ways, args.reps, clock)
    count = 64
    scene, model, places = world_scene(count)
    views = wp.array([[0.0, 1.0, 2.4, -0.1736, 0, 0, 0.9848]] * count, dtype=wp.transformf)
    worlds = [f"/world{i}" for i in range(count)]
    for transport, shadows in (("local", False), ("direct", True)):
        peers = {"newton": theirs(model, 64, count, shadows, np.arange(count)), "mujoco": batch(places, 64, shadows)}
        options = {"transport": transport, "threads": threads}
        ways = {way: ours(scene, 64, outputs, worlds, visibility=way, **options) for way in ("raster", "rays")}
        compare("64 views of 64x64" + ", shadow" * shadows, views, peers, ways, args.reps, clock)
    small_frames()


if __name__ == "__main__":
    main()
