"""The plots of a report, by matplotlib, as SVG."""

from __future__ import annotations

import io
from collections.abc import Sequence
from importlib.util import find_spec

import numpy as np

from .analysis import Row
from .settings import ASKED

MISSING = 'a report needs the package matplotlib: pip install "warprender[study]"'

#: Inches of a panel, and of the plots that take the page's width.
_PANEL, _WIDE = (4.4, 3.6), (8.6, 4.8)
#: One for each curve, so that curves are told apart without their colours.
_MARKERS = "osD^vPX*<>hp"
_FRONT = {"color": "black", "linestyle": "--", "linewidth": 1.0}


def check_available() -> None:
    """Raise ValueError, in one line, where matplotlib is not installed."""
    if find_spec("matplotlib") is None:
        raise ValueError(MISSING)


def label(row: Row) -> str:
    """Name of the curve that a row is on: errors that were asked for are one curve, each a point."""
    return row.knob if row.knob == ASKED else f"{row.knob} {row.value}"


def curves(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Rows by curve, by rising numbers of samples."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(label(row), []).append(row)
    return {name: sorted(curve, key=lambda r: r.samples) for name, curve in found.items()}


def front(rows: Sequence[Row]) -> list[Row]:
    """The Pareto front, the quickest first."""
    return sorted((row for row in rows if row.best), key=lambda row: row.time)


def best_over_time(rows: Sequence[Row], seconds: str) -> bytes:
    """RMSE over time of every setting, a marker for each knob; the Pareto front is numbered."""
    figure, axes = _figure(_WIDE, seconds, "RMSE of linear color")
    for marker, knob in zip(_MARKERS, dict.fromkeys(row.knob for row in rows), strict=False):
        points = [row for row in rows if row.knob == knob]
        style = {"marker": marker, "linestyle": "none", "markersize": 5, "alpha": 0.7}
        axes.plot([r.time for r in points], [r.rmse for r in points], label=knob, **style)
    best = front(rows)
    axes.plot([r.time for r in best], [r.rmse for r in best], label="Pareto front", **_FRONT)
    for number, row in enumerate(best, 1):
        place = {"xytext": (-5, -5), "textcoords": "offset points", "ha": "right", "va": "top"}
        axes.annotate(str(number), (row.time, row.rmse), fontsize=8, fontweight="bold", **place)
    figure.legend(loc="outside right upper", fontsize=8)
    return _svg(figure)


def knob_over_time(rows: Sequence[Row], knob: str, usual: str, seconds: str) -> bytes:
    """RMSE over time of one knob's curves, over all other settings in grey, the front and the usual curve."""
    figure, axes = _figure(_PANEL, seconds, "RMSE of linear color")
    axes.set_title(knob, fontsize=11)
    axes.plot([r.time for r in rows], [r.rmse for r in rows], ".", color="0.85", markersize=4, zorder=0)
    best, compared = front(rows), curves(rows).get(usual, [])
    axes.plot([r.time for r in best], [r.rmse for r in best], label="Pareto front", **_FRONT)
    own = curves([r for r in rows if r.knob == knob])
    if usual not in own:
        axes.plot([r.time for r in compared], [r.rmse for r in compared], "-", color="0.45", lw=2.5, label=usual)
    for marker, (name, curve) in zip(_MARKERS, own.items(), strict=False):
        style = {"label": name.removeprefix(f"{knob} "), "marker": marker, "markersize": 4, "linewidth": 1}
        axes.plot([r.time for r in curve], [r.rmse for r in curve], **style)
    figure.legend(loc="outside lower center", fontsize=7, ncols=2)
    return _svg(figure)


def error_over_samples(rows: Sequence[Row], slopes: dict[str, tuple[float, float]]) -> bytes:
    """RMSE over samples of each sampler, with the slope that was fitted, and the slope of independent samples."""
    figure, axes = _figure(_PANEL, "samples a pixel", "RMSE of linear color")
    samplers = curves([r for r in rows if r.knob == "sampler"])
    for marker, curve in zip(_MARKERS, samplers.values(), strict=False):
        found = slopes.get(curve[0].value)
        fitted = f": slope {found[0]:.2f} ± {found[1]:.2f}" if found else ""
        axes.plot([r.samples for r in curve], [r.rmse for r in curve], marker=marker, label=f"{curve[0].value}{fitted}")
    counts = sorted({r.samples for curve in samplers.values() for r in curve})
    first = max((curve[0] for curve in samplers.values()), key=lambda r: r.rmse)
    line = [1.3 * first.rmse * (n / first.samples) ** -0.5 for n in counts]
    axes.plot(counts, line, color="0.6", linestyle=":", label="slope −0.5")
    axes.set_xticks(counts, [f"{n:g}" for n in counts])
    axes.set_xticks([], minor=True)
    figure.legend(loc="outside lower center", fontsize=8, ncols=1)
    return _svg(figure)


def bias_beside_deviation(rows: Sequence[Row]) -> bytes:
    """Bias and standard deviation of each row, from left to right on a logarithmic axis; pale where chance explains it.

    Args:
        rows: of two or more pictures.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDE[0], 1.2 + 0.3 * len(rows)), layout="constrained")
    axes, place = figure.subplots(), np.arange(len(rows))
    axes.plot([r.deviation or np.nan for r in rows], place - 0.12, "o", color="tab:blue", label="standard deviation")
    for sure, name in ((True, "bias"), (False, "bias that chance explains")):
        marked = [r.bias if r.bias and r.biased is sure else np.nan for r in rows]
        fill = "tab:red" if sure else "none"
        axes.plot(marked, place + 0.12, "D", color="tab:red", markerfacecolor=fill, label=name)
    axes.set_yticks(place, [r.setting for r in rows], fontsize=8)
    axes.set(xscale="log", xlabel="RMS over pixels, of linear color", ylim=(len(rows) - 0.5, -0.5))
    axes.grid(True, which="major", alpha=0.3)
    figure.legend(loc="outside upper center", fontsize=8, ncols=3)
    return _svg(figure)


def _figure(size: tuple[float, float], x: str, y: str):
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots()
    axes.set(xscale="log", yscale="log", xlabel=x, ylabel=y)
    axes.grid(True, which="major", alpha=0.3)
    axes.grid(True, which="minor", alpha=0.1)
    axes.tick_params(which="both", labelsize=8)
    return figure, axes


def _svg(figure) -> bytes:
    from matplotlib import rc_context

    file = io.BytesIO()
    # Without a date, so that equal plots are equal files.
    with rc_context({"svg.hashsalt": "warprender"}):
        figure.savefig(file, format="svg", metadata={"Date": None})
    return file.getvalue()
