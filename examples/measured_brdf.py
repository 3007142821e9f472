"""Measure a material's BRDF, write it as a file of MERL's format, and render a stage that refers to the file.

python examples/measured_brdf.py --out measured.png
"""

import argparse
from pathlib import Path

import numpy as np

import warprender as wr

STAGE = Path(__file__).parent.parent / "scenes_usd" / "measured_brdf.usda"

#: How far the copy's picture may be off the original's, in its mean and as RMS over the pixels, both relative.
MEAN_LIMIT, RMS_LIMIT = 5e-4, 1e-3


def layer_that_names(file: Path) -> str:
    """A session layer in which the stage's measured material refers to this file."""
    return f"""#usda 1.0
over "Looks" {{
    over "Measured" {{
        over "Surface" {{
            asset inputs:file = @{file.resolve()}@
        }}
    }}
}}
"""


def main() -> None:
    parser = argparse.ArgumentParser(description="Measure a material, and render what was measured.")
    parser.add_argument("--out", default="measured.png", help="image file (default: measured.png)")
    parser.add_argument("--samples", type=int, default=16, help="samples for each pixel (default: 16)")
    parser.add_argument("--width", type=int, default=400, help="pixels (default: 400)")
    args = parser.parse_args()

    # 1. Measure: 90 x 90 x 180 pairs of directions, as MERL's machine did, and a file of 33 MiB.
    original = wr.load(STAGE).materials["/Looks/Original"]
    table = wr.measure_brdf(original)
    file = Path(args.out).with_suffix(".binary")
    table.write(file)
    print(f"{file}: albedo along the normal {table.albedos[0].round(4)}")

    # 2. The stage, its right ball with the new file. A layer could as well be written beside the stage.
    layer = Path(args.out).with_suffix(".usda")
    layer.write_text(layer_that_names(file), encoding="utf-8")
    scene = wr.load(STAGE, session_layer=layer)
    options = {"resolution": (args.width, args.width // 2), "samples": args.samples, "bounces": 0}
    frame = wr.render(scene, **options)
    frame.save(args.out)
    print(f"{args.out}: {frame!r}")

    # 3. The right ball once more with the original. Suns without width and no bounces make no noise: with the same
    #    seed, pixels differ by the cells alone.
    scene.placements["/World/Right"].material = "/Looks/Original"
    expected, found = (picture.numpy("color")[..., :3] for picture in (wr.render(scene, **options), frame))
    mean = abs(found.mean() / expected.mean() - 1)
    rms = np.sqrt(((found - expected) ** 2).mean() / (expected**2).mean())
    print(f"the copy's picture is off by {100 * mean:.3f} % in the mean, by {100 * rms:.3f} % RMS")
    assert expected.mean() > 0.01 and (found != expected).any()
    assert mean < MEAN_LIMIT and rms < RMS_LIMIT


if __name__ == "__main__":
    main()
