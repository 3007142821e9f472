"""What a study found, as figures: results.csv and results.json; `page` makes report.html of the same."""

from __future__ import annotations

import csv
import json
import os
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

from ..receipt import versions
from .analysis import Row, rows, sampler_slopes
from .kept import Reference
from .leaks import Leaks
from .measure import Study
from .page import page
from .settings import Setting

#: Packages that a report depends on beyond those of pictures.
_PACKAGES = ("matplotlib", "flip-evaluator", "pyoidn")


@dataclass(frozen=True)
class Account:
    """What a report says besides its figures.

    Attributes:
        title: of the page.
        stage: name of the file.
        command: that makes the same study.
        asked: what the picture is: flag or word to value.
        usual: the curve to compare with, as "sampler sobol".
        clock: of `analysis.CLOCKS`: what time goes by.
        skipped: names of settings that were left out for lack of time.
        leaks: of fast rays, None where they were not measured.
        machine: what it ran on, by name.
        packages: version by package.
    """

    title: str
    stage: str
    command: str
    asked: dict[str, str]
    usual: str
    clock: str
    skipped: Sequence[str] = ()
    leaks: Leaks | None = None
    machine: dict[str, str] = field(default_factory=dict)
    packages: dict[str, str] = field(default_factory=dict)


def machine(device: str, threads: int) -> dict[str, str]:
    """What measurements depend on: processor, system, device and threads."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = info.read_text(errors="replace").splitlines()
        name = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), name)
    return {
        "processor": name,
        "cores": str(os.cpu_count()),
        "system": f"{platform.system()} {platform.machine()}, Python {platform.python_version()}",
        "device": device,
        "threads": str(threads),
    }


def packages() -> dict[str, str]:
    """Version of each package that is installed."""
    return {name: found for name, found in versions(*_PACKAGES).items() if found}


def write_report(study: Study, settings: Sequence[Setting], reference: Reference, account: Account) -> list[Row]:
    """Write report.html, results.csv and results.json into the study's folder; returns the rows."""
    found = rows(study, settings, reference, account.clock)
    slopes = sampler_slopes(study, settings, reference)
    _write_csv(study.folder / "results.csv", found)
    values = {
        **{name: getattr(account, name) for name in ("stage", "command", "asked", "clock", "machine", "packages")},
        "reference": {"origin": reference.origin, "variance": reference.variance},
        "slopes": {name: {"slope": s, "half width of 95 %": h} for name, (s, h) in slopes.items()},
        "fast rays": None if account.leaks is None else asdict(account.leaks),
        "settings": [asdict(row) for row in found],
        "left out": list(account.skipped),
    }
    text = json.dumps(values, indent=2, allow_nan=False)
    (study.folder / "results.json").write_text(text + "\n", encoding="utf-8")
    if found:
        text = page(study, found, slopes, reference, account)
        (study.folder / "report.html").write_text(text, encoding="utf-8")
    return found


def _write_csv(path: Path, found: Sequence[Row]) -> None:
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Row)])
        writer.writeheader()
        writer.writerows(asdict(row) for row in found)
