"""What the measurements of a study say: bias and variance apart, efficiency, the Pareto front, slopes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .kept import Measurement, Reference
from .measure import Study
from .settings import Setting

#: Two-sided 95 % points of Student's t by degrees of freedom; beyond, the normal distribution's.
_T95 = (12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23, 2.20, 2.18, 2.16, 2.14, 2.13, 2.12, 2.11, 2.10)
#: Standard errors from which on a bias is called one.
_BIAS_SIGMAS = 3.0
#: What time goes by: seconds as they pass, or those of all threads of the processor, which other work disturbs less.
CLOCKS = ("wall", "processor")


@dataclass
class Row:
    """One setting, over its seeds.

    Attributes:
        setting: its name.
        knob: of it.
        value: of it.
        samples: a pixel, mean.
        pictures: how many seeds.
        seconds: median of sampling, by the clock.
        spread: of the seconds, (largest − smallest) / median.
        processor_seconds: median of all threads' time together.
        processor_spread: of it.
        rays: mean.
        rmse: root of the mean squared error over all pictures.
        relative_mse: mean.
        true_error: root mean square of the relative error over lit pixels, which `frame.stats["error"]` estimates.
        stated_error: of what the pictures stated, None below 4 samples; it knows of noise alone, not of bias.
        flip: mean, or None.
        bias: root of the squared bias over pixels, noise taken off; None for one picture.
        bias_sigmas: squared bias over its standard error; above 3 there is one. None for one picture, and where there
            is no noise, so that any difference is bias.
        deviation: standard deviation of a pixel from picture to picture; None for one picture.
        efficiency: 1 / (MSE · time); None where there is no error.
        biased: whether more than chance lies between the mean of the pictures and the reference; None for one picture.
        best: whether nothing measured is both quicker and closer (the Pareto front).
        time: the seconds that efficiency and the front go by: those of the clock or of the processor.
    """

    setting: str
    knob: str
    value: str
    samples: float
    pictures: int
    seconds: float
    spread: float
    processor_seconds: float
    processor_spread: float
    rays: float
    rmse: float
    relative_mse: float
    true_error: float
    stated_error: float | None
    flip: float | None
    bias: float | None
    bias_sigmas: float | None
    deviation: float | None
    efficiency: float | None
    biased: bool | None
    best: bool
    time: float


def rows(study: Study, settings: Sequence[Setting], reference: Reference, clock: str = "wall") -> list[Row]:
    """A row for each setting that has been measured, in the order of `settings`; `clock` is of `CLOCKS`."""
    found = []
    for setting in settings:
        measured = [m for m in study.measurements if m.setting == setting.name]
        if measured:
            pictures = np.stack([study.picture(m.setting, m.seed) for m in measured]).astype(np.float64)
            found.append(_row(setting, measured, pictures, reference, clock))
    for row in found:
        row.best = not any(
            (other.time <= row.time and other.rmse < row.rmse) or (other.time < row.time and other.rmse <= row.rmse)
            for other in found
        )
    return found


def _row(
    setting: Setting, measured: Sequence[Measurement], pictures: np.ndarray, reference: Reference, clock: str
) -> Row:
    seconds, spread = _median_and_spread([m.seconds for m in measured])
    processor, processor_spread = _median_and_spread([m.processor_seconds for m in measured])
    taken = processor if clock == "processor" else seconds
    mse = float(np.mean([m.rmse**2 for m in measured]))
    stated = float(np.sqrt(np.mean([m.stated_error**2 for m in measured])))
    flips = [m.flip for m in measured if m.flip is not None]
    bias, sigmas, deviation = bias_and_deviation(pictures, reference) if len(measured) > 1 else (None,) * 3
    return Row(
        setting=setting.name,
        knob=setting.knob,
        value=setting.value,
        samples=float(np.mean([m.samples for m in measured])),
        pictures=len(measured),
        seconds=seconds,
        spread=spread,
        processor_seconds=processor,
        processor_spread=processor_spread,
        rays=float(np.mean([m.rays for m in measured])),
        rmse=float(np.sqrt(mse)),
        relative_mse=float(np.mean([m.relative_mse for m in measured])),
        true_error=float(np.sqrt(np.mean([m.true_error**2 for m in measured]))),
        stated_error=stated if np.isfinite(stated) else None,
        flip=float(np.mean(flips)) if flips else None,
        bias=bias,
        bias_sigmas=sigmas if sigmas is not None and np.isfinite(sigmas) else None,
        deviation=deviation,
        efficiency=1.0 / (mse * taken) if mse * taken > 0.0 else None,
        biased=None if sigmas is None else sigmas > _BIAS_SIGMAS,
        best=False,
        time=taken,
    )


def _median_and_spread(values: Sequence[float]) -> tuple[float, float]:
    median = float(np.median(values))
    return median, float(np.ptp(values)) / median if median > 0.0 else 0.0


def bias_and_deviation(pictures: np.ndarray, reference: Reference) -> tuple[float, float, float]:
    """Bias and variance of independent pictures (K, H, W, C), K ≥ 2, apart.

    The mean of K pictures differs from the reference by bias, by its own noise, variance / K, and by the
    reference's. The latter two are known and taken off. Pixels are independent, their channels are not: the standard
    error comes from the spread over pixels.

    Returns:
        Root of the mean squared bias (0 where noise explains more than all of it), the squared bias in its standard
        errors, and the root of the mean variance of a picture.
    """
    variance = pictures.var(0, ddof=1)
    gap = (pictures.mean(0) - reference.color) ** 2 - variance / len(pictures) - reference.variance
    pixels = gap.mean(-1).ravel()
    squared = float(pixels.mean())
    error = float(pixels.std(ddof=1) / np.sqrt(pixels.size)) if pixels.size > 1 else 0.0
    # Where no picture has noise, any difference is bias.
    sigmas = squared / error if error > 0.0 else (float("inf") if squared > 0.0 else 0.0)
    return float(np.sqrt(max(squared, 0.0))), float(sigmas), float(np.sqrt(variance.mean()))


def slope(samples: Sequence[float], errors: Sequence[float]) -> tuple[float, float]:
    """Slope of log error over log samples, and half the width of its 95 % confidence interval.

    Least squares; −0.5 is what independent samples give. The errors must be of independent pictures, three or more,
    at two or more numbers of samples.
    """
    x, y = np.log(np.asarray(samples, float)), np.log(np.asarray(errors, float))
    x = x - x.mean()
    found = float(x @ y / (x @ x))
    residual = y - y.mean() - found * x
    freedom = len(x) - 2
    t = _T95[freedom - 1] if freedom <= len(_T95) else 1.96 + 2.4 / freedom
    return found, float(t * np.sqrt(residual @ residual / freedom / (x @ x)))


def sampler_slopes(study: Study, settings: Sequence[Setting], reference: Reference) -> dict[str, tuple[float, float]]:
    """Sampler to slope of RMSE over samples and its 95 % half width, the reference's variance taken off."""
    found = {}
    for name in dict.fromkeys(s.value for s in settings if s.knob == "sampler"):
        counts = {s.name: s.samples for s in settings if s.knob == "sampler" and s.value == name}
        pairs = [
            (counts[m.setting], np.sqrt(m.rmse**2 - reference.variance))
            for m in study.measurements
            if m.setting in counts and m.rmse**2 > 2 * reference.variance
        ]
        if len(pairs) >= 4 and len({n for n, _ in pairs}) >= 2:
            found[name] = slope(*zip(*pairs, strict=True))
    return found
