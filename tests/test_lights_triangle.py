"""Triangles that glow, seen from a point: their solid angle, where directions fall, and what it is worth."""

import numpy as np
import pytest
import warp as wp
from chance import SIGMAS, chi_square, polygon_irradiance, solid_angle, z_of

from warprender.lights.triangle import DrawnPoint, SeenTriangle, density_of, draw_point, seen_triangle
from warprender.numerics import mat34
from warprender.records import Instance

N = 1 << 16
SHAPES = {
    "plain": [(-0.7, -0.4, 1.0), (0.9, -0.5, 1.3), (0.1, 0.8, 0.9)],
    "a needle": [(-3.0, 0.5, 1.0), (3.0, 0.5, 1.0), (0.2, 0.501, 1.0)],
    "near": [(-1.0, -1.0, 0.01), (1.5, -1.0, 0.01), (0.0, 1.2, 0.01)],
    "all around": [(-1e4, -1e4, 1.0), (1e4, -1e4, 1.0), (0.0, 1e4, 1.0)],
    "nearly edge-on": [(0.5, -1.0, 1e-3), (3.0, -1.0, 1e-3), (1.0, 1.0, 2e-3)],
    "in its plane": [(0.5, -1.0, 0.0), (3.0, -1.0, 0.0), (1.0, 1.0, 0.0)],
    "small": [(0.3, 0.2, 1.0), (0.34, 0.2, 1.0), (0.3, 0.25, 1.01)],
    "just above the threshold": [(0.0, 0.0, 1.0), (0.025, 0.0, 1.0), (0.0, 0.025, 1.0)],
    "tiny": [(0.3, 0.2, 1.0), (0.3001, 0.2, 1.0), (0.3, 0.2002, 1.0)],
    "far": [(300.0, 200.0, 1000.0), (301.0, 200.0, 1000.0), (300.0, 201.0, 1000.0)],
    "a point": [(0.3, 0.2, 1.0)] * 3,
    "a line": [(0.3, 0.2, 1.0), (0.4, 0.2, 1.0), (0.5, 0.2, 1.0)],
    "at its corner": [(0.0, 0.0, 0.0), (1.0, 0.0, 1.0), (0.0, 1.0, 1.0)],
    "on its edge": [(-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 1.0)],
}


@wp.kernel(module="unique", enable_backward=False)
def points(
    instance: Instance,
    a: wp.vec3,
    b: wp.vec3,
    c: wp.vec3,
    u: wp.array(dtype=wp.vec2),
    out: wp.array(dtype=DrawnPoint),
    seen: wp.array(dtype=SeenTriangle),
    again: wp.array(dtype=wp.float32),
):
    i = wp.tid()
    seen[0] = seen_triangle(instance, a, b, c, wp.vec3())
    out[i] = draw_point(seen[0], u[i])
    again[i] = density_of(seen[0], out[i].way)


def drawn(corners, numbers=None, scale=1.0):
    """Points of a triangle seen from the origin, and its solid angle as the device has it."""
    instance = Instance()
    instance.to_world = mat34(*(np.eye(3, 4) * scale).reshape(-1))
    u = np.random.default_rng(3).random((N, 2), np.float32) if numbers is None else np.float32(numbers)
    out, seen = wp.empty(len(u), dtype=DrawnPoint), wp.empty(1, dtype=SeenTriangle)
    again = wp.empty(len(u), dtype=wp.float32)
    wp.launch(points, len(u), [instance, *map(wp.vec3, corners), wp.array(u, dtype=wp.vec2), out, seen, again])
    np.testing.assert_array_equal(again.numpy()[out.numpy()["pdf"] > 0], out.numpy()["pdf"][out.numpy()["pdf"] > 0])
    return out.numpy(), float(seen.numpy()["solid_angle"][0])


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
@pytest.mark.parametrize("name", SHAPES)
def test_points_lie_on_the_triangle_and_give_its_irradiance(name, scale):
    corners = np.array(SHAPES[name])
    out, _ = drawn(corners, scale=scale)
    assert np.isfinite(out["way"]).all() and np.isfinite(out["pdf"]).all()
    assert (out["u"] >= 0).all() and (out["v"] >= 0).all() and (out["u"] + out["v"] <= 1 + 1e-6).all()
    if name in ("a point", "a line", "in its plane", "at its corner", "on its edge"):
        return
    way = out["way"].astype(float)
    cosine = way[:, 2] / np.linalg.norm(way, axis=1)
    expected = polygon_irradiance(np.zeros(3), np.array([0, 0, 1.0]), corners)
    found = np.divide(cosine, out["pdf"], out=np.zeros(N), where=out["pdf"] > 0)
    assert abs(z_of(found, expected, floor=1e-4)) < SIGMAS


@pytest.mark.parametrize("name", [n for n in SHAPES if n not in ("in its plane", "a point", "a line", "at its corner")])
def test_the_solid_angle_is_that_of_float64(name):
    exact = solid_angle(np.zeros(3), SHAPES[name])
    _, found = drawn(np.array(SHAPES[name]), [(0.5, 0.5)])
    if found > 0:
        np.testing.assert_allclose(found, exact, rtol=2e-4 if name == "nearly edge-on" else 2e-5)
    else:
        assert exact < 3.1e-4 or name == "on its edge"


@pytest.mark.parametrize("name", ["plain", "a needle", "near", "all around", "small", "just above the threshold"])
def test_directions_are_uniform_in_solid_angle(name):
    corners = np.array(SHAPES[name], float)
    out, found = drawn(corners)
    assert found > 0
    # Parts of the triangle between weights of corner c, and within them of b: their solid angles in float64.
    count = 8
    v = out["v"].astype(float)
    rest = np.clip(out["u"] / np.maximum(1 - v, 1e-9), 0, 1 - 1e-9)
    # Edges of the parts where the samples are, so that none is nearly empty.
    v_edges = np.r_[0, np.quantile(v, np.arange(1, count) / count), 1]
    r_edges = np.r_[0, np.quantile(rest, np.arange(1, count) / count), 1]
    observed, _, _ = np.histogram2d(v[: N // 2], rest[: N // 2], (v_edges, r_edges))
    place = lambda a, b: corners[0] + (1 - a) * b * (corners[1] - corners[0]) + a * (corners[2] - corners[0])  # noqa: E731
    expected = np.zeros((count, count))
    for i, j in np.ndindex(count, count):
        cell = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
        expected[i, j] = solid_angle(np.zeros(3), [place(v_edges[a], r_edges[b]) for a, b in cell])
    np.testing.assert_allclose(expected.sum(), solid_angle(np.zeros(3), corners), rtol=1e-6)
    assert chi_square(observed, expected / expected.sum(), N // 2) > 1e-5


def test_the_four_corners_of_the_unit_square():
    corners = [(0.0, 0.0), (1 - 2**-24, 0.0), (0.0, 1 - 2**-24), (1 - 2**-24, 1 - 2**-24)]
    for name in SHAPES:
        out, _ = drawn(np.array(SHAPES[name]), corners)
        assert np.isfinite(out["way"]).all() and np.isfinite(out["pdf"]).all()
