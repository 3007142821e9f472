"""Write a data set: colour, depth, segmentation and boxes of a random pile, seen from around. It resumes where it was.

python examples/dataset.py --out dataset
"""

import argparse
import json
from pathlib import Path

import numpy as np
from rich.progress import track

import warprender as wr
from warprender import images
from warprender.sensors import Images

KINDS = ("ball", "egg")


def build(rng: np.random.Generator, count: int = 6) -> wr.Scene:
    """Balls and eggs of random colours on a floor; what each one is stands in its placement."""
    scene = wr.Scene()
    corners = np.array([(-4, 0, 4), (4, 0, 4), (4, 0, -4), (-4, 0, -4)], np.float32)
    scene.add_mesh("/floor", corners, [[0, 1, 2, 3]], color=(0.4, 0.4, 0.4))
    for i in range(count):
        kind = KINDS[i % 2]
        matrix = np.diag([0.3, 0.3 if kind == "ball" else 0.5, 0.3, 1.0])
        matrix[3, :3] = (*rng.uniform(-1.2, 1.2, 1), matrix[1, 1], *rng.uniform(-1.2, 1.2, 1))
        scene.add_sphere(f"/{kind}{i}", 1.0, pose=matrix, color=rng.uniform(0.1, 0.9, 3))
        scene.placements[f"/{kind}{i}"].semantic = kind
    scene.add_light(wr.DistantLight(intensity=3.0, angle=0.0, normalize=True, direction=(-0.4, -1.0, -0.3)))
    return scene


def around(angle: float, distance: float = 4.0) -> list[float]:
    """Pose of a camera that looks down at the middle by 30 degrees from an angle about Y."""
    turn, down = np.radians(angle) / 2, np.radians(-30.0) / 2
    (s, c), (sd, cd) = (np.sin(turn), np.cos(turn)), (np.sin(down), np.cos(down))
    flat = distance * np.cos(np.radians(30.0))
    place = flat * np.sin(np.radians(angle)), distance * 0.5 + 0.2, flat * np.cos(np.radians(angle))
    # About Y, after about X.
    return [*place, c * sd, s * cd, -s * sd, c * cd]


def boxes(prims: np.ndarray, labels: np.ndarray, seen: Images) -> list[dict]:
    """What is seen of each labelled prim: its path, label and box as left, top, right, bottom in pixels."""
    found = []
    for number in np.unique(prims[labels >= 0]):
        rows, columns = np.nonzero(prims == number)
        label = seen.labels[int(labels[rows[0], columns[0]])]
        box = [int(columns.min()), int(rows.min()), int(columns.max()) + 1, int(rows.max()) + 1]
        found.append({"prim": seen.prims[number], "label": label, "box": box})
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description="Write a data set of a random pile.")
    parser.add_argument("--out", default="dataset", help="folder (default: dataset)")
    parser.add_argument("--samples", type=int, default=24, help="pictures (default: 24)")
    parser.add_argument("--width", type=int, default=256, help="pixels (default: 256)")
    args = parser.parse_args()

    folder = Path(args.out)
    folder.mkdir(parents=True, exist_ok=True)
    scene = build(np.random.default_rng(1))
    outputs = ("color", "cameraDepth", "primId", "semantic")
    camera = wr.CameraSensor(scene, args.width, args.width, fov=45, outputs=outputs, transport="direct")
    for number in track(range(args.samples), "pictures"):
        # The list of boxes is written last: where it is, the picture is complete.
        done = folder / f"{number:05}.json"
        if done.exists():
            continue
        seen = camera.update([around(360.0 * number / args.samples)])
        color, depth, prims, labels = (seen.numpy(name)[0] for name in outputs)
        layers = {"color": color, "cameraDepth": depth, "primId": prims, "semantic": labels}
        images.write_exr(folder / f"{number:05}.exr", layers, {})
        done.write_text(json.dumps(boxes(prims, labels, seen), indent=1))

    for number in range(args.samples):
        objects = json.loads((folder / f"{number:05}.json").read_text())
        assert objects and all(thing["label"] in thing["prim"] for thing in objects)
        assert all(
            0 <= x0 < x1 <= args.width and 0 <= y0 < y1 <= args.width
            for x0, y0, x1, y1 in (thing["box"] for thing in objects)
        )
    print(f"{args.samples} pictures with boxes in {folder}")


if __name__ == "__main__":
    main()
