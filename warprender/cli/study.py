"""Measure what accuracy costs in time on a stage: a converged reference, then every setting against it.

FOLDER gets report.html, results.csv and results.json. A study that was stopped goes on when it is started again.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from .arguments import COMPLEXITIES, add_picture_arguments, positive_float, positive_int
from .progress import steps_bar
from .report import interrupted

if TYPE_CHECKING:
    from .. import Renderer
    from ..scene import Scene

#: Width in pixels where no flag asks for a size.
_WIDTH = 128
_SAMPLES = 256
#: Arguments of `Renderer` to flags, where they have other names.
_FLAGS = {"light_sampling": "lightSampling"}
_PICTURES = 4


def add_parser(commands: argparse._SubParsersAction) -> None:
    """Add the command and its flags."""
    parser = commands.add_parser(
        "study",
        usage="%(prog)s [FLAGS] STAGE FOLDER, or %(prog)s --numerics FOLDER",
        help="measure what accuracy costs in time",
        description=__doc__,
        allow_abbrev=False,
    )
    add_picture_arguments(parser)
    parser.add_argument(
        "folder", metavar="FOLDER", nargs="?", help="where the study is kept; made where it does not exist"
    )
    group = parser.add_argument_group("study")
    group.add_argument("--reference", metavar="FILE.exr", help="compare with this picture instead of rendering one")
    group.add_argument(
        "--pictures",
        type=positive_int,
        default=_PICTURES,
        metavar="COUNT",
        help=f"pictures of different seeds for each setting (default: {_PICTURES}); 2 or more tell bias from variance",
    )
    group.add_argument(
        "--budget",
        type=positive_float,
        metavar="SECONDS",
        help="begin no measurement after this time; the reference takes 40 %% of it at most",
    )
    group.add_argument(
        "--numerics",
        action="store_true",
        help="instead, measure hard cases: what plain Warp or the textbook does, what warprender does, what it costs",
    )
    parser.set_defaults(run=run, usage_error=parser.error)


def run(args: argparse.Namespace) -> int:
    """Render the reference, measure what is missing, write the report."""
    if args.numerics:
        return _numerics(args)
    if args.folder is None:
        args.usage_error("the following arguments are required: FOLDER")
    from ..denoise import available
    from ..study import plots
    from ..study.measure import Interrupted, Study
    from ..study.report import write_report
    from ..study.settings import sweep
    from .quiet import start_warp
    from .report import Warnings
    from .request import open_stage, remarks, times

    plots.check_available()
    start_warp(args.device)
    warnings = Warnings()
    warnings.show([*remarks(args), *_ignored(args)])
    scene = open_stage(args).read(times(args)[0])
    warnings.show(scene.warnings)

    def build(**changed: object) -> Renderer:
        level = changed.pop("complexity", None)
        seen = scene if level is None else _at_level(args, level)
        return _renderer(args, seen, changed)

    plan = build().plan
    most = args.samples or _SAMPLES
    settings = sweep(plan, most, available(), _levels(args, scene))
    study = Study(args.folder, build, _identity(args, scene, build()))
    skipped: list[str] = []
    try:
        with steps_bar("study") as progress:
            if args.reference:
                reference = study.take_reference(args.reference)
            else:
                reference = study.reference(most, args.budget, progress)
            seeds = range(args.seed, args.seed + args.pictures)
            share = None if args.budget is None else (1.0 if args.reference else 0.6) * args.budget
            skipped = study.measure(settings, seeds, share, progress)
    except (Interrupted, KeyboardInterrupt):
        return interrupted(f"what was measured is in {args.folder}; the same command goes on")
    found = write_report(study, settings, reference, f"What accuracy costs: {args.stage}", skipped)
    best = sorted((row for row in found if row.best), key=lambda row: row.seconds)
    for row in best:
        print(f"{row.seconds:9.4f} s  RMSE {row.rmse:.4g}  {row.setting}")
    left_out = f"; {len(skipped)} of {len(settings)} settings left out or cut short by --budget" if skipped else ""
    print(f"{args.folder}/report.html: {len(found)} settings, {len(study.measurements)} pictures{left_out}")
    return 0


def _numerics(args: argparse.Namespace) -> int:
    """Measure the hard cases; the one argument is the folder."""
    if args.folder is not None:
        args.usage_error("--numerics takes a FOLDER alone")
    from ..study.numerics import markdown, measure_cases, write_cases
    from .quiet import start_warp

    start_warp("cpu")
    with steps_bar("numerics") as progress:
        cases = measure_cases(progress)
    write_cases(cases, args.stage)
    print(markdown(cases), end="")
    return 0


def _ignored(args: argparse.Namespace) -> list[str]:
    names = [name for name in ("error", "seconds") if getattr(args, name) is not None]
    return [f"--{name}: a study sets it itself; --samples and --budget bound it" for name in names]


def _levels(args: argparse.Namespace, scene: Scene) -> list[str]:
    """The other values of --complexity, where they change the stage; the reference has the one of the flag."""
    other = _at_level(args, "medium" if args.complexity == "low" else "low")
    if _faces(other) == _faces(scene):
        return []
    return [level for level in COMPLEXITIES[:3] if level != args.complexity]


def _at_level(args: argparse.Namespace, level: str) -> Scene:
    from .request import open_stage, times

    return open_stage(argparse.Namespace(**{**vars(args), "complexity": level})).read(times(args)[0])


def _faces(scene: Scene) -> int:
    from ..shapes.mesh import Mesh

    return sum(len(p.shape.faces) for p in scene.placements.values() if isinstance(p.shape, Mesh))


def _renderer(args: argparse.Namespace, scene: Scene, changed: dict[str, object]) -> Renderer:
    """The study's renderer with some of `Renderer`'s arguments changed."""
    from ..framing import choose_camera, choose_resolution
    from .request import build_renderer

    flags = {"aov": None, "denoise": False, "adaptive": False, **{_FLAGS.get(k, k): v for k, v in changed.items()}}
    if "filter_textures" in changed:
        flags["disableTextureFilter"] = not changed["filter_textures"]
    if not (args.resolution or args.imageWidth):
        width, height = choose_resolution(scene, choose_camera(scene, args.camera), None)
        flags["resolution"] = (min(_WIDTH, width), max(1, round(height * min(_WIDTH, width) / width)))
    return build_renderer(argparse.Namespace(**{**vars(args), **flags}), scene, ("color",))


def _identity(args: argparse.Namespace, scene: Scene, renderer: Renderer) -> dict:
    """What must be the same for measurements to belong together."""
    from ..receipt import file_hash

    flags = ("camera", "filter", "enableLightVisibility", "enableDomeLightVisibility", "cameraLight", "device")
    return {
        "stage": scene.source,
        "stage's contents": file_hash(scene.source),
        "way of reading it": scene.loading,
        "resolution": list(renderer.resolution),
        **{flag: getattr(args, flag) for flag in flags},
        "energyCompensation": args.energyCompensation,
    }
