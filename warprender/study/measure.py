"""Renders the settings of a study, and keeps what is measured in its folder, so that a study can go on later."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from .. import images
from ..renderer import Renderer
from ..stopping import FEWEST_FOR_ERROR
from .metrics import differences, flip, flip_available
from .settings import Setting

#: The reference's two halves have seeds that no measurement has.
_REFERENCE_SEEDS = (2_000_000_011, 2_000_000_033)
#: Samples of the reference, in those of the best setting.
_REFERENCE_FACTOR = 16
#: Share of the budget that the reference may take.
_REFERENCE_SHARE = 0.4

#: Called with the share that is done and a word for what is under way.
Progress = Callable[[float, str], None]


class Interrupted(Exception):
    """Ctrl-C was pressed; what was finished is kept."""


@dataclass(frozen=True)
class Measurement:
    """One picture: what it took, and how far it lies from the reference.

    `seconds` are those of sampling (and denoising), `rays` of all kinds, `samples` a pixel; `flip` is None without
    flip-evaluator.
    """

    setting: str
    seed: int
    seconds: float
    rays: int
    rmse: float
    relative_mse: float
    maximum: float
    flip: float | None
    stated_error: float
    samples: float


@dataclass(frozen=True)
class Reference:
    """The picture that others are measured against.

    Attributes:
        color: (H, W, 3) float64, linear.
        variance: mean over pixels and channels of its squared standard error; 0 for a file.
        origin: what it is, in words.
    """

    color: np.ndarray
    variance: float
    origin: str


class Study:
    """A folder with the reference, the measurements and their pictures."""

    def __init__(self, folder: str | Path, build: Callable[..., Renderer], identity: dict) -> None:
        """Open or begin a study.

        Args:
            folder: is made where it does not exist.
            build: makes the renderer for arguments of `Renderer` that differ from the study's own.
            identity: plain values that say what is studied: a folder holds one study.

        Raises:
            ValueError: the folder holds another study.
        """
        self.folder, self._build = Path(folder), build
        (self.folder / "pictures").mkdir(parents=True, exist_ok=True)
        self._keep_identity(identity)
        self.measurements = self._read()
        self._renderers: dict[tuple, Renderer] = {}

    def reference(self, most: int, budget: float | None, progress: Progress) -> Reference:
        """The kept reference, or one that is rendered now: path tracing with all bounces that matter.

        Args:
            most: samples a pixel of the best setting; the reference has 16 times as many.
            budget: seconds for the whole study, of which it takes 40 % at most; None for no limit.
            progress: is told of it.

        Raises:
            Interrupted: Ctrl-C was pressed.
        """
        path, note = self.folder / "reference.exr", self.folder / "reference.json"
        if not (path.exists() and note.exists()):
            renderer = self._renderer(())
            seconds = None if budget is None else _REFERENCE_SHARE * budget / 2
            halves, samples = [], 0
            for number, seed in enumerate(_REFERENCE_SEEDS):
                frame = renderer.render(
                    samples=_REFERENCE_FACTOR * most // 2,
                    seconds=seconds,
                    seed=seed,
                    progress=lambda done, _, first=number: progress((first + done) / 2, "reference"),
                )
                if frame.stats["interrupted"]:
                    raise Interrupted
                halves.append(frame.numpy("color")[..., :3].astype(np.float64))
                samples += frame.stats["samples"]
            # Two independent halves: the variance of their mean is a quarter of their mean squared difference.
            variance = float(np.mean((halves[0] - halves[1]) ** 2) / 4)
            images.write(path, {"color": (halves[0] + halves[1]) / 2})
            _write_json(note, {"variance": variance, "origin": f"rendered here with {samples:g} samples a pixel"})
        return self._kept_reference()

    def take_reference(self, file: str) -> Reference:
        """Use a picture as the reference.

        Raises:
            ValueError: it cannot be read, has another size, or is another than the study began with.
        """
        layers, _ = images.read(file)
        size = self._renderer(()).resolution
        color = layers.get("color")
        if color is None or color.ndim != 3 or color.shape[2] < 3:
            raise ValueError(f"{file}: has no colour to compare with")
        if color.shape[1::-1] != size:
            raise ValueError(f"{file}: is {color.shape[1]}x{color.shape[0]} pixels, the study {size[0]}x{size[1]}")
        path = self.folder / "reference.exr"
        if self.measurements and path.exists() and (images.read(path)[0]["color"] != color[..., :3]).any():
            raise ValueError(f"{self.folder}: its measurements are against another reference than {file}")
        images.write(path, {"color": color[..., :3]})
        _write_json(self.folder / "reference.json", {"variance": 0.0, "origin": file})
        return self._kept_reference()

    def measure(
        self, settings: Sequence[Setting], seeds: Sequence[int], budget: float | None, progress: Progress
    ) -> list[str]:
        """Measure what is missing, a seed of all settings before the next seed.

        Returns:
            Names of the settings that the budget left out wholly or in part.

        Raises:
            Interrupted: Ctrl-C was pressed.
        """
        reference = self._kept_reference()
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
        return np.load(self.folder / "pictures" / f"{setting}, seed {seed}.npy")

    def _measure(self, setting: Setting, seed: int, reference: Reference) -> None:
        frame = self._render(setting, seed)
        if frame.stats["interrupted"]:
            raise Interrupted
        color = frame.numpy("color")[..., :3]
        found = differences(color, reference.color)
        measurement = Measurement(
            setting.name,
            seed,
            frame.stats["seconds"]["sample"] + frame.stats["seconds"].get("denoise", 0.0),
            sum(frame.stats["rays"].values()),
            found.rmse,
            found.relative_mse,
            found.maximum,
            flip(color, reference.color)[0] if flip_available() else None,
            float(frame.stats["error"]),
            float(frame.stats["samples"]),
        )
        # The picture first: a measurement that is listed has one.
        np.save(self.folder / "pictures" / f"{setting.name}, seed {seed}.npy", color)
        with open(self.folder / "measurements.jsonl", "a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(measurement)) + "\n")
        self.measurements.append(measurement)

    def _render(self, setting: Setting, seed: int):
        return self._renderer(setting.options).render(samples=setting.samples, error=setting.error, seed=seed)

    def _renderer(self, options: tuple[tuple[str, object], ...]) -> Renderer:
        """Made once for its options, and warm: compiling and the first touch of memory are not measured."""
        if options not in self._renderers:
            renderer = self._build(**dict(options))
            renderer.render(samples=FEWEST_FOR_ERROR + 1 if renderer.request.adaptive else 1)
            self._renderers[options] = renderer
        return self._renderers[options]

    def _kept_reference(self) -> Reference:
        note = json.loads((self.folder / "reference.json").read_text(encoding="utf-8"))
        color = images.read(self.folder / "reference.exr")[0]["color"].astype(np.float64)
        return Reference(color, note["variance"], note["origin"])

    def _keep_identity(self, identity: dict) -> None:
        path = self.folder / "study.json"
        identity = json.loads(json.dumps(identity))
        if path.exists():
            kept = json.loads(path.read_text(encoding="utf-8"))
            changed = [name for name in {**identity, **kept} if identity.get(name) != kept.get(name)]
            if changed:
                raise ValueError(
                    f"{self.folder}: holds a study with another {', '.join(changed)}; choose another folder"
                )
        _write_json(path, identity)

    def _read(self) -> list[Measurement]:
        """The measurements that are kept; a line that an interruption cut off is dropped."""
        path, found, whole = self.folder / "measurements.jsonl", [], ""
        for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
            try:
                found.append(Measurement(**json.loads(line)))
            except (json.JSONDecodeError, TypeError):
                continue
            whole += line + "\n"
        path.write_text(whole, encoding="utf-8")
        return found


def _write_json(path: Path, values: dict) -> None:
    path.write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")
