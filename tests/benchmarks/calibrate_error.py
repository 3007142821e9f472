"""How far the error that a render states lies from its true error. Run by hand; an hour or so.

    python tests/benchmarks/calibrate_error.py [--size 48] [--seeds 20] [--samples 64 256] [SCENE ...]

For each scene: pictures of several seeds against one of many samples, whose own noise is known from its four parts and
taken off. `error` and `frame error` are as `warprender.noise.true_errors` has them. The table has the true one, stated
over true as mean ± deviation over the seeds, the share of pictures within 10 %, by how much the true one varies from
seed to seed, the share within which a picture says that it lies (median), and how often it does. Channels: the true
error of the three channels alike, where the reference's are above 1e-3, over that of luminance.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import warp as wp

TESTS = Path(__file__).parent.parent
sys.path[:0] = [str(TESTS), str(TESTS / "mitsuba")]

import compare  # noqa: E402
import test_specialised as builders  # noqa: E402

import warprender as wr  # noqa: E402
from warprender.color import LUMINANCE  # noqa: E402
from warprender.noise import LIT  # noqa: E402

#: Scene and camera (None: the scene's own) by what they show.
SCENES = {
    "the Cornell box": lambda: (compare.cornell(), None),
    "a dome with a sun of one texel": lambda: (compare.dome(), None),
    "smooth glass": lambda: (compare.glass(), None),
    "metals under small lights": lambda: (compare.plates(), None),
    "two hundred lamps": lambda: (compare.lamps(), None),
    "a mesh under a rect light": builders.mesh_under_a_rect_light,
    "glossy spheres in a dome": builders.glossy_spheres_in_a_dome,
    "cut-out textures": builders.textures_under_the_camera_light,
    "glass through a lens": builders.glass_through_a_lens,
}
FIGURES = ("error", "frame error")


def color(frame):
    return frame.numpy("color")[..., :3].astype(np.float64)


class Reference:
    """The mean of four independent pictures, and the variance of that mean, of luminance and by channel."""

    def __init__(self, renderer, samples):
        parts = np.array([color(renderer.render(samples=samples / 4, seed=2_000_000_000 + k)) for k in range(4)])
        self.color, self.color_variance = parts.mean(0), parts.var(0, ddof=1) / 4
        light = parts @ LUMINANCE
        self.light, self.variance = light.mean(0), light.var(0, ddof=1) / 4
        self.lit = self.light > LIT

    def true_errors(self, picture):
        """Both true errors of luminance, and the relative one of all channels, without the reference's noise."""
        wanted, lit = self.light, self.lit
        squares = (((picture @ LUMINANCE) - wanted) ** 2 - self.variance)[lit]
        bright = self.color > LIT
        channels = ((picture - self.color) ** 2 - self.color_variance)[bright] / self.color[bright] ** 2
        means = (squares / wanted[lit] ** 2).mean(), squares.sum() / (wanted[lit] ** 2).sum(), channels.mean()
        return np.sqrt(np.maximum(means, 1e-30))


def row(name, samples, figure, true, frames):
    """A row of the table."""
    stated, within = (np.array([frame.stats[figure + word] for frame in frames]) for word in ("", " within"))
    ratio = stated / true
    inside = np.abs(true - stated) <= within * stated
    return (
        f"| {name} | {samples} | {figure} | {true.mean():.4f} | {ratio.mean():.3f} ± {ratio.std(ddof=1):.3f} "
        f"| {100 * (abs(ratio - 1) < 0.1).mean():.0f} % | {100 * true.std(ddof=1) / true.mean():.0f} % "
        f"| {100 * np.median(within):.0f} % | {100 * inside.mean():.0f} % |"
    )


def measure(name, options):
    """The rows of a scene, and a line about its channels."""
    renderer = wr.Renderer(*SCENES[name](), (options.size, options.size), sampler=options.sampler)
    reference = Reference(renderer, options.reference)
    for samples in options.samples:
        frames = [renderer.render(samples=samples, seed=seed) for seed in range(options.seeds)]
        for frame in frames:
            frame.stats.settle()
        true = np.array([reference.true_errors(color(frame)) for frame in frames])
        for k, figure in enumerate(FIGURES):
            print(row(name, samples, figure, true[:, k], frames), flush=True)
        channels = np.sqrt((true[:, 2] ** 2).mean() / (true[:, 0] ** 2).mean())
        print(f"channels over luminance: {channels:.2f}", file=sys.stderr, flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", choices=[[], *SCENES], metavar="SCENE", help=", ".join(SCENES))
    parser.add_argument("--size", type=int, default=48)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--samples", type=int, nargs="+", default=[64, 256])
    parser.add_argument("--reference", type=int, default=16384)
    parser.add_argument("--sampler", default="sobol")
    options = parser.parse_args()
    wp.config.log_level = wp.LOG_WARNING
    print(f"{options.size} x {options.size}, {options.seeds} seeds, references of {options.reference} samples\n")
    print("| scene | samples | figure | true | stated / true | within 10 % | true varies | states within | and is |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in options.scenes or SCENES:
        measure(name, options)


if __name__ == "__main__":
    main()
