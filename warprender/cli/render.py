"""Draw a stage into an image file, or a range of frames into one file each."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from .arguments import add_picture_arguments
from .framespec import frame_paths
from .progress import progress_bar
from .report import Warnings, interrupted, write_stats

if TYPE_CHECKING:
    from .. import StageReader
    from ..frame import Frame


def add_parser(commands: argparse._SubParsersAction) -> None:
    """Add the command and its flags."""
    parser = commands.add_parser(
        "render",
        usage="%(prog)s [FLAGS] STAGE OUTPUT",
        help="draw a stage into an image file",
        description=__doc__,
        allow_abbrev=False,
    )
    add_picture_arguments(parser)
    parser.add_argument(
        "output",
        metavar="OUTPUT",
        help="image file; .exr keeps every output as a layer; with --frames it holds ### or ###.###",
    )
    parser.add_argument("--stats", metavar="FILE.json", help="write what each frame took: time, rays, error")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Draw and save each frame; after an interruption, save what is finished and stop."""
    from .quiet import start_warp
    from .request import open_stage, remarks, times

    paths = frame_paths(args.output, args.frames)
    warnings = Warnings()
    warnings.show(remarks(args))
    warnings.show(_check_destinations(args, paths))
    start_warp(args.device)
    stage = open_stage(args)
    finished = []
    for time, path in zip(times(args), paths, strict=True):
        frame = _draw(args, stage, time, Path(path).name, warnings)
        frame.save(path, args.colorCorrectionMode)
        print(f"{path}: {frame!r}", flush=True)
        finished.append({"picture": path, "time": time, **frame.stats})
        if frame.stats.get("interrupted"):
            break
    if args.stats:
        write_stats(args.stats, args.stage, finished)
    if finished[-1].get("interrupted"):
        return interrupted(f"what was finished is in {finished[-1]['picture']}")
    return 0


def _draw(args: argparse.Namespace, stage: StageReader, time: float | None, title: str, warnings: Warnings) -> Frame:
    """One frame, with a progress bar on a terminal."""
    from .request import build_renderer

    with progress_bar(title) as progress:
        scene = stage.read(time)
        warnings.show(scene.warnings)
        frame = build_renderer(args, scene).render(
            samples=args.samples, error=args.error, seconds=args.seconds, seed=args.seed, progress=progress
        )
        warnings.show(frame.stats.get("warnings", ()))
        return frame


def _check_destinations(args: argparse.Namespace, paths: list[str]) -> list[str]:
    """Find now what would stop the pictures from being saved after a long render; returns warnings.

    Raises:
        ValueError: an unknown extension, a missing folder, or outputs that the format cannot hold.
    """
    from .. import images
    from .request import outputs

    for path in paths:
        images.check_destination(path)
    asked = outputs(args)
    kept = images.kept(paths[0], asked)
    if not kept:
        raise ValueError(f"{paths[0]}: this format holds color alone, and --aov has no color; .exr holds all")
    if args.stats and not Path(args.stats).absolute().parent.is_dir():
        raise ValueError(f"{args.stats}: the folder {Path(args.stats).parent} does not exist")
    lost = ", ".join(name for name in asked if name not in kept)
    return [f"{paths[0]}: this format does not keep {lost}; .exr holds all"] if lost else []
