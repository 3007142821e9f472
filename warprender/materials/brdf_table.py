"""Measured BRDFs on the host: files as MERL's, look-up, and the tables that half-vectors are drawn from.

A table has cells over the half- and difference angles of Rusinkiewicz (A New Change of Variables for Efficient BRDF
Representation, 1998): θ_half and φ_half are where the half-vector lies, θ_diff and φ_diff where the light does in a
frame about the half-vector. An isotropic BRDF does not depend on φ_half. Swapping viewer and light adds π to φ_diff,
so that φ_diff from 0 to π is enough. θ_half is stored by its square root, which makes cells small about a highlight.

A cell's value stands for its centre. Between centres it is linear in √θ_half, θ_diff and φ_diff, periodic in φ_diff,
and held beyond the first and the last centre of the other two.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
import warp as wp

from ..images import unpacked
from ..records import BrdfRecord

#: Cells of a MERL file over θ_half, θ_diff and φ_diff.
MERL_CELLS = (90, 90, 180)
#: What a file's red, green and blue numbers are multiplied by to become 1/sr (Matusik et al. 2003, BRDFRead.cpp).
SCALES = np.array([1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0])
#: What a cell without a measurement is written as; any negative number is read so.
MISSING = -1.0

#: Angles of the viewer, rows over √θ_half and columns over the half-vector's azimuth of the sampling tables.
ANGLES, ROWS, COLUMNS = 32, 90, 16
#: Most cells over θ_diff and φ_diff of the means that the tables are made of: wider than the tables' midpoints lie
#: apart, so that no cell of the data falls between them.
_POOLED = (30, 18)
_HEADER = 12


@dataclass(eq=False)
class BrdfTable:
    """An isotropic BRDF by half- and difference angles.

    Attributes:
        values: (θ_half, θ_diff, φ_diff, 3) float32 in 1/sr, linear Rec.709; negative where nothing was measured.
        name: the file that it was read from, for messages.
        remarks: what a measurement had to leave out.
    """

    values: np.ndarray = field(repr=False)
    name: str = ""
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            ValueError: a wrong shape, numbers that are not finite as float32, or no measured cell at all.
        """
        with np.errstate(over="ignore"):
            self.values = np.asarray(self.values, np.float32)
        if self.values.ndim != 4 or self.values.shape[3] != 3 or 0 in self.values.shape:
            raise ValueError(f"a BRDF table has the shape (θ_half, θ_diff, φ_diff, 3), not {self.values.shape}")
        bad = int((~np.isfinite(self.values)).sum())
        if bad:
            raise ValueError(f"{bad} of its {self.values.size} numbers are not finite")
        if not self.measured.any():
            raise ValueError("all of its cells are marked missing")
        self.values = np.where(self.measured[..., None], self.values, np.float32(MISSING))

    @property
    def cells(self) -> tuple[int, int, int]:
        """Numbers of cells over θ_half, θ_diff and φ_diff."""
        return self.values.shape[:3]

    @property
    def measured(self) -> np.ndarray:
        """(θ_half, θ_diff, φ_diff) bool: cells whose numbers are not marked missing."""
        return (self.values >= 0).all(-1)

    @classmethod
    def read(cls, path: str | os.PathLike) -> BrdfTable:
        """Read a file as MERL's: three int32, the cells, then float64 planes of red, green and blue, little-endian.

        Args:
            path: the file, which may lie in a package: `model.usdz[brdfs/brass.binary]`. Any numbers of cells are
                taken as the header has them. A file is read once as long as it does not change.

        Raises:
            ValueError: the file is missing, has another size than its header asks for, or numbers that are not
                finite; the message names it.
        """
        path = os.fspath(path)
        outer = path.split("[", 1)[0]
        stamp = (os.stat(outer).st_mtime_ns, os.stat(outer).st_size) if os.path.isfile(outer) else ()
        return _read(path, stamp)

    def write(self, path: str | os.PathLike) -> None:
        """Write a file as `read` reads it; MERL's own tools read those of 90 × 90 × 180 cells.

        Raises:
            OSError: the file cannot be written.
        """
        planes = np.where(self.measured[..., None], self.values.astype("<f8") / SCALES, MISSING)
        with open(path, "wb") as file:
            file.write(np.array(self.cells, "<i4").tobytes())
            file.write(np.ascontiguousarray(np.moveaxis(planes, 3, 0)).tobytes())

    @cached_property
    def warnings(self) -> list[str]:
        """One line for each thing about the data that a picture will show."""
        lines = list(self.remarks)
        wo, wi = directions(self.cells)
        above = (wo[..., 2] > 0) & (wi[..., 2] > 0)
        missing = int((above & ~self.measured).sum())
        if missing:
            count = int(above.sum())
            lines.append(f"{missing} of {count} cells above the horizon are missing; the nearest are taken")
        if self.largest_albedo() > 1.0:
            lines.append(f"it reflects up to {self.largest_albedo():.3g} times the light that arrives")
        return [f"{self.name}: {line}" for line in lines] if self.name else lines

    @cached_property
    def filled(self) -> np.ndarray:
        """`values` with missing cells as their nearest along θ_diff, or along φ_diff or θ_half where it has none.

        What is below the horizon is missing too: so cells that the horizon cuts are not darkened by it.
        """
        values, known = np.where(self.measured[..., None], self.values, 0.0).astype(np.float32), self.measured
        for axis in (1, 2, 0):
            if known.all():
                break
            values, known = _fill(values, known, axis)
        return values

    def at(self, wo: np.ndarray, wi: np.ndarray) -> np.ndarray:
        """Values for pairs of directions.

        Args:
            wo: (…, 3) unit vectors towards the viewer, z along the normal.
            wi: (…, 3) likewise towards the light.

        Returns:
            (…, 3) float64 in 1/sr, 0 where a direction is not above the horizon.
        """
        return _look_up(self.filled, *np.broadcast_arrays(np.asarray(wo, float), np.asarray(wi, float)))

    @cached_property
    def albedos(self) -> np.ndarray:
        """(93, 3) directional albedos for the viewers of `albedo_angles`."""
        values = _pooled(self.filled, 2, _POOLED[1])
        return np.stack([_reflected(values, angle, 1).sum((0, 1)) for angle in albedo_angles()])

    def largest_albedo(self) -> float:
        """The largest of the directional albedos, of any channel; they come from midpoints, so 1 % is added."""
        return 1.01 * float(self.albedos.max())

    @cached_property
    def distributions(self) -> tuple[np.ndarray, np.ndarray]:
        """Cumulative distributions of rows (ANGLES, ROWS + 1) and columns (ANGLES, ROWS, COLUMNS + 1), float32.

        Cells weigh what they reflect, the mean of the channels. Rows are 0 where nothing is reflected.
        """
        values = _pooled(_pooled(self.filled, 1, _POOLED[0]), 2, _POOLED[1])
        angles = (np.arange(ANGLES) + 0.5) / ANGLES * (np.pi / 2)
        weight = np.stack([_reflected(values, angle, 2).mean(-1) for angle in angles])
        in_rows = weight.sum(2)
        totals = in_rows.sum(1, keepdims=True)
        rows = np.cumsum(in_rows, 1) / np.where(totals > 0, totals, 1.0)
        rows[totals[:, 0] > 0, -1] = 1.0
        even = np.full(COLUMNS, 1.0 / COLUMNS)
        share = np.where(in_rows[..., None] > 0, weight / np.where(in_rows > 0, in_rows, 1.0)[..., None], even)
        columns = np.cumsum(share, 2)
        columns[..., -1] = 1.0
        padded = (np.pad(rows, ((0, 0), (1, 0))), np.pad(columns, ((0, 0), (0, 0), (1, 0))))
        return padded[0].astype(np.float32), padded[1].astype(np.float32)

    def upload(self, device: str) -> tuple[BrdfRecord, list[wp.array]]:
        """The record, and the arrays that must outlive it."""
        rows, columns = self.distributions
        record = BrdfRecord()
        record.values = wp.array(self.filled, dtype=wp.vec3, device=device)
        record.rows = wp.array(rows, dtype=wp.float32, device=device)
        record.columns = wp.array(columns, dtype=wp.float32, device=device)
        return record, [record.values, record.rows, record.columns]


def directions(cells: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Viewer and light at the centre of each cell, (…cells, 3) float64 each; either may lie below the horizon."""
    theta_half = ((np.arange(cells[0]) + 0.5) / cells[0])[:, None, None] ** 2 * (np.pi / 2)
    theta_diff = ((np.arange(cells[1]) + 0.5) / cells[1])[:, None] * (np.pi / 2)
    phi_diff = (np.arange(cells[2]) + 0.5) / cells[2] * np.pi
    x, y, z = np.broadcast_arrays(
        np.sin(theta_diff) * np.cos(phi_diff), np.sin(theta_diff) * np.sin(phi_diff), np.cos(theta_diff)
    )
    sine, cosine = np.sin(theta_half), np.cos(theta_half)
    wi = np.stack([cosine * x + sine * z, np.broadcast_to(y, cells), cosine * z - sine * x], -1)
    h = np.stack(np.broadcast_arrays(sine, 0.0, cosine), -1)
    return 2 * np.broadcast_to(np.cos(theta_diff), cells)[..., None] * h - wi, wi


def angles(wo: np.ndarray, wi: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """θ_half, θ_diff and φ_diff in [0, π] of directions (…, 3); the same numbers where they are swapped."""
    h, d = wo + wi, wi - wo
    theta_diff = np.arctan2(np.linalg.norm(d, axis=-1), np.linalg.norm(h, axis=-1))
    flat = np.hypot(h[..., 0], h[..., 1])
    theta_half = np.arctan2(flat, h[..., 2])
    safe = np.where(flat > 0, flat, 1.0)
    cosine, sine = np.where(flat > 0, h[..., 0] / safe, 1.0), h[..., 1] / safe
    x = np.cos(theta_half) * (cosine * d[..., 0] + sine * d[..., 1]) - np.sin(theta_half) * d[..., 2]
    y = cosine * d[..., 1] - sine * d[..., 0]
    back = (y < 0) | ((y == 0) & (x < 0))
    return theta_half, theta_diff, np.arctan2(np.abs(y), np.where(back, -x, x))


@lru_cache(maxsize=16)
def _read(path: str, stamp: tuple) -> BrdfTable:
    try:
        with unpacked(path) as file:
            data = Path(file).read_bytes()
        return BrdfTable(_parse(data), path)
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror or error}") from None
    except ValueError as error:
        message = str(error)
        raise ValueError(message if message.startswith(path) else f"{path}: {message}") from None


def _parse(data: bytes) -> np.ndarray:
    """(θ_half, θ_diff, φ_diff, 3) in 1/sr, negative where missing."""
    if len(data) < _HEADER:
        raise ValueError(f"no measured BRDF: it has {len(data)} bytes, its header alone takes {_HEADER}")
    cells = [int(n) for n in np.frombuffer(data, "<i4", 3)]
    size = " × ".join(map(str, cells))
    if min(cells) < 1:
        raise ValueError(f"no measured BRDF: its header asks for {size} cells")
    expected = _HEADER + 24 * cells[0] * cells[1] * cells[2]
    if len(data) != expected:
        raise ValueError(f"{size} cells take {expected} bytes, and it has {len(data)}")
    planes = np.frombuffer(data, "<f8", offset=_HEADER).reshape(3, *cells)
    with np.errstate(over="ignore"):
        return (np.moveaxis(planes, 0, 3) * SCALES).astype(np.float32)


def _fill(values: np.ndarray, known: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Values and what is known of them, after unknown cells took the nearest known one along an axis."""
    values, known = np.moveaxis(values, axis, -2), np.moveaxis(known, axis, -1)
    count = known.shape[-1]
    place = np.arange(count)
    before = np.maximum.accumulate(np.where(known, place, -1), -1)
    after = np.minimum.accumulate(np.where(known, place, count)[..., ::-1], -1)[..., ::-1]
    nearer = np.where((before >= 0) & ((after >= count) | (place - before <= after - place)), before, after)
    values = np.take_along_axis(values, np.clip(nearer, 0, count - 1)[..., None], -2)
    known = np.broadcast_to(known.any(-1, keepdims=True), known.shape)
    return np.moveaxis(values, -2, axis), np.moveaxis(known, -1, axis)


def _look_up(values: np.ndarray, wo: np.ndarray, wi: np.ndarray) -> np.ndarray:
    """(…, 3) float64 of a table without missing cells, for directions (…, 3) of one shape."""
    theta_half, theta_diff, phi_diff = angles(wo, wi)
    count = values.shape
    i, s = _held(np.sqrt(theta_half / (np.pi / 2)) * count[0] - 0.5, count[0])
    j, t = _held(theta_diff / (np.pi / 2) * count[1] - 0.5, count[1])
    z = phi_diff / np.pi * count[2] - 0.5
    k = np.floor(z).astype(int)
    flat = values.reshape(-1, 3)
    result = np.zeros(wo.shape)
    for low, along in ((i, 1 - s), (np.minimum(i + 1, count[0] - 1), s)):
        for high, across in ((j, 1 - t), (np.minimum(j + 1, count[1] - 1), t)):
            for layer, around in ((k % count[2], 1 - (z - k)), ((k + 1) % count[2], z - k)):
                index = (low * count[1] + high) * count[2] + layer
                result += (along * across * around)[..., None] * flat[index]
    return np.where(((wo[..., 2] > 0) & (wi[..., 2] > 0))[..., None], result, 0.0)


def _held(x: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Cell below a place and the share of the next one, held at the ends."""
    x = np.clip(x, 0, count - 1)
    i = x.astype(int)
    return i, x - i


def _pooled(values: np.ndarray, axis: int, most: int) -> np.ndarray:
    """Means of equal blocks of cells along an axis, as few cells to a block as leave `most` blocks."""
    count = values.shape[axis]
    block = next(size for size in range(-(-count // most), count + 1) if count % size == 0)
    shape = (*values.shape[:axis], count // block, block, *values.shape[axis + 1 :])
    return values.reshape(shape).mean(axis + 1)


def _reflected(values: np.ndarray, theta: float, fine: int) -> np.ndarray:
    """(ROWS, COLUMNS, 3) share of the light from one angle that each cell of half-vectors reflects.

    Args:
        values: a table without missing cells.
        theta: angle of the viewer.
        fine: midpoints in a cell across its columns; there are 2 across its rows.
    """
    half2, phi = _midpoints(2, fine)
    sine = 2 * np.sqrt(half2 * (1 - half2))
    wo = np.array([np.sin(theta), 0.0, np.cos(theta)])
    total = np.zeros((ROWS, COLUMNS, 3))
    for side in (1.0, -1.0):
        around = side * phi
        h = np.stack(np.broadcast_arrays(sine * np.cos(around), sine * np.sin(around), 1 - 2 * half2), -1)
        along = h @ wo
        wi = 2 * along[..., None] * h - wo
        above = (along > 0) & (wi[..., 2] > 0)
        lit = wi[above]
        value = np.zeros((*above.shape, 3))
        # dω of the light is 4 (wo · h) dω of the half-vector.
        value[above] = _look_up(values, np.broadcast_to(wo, lit.shape), lit) * (4 * along[above] * lit[:, 2])[:, None]
        total += value.reshape(ROWS, 2, COLUMNS, fine, 3).mean((1, 3))
    band = 2 * np.diff(_row_edges())
    return total * (band * np.pi / COLUMNS)[:, None, None]


def albedo_angles() -> np.ndarray:
    """Angles of the viewer in `BrdfTable.albedos`: the normal, centres of MERL's cells over θ_diff, two at grazing."""
    centres = (np.arange(MERL_CELLS[1]) + 0.5) / MERL_CELLS[1] * (np.pi / 2)
    return np.concatenate([[0.0], centres, np.radians([89.75, 89.9])])


def _row_edges() -> np.ndarray:
    """(ROWS + 1,) sin²(θ_half / 2) where the rows of the sampling tables begin and end."""
    return np.sin((np.arange(ROWS + 1) / ROWS) ** 2 * (np.pi / 4)) ** 2


def _midpoints(across_rows: int, across_columns: int) -> tuple[np.ndarray, np.ndarray]:
    """sin²(θ/2) (ROWS · n, 1) and φ (COLUMNS · m,) of the midpoints of sampling cells."""
    share = (np.arange(across_rows) + 0.5) / across_rows
    edges = _row_edges()
    half2 = (edges[:-1, None] * (1 - share) + edges[1:, None] * share).reshape(-1, 1)
    count = COLUMNS * across_columns
    return half2, (np.arange(count) + 0.5) / count * np.pi
