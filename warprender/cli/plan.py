"""Say which effects a picture of a stage calls for, which prim called for each, and what is left out."""

from __future__ import annotations

import argparse

from .arguments import add_picture_arguments


def add_parser(commands: argparse._SubParsersAction) -> None:
    """Add the command and its flags."""
    parser = commands.add_parser(
        "plan",
        usage="%(prog)s [FLAGS] STAGE",
        help="say what rendering a stage involves, and why",
        description=__doc__,
        allow_abbrev=False,
    )
    add_picture_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print the plan as JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print the plan of the picture, of the first one when --frames asks for several."""
    from .quiet import start_warp
    from .report import Warnings
    from .request import build_renderer, open_stage, remarks, times

    time = times(args)[0]
    start_warp(args.device)
    scene = open_stage(args).read(time)
    Warnings().show([*remarks(args), *scene.warnings])
    plan = build_renderer(args, scene).plan
    if args.json:
        import json

        print(json.dumps(plan.as_dict(), indent=2))
    else:
        print(plan.explain())
    return 0
