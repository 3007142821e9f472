"""What each effect costs: a base scene and one effect more at a time, as the table of `docs/cost_of_effects.md`.

    python tests/benchmarks/bench_effects.py > table.md
    python tests/benchmarks/bench_effects.py lens texture

Kernels are compiled into an empty cache, in seconds of the processor. Each scene is drawn by its own kernel, the base
scene also by the kernel of each effect (what code costs that nothing asks for), and every scene by the kernel with
everything compiled in. They take turns; times are the processor's, the least of several short runs, for one thread.
Pictures must agree bit for bit.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import warp as wp

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent)]

from effects import EFFECTS, base  # noqa: E402

import warprender as wr  # noqa: E402
from warprender.plan import everything  # noqa: E402


class Way:
    """A scene drawn by one kernel, and the least time that a sample took."""

    def __init__(self, name: str, key: object = None) -> None:
        """Compiled, which `compiling` says the seconds of; `key` takes the place of the plan's own."""
        add, options = EFFECTS[name]
        scene = base()
        add(scene)
        self.renderer = wr.Renderer(scene, resolution=(SIZE, SIZE), bounces=4, threads=1, **options)
        self.own = self.renderer.plan.path
        if key is not None:
            self.renderer.plan.path = key
        start = time.process_time()
        self.renderer.render(samples=1)
        self.compiling = time.process_time() - start
        self.nanoseconds = np.inf

    def run(self) -> None:
        """Draw once more."""
        start = time.process_time()
        self.frame = self.renderer.render(samples=SAMPLES)
        taken = 1e9 * (time.process_time() - start) / (SAMPLES * SIZE**2)
        self.nanoseconds = min(self.nanoseconds, taken)

    def agrees(self, other: Way) -> bool:
        """Whether both drew the same bits."""
        return np.array_equal(self.frame.numpy("color"), other.frame.numpy("color"))


SIZE, SAMPLES = 64, 32


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("effects", nargs="*", metavar="EFFECT", help=", ".join(EFFECTS))
    parser.add_argument("--runs", type=int, default=8)
    options = parser.parse_args()
    wp.config.quiet = True
    with tempfile.TemporaryDirectory() as cache:
        wp.config.kernel_cache_dir = cache
        wr.render(base(), resolution=(8, 8), samples=1, transport="none", outputs="normal")
        plain, general = Way("base"), everything()
        print(
            "| effect | compiling, s | ns a sample | by the kernel of everything | rays a sample: bounce, shadow ",
            end="",
        )
        print("| the base scene by this kernel, against its own |")
        print("|---|---|---|---|---|---|", flush=True)
        for name in options.effects or EFFECTS:
            row(name, plain, general, options.runs)


def row(name: str, plain: Way, general: object, runs: int) -> None:
    """Measure and print one effect."""
    own = plain if name == "base" else Way(name)
    whole = Way(name, replace(general, sdfs=own.own.sdfs))
    ways = [plain, own, whole]
    contained = all(set(getattr(plain.own, f)) <= set(getattr(own.own, f)) for f in ("shapes", "materials", "lights"))
    unused = Way("base", own.own) if contained and not own.own.terms and not own.own.sdfs else None
    ways += [unused] if unused else []
    for way in ways:
        way.nanoseconds = np.inf
    for _ in range(runs):
        for way in dict.fromkeys(ways):
            way.run()
    if not own.agrees(whole) or (unused and not unused.agrees(plain)):
        raise SystemExit(f"{name}: the pictures differ")
    rays, camera = own.frame.stats["rays"], own.frame.stats["rays"]["camera"]
    print(f"| {name} | {own.compiling:.1f} | {own.nanoseconds:.0f} | {whole.nanoseconds:.0f} ", end="")
    print(f"| {rays['bounce'] / camera:.2f}, {rays['shadow'] / camera:.2f} ", end="")
    print(f"| {unused.nanoseconds / plain.nanoseconds:.2f} |" if unused else "| |", flush=True)
    if name == "base":
        print(f"the kernel of everything: {whole.compiling:.1f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
