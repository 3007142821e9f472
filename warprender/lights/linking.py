"""Light linking: which prims a light shines on, and which keep its light off others."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import warp as wp

from ..records import DeviceScene


class LinkSets:
    """Sets of prims as rows of bits, each set stored once."""

    def __init__(self, prims: Iterable[str]) -> None:
        """`prims` are all prims in the order of their numbers."""
        self._numbers = {path: number for number, path in enumerate(prims)}
        self._rows: dict[frozenset[str], int] = {}
        self._bits: list[np.ndarray] = []

    def row(self, excluded: frozenset[str]) -> int:
        """The row of the set of all prims but those excluded; -1 for the set of all."""
        excluded = frozenset(path for path in excluded if path in self._numbers)
        if not excluded:
            return -1
        if excluded not in self._rows:
            members = np.ones(-(-len(self._numbers) // 32) * 32, bool)
            members[[self._numbers[path] for path in excluded]] = False
            self._rows[excluded] = len(self._bits)
            self._bits.append(np.packbits(members, bitorder="little").view("<u4"))
        return self._rows[excluded]

    def upload(self, device: str) -> wp.array:
        """(sets, words) uint32, bit p % 32 of word p / 32 for prim p."""
        if not self._bits:
            return wp.zeros((0, 0), dtype=wp.uint32, device=device)
        return wp.array(np.stack(self._bits), dtype=wp.uint32, device=device)


@wp.func
def is_linked(scene: DeviceScene, row: int, prim: int) -> bool:
    """Whether a prim is in a set; row -1 is the set of all."""
    if row < 0:
        return True
    return ((scene.link_sets[row, prim >> 5] >> wp.uint32(prim & 31)) & wp.uint32(1)) != wp.uint32(0)
