"""The rendering equation, unfolded: light scattered once, up to twice, up to three times, and all of it, side by side.

One render keeps the single terms: `color:0` is what the surfaces send out themselves, `color:1` what is scattered once
(the local reflection model, with shadows), and so on. `--bounces n` ends the sum after `color:(n + 1)`.

python examples/unfolded_recursion.py --out unfolded.png
"""

import argparse
from pathlib import Path

import numpy as np

import warprender as wr
from warprender import images

STAGES = Path(__file__).parent.parent / "scenes_usd"
TERMS = tuple(f"color:{n}" for n in range(4))


def check_series() -> None:
    """In the closed box each wall sends out e and mirrors ρ of what arrives: term n is e ρⁿ, their sum e / (1 - ρ)."""
    box = wr.load(STAGES / "closed_box.usda")
    look = box.materials["/World/looks/glowing"]
    e, rho = np.array(look.emissiveColor), np.array(look.diffuseColor)
    frame = wr.render(box, (16, 12), samples=64, outputs=("color", *TERMS))
    for n, name in enumerate(TERMS):
        print(f"closed box, {name}: {frame.numpy(name)[6, 8]}, the series has {(e * rho**n).round(6)}")
        # Mirrors make no noise: each pixel has the digits of float32.
        assert np.abs(frame.numpy(name) - e * rho**n).max() < 2e-6
    # Long paths are ended by chance, so the sum has a standard error; what the plan's bounces leave out is below 1e-4.
    color = frame.numpy("color")[..., :3].reshape(-1, 3)
    mean, noise = color.mean(0, dtype=np.float64), color.std(0) / np.sqrt(len(color))
    print(f"closed box, color: {mean} ± {noise}, the series has {e / (1 - rho)}")
    assert (np.abs(mean - e / (1 - rho)) < 4.5 * noise + 1e-4).all()


def main() -> None:
    parser = argparse.ArgumentParser(description="The Cornell box by the number of scatterings.")
    parser.add_argument("--out", default="unfolded.png", help="image file (default: unfolded.png)")
    parser.add_argument("--samples", type=int, default=64, help="for each pixel (default: 64)")
    parser.add_argument("--width", type=int, default=160, help="pixels of each picture (default: 160)")
    args = parser.parse_args()

    check_series()
    scene, size = wr.load(STAGES / "cornell_box.usda"), (args.width, args.width)
    frame = wr.render(scene, size, args.samples, outputs=("color", *TERMS), lights_visible=True)
    color = frame.numpy("color")
    sums = np.cumsum([frame.numpy(name) for name in TERMS], 0)
    pictures = [*sums[1:], color[..., :3]]
    opaque = np.concatenate([color[..., 3:]] * len(pictures), 1)
    images.write(args.out, {"color": np.concatenate([np.concatenate(pictures, 1), opaque], 2).astype(np.float32)})
    means = [float(picture.mean()) for picture in pictures]
    print(f"{args.out}: mean radiance {np.round(means, 4)}")
    # Each term adds light, and less than the one before.
    terms = [float(frame.numpy(name).mean()) for name in TERMS]
    assert (np.diff(means) > 0).all() and 0 < terms[3] < terms[2] < terms[1]
    assert (color[..., :3] - sums[-1] > -1e-5).all()


if __name__ == "__main__":
    main()
