"""Many worlds with image observations: balls that roll on plates, each seen by its own camera, to the bit the same.

python examples/environments.py --out observations.png
"""

import argparse

import numpy as np
import warp as wp

import warprender as wr
from warprender import images

WORLDS, STEPS, RADIUS = 16, 30, 0.2


@wp.kernel
def roll(poses: wp.array(dtype=wp.transformf), speeds: wp.array(dtype=wp.vec3), tilt: wp.array(dtype=wp.vec2)):
    """A ball on a plate that is tilted, which bounces off the rim."""
    i = wp.tid()
    place = wp.transform_get_translation(poses[i])
    speed = speeds[i] + wp.vec3(tilt[i][0], 0.0, tilt[i][1]) * 0.02
    for axis in range(2):
        k = 2 * axis
        if wp.abs(place[k] + speed[k]) > 0.8:
            speed[k] = -speed[k]
    speeds[i] = speed
    poses[i] = wp.transform(place + speed, wp.quat_identity())


class Balls:
    """Worlds at one place, told apart by number. An observation is (worlds, H, W) depth."""

    def __init__(self, seed: int, size: int) -> None:
        rng = np.random.default_rng(seed)
        self.scene = wr.Scene()
        corners = np.array([(-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)], np.float32)
        self.scene.add_mesh("/plate", corners, [[0, 1, 2, 3]])
        paths = [f"/world{i}/ball" for i in range(WORLDS)]
        for path in paths:
            self.scene.add_sphere(path, RADIUS)
        self.balls = self.scene.ids(paths)
        start = np.zeros((WORLDS, 7), np.float32)
        start[:, [0, 2]], start[:, 1], start[:, 6] = rng.uniform(-0.5, 0.5, (WORLDS, 2)), RADIUS, 1.0
        self.poses = wp.array(start, dtype=wp.transformf)
        self.speeds = wp.zeros(WORLDS, dtype=wp.vec3)
        worlds = [f"/world{i}" for i in range(WORLDS)]
        self.camera = wr.CameraSensor(self.scene, size, size, fov=60, outputs="cameraDepth", worlds=worlds)
        # From straight above.
        half = np.sqrt(0.5)
        self.eyes = wp.array([[0, 2.5, 0, -half, 0, 0, half]] * WORLDS, dtype=wp.transformf)

    def step(self, tilt: np.ndarray) -> wp.array:
        """Tilt the plates by (worlds, 2), and look."""
        wp.launch(roll, WORLDS, [self.poses, self.speeds, wp.array(tilt, dtype=wp.vec2)])
        self.scene.set_poses(self.balls, self.poses)
        return self.camera.update(self.eyes).cameraDepth


def run(size: int) -> list[np.ndarray]:
    """Observations of an episode whose actions depend on what is seen."""
    balls, tilt, seen = Balls(seed=7, size=size), np.zeros((WORLDS, 2), np.float32), []
    for _ in range(STEPS):
        depth = balls.step(tilt).numpy()
        near = (depth > 0) & (depth < 2.5 - RADIUS)
        # Tilt towards the middle: away from where the ball is seen.
        rows, columns = np.arange(size)[None, :, None] - size / 2, np.arange(size)[None, None, :] - size / 2
        mass = np.maximum(near.sum((1, 2)), 1)
        tilt = np.float32(np.stack([-(near * columns).sum((1, 2)) / mass, -(near * rows).sum((1, 2)) / mass], 1) / size)
        seen.append(depth.copy())
    return seen


def main() -> None:
    parser = argparse.ArgumentParser(description="Image observations of many worlds.")
    parser.add_argument("--out", default="observations.png", help="the last ones (default: observations.png)")
    parser.add_argument("--samples", type=int, default=2, help="episodes that must be alike (default: 2)")
    parser.add_argument("--width", type=int, default=64, help="pixels of an observation (default: 64)")
    args = parser.parse_args()

    first, *others = (run(args.width) for _ in range(max(args.samples, 2)))
    last = first[-1].reshape(4, 4, args.width, args.width).swapaxes(1, 2).reshape(4 * args.width, -1)
    images.write_png(args.out, np.repeat(last[..., None] / 2.5, 3, -1))

    for episode in others:
        assert all(np.array_equal(a, b) for a, b in zip(first, episode, strict=True)), "the same bits every time"
    highest = np.array([np.where(seen > 0, seen, np.inf).min((1, 2)) for seen in first])
    assert np.abs(highest - (2.5 - 2 * RADIUS)).max() < 0.05, "each camera sees one ball, its own"
    assert len(np.unique(first[0].reshape(WORLDS, -1), axis=0)) == WORLDS
    print(f"{STEPS} steps of {WORLDS} worlds, twice the same")


if __name__ == "__main__":
    main()
