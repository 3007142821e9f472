"""Renders the reference and the settings of a study, and measures each picture."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from .. import images
from ..frame import Frame
from ..noise import true_errors
from ..renderer import Renderer
from ..stopping import FEWEST_FOR_ERROR
from .kept import Folder, Measurement, Reference
from .metrics import differences, flip, flip_available
from .settings import Setting

#: The reference's two halves have seeds that no measurement has.
_REFERENCE_SEEDS = (2_000_000_011, 2_000_000_033)
#: Samples of the reference, in those of the best setting.
_REFERENCE_FACTOR = 16
#: Share of the budget that the reference may take.
REFERENCE_SHARE = 0.4

#: Called with the share that is done and a word for what is under way.
Progress = Callable[[float, str], None]


class Interrupted(Exception):
    """Ctrl-C was pressed; what was finished is kept."""


class Study:
    """Measures settings against a reference.

    Attributes:
        kept: the folder with all that was measured.
        measurements: all of them.
    """

    def __init__(self, folder: str | Path, build: Callable[..., Renderer], identity: dict) -> None:
        """Open or begin a study.

        Args:
            folder: is made where it does not exist.
            build: makes the renderer for arguments of `Renderer` that differ from the study's own.
            identity: plain values that say what is studied: a folder holds one study.

        Raises:
            ValueError: the folder holds another study.
        """
        self.kept, self._build = Folder(folder, identity), build
        self.measurements = self.kept.measurements()
        self._renderers: dict[tuple, Renderer] = {}

    @property
    def folder(self) -> Path:
        """Where it is kept."""
        return self.kept.path

    def reference(self, most: int, budget: float | None, progress: Progress) -> Reference:
        """The kept reference, or one that is rendered now by the study's own options.

        Args:
            most: samples a pixel of the best setting; the reference has 16 times as many.
            budget: seconds for the whole study, of which it takes 40 % at most; None for no limit.
            progress: is told of it.

        Raises:
            Interrupted: Ctrl-C was pressed.
        """
        kept = self.kept.reference()
        if kept is None:
            kept = self._render_reference(_REFERENCE_FACTOR * most, budget, progress)
            self._forget_measurements()
            self.kept.keep_reference(kept)
        return kept

    def take_reference(self, file: str) -> Reference:
        """Use a picture as the reference. A layer `standardError`, where it has one, tells its noise.

        Raises:
            ValueError: it cannot be read, has no colour, another size or values that are not finite, or is another
                than the study began with.
        """
        if Path(file).suffix.lower() in images.DISPLAY_FORMATS:
            raise ValueError(f"{file}: 8-bit pictures are no reference; give an EXR of linear colour")
        layers, _ = images.read(file)
        color = layers.get("color")
        if color is None or color.ndim != 3 or color.shape[2] < 3:
            channels = "no layer color" if color is None else f"{1 if color.ndim == 2 else color.shape[2]} channels"
            raise ValueError(f"{file}: has {channels}; a reference needs R, G and B")
        size = self._renderer(()).resolution
        if color.shape[1::-1] != size:
            raise ValueError(f"{file}: is {color.shape[1]}x{color.shape[0]} pixels, the study {size[0]}x{size[1]}")
        color = color[..., :3]
        bad = np.argwhere(~np.isfinite(color).all(-1))
        if len(bad):
            raise ValueError(f"{file}: is not finite in {len(bad)} pixels, the first (x={bad[0][1]}, y={bad[0][0]})")
        kept = self.kept.reference()
        if kept is None:
            self._forget_measurements()
        elif self.measurements and (kept.color != color).any():
            raise ValueError(f"{self.folder}: its measurements are against another reference than {file}")
        error = layers.get("standardError")
        known = error is not None and np.isfinite(error).all()
        reference = Reference(color.astype(np.float64), float(np.mean(error**2)) if known else 0.0, f"the file {file}")
        self.kept.keep_reference(reference)
        return reference

    def measure(
        self, settings: Sequence[Setting], seeds: Sequence[int], budget: float | None, progress: Progress
    ) -> list[str]:
        """Measure what is missing, a seed of all settings before the next seed.

        Returns:
            Names of the settings that the budget left out wholly or in part.

        Raises:
            Interrupted: Ctrl-C was pressed.
        """
        reference = self.kept.reference()
        start, total = time.perf_counter(), len(settings) * len(seeds)
        skipped: list[str] = []
        done = {(m.setting, m.seed) for m in self.measurements}
        for number, (seed, setting) in enumerate((seed, setting) for seed in seeds for setting in settings):
            if (setting.name, seed) in done:
                continue
            if budget is not None and time.perf_counter() - start > budget:
                skipped.append(setting.name)
                continue
            progress(number / total, setting.name)
            self._measure(setting, seed, reference)
        return list(dict.fromkeys(skipped))

    def picture(self, setting: str, seed: int) -> np.ndarray:
        """(H, W, 3) float32 of a measurement."""
        return self.kept.picture(setting, seed)

    def _render_reference(self, samples: int, budget: float | None, progress: Progress) -> Reference:
        """Two independent halves: the variance of their mean is a quarter of their mean squared difference."""
        renderer = self._renderer(())
        seconds = None if budget is None else REFERENCE_SHARE * budget / 2
        halves, taken = [], 0.0
        for number, seed in enumerate(_REFERENCE_SEEDS):
            frame = renderer.render(
                samples=-(-samples // 2),
                seconds=seconds,
                seed=seed,
                progress=lambda done, _, first=number: progress((first + done) / 2, "reference"),
            )
            _stop_if_interrupted(frame)
            halves.append(frame.numpy("color")[..., :3].astype(np.float64))
            taken += frame.stats["samples"]
        color = ((halves[0] + halves[1]) / 2).astype(np.float32).astype(np.float64)
        followed = renderer.plan.bounds.get("bounces")
        bounces = "" if followed is None else f", {followed:g} bounces"
        origin = f"rendered here: transport {renderer.plan.transport}{bounces}, {taken:.4g} samples a pixel"
        return Reference(color, float(np.mean((halves[0] - halves[1]) ** 2) / 4), origin)

    def _forget_measurements(self) -> None:
        """What was measured against a reference that is gone."""
        self.measurements = []
        (self.folder / "measurements.jsonl").unlink(missing_ok=True)

    def _measure(self, setting: Setting, seed: int, reference: Reference) -> None:
        renderer = self._renderer(setting.options)
        processor = time.process_time()
        frame = renderer.render(samples=setting.samples, error=setting.error, seed=seed)
        processor = time.process_time() - processor
        _stop_if_interrupted(frame)
        color = frame.numpy("color")[..., :3]
        found = differences(color, reference.color)
        measurement = Measurement(
            setting.name,
            seed,
            sum(frame.stats["seconds"].get(stage, 0.0) for stage in ("outputs", "sample", "denoise")),
            processor,
            sum(frame.stats["rays"].values()),
            found.rmse,
            found.relative_mse,
            found.maximum,
            flip(color, reference.color)[0] if flip_available() else None,
            true_errors(color, reference.color)[0],
            float(frame.stats["error"]),
            float(frame.stats["samples"]),
        )
        self.kept.keep(measurement, color)
        self.measurements.append(measurement)

    def _renderer(self, options: tuple[tuple[str, object], ...]) -> Renderer:
        """Made once for its options, and warm: compiling and the first touch of memory are not measured."""
        if options not in self._renderers:
            renderer = self._build(**dict(options))
            renderer.render(samples=FEWEST_FOR_ERROR + 1 if renderer.request.adaptive else 1)
            self._renderers[options] = renderer
        return self._renderers[options]


def _stop_if_interrupted(frame: Frame) -> None:
    if frame.stats["interrupted"]:
        raise Interrupted
