"""Draw a stage into an image file, a range of frames into one file each, or the stage's render products."""

from __future__ import annotations

import argparse
from dataclasses import astuple, replace
from pathlib import Path
from typing import TYPE_CHECKING

from .arguments import add_picture_arguments
from .progress import Progress, announce_compiling, progress_bar
from .report import Warnings, interrupted, write_stats
from .trace import tracing

if TYPE_CHECKING:
    from .. import StageReader
    from ..frame import Frame
    from ..scene import Scene
    from .pictures import Picture


def add_parser(commands: argparse._SubParsersAction) -> None:
    """Add the command and its flags."""
    parser = commands.add_parser(
        "render",
        usage="%(prog)s [FLAGS] STAGE [OUTPUT]",
        help="draw a stage into an image file",
        description=__doc__,
        allow_abbrev=False,
    )
    add_picture_arguments(parser)
    parser.add_argument(
        "output",
        nargs="?",
        metavar="OUTPUT",
        help="image file; .exr keeps every output as a layer; with --frames it holds ### or ###.###; without it, "
        "the render products of the stage name the files",
    )
    parser.add_argument("--stats", metavar="FILE.json", help="write what each frame took: time, rays, error")
    parser.add_argument("--quiet", dest="told", action="store_false", help="do not say that kernels are compiled")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Draw and save each picture; after an interruption, save what is finished and stop."""
    from .pictures import asked_pictures, product_pictures
    from .quiet import start_warp
    from .request import open_stage, remarks

    warnings = Warnings()
    warnings.show(remarks(args))
    pictures = asked_pictures(args) if args.output else []
    warnings.show(_check_destinations(args, pictures))
    start_warp(args.device)
    if args.told:
        announce_compiling()
    with tracing(args.traceToFile, args.traceFormat):
        stage = open_stage(args)
        if not args.output:
            pictures, lines = product_pictures(args, stage)
            warnings.show(lines)
        finished = _draw_all(args, stage, pictures, warnings)
    if args.stats:
        write_stats(args.stats, args.stage, finished)
    if finished[-1].get("interrupted"):
        return interrupted(f"what was finished is in {finished[-1]['picture']}")
    return 0


def _draw_all(args: argparse.Namespace, stage: StageReader, pictures: list[Picture], warnings: Warnings) -> list[dict]:
    """What each finished picture took; a time's scene is read once, and products that see the same are drawn once."""
    finished, read, scene, drawn = [], -1, None, {}
    for picture in pictures:
        with progress_bar(Path(picture.path).name) as progress:
            if picture.frame != read:
                read, scene, drawn = picture.frame, stage.read(picture.time), {}
                warnings.show(scene.warnings)
            view = _view(scene, picture)
            if view not in drawn:
                same = [p for p in pictures if p.frame == read and _view(scene, p) == view]
                drawn[view] = _draw(args, scene, same, progress)
            frame = drawn[view].chosen(picture.outputs)
            warnings.show(frame.stats.get("warnings", ()))
        frame.save(picture.path, args.colorCorrectionMode)
        print(f"{picture.path}: {frame!r}", flush=True)
        finished.append({"picture": picture.path, "time": picture.time, **frame.stats})
        if frame.stats.get("interrupted"):
            break
    return finished


def _view(scene: Scene, picture: Picture) -> tuple:
    """What a picture's product says of the view, () for the settings': equal where one render serves two files."""
    if picture.product is None:
        return ()
    product = scene.settings.products[picture.product]
    return astuple(replace(product, path="", productName="", outputs=()))


def _draw(args: argparse.Namespace, scene: Scene, same: list[Picture], progress: Progress | None) -> Frame:
    """One render with the outputs of all the pictures, which see the same."""
    from .request import build_renderer

    number = same[0].product
    if number is not None:
        scene = scene.for_product(scene.settings.products[number])
    shown = tuple(dict.fromkeys(name for picture in same for name in picture.outputs))
    return build_renderer(args, scene, shown).render(
        samples=args.samples, error=args.error, seconds=args.seconds, seed=args.seed, progress=progress
    )


def _check_destinations(args: argparse.Namespace, pictures: list[Picture]) -> list[str]:
    """Find now what would stop the pictures from being saved after a long render; returns warnings.

    Raises:
        ValueError: an unknown extension, a missing folder, or outputs that the format cannot hold.
    """
    from .. import images

    images.check_color_correction(args.colorCorrectionMode)
    for file in (args.stats, args.traceToFile):
        if file and not Path(file).absolute().parent.is_dir():
            raise ValueError(f"{file}: the folder {Path(file).parent} does not exist")
    for picture in pictures:
        images.check_destination(picture.path)
        kept = images.kept(picture.path, picture.outputs)
        if not kept:
            raise ValueError(f"{picture.path}: this format holds color alone, and --aov has no color; .exr holds all")
        if lost := ", ".join(name for name in picture.outputs if name not in kept):
            return [f"{picture.path}: this format does not keep {lost}; .exr holds all"]
    return []
