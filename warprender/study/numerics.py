"""Hard cases measured on this machine: what plain Warp or the textbook does, what we do, and what it costs.

Numbers of the cases are those of the tests in `tests/hard_cases/`, which hold the right column to more than a table
can show.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from html import escape
from pathlib import Path
from statistics import median

import numpy as np
import warp as wp

from ..materials.microfacet import ggx_density
from ..numerics import is_finite, safe_normalize, tangent_of
from ..sampling import one_minus_cos, sample_stream
from ..visibility.rays import RayCaster
from .page import document, rows
from .report import machine, packages

_RAYS = 100_000
_ROUNDS = 5
_HEADS = ("case", "", "plain Warp or the textbook", "warprender", "cost")
#: The table of all cases, as Markdown.
_CATALOGUE = Path(__file__).with_name("catalogue.md")
_OF_THE_CATALOGUE = (
    "Every case, in words. A test holds the fourth column of each; figures of the third were measured with Warp 1.19 "
    "on a CPU."
)


@dataclass(frozen=True)
class Case:
    """One line of the table: the case's number and name, both outcomes, and the cost of ours, in words.

    `measured` says whether the outcomes were measured on this machine; else they are those of the catalogue.
    """

    number: str
    name: str
    plain: str
    ours: str
    cost: str
    measured: bool = True


def measure_cases(progress: Callable[[float, str], None] = lambda done, words: None) -> list[Case]:
    """Run every case that can be shown by a figure; a quarter of a minute."""
    found = []
    for number, measure in enumerate(_CASES):
        progress(number / len(_CASES), measure.__name__.strip("_").replace("_", " "))
        found.append(measure())
    return found


def catalogue() -> list[Case]:
    """All cases, as the tests hold them."""
    lines = _CATALOGUE.read_text(encoding="utf-8").splitlines()[2:]
    return [Case(*(cell.strip() for cell in line.strip("|").split("|")), measured=False) for line in lines]


def write_cases(measured: Sequence[Case], folder: str | Path) -> None:
    """Write numerics.md, numerics.json and numerics.html into a folder, which is made where it does not exist."""
    folder = Path(folder)
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"{folder}: is a file; the table needs a folder")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "numerics.md").write_text(markdown(measured), encoding="utf-8")
    text = json.dumps([asdict(case) for case in (*measured, *catalogue())], indent=2, ensure_ascii=False)
    (folder / "numerics.json").write_text(text + "\n", encoding="utf-8")
    parts = []
    for title, words, cases in _sections(measured):
        lines = [(c.number, c.name, c.plain, c.ours, c.cost) for c in cases]
        parts += [f"<h2>{title}</h2><p>{words}</p>", rows(_HEADS, lines, kind="words")]
    facts = {**machine("cpu", os.cpu_count() or 1), **packages()}
    parts.append("<p>" + escape("; ".join(f"{name} {value}" for name, value in facts.items())) + "</p>")
    (folder / "numerics.html").write_text(document("Hard cases", parts), encoding="utf-8")


def markdown(measured: Sequence[Case]) -> str:
    """Both tables: what was measured, and the catalogue."""
    text = ""
    for title, words, cases in _sections(measured):
        lines = [f"| {' | '.join(_HEADS)} |", "|" + "---|" * len(_HEADS)]
        lines += [f"| {c.number} | {c.name} | {c.plain} | {c.ours} | {c.cost} |" for c in cases]
        text += f"## {title}\n\n{words}\n\n" + "\n".join(lines) + "\n\n"
    return text.rstrip() + "\n"


def _sections(measured: Sequence[Case]) -> tuple[tuple[str, str, Sequence[Case]], ...]:
    """Title, what it is, and lines of each table."""
    return (
        ("Measured here", "Outcomes and times on this machine, now.", measured),
        ("The whole catalogue", _OF_THE_CATALOGUE, catalogue()),
    )


def _rays_at_vertices() -> Case:
    points, faces = _cube(64)
    rng = np.random.default_rng(0)
    targets = points[rng.integers(len(points), size=_RAYS)]
    return _leaks("I2", f"{_RAYS} rays at the vertices of a closed cube, from inside", points, faces, targets, rng)


def _rays_at_edges() -> Case:
    points, faces = _cube(64)
    rng = np.random.default_rng(1)
    corner = faces[rng.integers(len(faces), size=_RAYS)]
    weight = rng.random((_RAYS, 1))
    targets = points[corner[:, 0]] * weight + points[corner[:, 1]] * (1 - weight)
    return _leaks("I2", f"{_RAYS} rays at its edges", points, faces, targets, rng)


def _leaks(
    number: str, name: str, points: np.ndarray, faces: np.ndarray, targets: np.ndarray, rng: np.random.Generator
) -> Case:
    origins = rng.uniform(-0.3, 0.3, (_RAYS, 3)).astype(np.float32)
    directions = (targets - origins).astype(np.float32)
    casters = [RayCaster(points, faces, accuracy=accuracy) for accuracy in ("fast", "watertight")]
    lost = [int((caster.closest(origins, directions).face.numpy() < 0).sum()) for caster in casters]
    ratio = _ratio(*(lambda c=caster: c.closest(origins, directions) for caster in casters))
    return Case(number, name, f"{lost[0]} escape (`wp.mesh_query_ray`)", f"{lost[1]} escape", ratio)


def _tiny_components() -> Case:
    n = 64
    x, y = np.meshgrid(np.arange(n + 1), np.arange(n + 1))
    points = np.stack([x.ravel() / n - 0.5, y.ravel() / n - 0.5, np.zeros((n + 1) ** 2)], 1).astype(np.float32)
    faces = _grid_faces(n)
    inside = (x.ravel() < n) & (y.ravel() < n)
    origins = points[inside] + np.float32([0, 0, 1])
    directions = np.broadcast_to(np.float32([1e-39, 1e-39, -1]), origins.shape)
    hits = [
        int((RayCaster(points, faces, accuracy=a).closest(origins, directions).face.numpy() >= 0).sum())
        for a in ("fast", "watertight")
    ]
    total = len(origins)
    return Case(
        "I8",
        f"direction (1e-39, 1e-39, −1) at {total} vertices of a flat grid",
        f"{hits[0]} hit",
        f"{hits[1]} hit",
        "none: the walk is the same",
    )


def _narrow_lobes() -> Case:
    alpha = np.float32(1e-4)
    angle = np.linspace(0, 5e-4, 1001)
    h = np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], 1).astype(np.float32)
    plain, ours = _formulas(h, np.full(len(h), alpha, np.float32))[:2]
    wide = h.astype(np.float64)
    a = float(alpha)
    exact = 1 / (np.pi * a**2 * ((wide[:, 0] / a) ** 2 + wide[:, 2] ** 2) ** 2)
    return Case(
        "S1",
        "GGX density at α = 1e-4",
        f"relative error {_worst(plain, exact)}: 1 + cos² (α² − 1) cancels",
        f"relative error {_worst(ours, exact)}: (x/α)² + (y/α)² + z²",
        "one division",
    )


def _small_lights() -> Case:
    s2 = (10.0 ** -np.linspace(2, 10, 33)).astype(np.float32)
    plain, ours = _formulas(np.zeros((len(s2), 3), np.float32), s2)[2:4]
    wide = s2.astype(np.float64)
    exact = wide / (1 + np.sqrt(1 - wide))
    return Case(
        "L1",
        "solid angle of a sphere light, radius over distance 1e-1 … 1e-5",
        f"relative error {_worst(plain, exact)}: 1 − √(1 − s²)",
        f"relative error {_worst(ours, exact)}: s² / (1 + √(1 − s²))",
        "one division",
    )


def _lengths_beyond_squares() -> Case:
    sizes = np.float32([1e-30, 1e-23, 1.0, 1e20, 1e30])
    v = np.stack([sizes, sizes, 0 * sizes], 1)
    plain, ours = _formulas(v, np.ones(len(v), np.float32))[4:6]
    good = [int((np.abs(u - 1) < 1e-5).sum()) for u in (plain, ours)]
    return Case(
        "S7",
        "unit vectors of lengths 1e-30 … 1e30",
        f"{good[0]} of {len(sizes)} have length 1 (`wp.normalize`)",
        f"{good[1]} of {len(sizes)}",
        "two comparisons",
    )


def _hidden_nan() -> Case:
    plain, ours = _formulas(np.full((1, 3), np.nan, np.float32), np.ones(1, np.float32))[6:8]
    return Case(
        "A2",
        "a NaN sample",
        f"`wp.clamp` makes it {plain[0]:g}: it darkens the pixel unseen",
        f"kept: {int(ours[0])}; dropped and counted",
        "one test a sample",
    )


def _long_sums() -> Case:
    values = np.random.default_rng(0).random(4096, np.float32)
    repeats = 8192
    exact = values.astype(np.float64).sum() * repeats
    sums = [_sum(dtype, values, repeats) for dtype in (wp.float32, wp.float64)]
    errors = [abs(float(total) - exact) / exact for total in sums]
    ratio = _ratio(*(lambda d=dtype: _sum(d, values, repeats) for dtype in (wp.float32, wp.float64)))
    return Case(
        "A1",
        f"the sum of {len(values) * repeats:.1e} samples",
        f"relative error {errors[0]:.1e} in float32",
        f"{errors[1]:.1e} in float64",
        ratio,
    )


def _frames_about_minus_z() -> Case:
    rng = np.random.default_rng(2)
    n = np.concatenate([[(0, 0, -1)], rng.normal(0, 1e-4, (999, 3)) + (0, 0, -1)])
    n = (n / np.linalg.norm(n, axis=1, keepdims=True)).astype(np.float32)
    plain, ours = _formulas(n, np.ones(len(n), np.float32))[8:10]
    worst = [_worst(v, np.ones(len(v))) for v in (plain, ours)]
    return Case(
        "S8",
        "length of a tangent about 1000 normals near −Z",
        f"relative error {worst[0]}: Frisvad's 1 / (1 + z)",
        f"relative error {worst[1]}: Duff et al.",
        "one sign",
    )


def _shared_streams() -> Case:
    count = 1 << 20
    states = [wp.zeros(count, dtype=t, device="cpu") for t in (wp.uint32, wp.uint32, wp.uint64, wp.uint64)]
    wp.launch(_streams_kernel(), count, states, device="cpu")
    values = [array.numpy() for array in states]
    shared = [len(np.intersect1d(a, b)) for a, b in (values[:2], values[2:])]
    return Case(
        "A4",
        f"random streams that {count} pixels of two seeds have in common",
        f"{shared[0]} (`wp.rand_init`: 32 bits)",
        f"{shared[1]} (64 bits)",
        "a wider hash",
    )


def _far_from_the_origin() -> Case:
    rng = np.random.default_rng(0)
    near = rng.uniform(-1, 1, (1000, 3))
    place = np.array([1e6, 1e6, 1e6])
    camera = place + (0, 0, 5)
    plain = (near + place).astype(np.float32) - camera.astype(np.float32)
    ours = (near + (place - camera)).astype(np.float32)
    errors = [np.abs(v - (near + place - camera)).max() for v in (plain, ours)]
    return Case(
        "C1",
        "a 1 m object seen from 5 m, 1e6 m from the origin",
        f"positions off by {errors[0]:.1e} m in world float32",
        f"{errors[1]:.1e} m: float64 at load, float32 relative to the camera's place",
        "none while rendering",
    )


_CASES = (
    _rays_at_vertices, _rays_at_edges, _tiny_components, _narrow_lobes, _small_lights, _lengths_beyond_squares,
    _long_sums, _hidden_nan, _far_from_the_origin, _frames_about_minus_z, _shared_streams,
)  # fmt: skip


def _cube(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and triangles of the cube from −1 to 1 with n × n quads a side; sides meet in equal coordinates."""
    x, y = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1))
    points, faces = [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            square = np.stack([x.ravel(), y.ravel(), np.full(x.size, side)], 1)
            points.append(np.roll(square, axis, axis=1))
            faces.append(_grid_faces(n) + len(faces) * x.size)
    return np.concatenate(points).astype(np.float32), np.concatenate(faces)


def _grid_faces(n: int) -> np.ndarray:
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    lower = np.stack([first, first + 1, first + n + 2], 1)
    return np.concatenate([lower, np.stack([first, first + n + 2, first + n + 1], 1)])


def _worst(values: np.ndarray, exact: np.ndarray) -> str:
    with np.errstate(invalid="ignore"):
        error = np.abs(values.astype(np.float64) / exact - 1)
    return f"{error.max():.1e}" if np.isfinite(error).all() else "infinite"


def _ratio(plain: Callable[[], object], ours: Callable[[], object]) -> str:
    """Time of ours over that of the plain form, rounds of both taking turns."""
    ratios = []
    for _ in range(_ROUNDS):
        begin = time.perf_counter()
        plain()
        middle = time.perf_counter()
        ours()
        ratios.append((time.perf_counter() - middle) / (middle - begin))
    return f"{median(ratios):.2f} times the time"


def _formulas(v: np.ndarray, x: np.ndarray) -> list[np.ndarray]:
    """Ten columns (N,) float32 in device arithmetic; see the kernel."""
    columns = [wp.zeros(len(x), dtype=wp.float32, device="cpu") for _ in range(10)]
    inputs = [wp.array(v, dtype=wp.vec3, device="cpu"), wp.array(x, dtype=wp.float32, device="cpu")]
    wp.launch(_formulas_kernel(), len(x), [*inputs, *columns], device="cpu")
    return [column.numpy() for column in columns]


@cache
def _formulas_kernel() -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False)
    def formulas(
        v: wp.array(dtype=wp.vec3),
        x: wp.array(dtype=wp.float32),
        plain_ggx: wp.array(dtype=wp.float32),
        our_ggx: wp.array(dtype=wp.float32),
        plain_cone: wp.array(dtype=wp.float32),
        our_cone: wp.array(dtype=wp.float32),
        plain_length: wp.array(dtype=wp.float32),
        our_length: wp.array(dtype=wp.float32),
        clamped: wp.array(dtype=wp.float32),
        finite: wp.array(dtype=wp.float32),
        plain_tangent: wp.array(dtype=wp.float32),
        our_tangent: wp.array(dtype=wp.float32),
    ):
        i = wp.tid()
        a2 = x[i] * x[i]
        cancelling = v[i][2] * v[i][2] * (a2 - 1.0) + 1.0
        plain_ggx[i] = a2 / (wp.pi * cancelling * cancelling)
        our_ggx[i] = ggx_density(v[i], x[i])
        plain_cone[i] = 1.0 - wp.sqrt(1.0 - x[i])
        our_cone[i] = one_minus_cos(x[i])
        plain_length[i] = wp.length(wp.normalize(v[i]))
        our_length[i] = wp.length(safe_normalize(v[i]))
        clamped[i] = wp.clamp(v[i][0], 0.0, 1.0)
        finite[i] = wp.where(is_finite(v[i]), 1.0, 0.0)
        a = 1.0 / (1.0 + v[i][2])
        plain_tangent[i] = wp.length(wp.vec3(1.0 - v[i][0] * v[i][0] * a, -v[i][0] * v[i][1] * a, -v[i][0]))
        our_tangent[i] = wp.length(tangent_of(v[i]))

    return formulas


@cache
def _streams_kernel() -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False)
    def streams(
        plain_0: wp.array(dtype=wp.uint32),
        plain_1: wp.array(dtype=wp.uint32),
        ours_0: wp.array(dtype=wp.uint64),
        ours_1: wp.array(dtype=wp.uint64),
    ):
        i = wp.tid()
        plain_0[i] = wp.rand_init(0, i)
        plain_1[i] = wp.rand_init(1, i)
        ours_0[i] = sample_stream(wp.uint32(0), i, 0, 0).key
        ours_1[i] = sample_stream(wp.uint32(1), i, 0, 0).key

    return streams


def _sum(dtype: type, values: np.ndarray, repeats: int) -> float:
    total = wp.zeros(1, dtype=dtype, device="cpu")
    wp.launch(_sum_kernel(dtype), 1, [wp.array(values, dtype=wp.float32, device="cpu"), repeats, total], device="cpu")
    return float(total.numpy()[0])


@cache
def _sum_kernel(dtype: type) -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False)
    def add(values: wp.array(dtype=wp.float32), repeats: wp.int32, total: wp.array(dtype=dtype)):
        result = dtype(0.0)
        for _ in range(repeats):
            for k in range(values.shape[0]):
                result += dtype(values[k])
        total[0] = result

    return add
