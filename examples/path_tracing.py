"""Path tracing as films use it: rough and clear glass, rough metal that keeps its light, a wide lens, an open shutter.

python examples/path_tracing.py --out path_tracing.png
"""

import argparse
from pathlib import Path

import numpy as np

import warprender as wr

STAGE = Path(__file__).parent.parent / "scenes_usd" / "path_tracing.usda"


def white_furnace() -> wr.Scene:
    """The stage's metal ball alone, its metal white, under a sky of radiance 1: what keeps its light cannot be seen."""
    scene = wr.load(STAGE)
    for path in list(scene.placements):
        if path != "/World/gold":
            del scene.placements[path]
    del scene.lights["/World/lamp"]
    scene.lights["/World/sky"].color, scene.lights["/World/sky"].intensity = (1, 1, 1), 1.0
    scene.materials["/World/looks/gold"].diffuseColor = (1, 1, 1)
    return scene


def main() -> None:
    parser = argparse.ArgumentParser(description="Glass, metal and a lens, by path tracing.")
    parser.add_argument("--out", default="path_tracing.png", help="image file (default: path_tracing.png)")
    parser.add_argument("--samples", type=int, default=128, help="samples for each pixel (default: 128)")
    parser.add_argument("--width", type=int, default=480, help="pixels (default: 480)")
    args = parser.parse_args()

    options = {"dome_light_visible": True, "energy_compensation": True}
    frame = wr.render(wr.load(STAGE), (args.width, args.width * 3 // 4), args.samples, **options)
    frame.save(args.out)
    print(f"{args.out}: {frame!r}, relative error {frame.stats['error']:.3f}, rays {frame.stats['rays']}")

    # The furnace, with and without the light between the facets: 4.5 standard errors of the mean over the ball.
    outputs, size, mean = ("color", "primId", "standardError"), (64, 48), {}
    for kept in (True, False):
        options["energy_compensation"] = kept
        furnace = wr.render(white_furnace(), size, 64, outputs=outputs, sampler="independent", **options)
        ball = furnace.numpy("primId") == 0
        light, error = (furnace.numpy(name)[ball][:, 1].astype(np.float64) for name in ("color", "standardError"))
        mean[kept], spread = light.mean(), np.sqrt((error**2).sum()) / len(error)
        print(f"white metal in a white furnace, compensation {kept}: {mean[kept]:.4f} ± {spread:.4f}")
        assert not kept or abs(mean[kept] - 1) < 4.5 * spread + 1e-3
    assert mean[False] < 0.75


if __name__ == "__main__":
    main()
