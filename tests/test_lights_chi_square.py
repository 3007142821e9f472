"""Directions of every kind of light against their density, from places that are hard for it.

Directions are mapped with equal area (Lambert's azimuthal projection) about their mean, so that a density per solid
angle is one per area. Bins are quantiles along the principal axes; in each the density that `meet` answers is summed.
"""

import numpy as np
import pytest
import scenes
from chance import chi_square
from test_lights import met, sampled

from warprender.lights import CylinderLight, DiskLight, DistantLight, DomeLight, LightTexture, RectLight, SphereLight

N = 1 << 16
BINS, FINE = 12, 32
PLACES = {
    "plain": np.eye(3),
    "turned": scenes.look_at((1.0, 2.0, 3.0))[:3, :3],
    "stretched": np.diag([3.0, 0.2, 1.0]),
    "sheared": np.array([(1, 0.4, 0), (0.3, 1, -0.5), (0.2, 0.6, 1)]),
    "mirrored": np.diag([-1.0, 1.0, 1.0]),
}


def checks(height=8):
    """(H, 2 H, 3) a picture with bright and dark places."""
    return np.random.default_rng(5).random((height, 2 * height, 3), np.float32) ** 3 + np.float32(0.01)


KINDS = {
    "rect": lambda: RectLight(width=2.0, height=1.4),
    "textured rect": lambda: RectLight(width=2.0, height=1.4, texture=LightTexture.of(checks())),
    "disk": lambda: DiskLight(radius=1.0),
    "sphere": lambda: SphereLight(radius=1.0),
    "cylinder": lambda: CylinderLight(radius=0.6, length=2.0),
}
#: Points of light space that see the light, in units of its half size.
FLAT_POINTS = {
    "in front": (0.2, -0.3, -2.0),
    "close": (0.2, -0.3, -0.02),
    "nearly in its plane": (1.6, 0.2, -1e-2),
    "on its edge": (1.0, 0.1, -1e-3),
    "far away": (40.0, 3.0, -60.0),
}
ROUND_POINTS = {
    "in front": (0.2, -0.3, -2.0),
    "close": (0.2, -0.3, -1.0),
    "beside it": (0.2, 1.6, 0.1),
    "far away": (40.0, 3.0, -60.0),
}
POINTS = dict.fromkeys(("rect", "textured rect", "disk"), FLAT_POINTS)
POINTS |= dict.fromkeys(("sphere", "cylinder"), ROUND_POINTS)
#: A disk is drawn by area. Close to its plane that density has a pole at the horizon, too steep for a sum over bins.
STEEP = [("disk", "close"), ("disk", "on its edge")]
CASES = [(kind, where) for kind in KINDS for where in POINTS[kind] if (kind, where) not in STEEP]


def from_place(kind, where, place, scale):
    """The light and the point, moved and scaled alike."""
    light = KINDS[kind]()
    light.transform = np.eye(4)
    light.transform[:3, :3] = PLACES[place] * scale
    light.transform[3, :3] = np.array([0.5, -0.25, 0.75]) * scale
    point = np.array(POINTS[kind][where])
    return light, (point @ light.local_to_world() + light.transform[3, :3]).astype(np.float32)


def frame_about(axis):
    """(3, 3) orthonormal rows, the last of which is the axis."""
    axis = axis / np.linalg.norm(axis)
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    return np.stack([side, np.cross(axis, side), axis])


def on_the_map(directions, frame):
    """(N, 2) places on the map of equal area whose middle is the frame's last row; within radius 2."""
    x, y, z = (np.asarray(directions, float) @ frame.T).T
    return np.stack([x, y], 1) * np.sqrt(2 / np.maximum(1 + z, 1e-12))[:, None]


def off_the_map(places, frame):
    """Directions (N, 3) of places (N, 2), and whether each is on the map."""
    square = (places**2).sum(1)
    out = np.sqrt(np.maximum(1 - square / 4, 0))[:, None] * places
    return np.column_stack([out, 1 - square / 2]) @ frame, square < 4


def assert_distributed_as_met(light, p, mean=None, slack=3e-3):
    """Directions drawn towards a light from p fall as the density says, and the density integrates to 1."""
    directions = sampled(light, p, N, seed=1)["direction"].astype(float)
    frame = frame_about(directions.mean(0) if mean is None else np.asarray(mean, float))
    places = on_the_map(directions, frame)
    pilot = on_the_map(sampled(light, p, N, seed=2)["direction"], frame)
    _, axes = np.linalg.eigh(np.cov(pilot.T))
    pilot, places = pilot @ axes, places @ axes
    edges = []
    for values in pilot.T:
        # Past the ends, so that nothing of the light is left out.
        inner = np.quantile(values, np.linspace(0, 1, BINS + 1)[1:-1])
        margin = 0.02 * np.ptp(values)
        edges.append(np.r_[values.min() - margin, inner, values.max() + margin])
    observed, _, _ = np.histogram2d(places[:, 0], places[:, 1], edges)
    middles = [(e[:-1, None] + np.diff(e)[:, None] * (np.arange(FINE) + 0.5) / FINE).ravel() for e in edges]
    grid = np.stack(np.meshgrid(*middles, indexing="ij"), -1).reshape(-1, 2)
    way, there = off_the_map(grid @ axes.T, frame)
    density = np.where(there, met(light, p, way.astype(np.float32))["pdf"].astype(float), 0.0)
    cells = density.reshape(BINS, FINE, BINS, FINE).mean((1, 3)) * np.outer(*map(np.diff, edges))
    assert cells.sum() == pytest.approx(1, abs=slack)
    assert chi_square(observed, cells / cells.sum(), N) > 1e-5


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize(("kind", "where"), CASES)
def test_directions_fall_as_their_density_says(kind, where, place):
    assert_distributed_as_met(*from_place(kind, where, place, 1.0))


@pytest.mark.parametrize("scale", [1e-4, 1e4])
@pytest.mark.parametrize(("kind", "where"), CASES)
def test_directions_fall_as_their_density_says_at_any_scale(kind, where, scale):
    assert_distributed_as_met(*from_place(kind, where, "sheared", scale))


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize(("kind", "where"), STEEP)
def test_a_disk_close_by_is_drawn_by_area(kind, where, place, scale):
    light, p = from_place(kind, where, place, scale)
    samples = sampled(light, p, N)
    to_world = light.local_to_world()
    inverse = np.linalg.inv(to_world)
    # The device has the light's place as float32.
    q = (p.astype(float) - light.transform[3, :3].astype(np.float32)) @ inverse
    local = samples["direction"].astype(float) @ inverse
    t = -q[2] / local[:, 2]
    x, y = (q[:2] + t[:, None] * local[:, :2]).T
    # Where a rounded direction meets the plane is known to its distance over the height.
    edges = np.linspace(0, 1.01, 9), np.linspace(-np.pi, np.pi, 17)
    observed, _, _ = np.histogram2d(x**2 + y**2, np.arctan2(y, x), edges)
    share = np.diff(np.minimum(edges[0], 1.0))
    assert chi_square(observed, np.outer(share, np.full(16, 1 / 16)), N) > 1e-5
    # Density per area over that per solid angle: distance² / cos, in the world. The height over the plane, a
    # thousandth of the light's size, has lost three digits.
    normal = np.cross(*to_world[:2])
    area = np.pi * np.linalg.norm(normal)
    way = t[:, None] * samples["direction"].astype(float)
    cosine = np.abs(samples["direction"].astype(float) @ normal) / np.linalg.norm(normal)
    expected = (way**2).sum(1) / (cosine * area)
    ratio = samples["pdf"] / expected
    assert np.abs(ratio - 1).max() < 2e-3 and abs(np.median(ratio) - 1) < 1e-4


@pytest.mark.parametrize("angle", [0.01, 0.53, 10.0, 90.0, 180.0, 270.0, 360.0])
def test_distant_lights(angle):
    light = DistantLight(angle=angle, transform=scenes.look_at((1.0, 2.0, 3.0)))
    assert_distributed_as_met(light, (4.0, 5.0, 6.0), mean=light.transform[2, :3])


@pytest.mark.parametrize("place", ["plain", "turned", "stretched"])
def test_textured_domes(place):
    light = DomeLight(texture=LightTexture.of(checks()))
    light.transform[:3, :3] = PLACES[place]
    assert_distributed_as_met(light, (0, 0, 0), mean=(0.3, 0.5, 0.8), slack=1e-2)
