"""Motion blur: what slides, turns and changes its shape while the shutter is open, and what stands still.

A square of width 1 that slides 2 units meanwhile fades in over one unit, and out over another: a ramp of known height.

python examples/motion_blur.py --out motion_blur.png
"""

import argparse
from pathlib import Path

import numpy as np

import warprender as wr

STAGE = Path(__file__).parent.parent / "scenes_usd" / "motion_blur.usda"


def check_ramp(frame: wr.Frame, samples: int) -> None:
    """The sliding square covers x from -1.5 to 1.5; each place for the share of the time that it is over it."""
    color = frame.numpy("color")[..., 0]
    size = len(color)
    # The rows about y = 3, where nothing else is; 8 units are seen.
    found = color[round(size * 0.1) : round(size * 0.15)].mean(0)
    x = ((np.arange(size * 64) + 0.5) / (size * 64) - 0.5) * 8
    exact = np.clip((1.5 - np.abs(x)) / 2, 0.0, 0.5).reshape(size, 64).mean(1)
    # Four sets of times, each with one in every of `parts` equal parts of the time: an edge falsifies one of them.
    parts = min(max(samples // 4, 1), 16)
    print(f"largest distance from the ramp: {np.abs(found - exact).max():.3f}, allowed are {2 / parts:.3f}")
    assert np.abs(found - exact).max() <= 2 / parts
    assert found[exact == 0.0].max() == 0.0


def main() -> None:
    parser = argparse.ArgumentParser(description="Draw what moves while the shutter is open.")
    parser.add_argument("--out", default="motion_blur.png", help="image file (default: motion_blur.png)")
    parser.add_argument("--samples", type=int, default=64, help="for each pixel (default: 64)")
    parser.add_argument("--width", type=int, default=160, help="pixels each way (default: 160)")
    args = parser.parse_args()

    scene = wr.load(STAGE)
    renderer = wr.Renderer(scene, "camera", (args.width, args.width), camera_light="off")
    print("motion blur:", renderer.plan.reasons["motion blur"])
    frame = renderer.render(args.samples)
    check_ramp(frame, args.samples)

    # What stands still keeps its bits: the same samples with a shutter that is open for no time.
    scene.cameras["/World/camera"].shutterOpen = scene.cameras["/World/camera"].shutterClose = 0.0
    sharp = wr.Renderer(scene, "camera", (args.width, args.width), camera_light="off")
    assert sharp.plan.shutter is None and sharp.plan.path == renderer.plan.path
    corner = slice(args.width * 5 // 8, None), slice(args.width * 5 // 8, None)
    picture = sharp.render(args.samples).numpy("color")
    assert (picture[corner] == frame.numpy("color")[corner]).all() and picture[corner].max() > 0.9
    frame.save(args.out)


if __name__ == "__main__":
    main()
