"""A simulation recorded to a time-sampled USD file, then path traced from it with motion blur.

While it runs, a depth camera looks at each step. Positions of the drum skin and transforms of the balls are written as
time samples; the file is read back at several times, and shows what the camera saw.

python examples/record_simulation.py --out recorded.png
"""

import argparse
from pathlib import Path

import numpy as np
import warp as wp
from pxr import Gf, Usd, UsdGeom, UsdLux

import warprender as wr
from warprender import images

N, STEPS, DT, WAVE, GRAVITY = 41, 36, 1.0 / 24.0, 1.2, 9.81  # points along an edge of the skin; a step is a frame
SUBSTEPS, RADIUS, BALLS = 16, 0.25, 3
FOV, EYE = 40.0, (0.0, 2.3, 4.3)
TILT = -0.44  # of the camera, in radians
TIMES = (4, 17, 30)


@wp.kernel
def swing(points: wp.array2d(dtype=wp.vec3), speeds: wp.array2d(dtype=float), dt: float, h: float):
    """The wave equation's accelerations; the rim is held."""
    i, j = wp.tid()
    if i > 0 and i < N - 1 and j > 0 and j < N - 1:
        around = points[i - 1, j][1] + points[i + 1, j][1] + points[i, j - 1][1] + points[i, j + 1][1]
        speeds[i, j] += dt * WAVE * WAVE * (around - 4.0 * points[i, j][1]) / (h * h)


@wp.kernel
def move(points: wp.array2d(dtype=wp.vec3), speeds: wp.array2d(dtype=float), dt: float):
    i, j = wp.tid()
    p = points[i, j]
    points[i, j] = wp.vec3(p[0], p[1] + dt * speeds[i, j], p[2])


@wp.kernel
def bounce(poses: wp.array(dtype=wp.transformf), speeds: wp.array(dtype=wp.vec3), dt: float):
    """Balls that fly, spin and jump off the height of the rim."""
    i = wp.tid()
    p = wp.transform_get_translation(poses[i])
    v = speeds[i] + wp.vec3(0.0, -GRAVITY * dt, 0.0)
    p += v * dt
    if p[1] < RADIUS and v[1] < 0.0:
        v = wp.vec3(v[0], -v[1], v[2])
    turn = wp.quat_from_axis_angle(wp.vec3(0.0, 0.0, 1.0), -v[0] / RADIUS * dt)
    speeds[i] = v
    poses[i] = wp.transform(p, wp.normalize(turn * wp.transform_get_rotation(poses[i])))


class Simulation:
    """The skin, the balls and the scene that shows them."""

    def __init__(self) -> None:
        x, z = np.meshgrid(np.linspace(-1.5, 1.5, N), np.linspace(-1.5, 1.5, N))
        y = 0.6 * np.exp(-10 * ((x - 0.4) ** 2 + (z - 0.3) ** 2)) - 0.1
        y[[0, -1]], y[:, [0, -1]] = -0.1, -0.1
        self.points = wp.array(np.stack([x, y, z], -1).reshape(-1, 3).astype(np.float32), dtype=wp.vec3)
        self.grid, self.rises = self.points.reshape((N, N)), wp.zeros((N, N), dtype=float)
        start = np.zeros((BALLS, 7), np.float32)
        start[:, 0], start[:, 1], start[:, 2], start[:, 6] = (-1.6, -1.2, -2.0), (1.0, 1.5, 0.6), (0.3, -0.6, -1.2), 1
        self.poses = wp.array(start, dtype=wp.transformf)
        self.speeds = wp.array(np.float32([(1.8, 0, 0), (2.6, 0, 0), (2.2, 0, 0)]), dtype=wp.vec3)
        n = np.arange(N * N).reshape(N, N)
        self.quads = np.stack([n[:-1, :-1], n[1:, :-1], n[1:, 1:], n[:-1, 1:]], -1).reshape(-1, 4)
        self.scene = wr.Scene()
        self.scene.add_mesh("/World/skin", self.points, self.quads)
        self.paths = [f"/World/ball{i}" for i in range(BALLS)]
        for path in self.paths:
            self.scene.add_sphere(path, RADIUS)
        self.balls = self.scene.ids(self.paths)
        self.scene.set_poses(self.balls, self.poses)

    def step(self) -> None:
        """A frame's time."""
        dt = DT / SUBSTEPS
        for _ in range(SUBSTEPS):
            wp.launch(swing, (N, N), [self.grid, self.rises, dt, 3.0 / (N - 1)])
            wp.launch(move, (N, N), [self.grid, self.rises, dt])
            wp.launch(bounce, BALLS, [self.poses, self.speeds, dt])
        self.scene.set_poses(self.balls, self.poses)


class Recorder:
    """Writes what moves as time samples, all else once."""

    def __init__(self, path: Path, simulation: Simulation) -> None:
        self.stage, self._simulation = Usd.Stage.CreateNew(str(path)), simulation
        self.stage.SetTimeCodesPerSecond(1 / DT)
        UsdGeom.SetStageUpAxis(self.stage, UsdGeom.Tokens.y)
        skin = UsdGeom.Mesh.Define(self.stage, "/World/skin")
        skin.CreateFaceVertexCountsAttr([4] * len(simulation.quads))
        skin.CreateFaceVertexIndicesAttr(simulation.quads.reshape(-1))
        skin.CreateSubdivisionSchemeAttr("none")
        skin.CreateDisplayColorAttr([(0.7, 0.55, 0.3)])
        self._points, self._ops = skin.CreatePointsAttr(), []
        for i, path in enumerate(simulation.paths):
            ball = UsdGeom.Sphere.Define(self.stage, path)
            ball.CreateRadiusAttr(RADIUS)
            ball.CreateDisplayColorAttr([[(0.7, 0.1, 0.1), (0.1, 0.4, 0.7), (0.2, 0.6, 0.2)][i]])
            double = UsdGeom.XformOp.PrecisionDouble
            self._ops.append((ball.AddTranslateOp(double), ball.AddOrientOp(double)))
        camera = UsdGeom.Camera.Define(self.stage, "/World/eye")
        camera.AddTranslateOp().Set(Gf.Vec3d(*EYE))
        camera.AddRotateXOp(UsdGeom.XformOp.PrecisionDouble).Set(float(np.degrees(TILT)))
        camera.CreateFocalLengthAttr(50.0)
        aperture = float(100 * np.tan(np.radians(FOV) / 2))
        camera.CreateVerticalApertureAttr(aperture)
        camera.CreateHorizontalApertureAttr(aperture)
        camera.CreateClippingRangeAttr((0.01, 100.0))
        camera.CreateShutterOpenAttr(-0.25)
        camera.CreateShutterCloseAttr(0.25)
        sun = UsdLux.DistantLight.Define(self.stage, "/World/sun")
        sun.CreateIntensityAttr(2.5)
        sun.CreateNormalizeAttr(True)
        sun.AddRotateXYZOp().Set((-20, 50, 0))
        UsdLux.DomeLight.Define(self.stage, "/World/sky").CreateIntensityAttr(0.35)

    def write(self, time: float) -> None:
        """The state as it is, as samples at a time code."""
        self._points.Set(self._simulation.points.numpy(), time)
        for (translate, orient), pose in zip(self._ops, self._simulation.poses.numpy().astype(float), strict=True):
            translate.Set(Gf.Vec3d(*pose[:3]), time)
            orient.Set(Gf.Quatd(pose[6], *pose[3:6]), time)

    def close(self) -> None:
        """Save the file."""
        self.stage.SetStartTimeCode(0)
        self.stage.SetEndTimeCode(STEPS - 1)
        self.stage.Save()


def main() -> None:
    parser = argparse.ArgumentParser(description="Record a simulation, then path trace it.")
    parser.add_argument("--out", default="recorded.png", help="three times side by side (default: recorded.png)")
    parser.add_argument("--samples", type=int, default=64, help="a pixel, 16 at least (default: 64)")
    parser.add_argument("--width", type=int, default=256, help="of a picture (default: 256)")
    args = parser.parse_args()

    file = Path(args.out).with_suffix(".usdc")
    file.unlink(missing_ok=True)
    simulation = Simulation()
    recorder = Recorder(file, simulation)
    size = args.width
    camera = wr.CameraSensor(simulation.scene, size, size, fov=FOV, outputs=("cameraDepth", "primId"))
    pose = wp.array([[*EYE, np.sin(TILT / 2), 0, 0, np.cos(TILT / 2)]], dtype=wp.transformf)
    live = []
    for time in range(STEPS):
        recorder.write(time)
        seen = camera.update(pose)
        paths = np.array([*seen.prims, ""])
        live.append((seen.numpy("cameraDepth")[0].copy(), paths[seen.numpy("primId")[0]]))
        simulation.step()
    recorder.close()

    pictures = []
    for time in TIMES:
        scene = wr.load(file, time=time)
        outputs = ("color", "cameraDepth", "primId")
        renderer = wr.Renderer(scene, "/World/eye", (size, size), outputs=outputs, transport="path")
        frame = renderer.render(samples=max(args.samples, 16))
        depth, prims = live[time]
        offline = np.array([*scene.prims, ""])[frame.numpy("primId")]
        there = (prims != "") & (offline != "")
        assert (prims != offline).sum() <= 2, "the same prims in the same pixels, but for an outline"
        apart = np.abs(frame.numpy("cameraDepth") - depth)[there & (prims == offline)]
        # The live camera was posed in float32, which counts most where a surface is seen edge-on.
        assert np.median(apart) < 1e-6 and apart.max() < 1e-4, "the file shows what the camera saw"
        assert renderer.plan.shutter is not None, "and blurs what moves"
        # Light from where nothing is has alpha 0: a blurred ball covers as much as it does on its way.
        alpha = frame.numpy("color")[..., 3]
        ways = [(live[t][1] != "").sum() for t in (time - 1, time, time + 1)]
        assert abs(alpha.sum() - ways[1]) < max(ways) - min(ways) + 0.03 * ways[1]
        pictures.append(frame.numpy("color"))
    images.write_png(args.out, np.concatenate(pictures, axis=1))
    print(f"{STEPS} steps in {file.stat().st_size // 1024} kB; depth apart by {apart.max():.1e} at most")


if __name__ == "__main__":
    main()
