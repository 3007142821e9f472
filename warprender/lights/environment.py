"""Pictures on lights: texels, and for a dome the drawing of directions in proportion to them.

A dome's directions are looked up as UsdLux says: latitude and longitude, the pole along +Y, +Z at the middle of the
picture, +X a quarter from its left edge. Other formats become latitude and longitude at upload.

Directions are drawn over bins of rows and columns. A bin's weight is the exact integral of the luminance that
bilinear look-up gives, to the change of sin θ within one texel; sums are float64, and each row is normalised by
itself, so that a sun in one texel takes no digits from its neighbours' rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..color import LUMINANCE
from ..given import shown
from ..numerics import PI
from ..records import ImageRecord
from ..sampling import interval_of, share_of

#: Bins at most; larger pictures share bins between neighbouring texels.
MOST_BINS = 2**21

FORMATS = ("automatic", "latlong", "mirroredBall", "angular", "cubeMapVerticalCross")


@dataclass
class LightTexture:
    """Texels that a light's radiance is multiplied by.

    Attributes:
        texels: (H, W, 3) float32 linear Rec.709, row 0 at the top.
        warnings: what had to be mended.
    """

    texels: np.ndarray
    warnings: tuple[str, ...] = ()

    @classmethod
    def of(cls, texels: np.ndarray) -> LightTexture:
        """Texels that are finite and not negative: others become 0, with a warning.

        Args:
            texels: (H, W, 3 or more) linear Rec.709, row 0 at the top; a dome's by latitude and longitude.

        Raises:
            ValueError: an array of another shape.
        """
        texels = np.asarray(texels, np.float32)
        if texels.ndim != 3 or texels.shape[2] < 3 or 0 in texels.shape:
            raise ValueError(f"a picture is an array (height, width, 3), not {texels.shape}")
        bad = ~(np.isfinite(texels[..., :3]) & (texels[..., :3] >= 0)).all(2)
        if not bad.any():
            return cls(np.ascontiguousarray(texels[..., :3]))
        warning = f"{int(bad.sum())} texels are negative or not finite and count as black"
        return cls(np.where(bad[..., None], np.float32(0), texels[..., :3]), (warning,))

    def mean(self) -> float:
        """Mean luminance."""
        return float(self.texels.mean((0, 1), dtype=np.float64) @ LUMINANCE)

    def mean_over_sphere(self) -> float:
        """Mean luminance over all directions, the picture taken as latitude and longitude."""
        edges = np.cos(np.linspace(0, np.pi, len(self.texels) + 1))
        rows = (self.texels.mean(1, dtype=np.float64) @ LUMINANCE) * -np.diff(edges)
        return float(rows.sum() / 2)

    def upload(self, device: str, drawn_from: bool) -> tuple[ImageRecord, list[wp.array]]:
        """The record, and the arrays that must outlive it; tables only where directions are drawn from it."""
        record = ImageRecord()
        record.texels = wp.array(self.texels, dtype=wp.vec3, device=device)
        kept = [record.texels]
        if drawn_from:
            rows, columns, density = bins(self.texels)
            record.rows = wp.array(rows, dtype=wp.float32, device=device)
            record.columns = wp.array(columns, dtype=wp.float32, device=device)
            record.density = wp.array(density, dtype=wp.float32, device=device)
            kept += [record.rows, record.columns, record.density]
        return record, kept


def fault_of_texture(texture: object) -> str:
    """What is wrong with a light's texture, in a few words; None is none."""
    if texture is None or isinstance(texture, LightTexture):
        return ""
    return f"texture is {shown(texture)}, not a LightTexture, as LightTexture.of(texels) makes it"


def bins(texels: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tables to draw directions of a dome from.

    Args:
        texels: (H, W, 3) latitude and longitude, not all black.

    Returns:
        Cumulative distributions of rows (R + 1,) and, row by row, of columns (R, C + 1), and the density (R, C) per
        solid angle; float64.
    """
    weight = _over_texels(texels @ LUMINANCE.astype(np.float64))
    height, width = weight.shape
    polar = np.linspace(0, np.pi, height + 1)
    # cos a - cos b without cancellation at the poles.
    band = 2 * np.sin((polar[:-1] + polar[1:]) / 2) * np.sin(np.diff(polar) / 2)
    weight = weight * band[:, None]
    shared = 1
    while weight.size / shared**2 > MOST_BINS or height % shared or width % shared:
        shared += 1
        if shared > min(height, width):
            shared = 1
            break
    weight = weight.reshape(height // shared, shared, width // shared, shared).sum((1, 3))
    band = band.reshape(-1, shared).sum(1)

    row_sums = weight.sum(1)
    rows = np.concatenate([[0.0], np.cumsum(row_sums)]) / row_sums.sum()
    even = np.full(weight.shape[1], 1.0 / weight.shape[1])
    share = np.where(row_sums[:, None] > 0, weight / np.where(row_sums > 0, row_sums, 1.0)[:, None], even)
    columns = np.concatenate([np.zeros((len(share), 1)), np.cumsum(share, 1)], 1)
    columns[:, -1] = 1.0
    rows[-1] = 1.0
    solid_angle = 2 * np.pi / weight.shape[1] * band
    density = weight / row_sums.sum() / solid_angle[:, None]
    return rows, columns, density


def _over_texels(luminance: np.ndarray) -> np.ndarray:
    """Mean over each texel of what bilinear look-up gives: (1, 6, 1) / 8 along both axes."""
    around = np.roll(luminance, 1, 1) + np.roll(luminance, -1, 1)
    luminance = 0.75 * luminance + 0.125 * around
    padded = np.pad(luminance, ((1, 1), (0, 0)), mode="edge")
    return 0.75 * luminance + 0.125 * (padded[:-2] + padded[2:])


def to_latlong(texels: np.ndarray, format: str) -> np.ndarray:
    """A dome's picture of any of `FORMATS` as latitude and longitude, (H, 2 H, 3)."""
    if format in ("automatic", "latlong"):
        return texels
    if format not in FORMATS:
        raise ValueError(f"texture format {format!r} is not one of {', '.join(FORMATS)}")
    height = min(texels.shape[0], 1024) if format != "cubeMapVerticalCross" else min(texels.shape[0] // 2, 1024)
    height = max(height, 2)
    polar = (np.arange(height) + 0.5) / height * np.pi
    longitude = np.pi * (1 - 2 * (np.arange(2 * height) + 0.5) / (2 * height))
    x = np.sin(polar)[:, None] * np.sin(longitude)
    z = np.sin(polar)[:, None] * np.cos(longitude)
    y = np.broadcast_to(np.cos(polar)[:, None], x.shape)
    column, row = {
        "mirroredBall": _on_mirrored_ball,
        "angular": _on_angular_map,
        "cubeMapVerticalCross": _on_vertical_cross,
    }[format](x, y, z)
    return _bilinear(texels, column * texels.shape[1] - 0.5, row * texels.shape[0] - 0.5)


def _on_mirrored_ball(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orthogonal view of a mirror ball from +Z: +Z in the middle, -Z all around the rim, +X to the right."""
    radius = np.sqrt(np.maximum(1 - z, 0) / 2)
    return _radial(x, y, radius)


def _on_angular_map(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """As the mirrored ball, with the radius in proportion to the angle from +Z (Debevec's light probes)."""
    return _radial(x, y, np.arccos(np.clip(z, -1, 1)) / np.pi)


def _radial(x: np.ndarray, y: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    length = np.hypot(x, y)
    scale = radius / np.where(length > 0, length, 1.0)
    return (1 + x * scale) / 2, (1 - y * scale) / 2


def _on_vertical_cross(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Three by four faces: +Y; +X, +Z, -X as seen from inside; -Y; -Z upside down."""
    ax, ay, az = np.abs(x), np.abs(y), np.abs(z)
    faces = [
        # Which directions, the face's column and row, and right and down on it.
        ((ay >= ax) & (ay >= az) & (y > 0), 1, 0, -x, z, ay),
        ((ay >= ax) & (ay >= az) & (y <= 0), 1, 2, -x, -z, ay),
        ((ax > ay) & (ax >= az) & (x > 0), 0, 1, z, -y, ax),
        ((ax > ay) & (ax >= az) & (x <= 0), 2, 1, -z, -y, ax),
        ((az > ay) & (az > ax) & (z > 0), 1, 1, -x, -y, az),
        ((az > ay) & (az > ax) & (z <= 0), 1, 3, -x, y, az),
    ]
    column, row = np.zeros_like(x), np.zeros_like(x)
    for chosen, face_column, face_row, right, down, depth in faces:
        column[chosen] = (face_column + (1 + right[chosen] / depth[chosen]) / 2) / 3
        row[chosen] = (face_row + (1 + down[chosen] / depth[chosen]) / 2) / 4
    return column, row


def _bilinear(texels: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Texels at (x, y) in texels from the first one's centre, held at the edges."""
    height, width = texels.shape[:2]
    x, y = np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)
    i, j = np.minimum(x.astype(int), max(width - 2, 0)), np.minimum(y.astype(int), max(height - 2, 0))
    right, down = np.minimum(i + 1, width - 1), np.minimum(j + 1, height - 1)
    s, t = (x - i)[..., None], (y - j)[..., None]
    top = texels[j, i] * (1 - s) + texels[j, right] * s
    bottom = texels[down, i] * (1 - s) + texels[down, right] * s
    return (top * (1 - t) + bottom * t).astype(np.float32)


@wp.func
def texel_at(image: ImageRecord, u: float, v: float, around: bool) -> wp.vec3:
    """Bilinear texel at (u, v) in [0, 1], v down; columns join at the edges where `around`, all else is held."""
    height = image.texels.shape[0]
    width = image.texels.shape[1]
    x = u * wp.float32(width) - 0.5
    y = wp.clamp(v * wp.float32(height) - 0.5, 0.0, wp.float32(height - 1))
    if not around:
        x = wp.clamp(x, 0.0, wp.float32(width - 1))
    i = wp.int32(wp.floor(x))
    j = wp.min(wp.int32(y), height - 1)
    s = x - wp.float32(i)
    t = y - wp.float32(j)
    left = wp.clamp(i, 0, width - 1)
    right = wp.clamp(i + 1, 0, width - 1)
    if around:
        left = (i + width) % width
        right = (i + 1 + width) % width
    below = wp.min(j + 1, height - 1)
    top = image.texels[j, left] * (1.0 - s) + image.texels[j, right] * s
    bottom = image.texels[below, left] * (1.0 - s) + image.texels[below, right] * s
    return top * (1.0 - t) + bottom * t


@wp.func
def place_of(direction: wp.vec3) -> wp.vec2:
    """(u, v) of a unit direction in the dome's space."""
    longitude = wp.atan2(direction[0], direction[2])
    polar = wp.atan2(wp.sqrt(direction[0] * direction[0] + direction[2] * direction[2]), direction[1])
    return wp.vec2(wp.clamp(0.5 - longitude / (2.0 * PI), 0.0, 1.0), wp.clamp(polar / PI, 0.0, 1.0))


@wp.func
def radiance_from(image: ImageRecord, direction: wp.vec3) -> wp.vec3:
    """Texel in a unit direction of the dome's space."""
    place = place_of(direction)
    return texel_at(image, place[0], place[1], True)


@wp.func
def density_of(image: ImageRecord, direction: wp.vec3) -> float:
    """Density per solid angle of `draw_direction`."""
    place = place_of(direction)
    row = wp.min(wp.int32(place[1] * wp.float32(image.density.shape[0])), image.density.shape[0] - 1)
    column = wp.min(wp.int32(place[0] * wp.float32(image.density.shape[1])), image.density.shape[1] - 1)
    return image.density[row, column]


@wp.func
def draw_direction(image: ImageRecord, u: wp.vec2) -> wp.vec3:
    """Unit direction of the dome's space; uniform within a bin."""
    rows = image.density.shape[0]
    columns = image.density.shape[1]
    row = interval_of(image.rows, u[1])
    s = share_of(image.rows[row], image.rows[row + 1], u[1])
    column = interval_of(image.columns[row], u[0])
    t = share_of(image.columns[row, column], image.columns[row, column + 1], u[0])

    # Uniform in cos θ between the rows' edges: 2 sin² of the half angle keeps its digits at the poles.
    top = wp.sin(0.5 * PI * wp.float32(row) / wp.float32(rows))
    bottom = wp.sin(0.5 * PI * wp.float32(row + 1) / wp.float32(rows))
    half2 = top * top * (1.0 - s) + bottom * bottom * s
    cos_polar = 1.0 - 2.0 * half2
    sin_polar = 2.0 * wp.sqrt(half2 * wp.max(1.0 - half2, 0.0))
    longitude = PI * (1.0 - 2.0 * (wp.float32(column) + t) / wp.float32(columns))
    return wp.vec3(sin_polar * wp.sin(longitude), cos_polar, sin_polar * wp.cos(longitude))
