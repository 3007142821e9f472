"""Cases L1 to L3 of the catalogue at every scale: lights seen from close by, from their plane, over their edge."""

import numpy as np
import pytest
import scenes
from chance import SIGMAS, solid_angle, z_of
from test_lights import met, outline, sampled

import warprender as wr

SCALES = (1e-4, 1.0, 1e4)
SHEAR = np.array([(1, 0.4, 0), (0.3, 1, -0.5), (0.2, 0.6, 1)])
PLACES = {"plain": np.eye(3), "turned": scenes.look_at((1.0, 2.0, 3.0))[:3, :3], "sheared": SHEAR}
#: Points of light space, in units of the light's half size, in front of it.
POINTS = {
    "in front": (0.2, -0.3, -2.0),
    "close": (0.2, -0.3, -0.02),
    "nearly in its plane": (1.6, 0.2, -1e-3),
    "under its edge": (1.0, 0.1, -0.05),
    "far to the side": (40.0, 3.0, -1.0),
}
KINDS = {
    "rect": lambda s: wr.RectLight(width=2 * s, height=1.4 * s),
    "disk": lambda s: wr.DiskLight(radius=s),
    "sphere": lambda s: wr.SphereLight(radius=s),
}


def seen(kind, place, scale, where):
    """The light and a point that sees it."""
    light = KINDS[kind](scale)
    light.transform = np.eye(4)
    light.transform[:3, :3] = PLACES[place]
    light.transform[3, :3] = np.array([0.5, -0.25, 0.75]) * scale
    point = np.array(POINTS[where], float)
    if kind == "sphere" and np.linalg.norm(point) < 1.01:
        point = 1.01 * point / np.linalg.norm(point)
    # Flat lights have their normal mended: the point keeps its height over the sheared plane.
    linear = light.local_to_world()
    return light, (point * scale) @ linear + light.transform[3, :3]


def vector_irradiance(p, corners):
    """∫ ω dω over a polygon seen from p, float64 (Lambert 1760)."""
    v = np.asarray(corners, float) - p
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    w = np.roll(v, -1, axis=0)
    cross = np.cross(v, w)
    length = np.linalg.norm(cross, axis=1)
    angle = np.arctan2(length, (v * w).sum(1))
    total = (cross * (angle / np.maximum(length, 1e-300))[:, None]).sum(0) / 2
    # Towards the polygon, whichever way round it was.
    return total * np.sign(total @ v.mean(0))


@pytest.mark.parametrize("where", POINTS)
@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("kind", KINDS)
def test_l1_l2_l3_moments_of_the_directions(kind, place, scale, where):
    light, p = seen(kind, place, scale, where)
    # The device has the point as float32: so has the reference.
    p = p.astype(np.float32).astype(float)
    m = light.transform.copy()
    corners = outline(light, p) if kind == "sphere" else flat_outline(light)
    light.transform = m
    samples = sampled(light, p, 1 << 15)
    pdf = samples["pdf"].astype(float)
    assert (pdf > 0).mean() > 0.999
    weight = np.divide(1.0, pdf, out=np.zeros(len(pdf)), where=pdf > 0)
    exact = vector_irradiance(p, corners)
    whole = np.linalg.norm(exact)
    # Rounding of the point beside a light whose plane it nearly lies in.
    floor = {"nearly in its plane": 3e-3, "close": 5e-4}.get(where, 2e-4)
    assert abs(z_of(weight, solid_angle_of(p, corners), floor=floor)) < SIGMAS
    for axis in (exact / whole, scenes.look_at((0, 0, 0), tuple(exact / whole), up=(0.3, 0.5, 0.8))[0, :3]):
        values = weight * (samples["direction"].astype(float) @ axis)
        error = np.hypot(values.std() / len(values) ** 0.5, floor * whole)
        assert abs(values.mean() - exact @ axis) < SIGMAS * error


def flat_outline(light):
    """Corners in the world of a flat light."""
    if isinstance(light, wr.RectLight):
        w, h = light.width / 2, light.height / 2
        local = np.array([(-w, -h, 0), (w, -h, 0), (w, h, 0), (-w, h, 0)])
    else:
        ring = np.exp(2j * np.pi * np.arange(4096) / 4096)
        local = light.radius * np.stack([ring.real, ring.imag, 0 * ring.real], 1)
    return local @ light.transform[:3, :3] + light.transform[3, :3]


def solid_angle_of(p, corners):
    """As a fan about the middle, so that no triangle of it is larger than a half sphere."""
    middle = corners.mean(0)
    pairs = zip(corners, np.roll(corners, -1, 0), strict=True)
    return sum(solid_angle(p, np.stack([middle, a, b])) for a, b in pairs)


@pytest.mark.parametrize("where", POINTS)
@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("kind", KINDS)
def test_l2_sampling_and_meeting_agree(kind, place, scale, where):
    light, p = seen(kind, place, scale, where)
    samples = sampled(light, p, 4096)
    found = samples["pdf"] > 0
    again = met(light, p, samples["direction"][found])
    # A rounded direction crosses the rim; from nearly the plane of a flat light the rim is most of what is seen.
    missed = (again["pdf"] <= 0).mean()
    assert missed < (0.01 if where in ("in front", "under its edge", "close") else 0.03)
    ratio = again["pdf"][again["pdf"] > 0] / samples["pdf"][found][again["pdf"] > 0]
    assert np.median(np.abs(ratio - 1)) < 1e-3
    assert (np.abs(ratio - 1) > 0.02).mean() < 0.01
