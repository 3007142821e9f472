"""Measure what accuracy costs in time on a stage: a converged reference, then every setting against it.

FOLDER gets report.html, results.csv and results.json. A study that was stopped goes on when it is started again.
"""

from __future__ import annotations

import argparse
import shlex
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from .arguments import COMPLEXITIES, add_picture_arguments, positive_float, positive_int
from .progress import steps_bar
from .report import interrupted
from .request import remarks

if TYPE_CHECKING:
    from .. import Renderer
    from ..scene import Scene
    from ..study.leaks import Leaks
    from ..study.measure import Study
    from ..study.report import Account

#: Width in pixels where no flag asks for a size.
_WIDTH = 128
_SAMPLES = 256
#: Arguments of `Renderer` to flags, where they have other names.
_FLAGS = {"light_sampling": "lightSampling", "ray_accuracy": "rayAccuracy"}
_PICTURES = 4
#: Triangles at complexity medium beyond which high is not tried: it may have four times as many, or more.
_MOST_FACES = 500_000


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
        "--clock",
        choices=("wall", "processor"),
        default="wall",
        help="what plots and efficiency go by: time as it passes, or that of all threads of the processor, which other "
        "work disturbs less (default: wall); both are kept",
    )
    group.add_argument(
        "--numerics",
        action="store_true",
        help="instead, measure hard cases: what plain Warp or the textbook does, what warprender does, what it costs",
    )
    parser.set_defaults(run=run, usage_error=parser.error, complexity=None)


def run(args: argparse.Namespace) -> int:
    """Render the reference, measure what is missing, write the report."""
    if args.numerics:
        return _numerics(args)
    if args.folder is None:
        args.usage_error("the following arguments are required: FOLDER")
    from ..denoise import available
    from ..study import plots
    from ..study.measure import REFERENCE_SHARE, Interrupted, Study
    from ..study.report import write_report
    from ..study.settings import sweep
    from .quiet import start_warp
    from .report import Warnings

    plots.check_available()
    start_warp(args.device)
    warnings = Warnings()
    warnings.show([*remarks(args), *_ignored(args)])
    levels = Levels(args)
    warnings.show(levels.scene.warnings)

    def build(**changed: object) -> Renderer:
        return _renderer(args, levels.at(changed.pop("complexity", levels.finest)), changed)

    own = build()
    most = args.samples or _SAMPLES
    settings = sweep(own.plan, most, available(), levels.coarser)
    study = Study(args.folder, build, _identity(args, levels.scene, own, most))
    skipped: list[str] = []
    try:
        with steps_bar("study") as progress:
            if args.reference:
                reference = study.take_reference(args.reference)
            else:
                reference = study.reference(most, args.budget, progress)
            seeds = range(args.seed, args.seed + args.pictures)
            share = None if args.budget is None else (1.0 if args.reference else 1.0 - REFERENCE_SHARE) * args.budget
            skipped = study.measure(settings, seeds, share, progress)
            progress(1.0, "fast and watertight rays")
            account = _account(args, own, levels, skipped, _leaks(study, levels.scene, args.device))
    except (Interrupted, KeyboardInterrupt):
        return interrupted(f"what was measured is in {args.folder}; the same command goes on")
    found = write_report(study, settings, reference, account)
    for row in sorted((row for row in found if row.best), key=lambda row: row.time):
        print(f"{row.time:9.4f} s  RMSE {row.rmse:.4g}  {row.setting}")
    left_out = f"; {len(skipped)} of {len(settings)} settings left out or cut short by --budget" if skipped else ""
    what = "report.html" if found else "results.json"
    print(f"{args.folder}/{what}: {len(found)} settings, {len(study.measurements)} pictures{left_out}")
    return 0


class Levels:
    """The stage at the levels of subdivision that are studied.

    Without --complexity the study's own picture, and the reference, take the finest one: what coarser ones lose is
    an error like others.

    Attributes:
        finest: level of the study's own picture.
        coarser: levels that change the stage, the coarsest first.
        scene: at the finest level.
    """

    def __init__(self, args: argparse.Namespace) -> None:
        """Read the stage; raises what reading it raises."""
        self._args, self._scenes = args, {}
        self.finest = args.complexity or self._choose()
        self.scene = self.at(self.finest)
        below = COMPLEXITIES[: COMPLEXITIES.index(self.finest)]
        differ = bool(below) and _faces(self.at("low")) != _faces(self.scene)
        self.coarser = below[-2:] if differ else ()

    def at(self, level: str) -> Scene:
        """The scene at a level, read once."""
        from .request import open_stage, times

        if level not in self._scenes:
            args = argparse.Namespace(**{**vars(self._args), "complexity": level})
            self._scenes[level] = open_stage(args).read(times(args)[0])
        return self._scenes[level]

    def _choose(self) -> str:
        """High, unless subdivision changes nothing or makes too much of it."""
        if _faces(self.at("low")) == _faces(self.at("medium")):
            return "low"
        return "high" if _faces(self.at("medium")) <= _MOST_FACES else "medium"


def _leaks(study: Study, scene: Scene, device: str) -> Leaks | None:
    """What fast rays lose, measured once."""
    from ..study.leaks import Leaks, measure_leaks

    kept = study.kept.read_json("rays.json")
    if kept is None:
        found = measure_leaks(scene, device)
        kept = {} if found is None else asdict(found)
        study.kept.write_json("rays.json", kept)
    return Leaks(**kept) if kept else None


def _account(
    args: argparse.Namespace, own: Renderer, levels: Levels, skipped: list[str], leaks: Leaks | None
) -> Account:
    """What the report says besides its figures."""
    from ..study.report import Account, machine, packages

    name = Path(args.stage).name
    width, height = own.resolution
    asked = {
        "stage": args.stage,
        "picture": f"{width}×{height} pixels, camera {args.camera or 'as the stage chooses'}",
        "usual way": f"transport {own.plan.transport}, sampler {own.request.sampler}, complexity {levels.finest}",
        "pictures": f"{args.pictures} of different seeds for each setting",
    }
    command = shlex.join(["warprender", *args.typed])
    return Account(
        f"What accuracy costs: {name}",
        name,
        command,
        asked,
        f"sampler {own.request.sampler}",
        args.clock,
        skipped,
        leaks,
        machine(args.device, own.threads),
        packages(),
    )


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
    """Remarks on flags of pictures that a study sets itself."""
    names = [name for name in ("error", "seconds") if getattr(args, name) is not None]
    lines = [f"--{name}: a study sets it itself; --samples and --budget bound it" for name in names]
    lines += [f"--{name}: a study tries it with and without" for name in ("denoise", "adaptive") if getattr(args, name)]
    lines += ["--aov: a study is of color alone"] if args.aov else []
    more = args.frames is not None and len(list(args.frames.times)) > 1
    return [*lines, *(["--frames: a study is of one picture, the first"] if more else [])]


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


def _identity(args: argparse.Namespace, scene: Scene, own: Renderer, most: int) -> dict:
    """What must be the same for measurements to belong together, by the flag's name where there is one."""
    from ..receipt import file_hash
    from ..study.report import machine

    asked = {name: value for name, value in asdict(own.request).items() if name != "outputs"}
    return {
        "stage": scene.source,
        "stage's contents": [file_hash(scene.source), *(file_hash(path) for path in scene.layers)],
        "way of reading it": scene.loading,
        "resolution": list(own.resolution),
        "--camera": args.camera,
        "--samples": most,
        **{f"--{_FLAGS.get(name, name)}": value for name, value in asked.items()},
        **machine(args.device, own.threads),
    }
