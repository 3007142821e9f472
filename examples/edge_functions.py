"""The graphics pipeline written out: project, edge functions at every pixel centre, depth buffer; against wr.rasterize.

An edge from p to q has the function e(x, y) = (p × q) · (x, y, 1), p and q on the screen with a third coordinate of 1.
Of a triangle that turns clockwise (y up) a point lies inside where e < 0 for all three edges. `wr.rasterize` uses the
same functions before the division by w, e = det(P, Q, (x, y, 1)), and divides them by the triangle's determinant: what
comes out are the barycentrics, all positive inside, whichever way the triangle turns.

python examples/edge_functions.py --out triangles.png
"""

import argparse

import numpy as np

import warprender as wr
from warprender import images

COLORS = np.array([(0.8, 0.1, 0.1), (0.1, 0.6, 0.2), (0.1, 0.2, 0.8), (0.7, 0.6, 0.1)])


def triangles() -> np.ndarray:
    """(4, 3, 3) vertices in the world: three long ones that overlap in a cycle, and one that cuts through them."""
    bar = np.array([[-1.6, -0.9, 0.5], [1.6, -0.6, -0.5], [-1.6, -0.3, 0.5]])
    turns = [2 * np.pi / 3 * k for k in range(3)]
    about_z = [np.array([[np.cos(t), -np.sin(t), 0], [np.sin(t), np.cos(t), 0], [0, 0, 1]]) for t in turns]
    across = [(-1.2, 0.2, -0.9), (0.1, 1.3, 0.2), (1.3, -0.9, 0.9)]
    return np.array([bar @ turn.T for turn in about_z] + [across])


def model_view_projection(near: float = 1.0, far: float = 10.0) -> np.ndarray:
    """(4, 4) for column vectors: a camera at (0, 0, 4) that looks down -Z, 53° wide and high. w is the depth."""
    view = np.eye(4)
    view[2, 3] = -4.0
    depth = [0, 0, (near + far) / (near - far), 2 * near * far / (near - far)]
    projection = np.array([(2, 0, 0, 0), (0, 2, 0, 0), depth, (0, 0, -1, 0)], float)
    return projection @ view


def draw(clip: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Which triangle each pixel shows, -1 for none, and its depth: (width, width) each.

    Args:
        clip: (N, 3, 4) clip positions.
        width: of the picture, and its height, in pixels.
    """
    x, y = np.meshgrid(np.arange(width) + 0.5, width - 0.5 - np.arange(width))
    centres = np.stack([x, y, np.ones_like(x)], -1)
    seen, stored = np.full((width, width), -1), np.full((width, width), np.inf)
    for number, corners in enumerate(clip):
        screen = corners[:, :3] / corners[:, 3:]
        points = np.stack([*((screen[:, :2] + 1) / 2 * width).T, np.ones(3)], -1)
        # Clockwise corners, so that the inside is e < 0 as in the lecture.
        if np.linalg.det(points) > 0:
            points, screen = points[::-1], screen[::-1]
        edges = [np.cross(points[k], points[(k + 1) % 3]) for k in range(3)]
        e = np.stack([centres @ edge for edge in edges], -1)
        # z / w is linear on the screen: the value of each corner counts by the edge function across from it.
        depth = e @ screen[[2, 0, 1], 2] / np.linalg.det(points)
        nearer = (e < 0).all(-1) & (depth < stored)
        seen[nearer], stored[nearer] = number, depth[nearer]
    return seen, stored


def main() -> None:
    parser = argparse.ArgumentParser(description="Edge functions and a depth buffer, by hand and by wr.rasterize.")
    parser.add_argument("--out", default="triangles.png", help="image file (default: triangles.png)")
    parser.add_argument("--samples", type=int, default=1, help="not used: visibility has no noise")
    parser.add_argument("--width", type=int, default=256, help="pixels (default: 256)")
    args = parser.parse_args()

    # The lecture's example: the edge from (0, 0) to (0, 1), a point on its left and one on its right.
    n = np.cross((0, 0, 1), (0, 1, 1))
    assert tuple(n) == (-1, 0, 0) and n @ (-1, 0, 1) > 0 > n @ (0.3, 0.3, 1)

    corners = np.concatenate([triangles(), np.ones((4, 3, 1))], -1)
    clip = (corners @ model_view_projection().T).astype(np.float32)
    seen, depth = draw(clip.astype(np.float64), args.width)
    raster = wr.rasterize(clip.reshape(-1, 4), np.arange(12).reshape(4, 3), args.width, args.width)

    color = np.where((seen >= 0)[..., None], COLORS[seen], 0.0)
    images.write(args.out, {"color": np.concatenate([color, seen[..., None] >= 0], 2).astype(np.float32)})
    print(f"{args.out}: {(seen >= 0).sum()} of {seen.size} pixels covered, by hand and by wr.rasterize")
    assert (seen >= 0).mean() > 0.1 and len(np.unique(seen)) == 5
    np.testing.assert_array_equal(raster.face.numpy(), seen)
    there = seen >= 0
    assert np.abs(raster.depth.numpy()[there] - depth[there]).max() < 1e-6


if __name__ == "__main__":
    main()
