"""A finished picture: the outputs of one render, how they came about, and the ways to keep or show them."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, ItemsView, Iterable, Iterator, ValuesView
from pathlib import Path

import numpy as np
import warp as wp

from . import images
from .camera import DataWindow


class Stats(dict):
    """A dictionary whose values may be functions without arguments, which are called when they are first asked for.

    What nobody asks for costs nothing: a small frame takes less time than its statistics.
    """

    def settle(self) -> Stats:
        """Call what is left to call; returns itself."""
        for key in self:
            self[key]
        return self

    def __iter__(self) -> Iterator[str]:
        # Another iterator than dict's own: `dict(stats)` and `**stats` then come by way of `__getitem__`.
        return iter(super().keys())

    def __getitem__(self, key: str) -> object:
        value = super().__getitem__(key)
        if callable(value):
            value = value()
            self[key] = value
        return value

    def get(self, key: str, default: object = None) -> object:
        """As of any mapping."""
        return self[key] if key in self else default

    def items(self) -> ItemsView:
        """As of any mapping."""
        return super(Stats, self.settle()).items()

    def values(self) -> ValuesView:
        """As of any mapping."""
        return super(Stats, self.settle()).values()

    def copy(self) -> dict:
        """A plain dictionary."""
        return dict(self)

    def __or__(self, other: dict) -> dict:
        return self.copy() | other

    def __eq__(self, other: object) -> bool:
        return super(Stats, self.settle()).__eq__(other)

    __hash__ = None

    def __repr__(self) -> str:
        return super(Stats, self.settle()).__repr__()

    def __reduce__(self) -> tuple:
        return dict, (self.copy(),)


class Frame:
    """The outputs of one render; `frame.color`, `frame.cameraDepth`, … are its `wp.array`s.

    The arrays stay on the device that rendered them. `torch.from_dlpack(frame.color)` and the like take them over
    without a copy. In a notebook a frame shows its color.

    Attributes:
        outputs: output name to `wp.array` (H, W), in the order that was asked for; row 0 is the top row. `color`
            is vec4 float32: linear Rec.709, premultiplied by alpha. The others are float32, int32 or vec3, as
            `warprender.outputs.OUTPUTS` says; a vector array becomes (H, W, C) in other libraries.
        stats: what the render took: "seconds" by stage, "samples" a pixel, "interrupted", "plan", "warnings";
            with color also "rays" by kind, "error" (RMS over lit pixels of luminance's standard error over its mean;
            inf below 4 samples), "frame error" (RMS standard error over RMS luminance), "error within" and "frame
            error within" (the share of each within which the true error lies in 95 of 100 frames) and "dropped
            samples" (those that were not finite).
        data_window: where the pixels lie in the picture that the render settings describe, None for all of it. EXR
            keeps it as data and display window.
    """

    def __init__(
        self,
        outputs: dict[str, wp.array],
        stats: dict | None = None,
        receipt: dict | Callable[[], dict] | None = None,
        data_window: DataWindow | None = None,
    ) -> None:
        self.outputs = dict(outputs)
        self.stats = stats if stats is not None else {}
        self._receipt = receipt if receipt is not None else {}
        self.data_window = data_window

    @property
    def receipt(self) -> dict:
        """What rendering it again needs: plan, request, seed, samples, versions, stage hash; JSON-able."""
        if callable(self._receipt):
            self._receipt = self._receipt()
        return self._receipt

    @receipt.setter
    def receipt(self, receipt: dict) -> None:
        self._receipt = receipt

    def __getattr__(self, name: str) -> wp.array:
        # Through __dict__: a Frame that is being unpickled has no outputs yet.
        outputs = self.__dict__.get("outputs", {})
        if name in outputs:
            return outputs[name]
        raise AttributeError(f"this frame has no output {name!r}; it has {', '.join(outputs) or 'none'}")

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.outputs]

    @property
    def resolution(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        height, width = next(iter(self.outputs.values())).shape[:2]
        return width, height

    def chosen(self, names: Iterable[str]) -> Frame:
        """The same frame with no other outputs than these, as far as it has them; arrays are shared."""
        found = {name: self.outputs[name] for name in names if name in self.outputs}
        return Frame(found, self.stats, self.receipt, self.data_window)

    def numpy(self, name: str) -> np.ndarray:
        """The output `name` on the host, (H, W) or (H, W, C); on the CPU it shares the array's memory.

        Raises:
            AttributeError: the frame has no such output.
        """
        return getattr(self, name).numpy()

    def save(self, path: str | Path, color_correction: str = "sRGB", half: bool = False) -> None:
        """Write an image file with the receipt in its metadata.

        EXR (.exr) keeps every output as a layer; .png, .jpg, .jpeg, .tif, .tiff and .hdr keep `color` alone. See
        `warprender.images` for how values are stored.

        Args:
            path: the file; the extension chooses the format.
            color_correction: "sRGB", "disabled" or "openColorIO", for the 8-bit formats.
            half: 16-bit floats in EXR.

        Raises:
            ValueError: the file cannot be written; the message names it and says why.
        """
        layers = {name: self.numpy(name) for name in self.outputs}
        receipt = {**self.receipt, "file": {"color_correction": color_correction, "half": half}}
        window = self.data_window
        display = (window.x, window.y, *window.full) if window is not None else None
        # ASCII JSON: a PNG text chunk is Latin-1.
        metadata = {"Software": "warprender", "warprender": json.dumps(receipt, sort_keys=True)}
        images.write(path, layers, metadata, color_correction, half, display)

    def _repr_png_(self) -> bytes | None:
        """The colour as PNG bytes, which is how a notebook shows a frame."""
        if "color" not in self.outputs:
            return None
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "frame.png"
            images.write_png(path, self.numpy("color"))
            return path.read_bytes()

    def __repr__(self) -> str:
        width, height = self.resolution
        samples = f"; {self.stats['samples']} samples" if self.stats.get("samples") else ""
        stopped = "; interrupted" if self.stats.get("interrupted") else ""
        return f"Frame({width}x{height}: {', '.join(self.outputs)}{samples}{stopped})"
