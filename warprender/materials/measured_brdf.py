"""Measured BRDFs: look-up by half- and difference angles (see `brdf_table.py`), and directions drawn from the data.

Directions come from two lobes. One draws half-vectors from a table that holds, for the viewer's angle, how much each
of them reflects; its density is constant over a cell of half-vectors. The other is cosine-weighted, so that what the
table does not see between its midpoints is found too.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cache

import numpy as np
import warp as wp

from ..numerics import PI
from ..records import BrdfRecord, Bsdf, BsdfSample, BsdfValue, DeviceScene, Surface
from ..sampling import cosine_hemisphere, cosine_hemisphere_pdf, interval_of, share_of
from .brdf_table import ANGLES, COLUMNS, ROWS, BrdfTable
from .material import BaseMaterial
from .scattering import scattered

ALBEDO = wp.constant(wp.int32(0))

#: Share of the samples that are cosine-weighted.
COSINE_SHARE = wp.constant(wp.float32(0.1))


@dataclass
class MeasuredBRDF(BaseMaterial):
    """A BRDF looked up in a file of MERL's format; it neither emits nor lets light through.

    It is isotropic, and seen alike from both sides. A measurement does not tell a diffuse part from a specular one: a
    light's `diffuse` scales all of it, its `specular` nothing.

    Attributes:
        file: path of the file, or a `BrdfTable`. It is read here.

    Raises:
        ValueError: the file cannot be read; the message names it.
    """

    file: str | os.PathLike | BrdfTable

    def __post_init__(self) -> None:
        self.table = self.file if isinstance(self.file, BrdfTable) else BrdfTable.read(self.file)

    def pack(self) -> np.ndarray:
        """Values by input number: (1, 3), the albedo seen along the normal."""
        return self.table.albedos[:1].astype(np.float32)

    def lobes(self) -> tuple[str, ...]:
        """What was measured is one."""
        return ("measured",)

    def largest_albedo(self) -> float:
        """Upper bound on the reflected share of light, any direction and channel; data may reflect more than 1."""
        return self.table.largest_albedo()


@cache
def prepare_function(features: tuple[str, ...]) -> wp.Function:
    """`prepare(scene, surface) -> Bsdf`, the same for all features."""
    return prepare


@wp.func
def prepare(scene: DeviceScene, surface: Surface) -> Bsdf:
    """Which table it is, and for the albedo output its colour."""
    bsdf = Bsdf()
    bsdf.diffuse = scene.materials[surface.material].values[ALBEDO]
    bsdf.present = 1.0
    bsdf.table = scene.materials[surface.material].table
    return bsdf


@wp.func
def polar_angle(w: wp.vec3) -> float:
    """Angle from +Z of a vector of any length."""
    return wp.atan2(wp.sqrt(w[0] * w[0] + w[1] * w[1]), w[2])


@wp.func
def azimuth(w: wp.vec3) -> wp.vec2:
    """Direction in the plane of the surface; +X for the normal."""
    length = wp.sqrt(w[0] * w[0] + w[1] * w[1])
    if length <= 0.0:
        return wp.vec2(1.0, 0.0)
    return wp.vec2(w[0] / length, w[1] / length)


@wp.func
def phi_difference(h: wp.vec3, d: wp.vec3, theta_half: float) -> float:
    """φ_diff from 0 to π, for the sum h and the difference d of two directions: the same bits for d and -d."""
    to = azimuth(h)
    x = wp.cos(theta_half) * (to[0] * d[0] + to[1] * d[1]) - wp.sin(theta_half) * d[2]
    y = to[0] * d[1] - to[1] * d[0]
    if y < 0.0 or (y == 0.0 and x < 0.0):
        x = -x
    return wp.atan2(wp.abs(y), x)


@wp.func
def brdf_at(brdf: BrdfRecord, wo: wp.vec3, wi: wp.vec3) -> wp.vec3:
    """Value in 1/sr for two unit vectors above the horizon, the same bits where they are swapped."""
    h = wo + wi
    d = wi - wo
    theta_half = polar_angle(h)
    theta_diff = wp.atan2(wp.length(d), wp.length(h))
    rows = brdf.values.shape[0]
    columns = brdf.values.shape[1]
    layers = brdf.values.shape[2]
    x = wp.sqrt(theta_half * (2.0 / PI)) * wp.float32(rows) - 0.5
    y = theta_diff * (2.0 / PI) * wp.float32(columns) - 0.5
    z = phi_difference(h, d, theta_half) / PI * wp.float32(layers) - 0.5
    x = wp.clamp(x, 0.0, wp.float32(rows - 1))
    y = wp.clamp(y, 0.0, wp.float32(columns - 1))
    i = wp.min(wp.int32(x), rows - 1)
    j = wp.min(wp.int32(y), columns - 1)
    k = wp.int32(wp.floor(z))
    s = x - wp.float32(i)
    t = y - wp.float32(j)
    r = z - wp.float32(k)
    result = wp.vec3(0.0, 0.0, 0.0)
    for corner in range(8):
        a = corner & 1
        b = (corner >> 1) & 1
        c = corner >> 2
        weight = wp.where(a == 1, s, 1.0 - s) * wp.where(b == 1, t, 1.0 - t) * wp.where(c == 1, r, 1.0 - r)
        layer = (k + c + layers) % layers
        result += brdf.values[wp.min(i + a, rows - 1), wp.min(j + b, columns - 1), layer] * weight
    return result


@wp.func
def row_edge(row: int) -> float:
    """sin²(θ_half / 2) where a row of the sampling tables begins."""
    share = wp.float32(row) / wp.float32(wp.static(ROWS))
    sine = wp.sin(0.25 * PI * share * share)
    return sine * sine


@wp.func
def angle_number(wo: wp.vec3) -> int:
    """Which of the sampling tables serves a viewer."""
    return wp.min(wp.int32(polar_angle(wo) * (2.0 / PI) * wp.float32(wp.static(ANGLES))), wp.static(ANGLES - 1))


@wp.func
def cosine_share(brdf: BrdfRecord, wo: wp.vec3) -> float:
    """Share of the cosine-weighted lobe: all where the table has nothing to draw."""
    return wp.where(brdf.rows[angle_number(wo), wp.static(ROWS)] > 0.0, COSINE_SHARE, 1.0)


@wp.func
def draw_half_vector(brdf: BrdfRecord, wo: wp.vec3, u: wp.vec2) -> wp.vec3:
    """A half-vector from the sampling table of the viewer's angle, uniform within a cell."""
    angle = angle_number(wo)
    row = interval_of(brdf.rows[angle], u[1])
    s = share_of(brdf.rows[angle, row], brdf.rows[angle, row + 1], u[1])
    # Half of the numbers are for each side of the viewer's plane.
    side = wp.where(u[0] < 0.5, 1.0, -1.0)
    x = wp.where(u[0] < 0.5, 2.0 * u[0], 2.0 * u[0] - 1.0)
    column = interval_of(brdf.columns[angle, row], x)
    t = share_of(brdf.columns[angle, row, column], brdf.columns[angle, row, column + 1], x)
    half2 = row_edge(row) * (1.0 - s) + row_edge(row + 1) * s
    sine = 2.0 * wp.sqrt(half2 * wp.max(1.0 - half2, 0.0))
    phi = side * PI * (wp.float32(column) + t) / wp.float32(wp.static(COLUMNS))
    to = azimuth(wo)
    x = wp.cos(phi)
    y = wp.sin(phi)
    return wp.vec3(sine * (to[0] * x - to[1] * y), sine * (to[1] * x + to[0] * y), 1.0 - 2.0 * half2)


@wp.func
def half_vector_pdf(brdf: BrdfRecord, wo: wp.vec3, h: wp.vec3) -> float:
    """Density per solid angle of reflecting wo about what `draw_half_vector` gives, at the unit vector h."""
    angle = angle_number(wo)
    row = wp.int32(wp.sqrt(polar_angle(h) * (2.0 / PI)) * wp.float32(wp.static(ROWS)))
    row = wp.min(row, wp.static(ROWS - 1))
    a = azimuth(wo)
    b = azimuth(h)
    phi = wp.atan2(wp.abs(a[0] * b[1] - a[1] * b[0]), a[0] * b[0] + a[1] * b[1])
    column = wp.min(wp.int32(phi / PI * wp.float32(wp.static(COLUMNS))), wp.static(COLUMNS - 1))
    chance = brdf.rows[angle, row + 1] - brdf.rows[angle, row]
    chance = chance * (brdf.columns[angle, row, column + 1] - brdf.columns[angle, row, column])
    # Both sides of the viewer's plane: a band of cos θ times 2 π / columns.
    solid_angle = 4.0 * PI / wp.float32(wp.static(COLUMNS)) * (row_edge(row + 1) - row_edge(row))
    return chance / (solid_angle * 4.0 * wp.dot(wo, h))


@wp.func
def evaluate(scene: DeviceScene, bsdf: Bsdf, wo: wp.vec3, wi: wp.vec3) -> BsdfValue:
    """The table's value, with the pdf of `sample`."""
    value = BsdfValue()
    if wo[2] <= 0.0 or wi[2] <= 0.0:
        return value
    h = wo + wi
    length = wp.length(h)
    # Opposite directions have no half-vector (hard case S9).
    if length < 1.0e-6:
        return value
    brdf = scene.brdfs[bsdf.table]
    share = cosine_share(brdf, wo)
    value.diffuse = brdf_at(brdf, wo, wi) * wi[2]
    value.pdf = share * cosine_hemisphere_pdf(wi[2])
    if share < 1.0:
        value.pdf += (1.0 - share) * half_vector_pdf(brdf, wo, h / length)
    return value


@wp.func
def sample(scene: DeviceScene, bsdf: Bsdf, wo: wp.vec3, u: wp.vec2, lobe: float) -> BsdfSample:
    """Pick a lobe, and weigh by the pdf of both."""
    brdf = scene.brdfs[bsdf.table]
    wi = cosine_hemisphere(u)
    if lobe >= cosine_share(brdf, wo):
        h = draw_half_vector(brdf, wo, u)
        wi = h * (2.0 * wp.dot(wo, h)) - wo
    return scattered(wi, evaluate(scene, bsdf, wo, wi), 1.0)
