"""What a study keeps in its folder, in such a way that it can be stopped at any moment and go on later."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from .. import images


@dataclass(frozen=True)
class Measurement:
    """One picture: what it took, and how far it lies from the reference.

    `seconds` are those of sampling (with denoising, and the outputs that guide it) by the clock; `processor_seconds`
    those of all threads together. `rays` are of all kinds, `samples` a pixel; `flip` is None without flip-evaluator.
    `true_error` is what `stated_error`, `frame.stats["error"]`, estimates (`noise.true_errors`).
    """

    setting: str
    seed: int
    seconds: float
    processor_seconds: float
    rays: int
    rmse: float
    relative_mse: float
    maximum: float
    flip: float | None
    true_error: float
    stated_error: float
    samples: float


@dataclass(frozen=True)
class Reference:
    """The picture that others are measured against.

    Attributes:
        color: (H, W, 3) float64, linear.
        variance: mean over pixels and channels of its squared standard error; 0 where that is not known.
        origin: what it is, in words.
    """

    color: np.ndarray
    variance: float
    origin: str


class Folder:
    """The files of one study: its identity, the reference, the measurements and their pictures."""

    def __init__(self, path: str | Path, identity: dict) -> None:
        """Open or begin a study.

        Args:
            path: is made where it does not exist.
            identity: plain values that say what is studied: a folder holds one study.

        Raises:
            ValueError: the folder holds another study, or what is there cannot be read.
        """
        self.path = Path(path)
        if self.path.exists() and not self.path.is_dir():
            raise ValueError(f"{path}: is a file; a study needs a folder")
        (self.path / "pictures").mkdir(parents=True, exist_ok=True)
        self._keep_identity(identity)

    def reference(self) -> Reference | None:
        """The reference, None where there is none yet.

        Raises:
            ValueError: it cannot be read.
        """
        path, note = self.path / "reference.exr", self.path / "reference.json"
        if not (path.exists() and note.exists()):
            return None
        values = _read_json(note)
        try:
            color = images.read(path)[0]["color"].astype(np.float64)
            return Reference(color, float(values["variance"]), str(values["origin"]))
        except (ValueError, KeyError, TypeError):
            raise ValueError(f"{path}: cannot be read any more; remove the folder to begin anew") from None

    def keep_reference(self, reference: Reference) -> None:
        """Write the reference; its note comes last, and says that the picture is whole."""
        (self.path / "reference.json").unlink(missing_ok=True)
        images.write(self.path / "reference.exr", {"color": reference.color.astype(np.float32)})
        self.write_json("reference.json", {"variance": reference.variance, "origin": reference.origin})

    def measurements(self) -> list[Measurement]:
        """What is kept. A line that was cut off is dropped, and one whose picture is gone or spoilt."""
        path, found, whole = self.path / "measurements.jsonl", {}, []
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines() if path.exists() else []:
            try:
                measurement = Measurement(**json.loads(line))
                key = measurement.setting, measurement.seed
                # Mapped, not read: a file that was cut off is too short for its shape.
                if key not in found and np.load(self._picture(*key), mmap_mode="r").ndim == 3:
                    found[key] = measurement
                    whole.append(line + "\n")
            except (TypeError, ValueError, OSError, EOFError):
                continue
        _write(path, "".join(whole).encode())
        return list(found.values())

    def keep(self, measurement: Measurement, color: np.ndarray) -> None:
        """Add a measurement and its picture (H, W, 3). The picture first: a measurement that is listed has one."""
        np.save(self._picture(measurement.setting, measurement.seed), color)
        with open(self.path / "measurements.jsonl", "a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(measurement)) + "\n")

    def picture(self, setting: str, seed: int) -> np.ndarray:
        """(H, W, 3) float32 of a measurement."""
        return np.load(self._picture(setting, seed))

    def read_json(self, name: str) -> dict | None:
        """What `write_json` has written, None where nothing is or where it cannot be read."""
        try:
            return _read_json(self.path / name)
        except (OSError, ValueError):
            return None

    def write_json(self, name: str, values: dict) -> None:
        """Write a file as a whole, or not at all."""
        _write(self.path / name, (json.dumps(values, indent=2) + "\n").encode())

    def _picture(self, setting: str, seed: int) -> Path:
        return self.path / "pictures" / f"{setting}, seed {seed}.npy"

    def _keep_identity(self, identity: dict) -> None:
        identity = json.loads(json.dumps(identity))
        if (self.path / "study.json").exists():
            kept = _read_json(self.path / "study.json")
            changed = [name for name in {**identity, **kept} if identity.get(name) != kept.get(name)]
            if changed:
                raise ValueError(f"{self.path}: holds a study with another {', '.join(changed)}; choose another folder")
        self.write_json("study.json", identity)


def _read_json(path: Path) -> dict:
    """A JSON object.

    Raises:
        ValueError: it is none.
    """
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
    except ValueError:
        values = None
    if not isinstance(values, dict):
        raise ValueError(f"{path}: cannot be read any more; remove the folder to begin anew")
    return values


def _write(path: Path, content: bytes) -> None:
    """By a file beside it that takes its place: an interruption leaves the old one."""
    beside = path.with_name(path.name + ".new")
    beside.write_bytes(content)
    os.replace(beside, path)
