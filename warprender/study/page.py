"""report.html of a study: one file with everything in it, for wide and narrow windows."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from . import crops, plots
from .analysis import Row
from .kept import Reference
from .measure import Study
from .settings import ASKED, TOGETHER

if TYPE_CHECKING:
    from .report import Account

_STYLE = """body { font: 15px/1.5 system-ui, sans-serif; max-width: 68em; margin: 2em auto; padding: 0 1em; color: #222;
  background: #fff } h2 { margin-top: 2em } h3 { margin: 1.5em 0 0.3em; font-size: 1em }
figure { margin: 0; min-width: 0 } figcaption { font-size: 13px; color: #444; overflow-wrap: anywhere }
img { max-width: 100%; height: auto } .plot img { width: 100% }
.wide img { min-width: 38em }
.panels { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 22em), 1fr)); gap: 1.5em }
.views { display: grid; grid-template-columns: repeat(5, minmax(0, 13em)); gap: 0.8em }
@media (max-width: 40em) { .views { grid-template-columns: repeat(2, minmax(0, 1fr)) } }
.single { max-width: 34em }
.views img { image-rendering: pixelated; width: 100%; display: block }
.scroll { overflow-x: auto; margin: 1em 0 } table { border-collapse: collapse; font-size: 13px; white-space: nowrap }
td, th { padding: 2px 8px; text-align: right } td:first-child, th:first-child { text-align: left }
tbody tr:nth-child(even) { background: #f3f3f3 } .best td { font-weight: bold }
.front td:nth-child(2), .front th:nth-child(2) { text-align: left }
dl { display: grid; grid-template-columns: max-content minmax(0, 1fr); gap: 0.1em 1em; font-size: 14px }
dt { color: #555 } dd { margin: 0; overflow-wrap: anywhere }
.words { white-space: normal } .words td, .words th { text-align: left; vertical-align: top; min-width: 7em }
.words td:first-child, .words th:first-child { min-width: 0 }
.scale { height: 0.8em; max-width: 13em }"""

_COLUMNS = {
    "setting": "knob, its value, and samples a pixel at most",
    "pictures": "of different seeds",
    "seconds": "by the clock, median over the pictures",
    "spread": "of the seconds: (largest − smallest) / median",
    "processor s": "seconds of all threads together, median",
    "rays": "of a picture, of all kinds",
    "RMSE": "root of the mean squared difference from the reference, linear color",
    "rel. MSE": "mean of squared difference / (squared reference + 0.01)",
    "FLIP": "difference that a person sees when the pictures alternate, 0 to 1",
    "bias": "RMS over pixels of mean picture − reference, noise taken off; in brackets where chance explains it",
    "deviation": "RMS standard deviation of a pixel from picture to picture",
    "1/(MSE·s)": "efficiency",
}


def page(
    study: Study, found: Sequence[Row], slopes: dict[str, tuple[float, float]], reference: Reference, account: Account
) -> str:
    """The whole page; `slopes` are of the samplers, with half of their 95 % confidence intervals."""
    seconds = "processor seconds" if account.clock == "processor" else "seconds"
    parts = [
        *_summary(study, found, reference, account),
        *_front(found, seconds),
        *_knobs(found, account.usual, seconds),
        *_samples(found, slopes),
        *_bias(found),
        *_rays(account),
        "<h2>Pictures</h2>",
        *_pictures(study, found, reference),
        *_table(found),
        *_measured(reference, account),
    ]
    return document(account.title, parts)


def document(title: str, parts: Sequence[str]) -> str:
    """A whole page of parts in HTML, with the style of all reports."""
    head = '<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
    return (
        f'<!doctype html>\n<html lang="en"><head>{head}<title>{escape(title)}</title>'
        f"<style>{_STYLE}</style></head>\n<body><main>\n<h1>{escape(title)}</h1>\n"
        + "\n".join(parts)
        + "\n</main></body></html>\n"
    )


def _summary(study: Study, found: Sequence[Row], reference: Reference, account: Account) -> Iterator[str]:
    height, width = reference.color.shape[:2]
    yield (
        f"<p>{len(found)} ways to render {escape(account.stage)} at {width}×{height} pixels, "
        f"{len(study.measurements)} pictures in all, each compared with a reference: {escape(reference.origin)}"
        f"{_noise(reference)}. Errors are of linear color.</p>"
    )
    measured = {row.setting for row in found}
    wholly = [name for name in account.skipped if name not in measured]
    if account.skipped:
        fewer = len(account.skipped) - len(wholly)
        yield f"<p>For lack of time {len(wholly)} settings were left out; {fewer} have fewer pictures than asked.</p>"
    if wholly:
        yield f"<details><summary>Left out</summary>{escape('; '.join(wholly))}</details>"


def _noise(reference: Reference) -> str:
    return f", whose own RMS error is {np.sqrt(reference.variance):.2g}" if reference.variance else ""


def _front(found: Sequence[Row], seconds: str) -> Iterator[str]:
    """The overview, and the Pareto front as a table with the plot's numbers."""
    yield "<h2>What each second buys</h2>"
    best = plots.front(found)
    words = (
        f"RMSE over {seconds} of every setting, both axes logarithmic; down and to the left is better. The dashed "
        "line is the Pareto front: nothing measured is both quicker and closer than its numbered settings, which the "
        "table names."
    )
    yield _plot(plots.best_over_time(found, seconds), words, wide=True)
    heads = ("", "setting", seconds, "RMSE", "FLIP", "bias")
    lines = [
        (str(number), row.setting, f"{row.time:.3g}", f"{row.rmse:.3g}", _number(row.flip), _bias_of(row))
        for number, row in enumerate(best, 1)
    ]
    yield rows(heads, lines, kind="front")


def _knobs(found: Sequence[Row], usual: str, seconds: str) -> Iterator[str]:
    """A panel for each knob, with what it shows in words."""
    yield "<h2>One knob at a time, and some together</h2>"
    yield (
        f"<p>In each panel the knob's curves stand over all other settings in light grey; {escape(usual)}, the usual "
        "way, is the thick grey line. Along a curve the number of samples grows fourfold from point to point.</p>"
    )
    yield '<div class="panels">'
    for knob in dict.fromkeys(row.knob for row in found):
        plot = plots.knob_over_time(found, knob, usual, seconds)
        yield _plot(plot, f"{knob}: {knob_in_words(found, knob, usual)}", f"RMSE over {seconds}, both logarithmic, by ")
    yield "</div>"


def knob_in_words(found: Sequence[Row], knob: str, usual: str) -> str:
    """What turning a knob does, at the most samples: error and time in those of the usual setting."""
    curves = plots.curves(found)
    basis = curves.get(usual, [found[0]])[-1]
    if knob == ASKED:
        said = [f"{row.value} took {row.samples:.3g} samples and {row.time:.3g} s" for row in curves[ASKED]]
        return f"of relative errors that were asked for, {'; '.join(said)}."
    said = []
    for curve in plots.curves([row for row in found if row.knob == knob]).values():
        row = curve[-1]
        if row is basis:
            said.append(f"{row.value} is the usual one")
            continue
        error, taken = row.rmse / basis.rmse, row.time / basis.time
        words = f"{row.value}: {error:.2g} × the error, {taken:.2g} × the time{', biased' if row.biased else ''}"
        said.append(words)
    return f"at {basis.samples:g} samples, beside {usual}: {'; '.join(said)}."


def _samples(found: Sequence[Row], slopes: dict[str, tuple[float, float]]) -> Iterator[str]:
    yield "<h2>Error over samples</h2>"
    fitted = "; ".join(f"{name} {s:.2f} ± {h:.2f}" for name, (s, h) in slopes.items())
    words = f"Fitted slopes with 95 % confidence intervals: {fitted}. " if fitted else ""
    words += "Independent samples have slope −0.5: four times as many halve the error."
    yield f'<div class="single">{_plot(plots.error_over_samples(found, slopes), words)}</div>'


def _bias(found: Sequence[Row]) -> Iterator[str]:
    """Each curve at its most samples."""
    last = [curve[-1] for curve in plots.curves(found).values()]
    last = [row for row in last if row.deviation is not None]
    if last:
        yield "<h2>Bias and noise apart</h2>"
        biased = [f"{row.knob} {row.value}" for row in last if row.biased]
        words = (
            "Standard deviation of a pixel from picture to picture, which more samples bring down, and bias, which "
            f"they do not; each curve at its most samples. Biased beyond chance: {', '.join(biased) or 'none'}."
        )
        yield _plot(plots.bias_beside_deviation(last), words, wide=True)


def _rays(account: Account) -> Iterator[str]:
    if account.leaks is not None:
        yield "<h2>Fast and watertight rays</h2>"
        yield (
            f"<p>Fast rays are Warp's own query, <code>wp.mesh_query_ray</code>. {escape(account.leaks.words())} "
            "The panel “rays” above has what they do to pictures.</p>"
        )


def _pictures(study: Study, found: Sequence[Row], reference: Reference) -> Iterator[str]:
    """Of each curve its picture of the most samples and its error map, and where it is worst, beside the reference."""
    whole = plots.curves([row for row in found if row.knob != TOGETHER or row.best])
    yield (
        "<p>Each curve at its most samples. The error map shows the relative difference, from 0 (black) to 1 and "
        "beyond; the crops are where picture and reference differ most.</p>"
        '<div class="scale" role="img" aria-label="Colors of the error maps from 0 to 1" '
        f'style="background: linear-gradient(90deg, {", ".join(_scale())})"></div>'
        '<p style="max-width: 13em; display: flex; justify-content: space-between; margin: 0"><span>0</span>'
        "<span>≥ 1</span></p>"
    )
    for row in (curve[-1] for curve in whole.values()):
        seed = next(m.seed for m in study.measurements if m.setting == row.setting)
        color = study.picture(row.setting, seed).astype(np.float64)
        crop = crops.worst_corner(color, reference.color)
        place = f"x {crop[1].start}…{crop[1].stop - 1}, y {crop[0].start}…{crop[0].stop - 1}"
        flip = "" if row.flip is None else f", FLIP {row.flip:.3g}"
        yield f'<h3>{escape(row.setting)}: RMSE {row.rmse:.3g}{flip}, {row.time:.3g} s</h3><div class="views">'
        yield _figure(crops.shown(color), "picture", f"{row.setting}: the picture")
        yield _figure(crops.shown(reference.color), "reference", "The reference")
        yield _figure(crops.error_map(color, reference.color), "error map", f"{row.setting}: map of relative errors")
        yield _figure(crops.shown(color[crop]), f"picture, {place}", f"{row.setting}: crop where it differs most")
        yield _figure(crops.shown(reference.color[crop]), "reference, the same", "The same crop of the reference")
        yield "</div>"


def _table(found: Sequence[Row]) -> Iterator[str]:
    yield "<h2>Every setting</h2>"
    yield "<p>Bold: on the Pareto front.</p>"
    lines = [
        (
            row.setting, str(row.pictures), f"{row.seconds:.3g}", f"{100 * row.spread:.0f} %",
            f"{row.processor_seconds:.3g}", f"{row.rays:.3g}", f"{row.rmse:.3g}", f"{row.relative_mse:.3g}",
            _number(row.flip), _bias_of(row), _number(row.deviation), _number(row.efficiency),
        )
        for row in found
    ]  # fmt: skip
    yield rows(tuple(_COLUMNS), lines, [row.best for row in found])
    yield "<dl>" + "".join(f"<dt>{escape(k)}</dt><dd>{escape(v)}</dd>" for k, v in _COLUMNS.items()) + "</dl>"


def _measured(reference: Reference, account: Account) -> Iterator[str]:
    """What was asked for, and what it ran on."""
    yield "<h2>How it was measured</h2>"
    clock = (
        "processor seconds: those of all threads together, which other work on the machine disturbs least"
        if account.clock == "processor"
        else "seconds by the clock"
    )
    yield (
        f"<p>Plots and efficiency go by {clock}: of sampling, with denoising and what guides it where there is any, "
        "without reading, compiling and writing. Settings take turns, one picture each, before the next seed. The "
        "noise of the reference is taken off bias and slopes, not off RMSE. A bias is called one from three standard "
        "errors on. Transport none is not among the settings, since it draws no color.</p>"
    )
    facts = {
        "command": account.command,
        "reference": reference.origin + _noise(reference),
        **account.asked,
        **account.machine,
        "versions": ", ".join(f"{name} {version}" for name, version in account.packages.items()),
    }
    yield "<dl>" + "".join(f"<dt>{escape(k)}</dt><dd>{escape(v)}</dd>" for k, v in facts.items()) + "</dl>"


def rows(heads: Sequence[str], lines: Sequence[Sequence[str]], bold: Sequence[bool] = (), kind: str = "") -> str:
    """A table that scrolls where the window is narrow.

    Args:
        heads: of the columns.
        lines: cells, in which backquotes mark code.
        bold: which lines are.
        kind: class of the table: "front", "words" or none.
    """
    marks = [' class="best"' if best else "" for best in bold] or [""] * len(lines)
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in heads)
    body = "\n".join(
        f"<tr{mark}>" + "".join(f"<td>{_inline(cell)}</td>" for cell in line) + "</tr>"
        for mark, line in zip(marks, lines, strict=True)
    )
    return (
        f'<div class="scroll" tabindex="0"><table class="{kind}"><thead><tr>{head}</tr></thead>\n'
        f"<tbody>{body}</tbody></table></div>"
    )


def _inline(text: str) -> str:
    """Escaped, with what stands in backquotes as code."""
    parts = escape(text).split("`")
    return "".join(f"<code>{part}</code>" if number % 2 else part for number, part in enumerate(parts))


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"


def _bias_of(row: Row) -> str:
    return "" if row.bias is None else f"{row.bias:.2g}" if row.biased else f"({row.bias:.2g})"


def _plot(svg: bytes, words: str, before: str = "Plot: ", wide: bool = False) -> str:
    """A plot with a caption; a wide one scrolls where the window is narrow."""
    source = f"data:image/svg+xml;base64,{base64.b64encode(svg).decode('ascii')}"
    alt = escape(before + words, quote=True)
    image = f'<img alt="{alt}" src="{source}">'
    image = f'<div class="wide scroll" tabindex="0">{image}</div>' if wide else image
    return f'<figure class="plot">{image}<figcaption>{escape(words)}</figcaption></figure>'


def _figure(png: bytes, caption: str, alt: str) -> str:
    source = f"data:image/png;base64,{base64.b64encode(png).decode('ascii')}"
    image = f'<img alt="{escape(alt, quote=True)}" src="{source}">'
    return f"<figure>{image}<figcaption>{escape(caption)}</figcaption></figure>"


def _scale() -> list[str]:
    """Colors of the error maps from 0 to 1, for a gradient."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return [to_hex(colormaps[crops.MAP_COLORS](x)) for x in np.linspace(0.0, 1.0, 9)]
