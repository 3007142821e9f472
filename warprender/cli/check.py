"""Name what is bad or numerically hard about a stage, prim by prim, with what it does to a picture."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from .arguments import add_picture_arguments

if TYPE_CHECKING:
    from ..checks import Finding
    from ..scene import Scene


def add_parser(commands: argparse._SubParsersAction) -> None:
    """Add the command and its flags."""
    parser = commands.add_parser(
        "check",
        usage="%(prog)s [FLAGS] STAGE",
        help="name bad and numerically hard input, prim by prim",
        description=__doc__,
        allow_abbrev=False,
        conflict_handler="resolve",
    )
    add_picture_arguments(parser)
    parser.add_argument(
        "--visibility",
        action="store_true",
        help="instead, draw by rays and by the rasterizer and name the prim behind each pixel that differs",
    )
    parser.add_argument("--json", action="store_true", help="print the findings as JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print one line a finding, of the first picture when --frames asks for several."""
    from ..checks import check
    from .quiet import start_warp
    from .report import Warnings
    from .request import open_stage, remarks, times

    start_warp(args.device)
    Warnings().show(remarks(args))
    scene = open_stage(args).read(times(args)[0])
    findings = _compare(args, scene) if args.visibility else check(scene)
    if args.json:
        import json
        from dataclasses import asdict

        print(json.dumps([asdict(finding) for finding in findings], indent=2))
        return 0
    for finding in findings:
        print(finding)
    print(f"{args.stage}: {len(findings)} findings" if findings else f"{args.stage}: nothing found")
    return 0


def _compare(args: argparse.Namespace, scene: Scene) -> list[Finding]:
    """What rays and the rasterizer see otherwise in the picture that the flags ask for."""
    from ..checks import COMPARED, visibility_findings
    from .request import build_renderer

    pictures = []
    for visibility in ("rays", "raster"):
        flags = {**vars(args), "visibility": visibility, "transport": "none", "aov": [COMPARED]}
        frame = build_renderer(argparse.Namespace(**flags), scene).render()
        pictures.append({name: frame.numpy(name) for name in COMPARED})
    return visibility_findings(scene, *pictures)
