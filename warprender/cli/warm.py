"""Compile ahead what a picture of a stage needs: a later render with the same flags finds its kernels cached."""

from __future__ import annotations

import argparse
import time
from typing import TYPE_CHECKING

from .arguments import add_picture_arguments

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..plan import RenderPlan
    from ..renderer import Renderer
    from .report import Warnings


def add_parser(commands: argparse._SubParsersAction) -> None:
    """Add the command and its flags."""
    parser = commands.add_parser(
        "warm",
        usage="%(prog)s [FLAGS] STAGE",
        help="compile the kernels that rendering a stage needs",
        description=__doc__,
        allow_abbrev=False,
    )
    add_picture_arguments(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Draw one sample of each picture whose plan names kernels that none before it did; print what took how long."""
    from .quiet import start_warp
    from .report import Warnings
    from .request import remarks

    warnings = Warnings()
    warnings.show(remarks(args))
    start_warp(args.device)
    seen: set[tuple] = set()
    for renderer, preparing in _renderers(args, warnings):
        plan = renderer.plan
        kernels = (plan.transport, plan.visibility, plan.color_visibility, plan.path, plan.outputs)
        if kernels in seen:
            continue
        seen.add(kernels)
        print(f"{preparing:7.2f} s  reading, trees and textures", flush=True)
        seconds = renderer.render(samples=1).stats["seconds"]
        for part, names in parts(plan).items():
            print(f"{seconds[part]:7.2f} s  {names}", flush=True)
    return 0


def parts(plan: RenderPlan) -> dict[str, str]:
    """What each timed part of a render compiles: "outputs" and "sample" to the names that its kernel is made of."""
    found = {}
    for part, title, key in (("outputs", "outputs", plan.outputs), ("sample", plan.transport, plan.path)):
        if key is not None:
            names = [*key.shapes, *key.materials, *getattr(key, "lights", ()), *key.camera, *key.features]
            found[part] = f"{title}: {', '.join((*getattr(key, 'outputs', ()), *names))}"
    return found


def _renderers(args: argparse.Namespace, warnings: Warnings) -> Iterator[tuple[Renderer, float]]:
    """The renderer of each picture that `render` would draw with these flags, and the seconds of making it."""
    from .request import build_renderer, open_stage, outputs, times

    start = time.perf_counter()
    stage = open_stage(args)
    for frame in times(args):
        scene = stage.read(frame)
        warnings.show(scene.warnings)
        for product in (None, *scene.settings.products):
            of_product = scene if product is None else scene.for_product(product)
            yield build_renderer(args, of_product, outputs(args, product)), time.perf_counter() - start
            start = time.perf_counter()
