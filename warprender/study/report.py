"""What a study found: report.html, one file with everything in it, and the same figures as CSV and JSON."""

from __future__ import annotations

import base64
import csv
import json
from collections.abc import Sequence
from dataclasses import asdict, fields
from html import escape
from pathlib import Path

import numpy as np

from . import plots
from .analysis import Row, is_biased, rows, sampler_slopes
from .measure import Reference, Study
from .settings import TOGETHER, Setting

_STYLE = """body { font: 15px/1.45 sans-serif; max-width: 62em; margin: 2em auto; padding: 0 1em; color: #222 }
table { border-collapse: collapse; font-size: 13px } td, th { padding: 2px 8px; text-align: right }
td:first-child, th:first-child { text-align: left } tr:nth-child(even) { background: #f3f3f3 }
.best td { font-weight: bold } img { image-rendering: pixelated } figure { display: inline-block; margin: 4px }
figcaption { font-size: 12px }"""

_COLUMNS = (
    "setting", "pictures", "seconds", "spread", "rays", "RMSE", "relative MSE", "FLIP", "bias", "deviation", "1/(MSE·s)"
)  # fmt: skip


def write_report(
    study: Study, settings: Sequence[Setting], reference: Reference, title: str, skipped: Sequence[str]
) -> list[Row]:
    """Write report.html, results.csv and results.json into the study's folder; returns the rows."""
    found = rows(study, settings, reference)
    slopes = sampler_slopes(study, settings, reference)
    _write_csv(study.folder / "results.csv", found)
    values = {
        "reference": {"origin": reference.origin, "variance": reference.variance},
        "slopes": {name: {"slope": s, "half width of 95 %": h} for name, (s, h) in slopes.items()},
        "settings": [{**asdict(row), "biased": is_biased(row)} for row in found],
        "left out": list(skipped),
    }
    (study.folder / "results.json").write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")
    if found:
        page = _page(study, found, slopes, reference, title, skipped)
        (study.folder / "report.html").write_text(page, encoding="utf-8")
    return found


def _write_csv(path: Path, found: Sequence[Row]) -> None:
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Row)])
        writer.writeheader()
        writer.writerows(asdict(row) for row in found)


def _page(
    study: Study,
    found: Sequence[Row],
    slopes: dict[str, tuple[float, float]],
    reference: Reference,
    title: str,
    skipped: Sequence[str],
) -> str:
    noise = f", whose own RMS error is {np.sqrt(reference.variance):.2g}" if reference.variance else ""
    usual = f"{found[0].knob} {found[0].value}"
    parts = [
        f"<h1>{escape(title)}</h1>",
        f"<p>Reference: {escape(reference.origin)}{noise}. Errors are of linear colour. Seconds are of sampling (and "
        "denoising) alone: median over the pictures, and (largest − smallest) over it. Bias has the noise taken off; "
        "in brackets where chance explains it (below three standard errors). Bold: nothing measured is both quicker "
        "and closer.</p>",
        "<h2>Error over time</h2>",
        _image(plots.best_over_time(found)),
        "<p>Below, a panel for each knob: its curves in colour, every other setting in light grey, the usual one in "
        "dark grey, the Pareto front dashed. The further down and to the left, the better.</p>",
        _image(plots.error_over_time(found, usual)),
        "<h2>Error over samples</h2>",
        _image(plots.error_over_samples(found, slopes)),
        "<p>Independent samples have slope −0.5. ± is half of a 95 % confidence interval.</p>",
        _best(found),
    ]
    if any(row.deviation is not None for row in found):
        parts += ["<h2>Bias and variance apart</h2>", _image(plots.bias_beside_deviation(found))]
    if skipped:
        parts.append(f"<p>Left out for lack of time, wholly or in part: {escape(', '.join(skipped))}.</p>")
    parts += ["<h2>Every setting</h2>", _table(found)]
    parts += ["<h2>Pictures</h2>", _pictures(study, found, reference)]
    body = "\n".join(parts)
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f"<style>{_STYLE}</style></head>\n<body>\n{body}\n</body></html>\n"
    )


def _best(found: Sequence[Row]) -> str:
    """The Pareto front in words, the quickest first."""
    front = sorted((row for row in found if row.best), key=lambda row: row.seconds)
    lines = [f"<li>{row.seconds:.3g} s: RMSE {row.rmse:.3g} by {escape(row.setting)}</li>" for row in front]
    return "<h2>What each second buys</h2>\n<ul>" + "\n".join(lines) + "</ul>"


def _table(found: Sequence[Row]) -> str:
    lines = ["<table><tr>" + "".join(f"<th>{name}</th>" for name in _COLUMNS) + "</tr>"]
    for row in found:
        bias = "" if row.bias is None else f"{row.bias:.2g}" if is_biased(row) else f"({row.bias:.2g})"
        cells = (
            row.setting, row.pictures, f"{row.seconds:.3g}", f"{100 * row.spread:.0f} %", f"{row.rays:.3g}",
            f"{row.rmse:.3g}", f"{row.relative_mse:.3g}", "" if row.flip is None else f"{row.flip:.3g}", bias,
            "" if row.deviation is None else f"{row.deviation:.2g}", f"{row.efficiency:.3g}",
        )  # fmt: skip
        mark = ' class="best"' if row.best else ""
        lines.append(f"<tr{mark}>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in cells) + "</tr>")
    return "\n".join([*lines, "</table>"])


def _pictures(study: Study, found: Sequence[Row], reference: Reference) -> str:
    """The reference, and of each curve its best picture, where it is worst, and its error map."""
    single = [row for row in found if row.knob != TOGETHER or row.best]
    last = {f"{row.knob} {row.value}": row for row in sorted(single, key=lambda r: r.samples)}
    parts = [_figure(plots.shown(reference.color), "reference")]
    for row in last.values():
        seed = next(m.seed for m in study.measurements if m.setting == row.setting)
        color = study.picture(row.setting, seed).astype(np.float64)
        crop = plots.worst_corner(color, reference.color)
        parts += [
            "<div>",
            _figure(plots.shown(color), row.setting),
            _figure(plots.error_map(color, reference.color), "relative error, white from 1 on"),
            _figure(plots.zoomed(color, crop), "where it differs most"),
            _figure(plots.zoomed(reference.color, crop), "the same of the reference"),
            "</div>",
        ]
    return "\n".join(parts)


def _figure(png: bytes, caption: str) -> str:
    return f"<figure>{_image(png)}<figcaption>{escape(caption)}</figcaption></figure>"


def _image(png: bytes) -> str:
    return f'<img alt="" src="data:image/png;base64,{base64.b64encode(png).decode("ascii")}">'
