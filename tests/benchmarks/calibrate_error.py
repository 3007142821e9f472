"""How far the error that a render states lies from its true error. Run by hand; minutes.

    python tests/benchmarks/calibrate_error.py [--size 64] [--seeds 20] [--samples 64 256] [--reference 4096]

For each scene: pictures of several seeds against one of many samples. `error` is the relative RMS over lit pixels,
`frame error` the RMS over the RMS of the picture. The table has stated / true as mean ± deviation over the seeds, the
share within 10 %, and how much the true and the stated error vary from seed to seed: what of the true one is chance no
statement can follow.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import warp as wp

sys.path.insert(0, str(Path(__file__).parent.parent))

from test_specialised import BUILDERS

import warprender as wr
from warprender.color import LUMINANCE
from warprender.film import LIT

ROOT = Path(__file__).parent.parent.parent


def cornell_box():
    return wr.load(ROOT / "scenes_usd" / "cornell_box.usda"), None


def luminance(frame):
    return frame.numpy("color")[..., :3].astype(np.float64) @ LUMINANCE


def true_errors(picture, reference):
    lit = reference > LIT
    gap = (picture - reference)[lit]
    relative = np.sqrt(np.mean((gap / reference[lit]) ** 2))
    return relative, np.sqrt((gap**2).sum() / (reference[lit] ** 2).sum())


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=int, default=64)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--samples", type=int, nargs="+", default=[64, 256])
    parser.add_argument("--reference", type=int, default=4096)
    options = parser.parse_args()
    wp.config.log_level = wp.LOG_WARNING
    print(
        f"{options.size}x{options.size}, {options.seeds} seeds, reference of {options.reference} samples, Sobol points"
    )
    print(f"{'scene':32} samples  figure       true     stated/true      within 10 %  true varies by  stated by")
    for build in (cornell_box, *BUILDERS):
        scene, view = build()
        renderer = wr.Renderer(scene, view, (options.size, options.size))
        reference = luminance(renderer.render(samples=options.reference, seed=123456))
        for samples in options.samples:
            frames = [renderer.render(samples=samples, seed=seed) for seed in range(options.seeds)]
            true = np.array([true_errors(luminance(frame), reference) for frame in frames])
            for k, name in enumerate(("error", "frame error")):
                stated = np.array([frame.stats[name] for frame in frames])
                ratio = stated / true[:, k]
                spread = (100 * v.std() / v.mean() for v in (true[:, k], stated))
                print(
                    f"{build.__name__:32} {samples:7}  {name:11}  {true[:, k].mean():.4f}   "
                    f"{ratio.mean():.3f} ± {ratio.std():.3f}   {100 * (abs(ratio - 1) < 0.1).mean():4.0f} %       "
                    f"{next(spread):4.1f} %       {next(spread):4.1f} %",
                    flush=True,
                )


if __name__ == "__main__":
    main()
