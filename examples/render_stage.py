"""Load a USD stage, render it, save the picture.

python examples/render_stage.py --out cornell.png
"""

import argparse
from pathlib import Path

import numpy as np

import warprender as wr

CORNELL_BOX = Path(__file__).parent.parent / "scenes_usd" / "cornell_box.usda"


def main() -> None:
    parser = argparse.ArgumentParser(description="Load a USD stage, render it, save the picture.")
    parser.add_argument("stage", nargs="?", default=str(CORNELL_BOX), help="USD file (default: the Cornell box)")
    parser.add_argument("--out", default="stage.png", help="image file (default: stage.png)")
    parser.add_argument("--samples", type=int, default=64, help="samples for each pixel (default: 64)")
    parser.add_argument("--width", type=int, help="pixels (default: the stage's resolution, or 960)")
    args = parser.parse_args()

    # 1. The stage. What cannot be drawn as the stage asks is named, prim by prim.
    scene = wr.load(args.stage)
    for warning in scene.warnings:
        print("warning:", warning)

    # 2. A renderer keeps the scene ready; it can render as often as needed.
    size = (args.width, args.width) if args.width else None
    renderer = wr.Renderer(scene, resolution=size, lights_visible=True)
    print(renderer.plan.explain())

    # 3. The picture, and what it took.
    frame = renderer.render(samples=args.samples)
    frame.save(args.out)
    print(f"{args.out}: {frame!r}, relative error {frame.stats['error']:.3f}, rays {frame.stats['rays']}")

    color = frame.numpy("color")
    assert np.isfinite(color).all() and color[..., :3].max() > 0.0, "the picture is black"


if __name__ == "__main__":
    main()
