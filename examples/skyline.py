"""An endless city by sphere tracing (Hart 1996), beside the prims of a stage; its roofs rise and fall with time.

python examples/skyline.py --out skyline.png
"""

import argparse
from pathlib import Path

import numpy as np
import warp as wp

import warprender as wr

STAGE = Path(__file__).parent.parent / "scenes_usd" / "skyline.usda"
#: No building is higher, and none is wider: between two of them are 0.2 units of street at least.
HIGHEST = wp.constant(wp.float32(3.4))
WIDEST = wp.constant(wp.float32(0.4))


@wp.func
def scatter(i: int, j: int) -> float:
    """A number from 0 to 1 for each plot."""
    h = wp.uint32(i) * wp.uint32(1597334677) + wp.uint32(j) * wp.uint32(625341585)
    h = (h ^ (h >> wp.uint32(15))) * wp.uint32(625341585)
    h = (h ^ (h >> wp.uint32(13))) * wp.uint32(1103515245)
    return wp.float32((h ^ (h >> wp.uint32(16))) >> wp.uint32(8)) * (1.0 / 16777216.0)


@wp.func
def roof(i: int, j: int, time: float) -> float:
    """Height of the building on plot (i, j)."""
    chance = scatter(i, j)
    return 0.4 + 2.4 * chance * chance + 0.5 * (0.5 + 0.5 * wp.sin(time + 40.0 * chance))


@wp.func
def city(p: wp.vec3, parameters: wp.vec4) -> float:
    """Distance to the buildings and the ground; `parameters[0]` is the time.

    Only the building on this plot is measured. Every other is farther than the edge of the plot by half a street, and
    none is higher than HIGHEST: so no step is longer than the true distance.
    """
    i = wp.int32(wp.floor(p[0]))
    j = wp.int32(wp.floor(p[2]))
    x = wp.abs(p[0] - wp.float32(i) - 0.5)
    z = wp.abs(p[2] - wp.float32(j) - 0.5)
    half = WIDEST - 0.15 * scatter(j, i)
    over = wp.vec3(x - half, p[1] - roof(i, j, parameters[0]), z - half)
    outside = wp.length(wp.vec3(wp.max(over[0], 0.0), wp.max(over[1], 0.0), wp.max(over[2], 0.0)))
    building = outside + wp.min(wp.max(over[0], wp.max(over[1], over[2])), 0.0)
    others = 0.5 - wp.max(x, z) + 0.5 - WIDEST
    buildings = wp.max(wp.min(building, others), p[1] - HIGHEST)
    return wp.min(p[1], buildings)


@wp.kernel
def measure(plots: wp.array(dtype=wp.vec2i), time: float, heights: wp.array(dtype=wp.float32)):
    plot = plots[wp.tid()]
    heights[wp.tid()] = roof(plot[0], plot[1], time)


def city_at(time: float) -> wr.Scene:
    scene = wr.load(str(STAGE))
    everywhere = [(-np.inf, -0.1, -np.inf), (np.inf, 3.5, np.inf)]
    scene.add_sdf("/World/city", city, everywhere, material="/World/Looks/concrete", precision=1e-4, parameters=(time,))
    return scene


def main() -> None:
    parser = argparse.ArgumentParser(description="Render an endless city from a signed distance function.")
    parser.add_argument("--out", default="skyline.png", help="picture (default: skyline.png)")
    parser.add_argument("--samples", type=int, default=64, help="samples for each pixel (default: 64)")
    parser.add_argument("--width", type=int, default=640, help="pixels (default: 640)")
    parser.add_argument("--time", type=float, default=0.0, help="radians of the roofs' motion (default: 0)")
    args = parser.parse_args()

    size = args.width, args.width * 9 // 16
    scene = city_at(args.time)
    outputs = ("color", "position", "normal", "primId")
    frame = wr.render(scene, size, args.samples, camera="/World/camera", outputs=outputs, dome_light_visible=True)
    frame.save(args.out)
    print(f"{args.out}: {frame!r}")

    # Every roof that is seen has the height of its plot at this time.
    ids, place, normal = (frame.numpy(name) for name in ("primId", "position", "normal"))
    prim = list(scene.placements).index("/World/city")
    roofs = place[(ids == prim) & (normal[..., 1] > 0.99) & (place[..., 1] > 0.2)].astype(float)
    near = roofs[np.linalg.norm(roofs, axis=1) < 30]
    plots = wp.array(np.floor(near[:, [0, 2]]).astype(np.int32), dtype=wp.vec2i)
    heights = wp.empty(len(plots), dtype=wp.float32)
    wp.launch(measure, len(plots), [plots, args.time, heights])
    assert len(near) > 10
    assert np.abs(near[:, 1] - heights.numpy()).max() < 1e-3


if __name__ == "__main__":
    main()
