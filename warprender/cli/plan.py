"""Say which effects a picture of a stage calls for, which prim called for each, and what is left out."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from .arguments import add_picture_arguments
from .progress import steps_bar

if TYPE_CHECKING:
    from .. import Camera, Renderer
    from ..scene import Scene
    from ..study.cost import Cost

#: Arguments of `Renderer` to flags.
_FLAGS = {"bounces": "bounces", "energy_compensation": "energyCompensation", "denoise": "denoise"}


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
    parser.add_argument(
        "--cost", action="store_true", help="time the picture with and without each effect; compiles a kernel for most"
    )
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
    renderer = build_renderer(args, scene)
    costs = _costs(args, scene, renderer) if args.cost else None
    if args.json:
        import json
        from dataclasses import asdict

        measured = {} if costs is None else {"cost": [asdict(cost) for cost in costs]}
        print(json.dumps({**renderer.plan.as_dict(), **measured}, indent=2))
        return 0
    print(renderer.plan.explain())
    if costs is not None:
        from ..study.cost import table

        print(f"\n{table(costs)}")
    return 0


def _costs(args: argparse.Namespace, scene: Scene, renderer: Renderer) -> list[Cost]:
    """What each effect of the picture costs."""
    from ..study.cost import measure_costs
    from .request import build_renderer

    def build(changed: Scene, camera: Camera, options: dict) -> Renderer:
        flags = {_FLAGS[name]: value for name, value in options.items() if name != "outputs"}
        asked = options.get("outputs", renderer.request.outputs)
        flags |= {"camera": camera, "resolution": renderer.data_window.full}
        if args.cameraLight == "auto":
            # A light at the camera must not step in for lights that were left out.
            flags["cameraLight"] = "off" if scene.lights else "on"
        return build_renderer(argparse.Namespace(**{**vars(args), **flags}), changed, asked)

    with steps_bar("cost") as progress:
        return measure_costs(scene, renderer, build, progress)
