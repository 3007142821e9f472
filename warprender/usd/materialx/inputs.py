"""What a network gives a surface's input: a constant, a texture, a primvar, or a picture that is made of it.

Arithmetic on one picture that is linear in its channels becomes the scale and bias of a `Texture`, arithmetic on
coordinates its transform, linear arithmetic on one primvar the matrix of its `PrimvarReader`. All are found by
evaluating the network: a linear function is known by its values at a few places, and checked at many more. Other
arithmetic on one picture is done texel by texel. What is left is baked over st in [0, 1].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from pxr import Sdf, Usd

from ...images import picture_header
from ...texels import decoded as decoded_texels
from ...texels import is_srgb, picture_range, rgba
from ...texture_lookup import sampled
from ...textures import PrimvarReader, Texture, as_picture
from ..reading import Reading, one_line
from .network import Evaluation, ImageLeaf, Leaf, PrimvarLeaf, Undrawable
from .nodes import Values, converted

#: Texels along each side of a baked picture: at least, and at most where pictures of more are in it.
BAKED, LARGEST_BAKED = 512, 2048
_PROBES = 64
_ROWS = 2**18

Function = Callable[[Evaluation], Values]
Resolved = float | tuple | Texture | PrimvarReader


def resolve(reading: Reading, prim: Usd.Prim, function: Function, width: int) -> Resolved | None:
    """What an input is; None, with a remark that names the node, where it cannot be drawn.

    Args:
        reading: the reading in progress.
        prim: the surface's shader.
        function: the input's values in one pass over the network.
        width: 1 for a number, 3 for a colour or a normal.
    """
    images: dict[Sdf.Path, ImageLeaf] = {}
    try:
        return _Input(reading, prim, lambda passing: converted(function(passing), width), width, images).resolved()
    except Undrawable as error:
        reading.remark(error.prim, error.message)
    except (ValueError, IndexError) as error:
        reading.remark(prim, f"its inputs do not fit together: {one_line(error)}")
    return None


class _Input:
    def __init__(
        self, reading: Reading, prim: Usd.Prim, function: Function, width: int, images: dict[Sdf.Path, ImageLeaf]
    ) -> None:
        self.reading, self.prim, self.function, self.width, self.images = reading, prim, function, width, images

    def resolved(self) -> Resolved:
        leaves = self._leaves(self.function, deep=False)
        if not leaves:
            return self._constant(self._values(self.function, {}))
        found = None
        if len(leaves) == 1 and isinstance(leaves[0], PrimvarLeaf):
            found = self._primvar(leaves[0])
        elif len(leaves) == 1:
            found = self._picture(leaves[0])
        return self._baked() if found is None else found

    def _constant(self, values: Values) -> float | tuple:
        numbers = tuple(map(float, np.nan_to_num(values[0], posinf=0.0, neginf=0.0)))
        return numbers[0] if self.width == 1 else numbers

    def _leaves(self, function: Function, deep: bool) -> list[Leaf]:
        """The leaves that a function asks for; `deep`, also those that the coordinates of pictures ask for."""
        met: dict[Leaf, None] = {}

        def trace(passing: Evaluation, leaf: Leaf) -> Values:
            met[leaf] = None
            if deep and isinstance(leaf, ImageLeaf):
                leaf.coordinates(passing)
            return np.zeros((1, 4 if isinstance(leaf, ImageLeaf) else leaf.width))

        function(Evaluation(self.reading, trace, self.images))
        return list(met)

    def _values(self, function: Function, given: dict[Leaf, Values]) -> Values:
        return function(Evaluation(self.reading, lambda passing, leaf: given[leaf], self.images))

    def _affine(self, function: Function, leaf: Leaf, low: Values, high: Values) -> np.ndarray | None:
        """(width, n + 1) matrix of a function that is linear in a leaf between two ends, else None."""
        probes = np.random.default_rng(0).uniform(low, high, (_PROBES, len(low)))
        values = self._values(function, {leaf: probes})
        values = np.broadcast_to(values, (_PROBES, values.shape[1]))
        if not np.isfinite(values).all():
            return None
        matrix = np.linalg.lstsq(np.append(probes, np.ones((_PROBES, 1)), 1), values, rcond=None)[0].T
        error = np.abs(np.append(probes, np.ones((_PROBES, 1)), 1) @ matrix.T - values)
        if (error > 1e-6 * (1.0 + np.abs(values))).any():
            return None
        return np.round(matrix, 12) + 0.0

    def _primvar(self, leaf: PrimvarLeaf) -> PrimvarReader | float | tuple | None:
        matrix = self._affine(self.function, leaf, -np.ones(leaf.width), np.ones(leaf.width))
        if matrix is not None and not matrix[:, :-1].any():
            return self._constant(matrix[:, -1:].T)
        if matrix is None:
            return None
        if np.allclose(matrix, np.eye(self.width, leaf.width + 1), atol=1e-6):
            return self._reader(leaf)
        fallback = matrix @ np.append(np.resize(np.append(leaf.fallback, np.zeros(leaf.width)), leaf.width), 1.0)
        rows = tuple(tuple(map(float, row)) for row in matrix)
        return replace(self._reader(leaf), fallback=tuple(map(float, fallback)), matrix=rows)

    def _reader(self, leaf: PrimvarLeaf) -> PrimvarReader:
        self.reading.primvars.setdefault(leaf.name, None)
        return PrimvarReader(leaf.name, leaf.fallback)

    def _placed(self, leaf: ImageLeaf) -> dict[str, object] | None:
        """`st` and `transform` of a texture where a picture's coordinates are linear in a primvar."""
        leaves = self._leaves(leaf.coordinates, deep=True)
        if not leaves:
            return {"st": tuple(map(float, self._values(leaf.coordinates, {})[0]))}
        if len(leaves) > 1 or isinstance(leaves[0], ImageLeaf):
            return None
        matrix = self._affine(
            leaf.coordinates, leaves[0], np.full(leaves[0].width, -2.0), np.full(leaves[0].width, 2.0)
        )
        if matrix is None or matrix[:, 2:-1].any():
            return None
        return {"st": self._reader(leaves[0]), "transform": matrix[:, [0, 1, -1]]}

    def _picture(self, leaf: ImageLeaf) -> Texture | float | tuple | None:
        """A function of one picture as a texture."""
        placed = self._placed(leaf)
        if placed is None:
            return None
        low, high = self._range(leaf)
        matrix = self._affine(self.function, leaf, low, high)
        if matrix is not None:
            fallback = matrix @ np.append(leaf.texture.fallback, 1.0)
            if not matrix[:, :4].any():
                return self._constant(fallback[None])
            found = self._scaled(leaf.texture, matrix, fallback)
            if found is not None:
                return replace(found, **placed)
        if leaf.texture.is_tiled:
            raise Undrawable(
                self.reading.stage.GetPrimAtPath(leaf.texture.prim), "such arithmetic on tiles is not drawn"
            )
        return self._by_texels(leaf, placed)

    def _scaled(self, texture: Texture, matrix: np.ndarray, fallback: np.ndarray) -> Texture | None:
        """The texture with the matrix as scale and bias, where it has one channel for each number."""
        weights, bias = matrix[:, :4], matrix[:, 4]
        whole = (
            tuple(map(float, np.append(fallback, np.zeros(4))[:4])) if self.width == 3 else (float(fallback[0]),) * 4
        )
        if self.width == 3 and not (weights - np.pad(np.diag(np.diag(weights)), ((0, 0), (0, 1)))).any():
            scale = tuple(map(float, np.append(np.diag(weights), 1.0)))
            return replace(texture, channel="rgb", scale=scale, bias=(*map(float, bias), 0.0), fallback=whole)
        used = np.flatnonzero(weights.any(0))
        same = np.allclose(weights, weights[0]) and np.allclose(bias, bias[0])
        if len(used) != 1 or not same or not np.allclose(fallback, fallback[0]):
            return None
        scale, offset = (float(weights[0, used[0]]),) * 4, (float(bias[0]),) * 4
        return replace(texture, channel="rgba"[used[0]], scale=scale, bias=offset, fallback=(float(fallback[0]),) * 4)

    def _range(self, leaf: ImageLeaf) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest value of each channel, at least 0 … 1."""
        low, high = np.zeros(4), np.ones(4)
        for _, source in leaf.texture.sources():
            try:
                ends = picture_range(as_picture(source), leaf.texture.sourceColorSpace)
            except ValueError:
                continue
            low, high = np.fmin(low, ends[0]), np.fmax(high, ends[1])
        return low, high

    def _by_texels(self, leaf: ImageLeaf, placed: dict[str, object]) -> Texture | float | tuple:
        """The texture of the function's values at each texel of its one picture."""
        try:
            picture = as_picture(leaf.texture.file)
        except ValueError as error:
            self.reading.remark(self.reading.stage.GetPrimAtPath(leaf.texture.prim), f"{error}; its default is taken")
            return self._constant(self._values(self.function, {leaf: np.array([leaf.texture.fallback])}))
        texels = rgba(picture.pixels)
        srgb = is_srgb(picture, leaf.texture.sourceColorSpace)
        height, width = texels.shape[:2]
        flat = texels.reshape(-1, 4)
        values = np.empty((len(flat), self.width), np.float32)
        for first in range(0, len(flat), _ROWS):
            rows = decoded_texels(flat[first : first + _ROWS], srgb).astype(np.float64)
            values[first : first + _ROWS] = self._values(self.function, {leaf: rows})
        return self._made(values.reshape(height, width, -1), leaf.texture, **placed)

    def _made(self, values: np.ndarray, like: Texture | None, **fields) -> Texture:
        values = np.nan_to_num(values, posinf=0.0, neginf=0.0)
        wraps = {"wrapS": like.wrapS, "wrapT": like.wrapT} if like else {"wrapS": "repeat", "wrapT": "repeat"}
        channel = "r" if self.width == 1 else "rgb"
        return Texture(values, channel, sourceColorSpace="raw", prim=str(self.prim.GetPath()), **wraps, **fields)

    def _baked(self) -> Texture | float | tuple:
        """A picture of the function over st in [0, 1], repeated outside."""
        leaves = self._leaves(self.function, deep=True)
        images = [leaf for leaf in leaves if isinstance(leaf, ImageLeaf)]
        primvars = [leaf for leaf in leaves if isinstance(leaf, PrimvarLeaf)]
        names = {leaf.name for leaf in primvars}
        if len(names) > 1 or any(leaf.width != 2 for leaf in primvars):
            raise Undrawable(self.prim, f"arithmetic on {', '.join(sorted(names))} is not drawn")
        size = min(max([BAKED, *map(_size, images)]), LARGEST_BAKED)
        if not names:
            size = 1
        values = np.empty((size, size, self.width), np.float32)
        s = (np.arange(size) + 0.5) / size
        block = max(1, _ROWS // size)
        for first in range(0, size, block):
            rows = 1.0 - s[first : first + block]
            st = np.stack(np.broadcast_arrays(s, rows[:, None]), -1).reshape(-1, 2)
            found = self.function(Evaluation(self.reading, _Baking(st).values, self.images))
            values[first : first + block] = np.broadcast_to(found, (len(st), self.width)).reshape(len(rows), size, -1)
        if not names:
            return self._constant(values.reshape(-1, self.width))
        message = f"a network is baked into {size} × {size} texels over {primvars[0].name} in [0, 1], repeated outside"
        self.reading.remark(self.prim, message)
        return self._made(values, None, st=self._reader(primvars[0]))


class _Baking:
    """Leaves at places on the unit square."""

    def __init__(self, st: Values) -> None:
        self.st = st

    def values(self, passing: Evaluation, leaf: Leaf) -> Values:
        if isinstance(leaf, PrimvarLeaf):
            return self.st
        try:
            return sampled(leaf.texture, leaf.coordinates(passing))
        except ValueError as error:
            prim = passing.reading.stage.GetPrimAtPath(leaf.texture.prim)
            passing.reading.remark(prim, f"{error}; its default is taken")
            return np.array([leaf.texture.fallback])


def _size(leaf: ImageLeaf) -> int:
    try:
        if isinstance(leaf.texture.file, str):
            header = picture_header(next(leaf.texture.sources(), (0, leaf.texture.file))[1])
            return max(header.width, header.height)
    except ValueError:
        return 0
    return 0
