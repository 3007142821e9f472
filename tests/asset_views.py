"""Which pictures to take of the assets, and the reference pictures to put beside them."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

STAGES = (".usda", ".usdc", ".usd", ".usdz")
PICTURES = (".png", ".jpg", ".jpeg", ".webp")

#: A row of a README's table: its cells without the backticks.
_ROW = re.compile(r"^\|(.+)\|\s*$", re.MULTILINE)


@dataclass
class View:
    """One picture of one stage.

    Attributes:
        stage: path below the folder of all assets.
        time: time code, None for the stage's own.
        camera: path or name of a camera, None for the usual choice.
        complexity: usdrecord's.
        references: pictures to compare with, below the folder of all assets.
        first_camera: whether the stage's first camera is taken where none is named.
        remark: how the references were made.
    """

    stage: str
    time: float | None = None
    camera: str | None = None
    complexity: float = 1.0
    references: tuple[str, ...] = ()
    first_camera: bool = False
    remark: str = ""

    @property
    def name(self) -> str:
        """A file name without extension, unique among the views."""
        name = self.stage.replace("/", "-")
        if self.time is not None:
            name += f"@{self.time:g}"
        return name if self.complexity == 1.0 else f"{name}~{self.complexity:g}"


def find_views(assets: Path) -> list[View]:
    """Every stage once, those whose references differ in time or complexity once for each."""
    known: dict[str, dict[str, View]] = {}
    for view in (*_baselines(assets), *_arnold(assets), *_others(assets)):
        same = known.setdefault(view.stage, {}).setdefault(view.name, view)
        same.references = tuple(dict.fromkeys(same.references + view.references))
    views: list[View] = []
    for path in sorted(p for p in assets.rglob("*") if p.suffix in STAGES):
        stage = str(path.relative_to(assets))
        views += known.get(stage, {}).values() or [View(stage, references=_near(path, assets))]
    return views


def _near(stage: Path, assets: Path) -> tuple[str, ...]:
    """Pictures in a folder `reference` or `baseline` beside a stage; those of its name, if there are any."""
    pictures = [p for f in ("reference", "baseline") for p in sorted((stage.parent / f).glob("*"))]
    pictures = [p for p in pictures if p.suffix in PICTURES]
    named = [p for p in pictures if stage.stem.lower() in p.stem.lower()]
    return tuple(str(p.relative_to(assets)) for p in (named or pictures)[:6])


def _others(assets: Path) -> list[View]:
    """Views whose flags stand in no table."""
    folder = "openusd_baselines"
    views = [
        View(
            f"{folder}/RecordTest/AnimCube.usda",
            time,
            "main_cam",
            references=(f"{folder}/RecordTest/baseline/AnimCube.{time}.png",),
        )
        for time in (1, 5, 10)
    ]
    views += [
        View(
            f"{folder}/SkelSkinning/test_{short}.usda",
            time,
            references=tuple(
                f"{folder}/SkelSkinning/baseline/{long}Skinning_{by}_{time:03}.png" for by in ("Embree", "Storm")
            ),
        )
        for short, long in (("lbs", "LB"), ("dqs", "DQ"))
        for time in (31, 91)
    ]
    return [view for view in views if (assets / view.stage).exists()]


def _rows(readme: Path) -> list[list[str]]:
    if not readme.exists():
        return []
    return [[cell.strip().strip("`") for cell in row.split("|")] for row in _ROW.findall(readme.read_text())]


def _arnold(assets: Path) -> list[View]:
    folder = "arnold_regression"
    views = []
    for test, scene, frame, what in (r for r in _rows(assets / folder / "README.md") if len(r) == 4):
        if (assets / folder / test).is_dir():
            reference = f"{folder}/{test}/reference.png"
            stage, time = f"{folder}/{test}/{scene}", float(frame) if frame else None
            views.append(View(stage, time, references=(reference,), first_camera=True, remark=what))
    return views


def _baselines(assets: Path) -> list[View]:
    """The rows of OpenUSD's baselines: flags of its test application, and the pictures that they gave."""
    folder = "openusd_baselines"
    views = []
    for test, flags, pictures in (r for r in _rows(assets / folder / "README.md") if len(r) == 3):
        group = test.split("/")[0]
        if (assets / folder / group).is_dir() and "-stage" in flags:
            views += _baseline_views(f"{folder}/{group}", flags, pictures.split(", "))
    return views


def _baseline_views(folder: str, flags: str, pictures: list[str]) -> list[View]:
    options = _options(flags)
    times = [float(t) for t in options.get("times", [])] or [None]
    levels = [float(c) for c in options.get("complexities", options.get("complexity", ["1.0"]))]
    choices = [(time, level) for level in levels for time in times]
    return [
        View(
            f"{folder}/{options['stage'][0]}",
            time,
            next(iter(options.get("camera", [])), None),
            level,
            (f"{folder}/baseline/{picture}",),
            remark=flags,
        )
        for (time, level), picture in zip(choices, pictures, strict=False)
    ]


def _options(flags: str) -> dict[str, list[str]]:
    """Flag to its values; a negative number is a value."""
    options: dict[str, list[str]] = {}
    name = ""
    for word in shlex.split(flags):
        if re.match(r"-+[a-zA-Z]", word):
            name = word.lstrip("-")
            options[name] = []
        elif name:
            options[name].append(word)
    return options
