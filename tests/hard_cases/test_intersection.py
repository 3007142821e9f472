"""Ray intersection, hard cases I1 to I20 of the catalogue, by number.

Counts are small by default; WARPRENDER_RAYS multiplies them (50 gives the catalogue's own).
"""

import ctypes
import os

import numpy as np
import pytest
import warp as wp
from closed_meshes import SHAPES, aimed_rays, brute_force, grid_cube, icosphere, needles, placed

from warprender import numerics
from warprender.numerics import mat34, offset_origin, place_point, spawn_between, triangle_point
from warprender.records import Hit, Ray, World
from warprender.visibility import native
from warprender.visibility.rays import (
    RayCaster,
    miss,
    scene_closest,
    scene_closest_after,
    scene_occluded,
)
from warprender.visibility.trees import MeshTree, SphereShape
from warprender.visibility.world_tree import WorldTree

RAYS = int(20_000 * float(os.environ.get("WARPRENDER_RAYS", "1")))

QUAD = (
    np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32),
    np.array([[0, 1, 2], [0, 2, 3]]),
)


def closest(caster, origins, directions, **options):
    """Hits as numpy arrays."""
    hits = caster.closest(np.atleast_2d(origins), np.atleast_2d(directions), **options)
    return type(hits)(*(column.numpy() for column in hits))


def misses(caster, origins, directions):
    """Rays that hit nothing, by the closest-hit and by the any-hit query."""
    free = ~caster.occluded(origins, directions).numpy()
    return int((closest(caster, origins, directions).face < 0).sum()), int(free.sum())


def case(number, *values):
    """A parameter set whose test id begins with the catalogue's number."""
    return pytest.param(*values, id="-".join([number, *map(str, values)]))


# ---------------------------------------------------------------- watertight


CLOSED = {"I1": "icosphere", "I2": "cube", "I3": "needles"}


@pytest.mark.parametrize("at", ["edges", "vertices", "random"])
@pytest.mark.parametrize(
    ("shape", "scale", "shift"),
    [case(n, s, 1.0, 0.0) for n, s in CLOSED.items()]
    + [case("I4", s, 1.0, shift) for s in SHAPES for shift in (1e3, 1e4, 1e5, 1e6)]
    + [case("I5", s, scale, 0.0) for s in SHAPES for scale in (1e-6, 1e-3, 1e3, 1e6)],
)
def test_closed_mesh_lets_nothing_out(shape, scale, shift, at):
    points, faces = placed(shape, scale, shift)
    rays = aimed_rays(points, faces, RAYS, at, np.random.default_rng(1), scale, shift)
    assert misses(RayCaster(points, faces), *rays) == (0, 0)


@pytest.mark.parametrize(("number", "shape"), CLOSED.items())
def test_the_plain_query_leaks_here(number, shape):
    points, faces = placed(shape)
    rays = aimed_rays(points, faces, 200_000, "vertices", np.random.default_rng(1))
    assert misses(RayCaster(points, faces, accuracy="fast"), *rays)[0] > 100


@pytest.mark.parametrize("scale", [case("I5", 10.0**e) for e in (-36, -20, -15, -12, -10, 10, 12, 15, 20, 36)])
def test_scales_beyond_products_of_lengths(scale):
    points, faces = icosphere(2)
    points = (points * scale).astype(np.float32)
    o, d = aimed_rays(points, faces, RAYS // 10, "vertices", np.random.default_rng(2), scale)
    hits = closest(RayCaster(points, faces), o, d)
    assert (hits.face >= 0).all()
    t = brute_force(points / scale, faces, o[:50] / scale, d[:50])[0] * scale
    assert np.allclose(hits.t[:50], t, rtol=1e-5)


@pytest.mark.parametrize("at", [case("I6", a) for a in ("edges", "vertices")])
def test_inner_of_two_shells(at):
    points, faces = placed("icosphere")
    both = np.concatenate([points, 2 * points]), np.concatenate([faces, faces + len(points)])
    o, d = aimed_rays(points, faces, 5 * RAYS, at, np.random.default_rng(3))
    face = closest(RayCaster(*both), o, d).face
    assert ((face >= 0) & (face < len(faces))).all()


# ---------------------------------------------------------------- directions


def lattice(n):
    """Flat n x n quads of the unit square at z = 0."""
    g = np.arange(n + 1) / n
    x, y = np.meshgrid(g, g, indexing="ij")
    points = np.stack([x, y, 0 * x], -1).reshape(-1, 3).astype(np.float32)
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    corners = a, a + n + 1, a + n + 2, a + 1
    return points, np.concatenate([np.stack([corners[k] for k in t], 1) for t in ((0, 1, 2), (0, 2, 3))])


@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [
        case("I7", 0.0, 0.0, 4225),
        case("I7", -0.0, -0.0, 4225),
        case("I8", 1e-39, 1e-39, 4096),
        case("I8", -1e-42, 1e-42, 4096),
        case("I8", 1e-32, -0.0, 4096),
    ],
)
def test_zero_and_tiny_components(x, y, expected):
    points, faces = lattice(64)
    d = np.broadcast_to(np.float32([x, y, -1]), points.shape)
    hits = closest(RayCaster(points, faces), points + np.float32([0, 0, 1]), d)
    assert (hits.face >= 0).sum() >= expected
    assert (hits.t[hits.face >= 0] == 1.0).all()


@pytest.mark.parametrize("axis", [case("I7", k) for k in range(3)])
def test_camera_on_the_symmetry_plane(axis):
    points, faces = placed("cube")
    d = np.zeros((511, 3), np.float32)
    d[:, (axis + 1) % 3] = np.linspace(-0.9, 0.9, 511)
    d[:, (axis + 2) % 3] = -1
    assert misses(RayCaster(points, faces), np.zeros_like(d), d) == (0, 0)


@pytest.mark.parametrize("origin", [case("I9", o) for o in ((-2, 0.2, 0), (0, 0.2, 0), (-2, 1, 0), (-2, -1, 0))])
def test_rays_within_the_plane(origin):
    hits = closest(RayCaster(*QUAD), np.float32(origin), np.float32([1, 0, 0]))
    assert hits.face[0] == -1
    assert np.isinf(hits.t[0])


def test_I9_edge_on_box_keeps_its_silhouette():
    points, faces = placed("cube")
    y = np.linspace(-0.999, 0.999, 500)
    o = np.stack([np.full(500, -3.0), y, np.ones(500)], 1)  # within the plane z = 1 of one side
    d = np.broadcast_to(np.float32([1, 0, 0]), o.shape)
    assert (closest(RayCaster(points, faces), o, d).t == 2.0).all()


@pytest.mark.parametrize(
    ("t_max", "hit"),
    [
        case("I10", 1.0, False),
        case("I10", np.nextafter(np.float32(1), np.float32(2)), True),
        case("I10", np.inf, True),
        case("I10", np.nan, False),
        case("I10", -1.0, False),
        case("I10", 0.0, False),
    ],
)
def test_interval_ends(t_max, hit):
    caster = RayCaster(*QUAD)
    o, d = np.float32([[0.2, 0.1, 1.0]]), np.float32([[0, 0, -1]])
    assert (closest(caster, o, d, t_max=t_max).face[0] >= 0) == hit
    assert caster.occluded(o, d, t_max=t_max).numpy()[0] == hit
    assert (closest(caster, o, d, t_max=np.float32([t_max])).face[0] >= 0) == hit


def test_I10_t_is_in_units_of_the_direction():
    caster = RayCaster(*QUAD)
    for length in (2.0, 0.5, 1e-30, 1e30, 1e-38):
        t = closest(caster, np.float32([0.2, 0.1, 1.0]), np.float32([0, 0, -length])).t[0]
        assert t == pytest.approx(1.0 / length, rel=1e-6)
    assert closest(caster, np.float32([0.2, 0.1, 0.0]), np.float32([0, 0, -1])).t[0] == 0.0


@pytest.mark.parametrize("bad", [case("I13", v) for v in (np.nan, np.inf, -np.inf)])
def test_bad_rays_miss(bad):
    good = np.float32([0.2, 0.1, 1.0]), np.float32([0, 0, -1])
    o, d = (np.tile(g, (7, 1)) for g in good)
    for k in range(3):
        o[k, k] = bad
        d[3 + k, k] = bad
    d[6] = 0.0
    o, d = np.tile(o, (20, 1)), np.tile(d, (20, 1))
    assert misses(RayCaster(*QUAD), o, d) == (140, 140)


@pytest.mark.parametrize("rays", [1, 40])
def test_I13_a_t_beyond_float32_is_no_hit(rays):
    """The wall is 1 away: t is 1 over the direction's length, and float32 ends at 3.4028e38."""
    caster = RayCaster(*QUAD)
    tree = WorldTree([mesh_tree(*QUAD)] * 2, [0, 1], np.stack([np.eye(4)] * 2), "cpu")
    o = np.tile(np.float32([0.2, 0.1, 1.0]), (rays, 1))
    for length, hit in ((1e-38, True), (2.95e-39, True), (2.93e-39, False), (1e-42, False), (1.4e-45, False)):
        d = np.tile(np.float32([0, 0, -length]), (rays, 1))
        assert misses(caster, o, d) == ((0, 0) if hit else (rays, rays))
        found, placed = closest(caster, o, d), trace(tree, o, d)
        assert (np.isfinite(found.t) == hit).all()
        assert ((placed[0]["face"] >= 0) == hit).all() and (placed[1] == hit).all()


# ---------------------------------------------------------------- spawning


@wp.kernel(enable_backward=False, module="unique")
def _bounce(
    points: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.int32),
    face: wp.array(dtype=wp.int32),
    u: wp.array(dtype=wp.float32),
    v: wp.array(dtype=wp.float32),
    incoming: wp.array(dtype=wp.vec3),
    direction: wp.array(dtype=wp.vec3),
    use_offset: wp.bool,
    origin: wp.array(dtype=wp.vec3),
):
    """Origins of rays that leave each hit to the side that it was seen from."""
    i = wp.tid()
    f = face[i]
    p0 = points[faces[3 * f]]
    p1 = points[faces[3 * f + 1]]
    p2 = points[faces[3 * f + 2]]
    n = wp.normalize(wp.cross((p1 - p0) / wp.length(p1 - p0), (p2 - p0) / wp.length(p2 - p0)))
    if wp.dot(n, incoming[i]) > 0.0:
        n = -n
    d = direction[i]
    if wp.dot(n, d) < 0.0:
        d = -d
    direction[i] = d
    p, error = triangle_point(p0, p1, p2, u[i], v[i])
    origin[i] = p
    if use_offset:
        origin[i] = offset_origin(p, error, n, d)


def self_hits(shape, scale, shift, use_offset):
    """Share of bounces that meet the face they leave, of a convex mesh seen from outside."""
    rng = np.random.default_rng(5)
    points, faces = placed(shape, scale, shift)
    o = rng.normal(size=(RAYS, 3))
    o *= 5 / np.linalg.norm(o, axis=1, keepdims=True)
    d = rng.uniform(-0.5, 0.5, (RAYS, 3)) - o
    d = (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)
    o = (o * scale + shift).astype(np.float32)
    caster = RayCaster(points, faces)
    hits = caster.closest(o, d)
    hit = hits.face.numpy() >= 0
    assert hit.mean() > 0.9
    t, face, u, v = (np.ascontiguousarray(c.numpy()[hit]) for c in hits)
    out = rng.normal(size=(len(t), 3))
    out = wp.array((out / np.linalg.norm(out, axis=1, keepdims=True)).astype(np.float32), dtype=wp.vec3)
    origin = wp.empty_like(out)
    inputs = [
        caster.points,
        caster.indices,
        wp.array(face),
        wp.array(u),
        wp.array(v),
        wp.array(d[hit], dtype=wp.vec3),
    ]
    wp.launch(_bounce, len(t), inputs=[*inputs, out, use_offset], outputs=[origin])
    return float((caster.closest(origin, out).face.numpy() == face).mean())


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(
    ("scale", "shift"),
    [case("I11", s, 0.0) for s in (1e-6, 1e-3, 1.0, 1e3, 1e6)] + [case("I11", 1.0, s) for s in (1e3, 1e4, 1e5, 1e6)],
)
def test_no_self_hits(shape, scale, shift):
    assert self_hits(shape, scale, shift, use_offset=True) == 0.0


def test_I11_without_an_offset_there_are():
    assert self_hits("icosphere", 1.0, 0.0, use_offset=False) > 0.1


@wp.kernel(enable_backward=False, module="unique")
def _leave_floor(at: wp.array(dtype=wp.vec3), direction: wp.array(dtype=wp.vec3), origin: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    a = wp.vec3(-0.5, -0.5, 0.0)
    b = wp.vec3(0.5, -0.5, 0.0)
    c = wp.vec3(0.5, 0.5, 0.0)
    p, error = triangle_point(a, b, c, at[i][0], at[i][1])
    origin[i] = offset_origin(p, error, wp.vec3(0.0, 0.0, 1.0), direction[i])


def test_I12_contact():
    rng = np.random.default_rng(6)
    quad = QUAD[0] / 2
    points = np.concatenate([quad, 10 * quad + np.float32([0, 0, 4e-6])])
    at = np.sort(rng.random((RAYS, 3)), axis=1)
    at[:, 1] -= at[:, 0]
    d = rng.normal(size=(RAYS, 3))
    d[:, 2] = np.abs(d[:, 2]) + 0.1
    d = wp.array(d.astype(np.float32), dtype=wp.vec3)
    origin = wp.empty_like(d)
    wp.launch(_leave_floor, RAYS, inputs=[wp.array(at.astype(np.float32), dtype=wp.vec3), d], outputs=[origin])
    face = RayCaster(points, np.concatenate([QUAD[1], QUAD[1] + 4])).closest(origin, d).face.numpy()
    assert (face >= 2).all()


@wp.kernel(enable_backward=False, module="unique")
def _shadow(
    p: wp.array(dtype=wp.vec3),
    q: wp.array(dtype=wp.vec3),
    error: wp.vec3,
    origin: wp.array(dtype=wp.vec3),
    direction: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    n = wp.vec3(0.0, 0.0, 1.0)
    o, d = spawn_between(p[i], error, n, q[i], error, n)
    origin[i] = o
    direction[i] = d


@pytest.mark.parametrize("height", [case("I10", h) for h in (1e-3, 1.0, 1e4)])
def test_shadow_rays_meet_neither_end(height):
    rng = np.random.default_rng(7)
    low, high = (
        wp.array(np.column_stack([rng.uniform(-1, 1, (RAYS, 2)), np.full(RAYS, z)]), dtype=wp.vec3) for z in (0, height)
    )
    error = wp.vec3(*[float(height) * 1e-6] * 3)
    origin, direction = wp.empty_like(low), wp.empty_like(low)
    wp.launch(_shadow, RAYS, inputs=[low, high, error], outputs=[origin, direction])
    points = np.concatenate([2 * QUAD[0], 2 * QUAD[0] + np.float32([0, 0, height])])
    caster = RayCaster(points, np.concatenate([QUAD[1], QUAD[1] + 4]))
    assert not caster.occluded(origin, direction, t_max=1.0).numpy().any()
    assert caster.occluded(origin, direction, t_max=1.001).numpy().all()


# ---------------------------------------------------------------- bad meshes


def test_I14_repeated_indices_are_dropped():
    points, faces = placed("icosphere")
    faces[:1000, 2] = faces[:1000, 1]
    rays = aimed_rays(points, faces[1000:], RAYS, "random", np.random.default_rng(8))
    caster = RayCaster(points, faces)
    assert caster.dropped_faces == 1000
    hits = closest(caster, *rays)
    assert 0.02 < (hits.face < 0).mean() < 0.08
    assert not np.isnan(hits.t).any()
    assert (hits.face[hits.face >= 0] >= 1000).all()


def test_I14_collinear_faces_close():
    points = np.float32([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, 0, 0]])
    faces = np.array([[0, 1, 2], [0, 4, 2], [0, 2, 3]])  # the middle one has no area
    x = np.linspace(-0.9, 0.9, 1001)
    o = np.stack([x, x, np.ones_like(x)], 1)
    hits = closest(RayCaster(points, faces), o, np.broadcast_to(np.float32([0, 0, -1]), o.shape))
    assert set(hits.face) <= {0, 2}


@pytest.mark.parametrize("value", [case("I15", v) for v in (np.nan, np.inf, -np.inf)])
def test_non_finite_vertices(value):
    points, faces = placed("icosphere")
    whole = points.copy()
    around = (faces == 100).any(1)
    caster = RayCaster(points, faces)
    points[100, 1] = value
    rays = aimed_rays(whole, faces, RAYS, "random", np.random.default_rng(9))
    for cleaned in (RayCaster(points, faces), caster):
        cleaned.refit()
        hits = closest(cleaned, *rays)
        assert cleaned.dropped_faces == around.sum()
        assert not np.isin(hits.face, np.flatnonzero(around)).any()
        assert np.isfinite(hits.t[hits.face >= 0]).all()
        assert (hits.face >= 0).mean() > 0.99
    points[100] = whole[100]
    caster.refit()
    assert caster.dropped_faces == 0
    assert (closest(caster, *rays).face >= 0).all()


def test_I15_nothing_finite():
    points, faces = placed("icosphere")
    caster = RayCaster(np.full_like(points, np.nan), faces)
    assert caster.dropped_faces == len(faces)
    assert misses(caster, points, -points) == (len(points), len(points))


@pytest.mark.parametrize("accuracy", [case("I16", a) for a in ("watertight", "fast")])
def test_empty_mesh_misses(accuracy):
    for points in (np.zeros((0, 3)), QUAD[0]):
        caster = RayCaster(points, np.zeros((0, 3), int), accuracy=accuracy)
        assert misses(caster, np.zeros((5, 3)), np.ones((5, 3))) == (5, 5)
        caster.refit()
    assert len(closest(RayCaster(*QUAD, accuracy=accuracy), np.zeros((0, 3)), np.zeros((0, 3))).t) == 0


@pytest.mark.parametrize(
    "indices",
    [
        case("I16", i)
        for i in (
            [0, 1, 4],
            [0, 1, -1],
            [0, 1, 2**31],
            [0, 1, 10**6],
            [0, 1],
            [[0, 1, 2, 3]],
            [0.0, 1.0, 2.0],
        )
    ],
)
def test_bad_indices_raise(indices):
    with pytest.raises(ValueError, match="ind"):
        RayCaster(QUAD[0], np.array(indices))


# ---------------------------------------------------------------- order and resume


@pytest.mark.parametrize("seed", [case("I17", s) for s in range(3)])
def test_coincident_faces_give_the_smaller_id(seed):
    rng = np.random.default_rng(seed)
    points, faces = placed("icosphere")
    faces = faces[rng.permutation(len(faces))]
    twice = np.concatenate([faces, faces[rng.permutation(len(faces))]])
    caster = RayCaster(points, twice)
    for at in ("edges", "vertices", "random"):
        o, d = aimed_rays(points, faces, RAYS, at, rng)
        assert (closest(caster, o, d).face < len(faces)).all()
    caster.refit()
    assert (closest(caster, o, d).face < len(faces)).all()
    assert (closest(RayCaster(points, twice, accuracy="fast"), o, d).face >= len(faces)).mean() > 0.2


def test_I17_resume_visits_each_copy_once_in_order():
    points, faces = QUAD
    stack = np.concatenate([points + np.float32([0, 0, -z]) for z in (0, 1, 1, 2)])
    caster = RayCaster(stack, np.concatenate([faces + 4 * k for k in range(4)]))
    o, d = np.float32([[0.3, 0.1, 1.0]]), np.float32([[0, 0, -1]])
    seen, hits = [], None
    while hits is None or hits.face.numpy()[0] >= 0:
        hits = caster.closest(o, d, after=hits)
        seen.append((float(hits.t.numpy()[0]), int(hits.face.numpy()[0])))
    assert seen == [(1, 0), (2, 2), (2, 4), (3, 6), (np.inf, -1)]


@pytest.mark.parametrize("gap", [case("I18", g) for g in (0.0, 1e-3)])
def test_t_junction_is_as_open_as_its_gap(gap):
    points = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, -gap, 0], [0, -1, 0], [1, -1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 5, 4], [4, 5, 6], [4, 6, 1]])
    x = np.random.default_rng(10).uniform(0.01, 0.99, RAYS)
    o = np.stack([x, np.full(RAYS, -gap / 4), np.ones(RAYS)], 1)
    free = misses(RayCaster(points, faces), o, np.broadcast_to(np.float32([0, 0, -1]), o.shape))[0] / RAYS
    assert free == 0.0 if gap == 0.0 else 0.5 < free < 1.0


def test_I19_many_copies():
    points = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    caster = RayCaster(points, np.tile([[0, 1, 2]], (200_000, 1)))
    hits = closest(caster, np.float32([[0.2, 0.2, 1], [5, 5, 1]]), np.float32([[0, 0, -1], [0, 0, -1]]))
    assert hits.face.tolist() == [0, -1]


def test_I19_deep_trees():
    k = np.arange(120)
    size = (2.0**-k)[:, None, None]
    points = (size * np.array([[[-1, -1, 0], [1, -1, 0], [0, 1, 0]]])).reshape(-1, 3).astype(np.float32)
    caster = RayCaster(points, np.arange(360).reshape(-1, 3))
    hits = closest(caster, np.float32([[0.5, -0.9, 1], [0, 0, 1], [3, 0, 1]]), np.float32([[0, 0, -1]] * 3))
    assert hits.face.tolist() == [0, 0, -1]


# ---------------------------------------------------------------- worlds: instances, spheres, kernels


@wp.kernel(enable_backward=False, module="unique")
def _trace(
    world: World,
    origins: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    t_max: wp.float32,
    hits: wp.array(dtype=Hit),
    occluded: wp.array(dtype=wp.bool),
):
    i = wp.tid()
    ray = Ray(origins[i], directions[i], t_max)
    hits[i] = scene_closest(world, ray)
    occluded[i] = scene_occluded(world, ray)


@wp.kernel(enable_backward=False, module="unique")
def _layers(
    world: World,
    origins: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    count: wp.array(dtype=wp.int32),
):
    """How many surfaces lie along each ray."""
    i = wp.tid()
    ray = Ray(origins[i], directions[i], wp.inf)
    hit = scene_closest(world, ray)
    while hit.face >= 0:
        count[i] += 1
        hit = scene_closest_after(world, ray, hit)
    if hit.t != miss().t or hit.instance != miss().instance:
        count[i] = -1


def trace(tree, origins, directions, t_max=np.inf, kernel=_trace):
    """Hits of rays with a world, as a numpy record array, and occlusion."""
    o, d = (wp.array(np.ascontiguousarray(a, np.float32), dtype=wp.vec3, device="cpu") for a in (origins, directions))
    hits, occluded = wp.empty(len(o), dtype=Hit, device="cpu"), wp.empty(len(o), dtype=wp.bool, device="cpu")
    wp.launch(kernel, len(o), inputs=[tree.world, o, d, t_max], outputs=[hits, occluded], device="cpu")
    return hits.numpy(), occluded.numpy()


def surfaces_along(tree, origins, directions):
    """Number of surfaces along each ray."""
    count = wp.zeros(len(origins), dtype=wp.int32, device="cpu")
    rays = [wp.array(part, dtype=wp.vec3, device="cpu") for part in (origins, directions)]
    wp.launch(_layers, len(origins), inputs=[tree.world, *rays], outputs=[count], device="cpu")
    return count.numpy()


def mesh_tree(points, faces, **options):
    points = wp.array(np.ascontiguousarray(points, np.float32), dtype=wp.vec3, device="cpu")
    return MeshTree(points, wp.array(faces.astype(np.int32).ravel(), dtype=wp.int32, device="cpu"), **options)


def rotations(count, rng):
    q, r = np.linalg.qr(rng.normal(size=(count, 3, 3)))
    return q * np.sign(np.einsum("nii->ni", r))[:, None, :]


def placements(count, rng, size=1.0, spread=20.0):
    """(count, 3, 4) rotations, sizes that differ by axis, and places."""
    m = rotations(count, rng) * (size * rng.uniform(0.3, 3.0, (count, 1, 3)))
    return np.concatenate([m, rng.uniform(-spread, spread, (count, 3, 1))], axis=2)


@pytest.mark.parametrize("radius", [case("I20", r) for r in (1.0, 1e-3, 1e3)])
def test_spheres_are_exact(radius):
    rng = np.random.default_rng(11)
    tree = WorldTree([SphereShape(radius)], [0], np.eye(4)[None], "cpu")
    for distance in (2.0, 1e3, 1e4, 1e6):
        side = rng.normal(size=(RAYS, 3))
        o = (side / np.linalg.norm(side, axis=1, keepdims=True) * distance * radius).astype(np.float32)
        target = rng.normal(size=(RAYS, 3))
        target *= radius * rng.uniform(0.9, 1.1, (RAYS, 1)) / np.linalg.norm(target, axis=1, keepdims=True)
        d = (target - o).astype(np.float32)
        hits, occluded = trace(tree, o, d)
        o, d = o.astype(np.longdouble), d.astype(np.longdouble)
        a, b = (d * d).sum(1), (o * d).sum(1)
        q = o - (b / a)[:, None] * d
        rest = np.longdouble(np.float32(radius)) ** 2 - (q * q).sum(1)
        clear = np.abs(rest) > 1e-9 * distance**2 * 1e-6 * radius**2  # the reference's own rounding
        assert ((hits["face"] == 0) == (rest >= 0))[clear].all()
        assert (occluded == (hits["face"] == 0)).all()
        hit = (hits["face"] == 0) & clear
        t = (-b - np.sqrt(a * np.maximum(rest, 0)))[hit] / a[hit]
        assert np.allclose(hits["t"][hit], t.astype(float), rtol=3e-7)


def test_I20_sphere_from_inside_and_through():
    tree = WorldTree([SphereShape(2.0)], [0], np.eye(4)[None], "cpu")
    o = np.float32([[0, 0, 0], [0, 0, 5], [0, 2, 0], [0, 0, 5]])
    d = np.float32([[0, 0, 1], [0, 0, -1], [0, 0, 1], [0, 1, 0]])
    assert trace(tree, o, d)[0]["t"].tolist() == [2.0, 3.0, 0.0, np.inf]
    assert surfaces_along(tree, o, d).tolist() == [1, 2, 1, 0]


def test_instances_against_flattened_meshes():
    rng = np.random.default_rng(12)
    shapes = [icosphere(2), needles(40)]
    which = rng.integers(0, 2, 60)
    place = placements(60, rng)
    tree = WorldTree([mesh_tree(*s) for s in shapes], which, place, "cpu")
    points = np.concatenate(
        [shapes[k][0].astype(np.float32) @ m[:, :3].T + m[:, 3] for k, m in zip(which, place, strict=True)]
    )
    first = np.cumsum([0, *(len(shapes[k][0]) for k in which)])[:-1]
    faces = np.concatenate([shapes[k][1] + f for k, f in zip(which, first, strict=True)])
    owner = np.repeat(np.arange(60), [len(shapes[k][1]) for k in which])
    o = rng.uniform(-20, 20, (RAYS, 3)).astype(np.float32)
    d = rng.normal(size=(RAYS, 3)).astype(np.float32)
    hits, occluded = trace(tree, o, d)
    flat = closest(RayCaster(points, faces), o, d)
    same = (hits["face"] >= 0) == (flat.face >= 0)
    assert same.mean() > 0.999
    both = same & (flat.face >= 0)
    assert (hits["instance"][both] == owner[flat.face[both]]).mean() > 0.999
    assert np.allclose(hits["t"][both], flat.t[both], rtol=1e-3, atol=1e-3)
    assert (occluded == (hits["face"] >= 0)).all()


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("shift", [0.0, 1e4])
def test_instances_are_watertight(shape, shift):
    rng = np.random.default_rng(13)
    points, faces = placed(shape)
    place = placements(4, rng, spread=5.0)
    place[:, :, 3] += shift
    tree = WorldTree([mesh_tree(points, faces)], [0, 0, 0, 0], place, "cpu")
    for m in place:
        o, d = aimed_rays(points, faces, RAYS // 4, "vertices", rng)
        o, d = o @ m[:, :3].T + m[:, 3], d @ m[:, :3].T
        hits, occluded = trace(tree, o, d)
        assert (hits["face"] >= 0).all()
        assert occluded.all()


@pytest.mark.parametrize("distance", [0.0, 1e3, 1e6])
def test_thin_instances_are_hit_from_afar(distance):
    """Boxes of instances must cover what the rounded rays of object space meet."""
    rng = np.random.default_rng(14)
    points, faces = lattice(4)
    place = placements(200, rng)
    place[:, :, 3] = rng.uniform(-20, 20, (200, 3))
    tree = WorldTree([mesh_tree(points, faces)], np.zeros(200, int), place, "cpu")
    everything, instances = tree.world, tree.world.instances
    for i in range(0, 200, 10):
        at = np.column_stack([rng.uniform(-0.01, 1.01, (RAYS // 10, 2)), np.zeros(RAYS // 10)])
        target = at @ place[i, :, :3].T + place[i, :, 3]
        away = rng.normal(size=target.shape)
        o = (target + away * (1 + distance)).astype(np.float32)
        d = (target - o).astype(np.float32)
        tree.world = everything
        among_all = trace(tree, o, d)[0]["t"]
        tree.world = World()
        tree.world.geometries, tree.world.count = everything.geometries, 1
        tree.world.instances = instances[i : i + 1]
        alone = trace(tree, o, d)[0]["t"]
        assert np.isfinite(alone).mean() > 0.5
        assert (among_all <= alone).all()


@wp.kernel(enable_backward=False, module="unique")
def _bounce_placed(
    world: World,
    points: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.int32),
    origins: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    out: wp.array(dtype=wp.vec3),
    same: wp.array(dtype=wp.int32),
):
    """1 where a bounce off an instance meets the very face it leaves, -1 where nothing was hit at first."""
    i = wp.tid()
    hit = scene_closest(world, Ray(origins[i], directions[i], wp.inf))
    if hit.face < 0:
        same[i] = -1
        return
    place = world.instances[hit.instance]
    p0 = points[faces[3 * hit.face]]
    p1 = points[faces[3 * hit.face + 1]]
    p2 = points[faces[3 * hit.face + 2]]
    p, error = triangle_point(p0, p1, p2, hit.u, hit.v)
    q, bound = place_point(place.to_world, place.to_object, p, error)
    n = wp.cross((p1 - p0) / wp.length(p1 - p0), (p2 - p0) / wp.length(p2 - p0))
    m = place.to_object
    n = wp.normalize(
        wp.vec3(
            m[0, 0] * n[0] + m[1, 0] * n[1] + m[2, 0] * n[2],
            m[0, 1] * n[0] + m[1, 1] * n[1] + m[2, 1] * n[2],
            m[0, 2] * n[0] + m[1, 2] * n[1] + m[2, 2] * n[2],
        )
    )
    if wp.dot(n, directions[i]) > 0.0:
        n = -n
    d = out[i]
    if wp.dot(n, d) < 0.0:
        d = -d
    again = scene_closest(world, Ray(offset_origin(q, bound, n, d), d, wp.inf))
    same[i] = wp.where(again.instance == hit.instance and again.face == hit.face, 1, 0)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("size", "shift"), [case("I11", *v) for v in ((1.0, 0.0), (1e-3, 0.0), (1.0, 1e4))])
def test_no_self_hits_of_instances(shape, size, shift):
    rng = np.random.default_rng(22)
    points, faces = placed(shape)
    place = placements(20, rng, size, 10 * size)
    place[:, :, 3] += shift
    tree = WorldTree([mesh_tree(points, faces)], [0] * 20, place, "cpu")
    i = rng.integers(0, 20, RAYS)
    o = place[i, :, 3] + rng.normal(size=(RAYS, 3)) * 20 * size
    d = place[i, :, 3] + rng.uniform(-0.3, 0.3, (RAYS, 3)) * size - o
    o, d, out = (wp.array(a.astype(np.float32), dtype=wp.vec3) for a in (o, d, rng.normal(size=(RAYS, 3))))
    same = wp.empty(RAYS, dtype=wp.int32)
    shape = [wp.array(points, dtype=wp.vec3), wp.array(faces.ravel(), dtype=wp.int32)]
    wp.launch(_bounce_placed, RAYS, inputs=[tree.world, *shape, o, d, out], outputs=[same])
    assert (same.numpy() >= 0).mean() > 0.9
    assert (same.numpy() == 1).sum() == 0


def test_world_of_one_is_the_mesh_itself():
    points, faces = placed("icosphere")
    o, d = aimed_rays(points, faces, RAYS, "edges", np.random.default_rng(15))
    hits, _ = trace(WorldTree([mesh_tree(points, faces)], [0], np.eye(4)[None], "cpu"), o, d)
    flat = closest(RayCaster(points, faces), o, d)
    for name in ("t", "face", "u", "v"):
        assert (hits[name] == getattr(flat, name)).all()


def test_singular_and_empty_instances_draw_nothing():
    place = np.repeat(np.eye(4)[None], 4, 0)
    place[0, 2, 2] = 0.0
    place[1] = np.nan
    place[3, :3, 3] = 5
    trees = [mesh_tree(*QUAD), mesh_tree(QUAD[0], np.zeros((0, 3), int))]
    hits, _ = trace(WorldTree(trees, [0, 0, 1, 0], place, "cpu"), [[0.1, 0, 1], [5.1, 5, 9]], [[0, 0, -1]] * 2)
    assert hits["instance"].tolist() == [-1, 3]


def swept_blocks(tree):
    """Blocks of triangles that rays sweep instead of walking the tree; -1 or 0 where they walk."""
    return ctypes.c_int.from_address(tree.world.few).value if tree.world.few else 0


def test_few_triangles_are_swept_with_the_hits_of_the_tree():
    """Five boxes, two of them at one place and two coincident with others: ties, edges, vertices, ends of rays."""
    rng = np.random.default_rng(31)
    points, faces = grid_cube(1)
    place = np.repeat(np.eye(4)[None], 5, 0)
    place[2:, :3, 3] = [[1.5, 0, 0], [1.5, 0, 0], [-0.7, 0.3, 2.0]]
    tree = WorldTree([mesh_tree(points, faces)], [0] * 5, place, "cpu")
    for _ in range(2):
        assert swept_blocks(tree) == 24 // 8 + 24 // 8 + 2
        rays = [
            aimed_rays(points + p[:3, 3], faces, RAYS // 20, at, rng)
            for p in place
            for at in ("edges", "vertices", "random")
        ]
        rays.append((points[rng.integers(len(points), size=500)], rng.normal(size=(500, 3))))
        o, d = (np.concatenate(part).astype(np.float32) for part in zip(*rays, strict=True))
        for t_max in (np.inf, 3.0, 1.0):
            swept, swept_occluded = trace(tree, o, d, t_max)
            layers = surfaces_along(tree, o, d)
            few, tree.world.few = tree.world.few, 0
            walked, walked_occluded = trace(tree, o, d, t_max)
            for name in walked.dtype.names:
                assert (swept[name] == walked[name]).all()
            assert (swept_occluded == walked_occluded).all()
            assert (layers == surfaces_along(tree, o, d)).all()
            tree.world.few = few
        place[:, :3, 3] += (0.25, -3.0, 7.0)
        tree.update(place[:, :3])


def test_other_small_worlds_are_walked():
    turned = np.repeat(np.eye(4)[None], 2, 0)
    turned[1, :2, :2] = [[0, -1], [1, 0]]
    box = mesh_tree(*grid_cube(1))
    assert swept_blocks(WorldTree([box], [0, 0], turned, "cpu")) == -1
    assert swept_blocks(WorldTree([box, SphereShape(1.0)], [0, 1], turned[:1].repeat(2, 0), "cpu")) == 0
    assert swept_blocks(WorldTree([box], [0] * 6, turned[:1].repeat(6, 0), "cpu")) == 0


def test_world_follows_its_instances():
    place = np.repeat(np.eye(4)[None], 2, 0)
    tree = WorldTree([mesh_tree(*QUAD)], [0, 0], place, "cpu")
    place[:, 2, 3] = 3.0, 4.0
    tree.update(place)
    assert trace(tree, [[0.1, 0, 9]], [[0, 0, -1]])[0]["t"][0] == 5.0


# ---------------------------------------------------------------- against others


@pytest.mark.parametrize("shape", ["icosphere", "needles", "soup"])
def test_against_float64_brute_force(shape):
    rng = np.random.default_rng(16)
    if shape == "soup":
        points, faces = rng.normal(size=(900, 3)).astype(np.float32), np.arange(900).reshape(-1, 3)
    else:
        points, faces = icosphere(2) if shape == "icosphere" else needles(50)
        points = points.astype(np.float32)
    o = rng.uniform(-2, 2, (2000, 3)).astype(np.float32)
    d = rng.normal(size=(2000, 3)).astype(np.float32)
    limit = rng.uniform(0, 4, 2000).astype(np.float32)
    for t_max in (np.inf, limit):
        t, face, u, v = brute_force(points, faces, o, d)
        t_end = np.broadcast_to(t_max, t.shape)
        t, face = np.where(t < t_end, t, np.inf), np.where(t < t_end, face, -1)
        hits = closest(RayCaster(points, faces), o, d, t_max=t_max)
        assert (hits.face == face).mean() > 0.999
        same = (hits.face == face) & (face >= 0)
        assert np.allclose(hits.t[same], t[same], rtol=1e-4, atol=1e-5)
        assert np.allclose(np.stack([hits.u, hits.v])[:, same], np.stack([u, v])[:, same], atol=1e-3)


@wp.kernel(enable_backward=False, module="unique")
def _coherent(width: wp.int32, origin: wp.array(dtype=wp.vec3), direction: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    origin[i] = wp.vec3(0.1, 0.2, 0.3)
    x = wp.float32(i % width) / wp.float32(width) - 0.5
    y = wp.float32(i / width) / wp.float32(width) - 0.5
    direction[i] = wp.vec3(x, y, -1.0)


@pytest.mark.parametrize("shape", SHAPES)
def test_groups_streams_and_single_rays_agree(shape):
    """The same rays in three orders: walked in groups, in turns, and one by one."""
    points, faces = placed(shape)
    o = wp.empty(128 * 128, dtype=wp.vec3, device="cpu")
    d = wp.empty_like(o)
    wp.launch(_coherent, len(o), inputs=[128], outputs=[o, d], device="cpu")
    o, d = o.numpy(), d.numpy()
    caster = RayCaster(points, faces)
    grouped = closest(caster, o, d)
    shuffle = np.random.default_rng(17).permutation(len(o))
    streamed = closest(caster, o[shuffle], d[shuffle])
    single, _ = trace(WorldTree([mesh_tree(points, faces)], [0], np.eye(4)[None], "cpu"), o, d)
    for name in ("t", "face", "u", "v"):
        assert (getattr(grouped, name)[shuffle] == getattr(streamed, name)).all()
        assert (getattr(grouped, name) == single[name]).all()
    assert (grouped.face >= 0).all()
    t_max = float(np.median(grouped.t))
    occluded = caster.occluded(o, d, t_max=t_max).numpy()
    assert (occluded == (grouped.t < t_max)).all()


def _scalar_trace():
    closest_hit, occluded_hit = native.scene_functions("#define WR_SCALAR\n")

    @wp.kernel(enable_backward=False, module="unique")
    def kernel(
        world: World,
        origins: wp.array(dtype=wp.vec3),
        directions: wp.array(dtype=wp.vec3),
        t_max: wp.float32,
        hits: wp.array(dtype=Hit),
        occluded: wp.array(dtype=wp.bool),
    ):
        i = wp.tid()
        bits = closest_hit(world, origins[i], directions[i], t_max, -1.0, -1, -1)
        hits[i] = Hit(
            wp.cast(bits[0], wp.float32),
            bits[1],
            bits[2],
            wp.cast(bits[3], wp.float32),
            wp.cast(bits[4], wp.float32),
        )
        occluded[i] = occluded_hit(world, origins[i], directions[i], t_max)

    return kernel


@pytest.mark.parametrize("shape", SHAPES)
def test_scalar_form_agrees(shape):
    """What CUDA runs, on the CPU: the same hits, in one mesh and among instances."""
    kernel = _scalar_trace()
    rng = np.random.default_rng(18)
    points, faces = placed(shape)
    place = np.concatenate([np.eye(3, 4)[None], placements(5, rng, size=2.0, spread=3.0)])
    for count in (1, 6):
        wide = WorldTree([mesh_tree(points, faces)], [0] * count, place[:count], "cpu")
        scalar = WorldTree([mesh_tree(points, faces, wide=False)], [0] * count, place[:count], "cpu")
        for at in ("vertices", "edges", "random"):
            o, d = aimed_rays(points, faces, RAYS // 4, at, rng)
            a, occluded = trace(wide, o, d)
            b, occluded_b = trace(scalar, o, d, kernel=kernel)
            assert (a["face"] >= 0).all()
            for name in a.dtype.names:
                assert (a[name] == b[name]).all()
            assert (occluded == occluded_b).all()


def test_I21_refit_equals_build():
    points, faces = placed("icosphere")
    caster = RayCaster(points.copy(), faces)
    moved = (points * np.float32([1, 2, 0.5]) + np.float32([0.1, 0, 0])).astype(np.float32)
    caster.points.assign(moved)
    caster.refit()
    rays = aimed_rays(moved, faces, RAYS, "vertices", np.random.default_rng(19))
    refitted, built = closest(caster, *rays), closest(RayCaster(moved, faces), *rays)
    for a, b in zip(refitted, built, strict=True):
        assert (a == b).all()


def test_refit_uses_warp_arrays_in_place():
    points = wp.array(QUAD[0], dtype=wp.vec3, device="cpu")
    caster = RayCaster(points, QUAD[1])
    points.assign(QUAD[0] + np.float32([0, 0, 3]))
    caster.refit()
    assert closest(caster, np.float32([0.1, 0, 9]), np.float32([0, 0, -1])).t[0] == 6.0


def test_I21_threads_change_nothing():
    points, faces = placed("needles")
    rays = aimed_rays(points, faces, RAYS, "edges", np.random.default_rng(20))
    one, two = (closest(RayCaster(points, faces, threads=n), *rays) for n in (1, 2))
    for a, b in zip(one, two, strict=True):
        assert (a == b).all()


# ---------------------------------------------------------------- building


def test_kernels_compile_for_cuda(tmp_path):
    from warprender.visibility import rays

    for kernel in (rays._closest_cuda, rays._occluded_cuda):
        wp.compile_aot_module(kernel.module, device=None, arch=90, use_ptx=True, module_dir=str(tmp_path))


def test_header_is_part_of_the_module_hash(monkeypatch):
    def module_hash():
        closest_hit, _ = native.scene_functions()

        @wp.kernel(enable_backward=False, module="unique")
        def kernel(world: World, out: wp.array(dtype=wp.int32)):
            out[0] = closest_hit(world, wp.vec3(), wp.vec3(), 1.0, -1.0, -1, -1)[1]

        return kernel.module.hash_module()

    before = module_hash()
    assert module_hash() == before
    monkeypatch.setattr(native, "_INSTANCES", native._INSTANCES.replace("gamma(3)", "gamma(4)", 1))
    assert module_hash() != before


def test_another_warp_falls_back(monkeypatch):
    monkeypatch.setattr(native, "SUPPORTED", False)
    with pytest.warns(UserWarning, match="not the version"):
        caster = RayCaster(*QUAD)
    assert caster.accuracy == "fast"
    assert closest(caster, np.float32([0.1, 0, 1]), np.float32([0, 0, -1])).t[0] == 1.0


@pytest.mark.parametrize("accuracy", ["watertight", "fast"])
def test_barycentrics_weigh_vertices_1_and_2(accuracy):
    points, faces = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), [[0, 1, 2]]
    hits = closest(RayCaster(points, faces, accuracy=accuracy), np.float32([0.25, 0.5, 1]), np.float32([0, 0, -1]))
    assert (hits.u[0], hits.v[0]) == pytest.approx((0.25, 0.5))


# ---------------------------------------------------------------- numerics


@wp.kernel(enable_backward=False, module="unique")
def _placed(
    p: wp.array(dtype=wp.vec3),
    to_world: mat34,
    to_object: mat34,
    q: wp.array(dtype=wp.vec3),
    bound: wp.array(dtype=wp.vec3),
    up: wp.array(dtype=wp.float32),
):
    i = wp.tid()
    a, b = place_point(to_world, to_object, p[i], wp.vec3())
    q[i] = a
    bound[i] = b
    up[i] = numerics.next_up(p[i][0])


def test_bounds_hold():
    rng = np.random.default_rng(21)
    m = placements(1, rng)[0]
    inverse = np.linalg.inv(np.vstack([m, [0, 0, 0, 1]]))[:3]
    p = rng.normal(size=(RAYS, 3)).astype(np.float32)
    p[:3, 0] = 0.0, -1.0, -1e-45
    q, bound = (wp.empty(RAYS, dtype=wp.vec3, device="cpu") for _ in range(2))
    up = wp.empty(RAYS, dtype=wp.float32, device="cpu")
    matrices = [mat34(*np.float32(a).ravel()) for a in (m, inverse)]
    wp.launch(_placed, RAYS, inputs=[wp.array(p, dtype=wp.vec3), *matrices], outputs=[q, bound, up], device="cpu")
    true = p.astype(float) @ np.float32(m[:, :3]).astype(float).T + np.float32(m[:, 3])
    assert (np.abs(q.numpy() - true) <= bound.numpy()).all()
    assert (bound.numpy() < 1e-4).all()
    assert (up.numpy() == np.nextafter(p[:, 0], np.float32(np.inf))).all()
