"""Newton's shapes without Newton: closed forms of those that are made here, and what they share."""

from types import SimpleNamespace

import numpy as np
import pytest

from warprender import newton_shapes as kinds
from warprender.shapes import Sphere


def made(kind, scale, source=None):
    """Triangles (T, 3, 3) of a shape where it stands."""
    _, factor, make = kinds.shape_of(kind, np.array(scale, float), source)
    mesh = make()
    return mesh.host_points().astype(np.float64)[mesh.triangles] * factor


def volume(corners):
    return np.einsum("tk,tk->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6


def is_closed(corners):
    """Whether each edge is met once in each direction."""
    keys = {tuple(p) for p in np.round(corners, 6).reshape(-1, 3).tolist()}
    number = {p: i for i, p in enumerate(sorted(keys))}
    faces = np.array([[number[tuple(p)] for p in t] for t in np.round(corners, 6).tolist()])
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there, back = ({tuple(e) for e in pairs.tolist()} for pairs in (edges, edges[:, ::-1]))
    return len(there) == len(edges) and there == back


def barrel_volume(radius, half, arc):
    """Of the solid between caps, whose side is an arc: ∫ π r(z)² dz."""
    z = np.linspace(-half, half, 20001)
    r = radius - np.sqrt(arc**2 - half**2) + np.sqrt(arc**2 - z**2)
    return np.trapezoid(np.pi * r**2, z)


@pytest.mark.parametrize(
    ("kind", "scale", "expected"),
    [
        (kinds.BOX, (0.1, 0.2, 0.3), 8 * 0.006),
        (kinds.CYLINDER, (0.3, 0.4, 0.0), np.pi * 0.09 * 0.8),
        (kinds.CYLINDER, (0.3, 0.4, 0.9), barrel_volume(0.3, 0.4, 0.9)),
        (kinds.CONE, (0.3, 0.4, 0.3), np.pi * 0.09 * 0.8 / 3),
        (kinds.CAPSULE, (0.3, 0.4, 0.3), np.pi * 0.09 * 0.8 + 4 / 3 * np.pi * 0.027),
    ],
)
def test_volumes(kind, scale, expected):
    """Polygons of 128 corners leave 4e-4 of a circle's area out, spheres made of them twice as much."""
    corners = made(kind, scale)
    assert is_closed(corners)
    lost = 0.0 if kind == kinds.BOX else 8e-4
    assert -1e-6 <= expected - volume(corners) <= lost * expected + 1e-6


@pytest.mark.parametrize("scale", [(1, 1, 1), (2, 1, 0.5), (1, -1, 1), (-1, -2, -1)])
def test_a_heightfield_is_a_closed_solid_over_its_floor(scale):
    rng = np.random.default_rng(2)
    data = rng.uniform(size=(4, 6))
    source = SimpleNamespace(data=data, hx=2.0, hy=1.0, min_z=-0.5, max_z=1.5)
    corners = made(kinds.HEIGHTFIELD, scale, source)
    assert is_closed(corners)
    heights = data * 2.0 - 0.5
    floor = -0.5 - 1e-3 * 2.0
    # Each cell is two triangles: a prism under each has its area times the mean of its three heights.
    a, b, c, d = heights[:-1, :-1], heights[:-1, 1:], heights[1:, :-1], heights[1:, 1:]
    area = 4.0 / 5 * 2.0 / 3 / 2
    expected = area * ((a + b + c) / 3 + (b + c + d) / 3 - 2 * floor).sum()
    assert volume(corners) == pytest.approx(expected * np.prod(scale), rel=1e-5)
    top = corners.reshape(-1, 3)[np.isclose(np.abs(corners.reshape(-1, 3)[:, 0]), 2 * abs(scale[0]))]
    assert np.isclose(top[:, 2], heights[0, 0] * scale[2]).any()


def test_planes_end_where_they_say():
    finite = made(kinds.PLANE, (2.0, 3.0, 0.0)).reshape(-1, 3)
    np.testing.assert_allclose([finite.min(0), finite.max(0)], [(-1, -1.5, 0), (1, 1.5, 0)])
    half = made(kinds.PLANE, (0.0, 3.0, 0.0))
    np.testing.assert_allclose(np.abs(half.reshape(-1, 3)).max(0), (kinds.ENDLESS, 1.5, 0))
    endless = made(kinds.PLANE, (0.0, 0.0, 0.0))
    areas = np.linalg.norm(np.cross(endless[:, 1] - endless[:, 0], endless[:, 2] - endless[:, 0]), axis=1) / 2
    assert areas.sum() == pytest.approx(4 * kinds.ENDLESS**2, rel=1e-5)
    # Fine about the origin: the triangles that touch the unit square reach no farther than 1.
    inside = (np.abs(endless.mean(1)) < 1).all(1)
    assert inside.any() and np.abs(endless[inside]).max() <= 1.0 + 1e-6


def test_shapes_that_differ_in_scale_alone_are_one():
    for kind, scales in (
        (kinds.BOX, ((1, 2, 3), (4, 5, 6))),
        (kinds.CYLINDER, ((1, 2, 0), (3, 4, 0))),
        (kinds.CONE, ((1, 2, 0), (3, 4, 0))),
        (kinds.ELLIPSOID, ((1, 2, 3), (4, 5, 6))),
        (kinds.CAPSULE, ((1, 2, 0), (2, 4, 0))),
    ):
        keys = [kinds.shape_of(kind, np.array(scale, float), None)[0] for scale in scales]
        assert keys[0] == keys[1]
    assert isinstance(kinds.shape_of(kinds.SPHERE, np.array([0.3, 0, 0]), None)[2](), Sphere)
    for kind, scale in ((kinds.SPHERE, (0, 0, 0)), (kinds.BOX, (1, 0, 1)), (kinds.CONE, (-1, 1, 0)), (11, (1, 1, 1))):
        assert kinds.shape_of(kind, np.array(scale, float), None) is None
    assert kinds.shape_of(kinds.MESH, np.ones(3), SimpleNamespace(indices=[], vertices=[])) is None


def test_looks_that_are_alike_are_one():
    color = np.array([0.5, 0.2, 0.1])
    one, other = kinds.look_of(color, 1.0, None), kinds.look_of(color.copy(), 1.0, None)
    assert one[0] == other[0] and one[0] != kinds.look_of(color, 0.5, None)[0]
    # 0.5 on the sRGB curve.
    assert one[1].color[0] == pytest.approx(0.21404, abs=1e-5)
    shiny = SimpleNamespace(roughness=0.2, metallic=1.0)
    assert kinds.look_of(color, 1.0, shiny)[1].metallic == 1.0
