"""Layers as the channels of an EXR, and back."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

#: Layers of three numbers that are colours, not vectors.
_COLOR_LAYERS = ("color", "albedo", "standardError")


def stack(layers: Mapping[str, np.ndarray], dtype: type) -> tuple[list[str], np.ndarray]:
    """Channel names, and all channels as one contiguous (H, W, C) array."""
    names, planes = [], []
    for name, array in layers.items():
        array = np.asarray(array).astype(dtype, copy=False)
        array = array.reshape(*array.shape[:2], -1)
        names += _channel_names(name, array.shape[2], dtype is np.int32)
        planes.append(array)
    return names, np.ascontiguousarray(np.concatenate(planes, axis=2))


def unstack(channels: tuple[str, ...], pixels: np.ndarray) -> dict[str, np.ndarray]:
    """The layers of `stack` from channels in any order: EXR stores them by name."""
    members: dict[str, list[tuple[str, int]]] = {}
    for index, channel in enumerate(channels):
        layer, _, letter = channel.rpartition(".")
        members.setdefault(layer or "color", []).append((letter, index))
    layers = {}
    for layer, found in members.items():
        order = [index for _, index in sorted(found, key=lambda c: "XYZRGBA".find(c[0]))]
        layers[layer] = pixels[..., order] if len(order) > 1 else pixels[..., order[0]]
    return layers


def _channel_names(layer: str, count: int, integers: bool) -> list[str]:
    if count == 1:
        letters = ["id" if integers else "Z"]
    elif count == 4 or layer.partition(":")[0] in _COLOR_LAYERS:
        letters = list("RGBA"[:count])
    else:
        letters = list("XYZ"[:count])
    return letters if layer == "color" else [f"{layer}.{c}" for c in letters]
