"""The rendering equation, unfolded: light scattered once, twice, three times and without end, side by side.

`bounces` counts what follows the first surface: with 0 there are emission and direct light, scattered once.

python examples/unfolded_recursion.py --out unfolded.png
"""

import argparse
from pathlib import Path

import numpy as np

import warprender as wr
from warprender import images

STAGES = Path(__file__).parent.parent / "scenes_usd"


def series(bounces: int | None) -> np.ndarray:
    """Radiance in the closed box: e (1 + ρ + … + ρⁿ) for n = bounces + 1 scatterings, or e / (1 - ρ) for None."""
    look = wr.load(STAGES / "closed_box.usda").materials["/World/looks/glowing"]
    e, rho = np.array(look.emissiveColor), np.array(look.diffuseColor)
    return e / (1 - rho) if bounces is None else e * (1 - rho ** (bounces + 2)) / (1 - rho)


def main() -> None:
    parser = argparse.ArgumentParser(description="The Cornell box with 0, 1, 2 and all bounces.")
    parser.add_argument("--out", default="unfolded.png", help="image file (default: unfolded.png)")
    parser.add_argument("--samples", type=int, default=64, help="for each pixel (default: 64)")
    parser.add_argument("--width", type=int, default=160, help="pixels of each picture (default: 160)")
    args = parser.parse_args()

    # 1. What is known. Mirrors make no noise: each pixel has the value of the series to float32's digits. Only where
    #    long paths are ended by chance (Russian roulette, from the fourth bounce on) there are standard errors.
    box = wr.load(STAGES / "closed_box.usda")
    for bounces in (0, 1, 2, None):
        color = wr.render(box, (16, 12), samples=64, bounces=bounces).numpy("color")[..., :3].reshape(-1, 3)
        mean, expected = color.mean(0, dtype=np.float64), series(bounces)
        print(f"closed box, bounces {bounces}: {mean.round(6)}, the series gives {expected.round(6)}")
        # What the plan leaves out where nobody sets bounces is below 1e-4 of what is emitted.
        noise = 4.5 * color.std(0) / np.sqrt(len(color)) + 1e-4 if bounces is None else 2e-6
        assert (np.abs(mean - expected) < noise).all() and (bounces is None or np.ptp(color, 0).max() < 2e-6)

    # 2. What is not: with one seed the paths of a longer render begin as those of a shorter one.
    scene, size = wr.load(STAGES / "cornell_box.usda"), (args.width, args.width)
    options = {"samples": args.samples, "lights_visible": True}
    frames = [wr.render(scene, size, bounces=bounces, **options) for bounces in (0, 1, 2, None)]
    colors = [frame.numpy("color") for frame in frames]
    images.write(args.out, {"color": np.concatenate(colors, 1)})
    means = [float(color[..., :3].mean()) for color in colors]
    print(f"{args.out}: mean radiance with 0, 1, 2 and all bounces {np.round(means, 4)}")
    assert all(a < b for a, b in zip(means, means[1:], strict=False))


if __name__ == "__main__":
    main()
