"""A lidar that turns in a room with a pillar, one revolution in steps, as a picture of ranges and as points.

python examples/spinning_lidar.py --out scan.png
"""

import argparse

import numpy as np
import warp as wp

import warprender as wr
from warprender import images

ROOM, PILLAR = 6.0, 0.5


def build() -> wr.Scene:
    """A room of 6 by 6 by 6 about the origin, and a round pillar as a sphere that is drawn out."""
    scene = wr.Scene()
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32) * ROOM / 2
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    scene.add_mesh("/room", corners, faces)
    scene.add_sphere("/pillar", PILLAR, pose=(0, 0, -2, 0, 0, 0, 1))
    return scene


def main() -> None:
    parser = argparse.ArgumentParser(description="Scan a room with a lidar that turns.")
    parser.add_argument("--out", default="scan.png", help="picture of the ranges (default: scan.png)")
    parser.add_argument("--samples", type=int, default=8, help="steps of a revolution (default: 8)")
    parser.add_argument("--width", type=int, default=360, help="rays of a revolution (default: 360)")
    args = parser.parse_args()

    scene, steps = build(), args.samples
    sector = 360.0 / steps
    columns = max(1, args.width // steps)
    # The sector's rays are the same at each step: the sensor turns.
    azimuths = (np.arange(columns) + 0.5) / columns * sector - sector / 2
    lidar = wr.LidarSensor(scene, azimuths, elevations=np.linspace(30, -30, 32), range=(0.1, 20.0))
    turns = np.radians(sector) * np.arange(steps) / 2
    poses = np.zeros((steps, 7), np.float32)
    poses[:, 4], poses[:, 6] = np.sin(turns), np.cos(turns)
    scan = lidar.update(wp.array(poses, dtype=wp.transformf))

    # One picture of the revolution, step beside step, azimuth growing to the right.
    distance, prims = (np.concatenate(list(scan.numpy(name)), axis=1) for name in ("distance", "primId"))
    images.write_png(args.out, np.repeat(1.0 / (1.0 + distance[..., None]), 3, -1))

    assert (distance > 0).all(), "in a closed room every ray returns"
    assert distance.max() <= np.sqrt(3) * ROOM / 2 + 1e-4
    assert scan.prims == ["/room", "/pillar"]
    on_pillar = prims == 1
    assert on_pillar.any() and abs(distance[on_pillar].min() - (2 - PILLAR)) < 0.05
    print(f"{distance.size} rays, {on_pillar.mean():.1%} of them on the pillar")


if __name__ == "__main__":
    main()
