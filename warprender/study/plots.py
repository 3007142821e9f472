"""The pictures of a report, as PNG bytes: plots by matplotlib, crops and error maps."""

from __future__ import annotations

import io
from collections.abc import Sequence
from importlib.util import find_spec

import numpy as np

from ..images import display_bytes
from .analysis import Row, is_biased
from .settings import ASKED

MISSING = 'a report needs the package matplotlib: pip install "warprender[study]"'

#: Pixels of a report's pictures to one of a crop.
_ZOOM = 6


def check_available() -> None:
    """Raise ValueError, in one line, where matplotlib is not installed."""
    if find_spec("matplotlib") is None:
        raise ValueError(MISSING)


def best_over_time(rows: Sequence[Row]) -> bytes:
    """RMSE over seconds of every setting, both logarithmic, a colour for each knob; the Pareto front has labels."""
    figure, axes = _figure("seconds", "RMSE", height=6.0)
    for knob in dict.fromkeys(row.knob for row in rows):
        points = [row for row in rows if row.knob == knob]
        axes.plot([r.seconds for r in points], [r.rmse for r in points], "o", label=knob, markersize=4, alpha=0.6)
    front = sorted((r for r in rows if r.best), key=lambda r: r.seconds)
    axes.plot([r.seconds for r in front], [r.rmse for r in front], "k--", label="Pareto front", linewidth=1.5)
    for row in front:
        axes.annotate(
            row.setting, (row.seconds, row.rmse), fontsize=6, rotation=30, xytext=(3, 3), textcoords="offset points"
        )
    return _finished(figure, axes)


def error_over_time(rows: Sequence[Row], usual: str) -> bytes:
    """The same, a panel for each knob: its curves over all other settings in grey, the front and the usual curve.

    Args:
        rows: every setting.
        usual: label of the curve to compare with, as "sampler sobol".
    """
    from matplotlib.figure import Figure

    knobs = list(dict.fromkeys(row.knob for row in rows))
    lines = -(-len(knobs) // 2)
    figure = Figure(figsize=(9, 3.2 * lines), layout="constrained")
    panels = figure.subplots(lines, 2, sharex=True, sharey=True, squeeze=False).ravel()
    front = sorted((r for r in rows if r.best), key=lambda r: r.seconds)
    compared = _curves(rows).get(usual, [])
    for axes, knob in zip(panels, knobs, strict=False):
        axes.plot([r.seconds for r in rows], [r.rmse for r in rows], ".", color="0.85", markersize=3, zorder=0)
        axes.plot([r.seconds for r in front], [r.rmse for r in front], "k--", linewidth=1, alpha=0.6)
        if knob != usual.split()[0]:
            axes.plot([r.seconds for r in compared], [r.rmse for r in compared], "-", color="0.4", label=usual)
        for label, curve in _curves([r for r in rows if r.knob == knob]).items():
            style = {"label": label.removeprefix(f"{knob} "), "markersize": 4, "linewidth": 1}
            axes.plot([r.seconds for r in curve], [r.rmse for r in curve], "o-", **style)
        axes.set(title=knob, xscale="log", yscale="log")
        axes.grid(True, which="major", alpha=0.25)
        axes.legend(fontsize=6, ncols=2)
    for axes in panels[len(knobs) :]:
        axes.set_axis_off()
    figure.supxlabel("seconds")
    figure.supylabel("RMSE")
    return _bytes(figure)


def error_over_samples(rows: Sequence[Row], slopes: dict[str, tuple[float, float]]) -> bytes:
    """RMSE over samples of each sampler, with the slope that was fitted."""
    figure, axes = _figure("samples a pixel", "RMSE")
    for label, curve in _curves([r for r in rows if r.knob == "sampler"]).items():
        found = slopes.get(curve[0].value)
        if found:
            label += f": slope {found[0]:.2f} ± {found[1]:.2f}"
        axes.plot([r.samples for r in curve], [r.rmse for r in curve], "o-", label=label)
    return _finished(figure, axes)


def bias_beside_deviation(rows: Sequence[Row]) -> bytes:
    """Bias and standard deviation of each setting; bias that chance explains is pale."""
    rows = [r for r in rows if r.deviation is not None]
    figure, axes = _figure("RMS over pixels", "", height=1.0 + 0.22 * len(rows), logarithmic=False)
    place = np.arange(len(rows))
    axes.barh(place - 0.2, [r.deviation for r in rows], 0.4, label="standard deviation", color="tab:blue")
    bars = axes.barh(place + 0.2, [r.bias for r in rows], 0.4, label="bias", color="tab:red")
    for bar, row in zip(bars, rows, strict=True):
        bar.set_alpha(1.0 if is_biased(row) else 0.3)
    axes.set_yticks(place, [r.setting for r in rows], fontsize=7)
    axes.invert_yaxis()
    axes.set_xscale("symlog", linthresh=max(min((r.deviation for r in rows if r.deviation > 0), default=1e-3), 1e-6))
    return _finished(figure, axes)


def shown(color: np.ndarray) -> bytes:
    """A linear picture (H, W, 3) as usdrecord would write it."""
    return _png(display_bytes(color))


def error_map(color: np.ndarray, reference: np.ndarray) -> bytes:
    """Difference over (reference + a tenth of its mean), averaged over channels: black 0, white 1 and beyond."""
    from matplotlib import colormaps

    gap = np.abs(color - reference).mean(-1) / (reference.mean(-1) + 0.1 * max(reference.mean(), 1e-30))
    return _png((colormaps["magma"](np.clip(gap, 0.0, 1.0))[..., :3] * 255).astype(np.uint8))


def worst_corner(color: np.ndarray, reference: np.ndarray, size: int = 32) -> tuple[slice, slice]:
    """Rows and columns of the square crop in which two pictures differ most."""
    gap = ((color - reference) ** 2).mean(-1)
    height, width = gap.shape
    size = min(size, height, width)
    sums = np.pad(gap, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    inside = sums[size:, size:] - sums[:-size, size:] - sums[size:, :-size] + sums[:-size, :-size]
    y, x = np.unravel_index(inside.argmax(), inside.shape)
    return slice(y, y + size), slice(x, x + size)


def zoomed(color: np.ndarray, crop: tuple[slice, slice]) -> bytes:
    """A crop, its pixels as squares."""
    pixels = display_bytes(color[crop])
    return _png(pixels.repeat(_ZOOM, 0).repeat(_ZOOM, 1))


def _curves(rows: Sequence[Row]) -> dict[str, list[Row]]:
    found: dict[str, list[Row]] = {}
    for row in rows:
        # Errors that were asked for are one curve, each a point.
        label = row.knob if row.knob == ASKED else f"{row.knob} {row.value}"
        found.setdefault(label, []).append(row)
    return {label: sorted(curve, key=lambda r: r.samples) for label, curve in found.items()}


def _figure(x: str, y: str, height: float = 4.5, logarithmic: bool = True):
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, height), layout="constrained")
    axes = figure.subplots()
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(True, which="both", alpha=0.25)
    if logarithmic:
        axes.set_xscale("log")
        axes.set_yscale("log")
    return figure, axes


def _finished(figure, axes) -> bytes:
    axes.legend(fontsize=7)
    return _bytes(figure)


def _bytes(figure) -> bytes:
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=110)
    return file.getvalue()


def _png(pixels: np.ndarray) -> bytes:
    """8-bit pixels as they are."""
    from matplotlib.image import imsave

    file = io.BytesIO()
    imsave(file, pixels, format="png")
    return file.getvalue()
