"""Three bars that overlap in a cycle: no order of drawing shows them right, a depth buffer does.

The picture has the painter's algorithm on the left and the depth buffer on the right.

python examples/painters_algorithm.py --out bars.png
"""

import argparse

import numpy as np

import warprender as wr
from warprender import images

COLORS = {"/red": (0.8, 0.1, 0.1), "/green": (0.1, 0.6, 0.2), "/blue": (0.1, 0.2, 0.8)}


def build() -> wr.Scene:
    """Each bar starts before the next one and ends behind the one before it, seen from +Z."""
    scene = wr.Scene()
    for turn, (path, color) in enumerate(COLORS.items()):
        bar = np.array([[-1.4, -0.8, 0.5], [1.4, -0.8, -0.5], [1.4, -0.4, -0.5], [-1.4, -0.4, 0.5]])
        angle = 2 * np.pi / 3 * turn
        about_z = [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
        scene.add_mesh(path, (bar @ np.transpose(about_z)).astype(np.float32), [[0, 1, 2, 3]], color=color)
    camera = wr.Camera(projection="orthographic", horizontalAperture=36, verticalAperture=36)
    scene.add_camera("/camera", camera, pose=(0, 0, 5, 0, 0, 0, 1))
    return scene


def nearest_bar(width: int) -> np.ndarray:
    """Which bar is nearest at each pixel centre, by its plane; -1 where there is none."""
    centre = ((np.arange(width) + 0.5) / width - 0.5) * 3.6
    x, y = np.meshgrid(centre, -centre)
    nearest, height = np.full((width, width), -1), np.full((width, width), -np.inf)
    for turn in range(len(COLORS)):
        angle = 2 * np.pi / 3 * turn
        along, across = np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x
        z = -along * 0.5 / 1.4
        here = (np.abs(along) < 1.4) & (np.abs(across + 0.6) < 0.2) & (z > height)
        nearest[here], height[here] = turn, z[here]
    return nearest


def main() -> None:
    parser = argparse.ArgumentParser(description="The painter's algorithm beside the depth buffer.")
    parser.add_argument("--out", default="bars.png", help="image file (default: bars.png)")
    parser.add_argument("--samples", type=int, default=1, help="not used: visibility has no noise")
    parser.add_argument("--width", type=int, default=256, help="pixels of each picture (default: 256)")
    args = parser.parse_args()

    scene, size = build(), (args.width, args.width)
    frames = {
        name: wr.Renderer(scene, "/camera", size, ("albedo", "primId"), visibility=name).render()
        for name in ("painter", "raster")
    }
    both = np.concatenate([frame.numpy("albedo") for frame in frames.values()], 1)
    images.write(args.out, {"color": np.concatenate([both, np.ones_like(both[..., :1])], 2)})

    right = nearest_bar(args.width)
    wrong = {name: int((frame.numpy("primId") != right).sum()) for name, frame in frames.items()}
    print(f"{args.out}: pixels that show the wrong bar: {wrong}")
    assert wrong["raster"] == 0
    # The first of three that lie on each other in a cycle is drawn over by one that is behind it.
    assert wrong["painter"] > 0.001 * right.size


if __name__ == "__main__":
    main()
