"""The rasterizer's hard cases, R1 to R12, against rational arithmetic."""

import itertools

import exact_raster
import numpy as np
import pytest
import warp as wp
from hypothesis import given, settings
from hypothesis import strategies as st

import warprender as wr
from warprender.visibility import raster, raster_kernels
from warprender.visibility.raster import DrawList
from warprender.visibility.raster_kernels import Triangles

QUAD = [[0, 1, 2], [0, 2, 3]]


def at_pixels(points, width, height, z=0.0):
    """Clip positions (N, 4) of points (N, 2) in pixels from the top left."""
    points = np.asarray(points, np.float64)
    columns = [2 * points[:, 0] / width - 1, 1 - 2 * points[:, 1] / height]
    return np.stack([*columns, np.full(len(points), z), np.ones(len(points))], 1).astype(np.float32)


def faces_of(*arguments, **options):
    return wr.rasterize(*arguments, **options).face.numpy()


def draw_list(clip, indices):
    triangles = Triangles()
    triangles.clip = wp.array(clip, dtype=wp.vec4, device="cpu")
    triangles.indices = wp.array(np.reshape(indices, -1), dtype=wp.int32, device="cpu")
    return DrawList([triangles], [0], "cpu")


def by_keys(clip, indices, width, height):
    """What CUDA would draw, on one CPU thread."""
    draws = draw_list(clip, indices)
    draws._draw_in_bins = lambda threads: draws._draw_by_keys()
    return draws.rasterize(width, height)


def coverage_counts(clip, indices, width, height):
    """How many of the triangles cover each pixel: each drawn alone."""
    return sum((faces_of(clip, [face], width, height) >= 0).astype(int) for face in indices)


def check_against_exact(clip, indices, width, height, seen=None):
    seen = seen or wr.rasterize(clip, indices, width, height)
    face, depth, u, v = exact_raster.rasterize(clip, np.asarray(indices), width, height)
    np.testing.assert_array_equal(seen.face.numpy(), face)
    np.testing.assert_allclose(seen.depth.numpy(), depth, atol=1e-6)
    np.testing.assert_allclose(seen.u.numpy(), u, atol=1e-6)
    np.testing.assert_allclose(seen.v.numpy(), v, atol=1e-6)


# ---------------------------------------------------------------- R1, R2, R3, R4: edges


@pytest.mark.parametrize("turn", range(3))
@pytest.mark.parametrize("mirrored", [False, True])
def test_r1_shared_diagonal(turn, mirrored):
    clip = at_pixels([(0, 0), (8, 0), (8, 8), (0, 8)], 8, 8)
    triangles = [np.roll(t, turn)[:: -1 if mirrored else 1] for t in QUAD]
    face = faces_of(clip, triangles, 8, 8)
    assert [(face == 0).sum(), (face == 1).sum()] == [36, 28]
    assert (coverage_counts(clip, triangles, 8, 8) == 1).all()


def test_r1_direct3d_example():
    """15 and 10 pixels of 5×5 on either side of a diagonal."""
    clip = at_pixels([(0, 0), (5, 0), (5, 5), (0, 5)], 5, 5)
    face = faces_of(clip, QUAD, 5, 5)
    assert [(face == 0).sum(), (face == 1).sum()] == [15, 10]


@pytest.mark.parametrize("slivers", [64, 512])
def test_r2_sliver_fan_at_16k(slivers):
    middle = 8192.0
    angle = np.arange(slivers) * (2 * np.pi / slivers)
    rim = np.stack([np.cos(angle), np.sin(angle)], 1) * 4000 + middle
    points = np.round(np.concatenate([[(middle + 0.5004, middle + 0.4997)], rim]) * 256) / 256
    ring = np.arange(slivers)
    fan = np.stack([np.zeros(slivers, int), 1 + ring, 1 + (ring + 1) % slivers], 1)
    # The 260×260 pixels about the hub, as a picture of their own: a shift and a scale by powers of two are exact.
    window = 256
    local = at_pixels(points - (middle - window / 2), window, window)
    assert (faces_of(local, fan, window, window) >= 0).all()
    backwards = faces_of(local, fan[::-1], window, window)
    np.testing.assert_array_equal(slivers - 1 - backwards, faces_of(local, fan, window, window))


def test_r2_fan_in_the_whole_viewport():
    size, slivers = 4096, 512
    angle = np.arange(slivers) * (2 * np.pi / slivers)
    points = np.concatenate([[(0.0, 0.0)], np.stack([np.cos(angle), np.sin(angle)], 1) * 1000]) + 2048.5003
    ring = np.arange(slivers)
    fan = np.stack([np.zeros(slivers, int), 1 + ring, 1 + (ring + 1) % slivers], 1)
    clip = at_pixels(np.round(points * 256) / 256, size, size)
    first = faces_of(clip, fan, size, size)
    last = slivers - 1 - faces_of(clip, fan[::-1], size, size)
    # All depths are equal, so of several triangles over a pixel the two orders would show two.
    np.testing.assert_array_equal(first, np.where(last == slivers, -1, last))
    hub = slice(2048 - 130, 2048 + 130)
    assert (first[hub, hub] >= 0).all()


@pytest.mark.parametrize("top", [0, 8160, 15968, 16320])
def test_r3_integer_range(top):
    """64 rows of a 16384² viewport, against integers: products reach 2^44."""
    width, height = 16384, 64
    corners = np.array([(0, 0), (int(16383.9 * 256), int(16000.3 * 256)), (0, 16384 * 256)]) - (0, top * 256)
    clip = at_pixels(corners / 256, width, height)
    assert ((clip[:, :2] * (0.5, -0.5) + 0.5) * (width, height) * 256 == corners).all()
    face = faces_of(clip, [[0, 1, 2]], width, height)
    column, row = np.arange(width) * 256 + 128, (np.arange(height) * 256 + 128)[:, None]
    inside = True
    for p, q in itertools.pairwise([*corners, corners[0]]):
        inside = inside & ((q[0] - p[0]) * (row - p[1]) - (q[1] - p[1]) * (column - p[0]) >= 0)
    np.testing.assert_array_equal(face >= 0, inside)


def test_r4_subpixel_mesh():
    side, cells = 100, 700
    random = np.random.default_rng(4)
    lattice = np.stack(np.meshgrid(*[np.linspace(0, side, cells + 1)] * 2, indexing="ij"), -1)
    lattice[1:-1, 1:-1] += random.uniform(-0.04, 0.04, (cells - 1, cells - 1, 2))
    points = 14 + np.round(lattice * 256) / 256
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    first = np.stack([corner, corner + cells + 1, corner + cells + 2], 1)
    triangles = np.concatenate([first, np.stack([corner, corner + cells + 2, corner + 1], 1)])
    clip = at_pixels(points.reshape(-1, 2), 128, 128)
    forward, backward = (wr.rasterize(clip, t, 128, 128).face.numpy() for t in (triangles, triangles[::-1]))
    covered = np.zeros((128, 128), bool)
    covered[14:114, 14:114] = True
    np.testing.assert_array_equal(forward >= 0, covered)
    np.testing.assert_array_equal(forward[covered], len(triangles) - 1 - backward[covered])


# ---------------------------------------------------------------- R5 to R8: degenerate, near plane, behind, huge


@pytest.mark.parametrize(
    "points",
    [
        [(3, 3), (3, 3), (3, 3)],
        [(0.5, 0.5), (0.5, 0.5), (7, 4)],
        [(0, 0), (4, 4), (8, 8)],
        [(0.5, 0.5), (4.5, 0.5), (7.5, 0.5)],
    ],
)
def test_r5_degenerate_triangles(points):
    seen = wr.rasterize(at_pixels(points, 8, 8), [[0, 1, 2]], 8, 8)
    assert (seen.face.numpy() == -1).all()
    assert all(np.isfinite(a.numpy()).all() for a in seen)


def test_r5_height_1e_30():
    clip = np.array([[-1, 0, 0, 1], [1, 0, 0, 1], [0, 1e-30, 0, 1]], np.float32)
    for height in (7, 8):  # the middle row's centres lie on the base, then beside it
        check_against_exact(clip, [[0, 1, 2]], 8, height)


def floor_at(size):
    """A floor 1 below the eye from 5 behind it to 1000 before it, 90° wide, near 0.1."""
    points = np.array([[-50, -1, 5], [50, -1, 5], [50, -1, -1000], [-50, -1, -1000]], np.float64)
    near, far = 0.1, 1e4
    z = (far + near) / (near - far) * points[:, 2] + 2 * far * near / (near - far)
    return np.stack([points[:, 0], points[:, 1], z, -points[:, 2]], 1).astype(np.float32)


def test_r6_near_plane_through_the_floor():
    size = 64
    face = faces_of(floor_at(size), QUAD, size, size)
    slope = 1 - (2 * np.arange(size) + 1) / size
    with np.errstate(divide="ignore"):
        depth = np.where(slope < 0, -1 / slope, np.inf)
    across = depth[:, None] * ((2 * np.arange(size) + 1) / size - 1)
    np.testing.assert_array_equal(face >= 0, (np.abs(across) <= 50) & (depth[:, None] <= 1000))


def test_r7_behind_the_eye():
    clip = np.random.default_rng(7).normal(size=(30, 4)).astype(np.float32)
    clip[:, 3] = -np.abs(clip[:, 3])
    assert (faces_of(clip, np.arange(30).reshape(-1, 3), 16, 16) == -1).all()


@pytest.mark.parametrize("z", [0.0, 0.25])
def test_r7_zero_and_tiny_w(z):
    base = np.array([[-1, -1, z, 1], [1, -1, z, 1], [0.3, 1, 0, 0]], np.float32)
    pictures = []
    for w in (0.0, -0.0, 1e-38, 1e-45):
        clip = base.copy()
        clip[2, 3] = w
        seen = wr.rasterize(clip, [[0, 1, 2]], 16, 16)
        assert all(np.isfinite(a.numpy()).all() for a in seen)
        check_against_exact(clip, [[0, 1, 2]], 16, 16, seen)
        pictures.append(np.stack([a.numpy() for a in seen]))
    np.testing.assert_array_equal(pictures[0], pictures[1])
    assert (pictures[0][0] >= 0).any()


def test_r7_depth_where_w_cancels():
    """The sum of e_k w_k is 2, of numbers near 2^54."""
    clip = np.array([[1, 1, 1, 0], [0, 0, 0, -1], [-1, 0, 0, 2.0**54]], np.float32)
    check_against_exact(clip, [[0, 1, 2]], 1, 2)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("component", range(4))
def test_r7_non_finite_triangles_are_not_drawn(bad, component):
    clip = np.concatenate([at_pixels([(0, 0), (8, 0), (8, 8)], 8, 8), at_pixels([(0, 0), (8, 8), (0, 8)], 8, 8)])
    clip[4, component] = bad
    seen = wr.rasterize(clip, [[0, 1, 2], [3, 4, 5]], 8, 8)
    assert set(np.unique(seen.face.numpy())) == {-1, 0}
    assert all(np.isfinite(a.numpy()).all() for a in seen)


def test_r8_huge_triangle():
    clip = np.array([[-1e9, -1e9, 0.5, 1], [3e9, -1e9, 0.5, 1], [-1e9, 3e9, 0.5, 1]], np.float32)
    seen = wr.rasterize(clip, [[0, 1, 2]], 640, 360)
    assert (seen.face.numpy() == 0).all()
    np.testing.assert_allclose(seen.depth.numpy(), 0.5, rtol=1e-6)


# ---------------------------------------------------------------- R9, R10, R11: depth and attributes


def test_r9_ties_and_order():
    quads = np.concatenate([at_pixels([(1, 1), (15, 2), (13, 14), (2, 15)], 16, 16, 0.3)] * 4)
    quads[:, 2] += 0.1 * quads[:, 0]
    pictures = []
    for order in itertools.permutations(range(4)):
        triangles = np.concatenate([4 * k + np.array(QUAD) for k in order])
        for threads in (1, 2):
            pictures.append(np.stack([a.numpy() for a in wr.rasterize(quads, triangles, 16, 16, threads=threads)]))
    assert all((p == pictures[0]).all() for p in pictures)
    assert set(np.unique(pictures[0][0])) == {-1, 0, 1}


def test_r9_coplanar_quads_with_other_diagonals():
    """Equal depths tie although they are interpolated from other vertices."""
    quad = at_pixels([(0, 0), (64, 0), (64, 64), (0, 64)], 64, 64)
    quad[:, 2] = 0.25 * quad[:, 0] - 0.5 * quad[:, 1]
    face = faces_of(quad, [[1, 2, 3], [1, 3, 0], *QUAD], 64, 64)
    assert face.max() <= 1


def shuffled_soup(seed, count=400, size=96):
    random = np.random.default_rng(seed)
    clip = random.normal(size=(3 * count, 4)).astype(np.float32)
    clip[:, 3] = random.choice([1.0, 0.7, 2.0, 1.3], 3 * count)
    clip[: 3 * count // 8, 3] *= -1
    return clip, np.arange(3 * count).reshape(-1, 3), size


def test_r9_any_order_of_drawing_gives_the_same_bits():
    clip, triangles, size = shuffled_soup(9)
    reference = wr.rasterize(clip, triangles, size, size)
    order = np.random.default_rng(1).permutation(len(triangles))
    other = wr.rasterize(clip, triangles[order], size, size)
    face = other.face.numpy()
    np.testing.assert_array_equal(np.where(face >= 0, order[face], -1), reference.face.numpy())
    for a, b in zip(other[1:], reference[1:], strict=True):
        np.testing.assert_array_equal(a.numpy(), b.numpy())


def test_r9_threads_change_no_bit():
    clip, triangles, size = shuffled_soup(10, count=9000)
    one, three = (wr.rasterize(clip, triangles, size, size, threads=n) for n in (1, 3))
    for a, b in zip(one, three, strict=True):
        np.testing.assert_array_equal(a.numpy(), b.numpy())


def test_r9_company_changes_no_bit():
    """Small triangles drawn among few and among many: a full chunk must not draw them by other arithmetic."""
    count, width, height = 100_000, 16384, 32
    random = np.random.default_rng(3)
    size = np.where(np.arange(count) % 2, 0.2, 1.0)[:, None, None]
    corners = np.array([[0, 0], [3.8, 0.2], [0.3, 5.7]]) * size * 2 / (width, height)
    points = random.uniform(-0.99, 0.99, (count, 1, 2)) + corners
    w, z = random.uniform(0.5, 2, (count, 3, 1)), random.uniform(-0.9, 0.9, (count, 3, 1))
    clip = np.concatenate([points * w, z * w, w], 2).reshape(-1, 4).astype(np.float32)
    triangles = np.arange(3 * count).reshape(-1, 3)
    mixed = wr.rasterize(clip, triangles, width, height)
    large_first = np.concatenate([np.arange(0, count, 2), np.arange(1, count, 2)])
    sorted_by_size = wr.rasterize(clip, triangles[large_first], width, height)
    face = sorted_by_size.face.numpy()
    np.testing.assert_array_equal(np.where(face >= 0, large_first[face], -1), mixed.face.numpy())
    for a, b in zip(sorted_by_size[1:], mixed[1:], strict=True):
        np.testing.assert_array_equal(a.numpy(), b.numpy())


@pytest.mark.parametrize("nearer_first", [True, False])
def test_r10_depth_resolution(nearer_first):
    """A millimetre at a kilometre, near 0.1 and far 1e6, through the renderer."""
    scene = wr.Scene()
    for name, z in sorted({"/red": -1000.0, "/grey": -1000.001}.items(), reverse=nearer_first):
        square = np.array([[-1, -1, z], [1, -1, z], [1, 1, z], [-1, 1, z]], np.float32) * (2000, 2000, 1)
        scene.add_mesh(name, square, [[0, 1, 2, 3]])
    camera = wr.Camera(clippingRange=(0.1, 1e6))
    frame = wr.Renderer(scene, camera, (64, 48), ("primId",), visibility="raster").render()
    assert (frame.numpy("primId") == list(scene.placements).index("/red")).all()


@pytest.mark.parametrize("far_w", [1e3, 1e6, 1e8])
def test_r11_perspective_correct_attributes(far_w):
    w = np.array([0.1, far_w, 0.1])
    screen = np.array([(-1, -1), (1, -1), (-1, 1)])
    clip = np.concatenate([screen * w[:, None], (0.5 * w)[:, None], w[:, None]], 1).astype(np.float32)
    check_against_exact(clip, [[0, 1, 2]], 24, 24)


# ---------------------------------------------------------------- R12: sizes, arguments


@pytest.mark.parametrize("size", [(1, 1), (1, 16384), (16384, 1), (3, 5), (65, 64), (1023, 7), (1025, 129)])
def test_r12_sizes(size):
    clip = at_pixels([(0, 0), (size[0], 0), (size[0], size[1]), (0, size[1])], *size, z=-0.5)
    seen = wr.rasterize(clip, QUAD, *size)
    assert seen.face.shape == (size[1], size[0])
    assert (seen.face.numpy() >= 0).all()
    assert (seen.depth.numpy() == -0.5).all()


def test_r12_odd_widths_keep_rows_apart():
    for width in range(1, 40):
        clip = at_pixels([(width / 2, 0.2), (width + 3, 5), (-2, 8.7)], width, 9)
        check_against_exact(clip, [[0, 1, 2]], width, 9)


def test_r12_out_of_memory_is_one_clear_error(monkeypatch):
    monkeypatch.setattr(raster, "_free_memory", lambda device: 2**30)
    with pytest.raises(MemoryError, match="16384x16384 pixels needs 4096 MiB"):
        wr.rasterize(np.zeros((3, 4), np.float32), [[0, 1, 2]], 16384, 16384)


@pytest.mark.parametrize("size", [(0, 8), (8, 0), (-1, 8), (8.5, 8), (20000, 1)])
def test_r12_sizes_that_are_none(size):
    with pytest.raises(ValueError, match="pixels, not"):
        wr.rasterize(np.zeros((3, 4), np.float32), [[0, 1, 2]], *size)


@pytest.mark.parametrize("bad", [-1, 3, 2**31 - 1, -(2**31), 2**40])
def test_indices_out_of_range(bad):
    clip = at_pixels([(0, 0), (8, 0), (8, 8)], 8, 8)
    with pytest.raises(ValueError, match=r"triangle 1 has the indices .* there are 3 vertices"):
        wr.rasterize(clip, [[0, 1, 2], [0, bad, 2]], 8, 8)


@pytest.mark.parametrize("indices", [[0, 1], [[0, 1]], np.zeros((2, 4), int), np.zeros((1, 3))])
def test_indices_of_another_shape(indices):
    with pytest.raises(ValueError, match="indices must"):
        wr.rasterize(np.zeros((3, 4), np.float32), indices, 8, 8)


def test_positions_of_another_shape():
    with pytest.raises(ValueError, match="clip positions must"):
        wr.rasterize(np.zeros((3, 3), np.float32), [[0, 1, 2]], 8, 8)


def test_nothing_to_draw():
    seen = wr.rasterize(np.zeros((0, 4), np.float32), np.zeros((0, 3), np.int32), 4, 3)
    assert (seen.face.numpy() == -1).all() and (seen.depth.numpy() == 1).all()


def test_arrays_in_any_form_give_the_same_picture():
    clip, triangles, size = shuffled_soup(11)
    reference = faces_of(clip, triangles, size, size)
    forms = [
        (wp.array(clip, dtype=wp.vec4), wp.array(triangles.reshape(-1), dtype=wp.int32)),
        (wp.array(clip, dtype=wp.float32), wp.array(triangles, dtype=wp.int32)),
        (clip.astype(np.float64), triangles.astype(np.uint32).reshape(-1)),
        (clip.tolist(), triangles.tolist()),
    ]
    for positions, indices in forms:
        np.testing.assert_array_equal(faces_of(positions, indices, size, size), reference)


def test_culling():
    clip = at_pixels([(0, 0), (8, 0), (8, 8), (0, 8)], 8, 8)
    one_way_each = [[0, 2, 1], [0, 2, 3]]  # counter-clockwise, clockwise as seen
    turning = {
        cull: set(np.unique(faces_of(clip, one_way_each, 8, 8, cull=cull))) for cull in ("none", "back", "front")
    }
    signed = np.linalg.det(clip[[0, 2, 1]][:, [0, 1, 3]].astype(float))
    front = 0 if signed > 0 else 1
    assert turning == {"none": {0, 1}, "back": {-1, front}, "front": {-1, 1 - front}}


# ---------------------------------------------------------------- everything against rational arithmetic

coordinate = st.one_of(
    st.integers(-3, 3).map(float),
    st.floats(-2, 2, width=32),
    st.floats(-(2.0**100), 2.0**100, width=32),
    st.sampled_from([0.0, -0.0, 1e-38, -1e-38, 1e-45]),
)
vertex = st.one_of(
    st.tuples(coordinate, coordinate, coordinate, coordinate),
    st.tuples(*[st.integers(-10, 10).map(lambda k: k / 8)] * 3, st.just(1.0)),
)


@settings(max_examples=150, deadline=None)
@given(st.lists(vertex, min_size=3, max_size=7), st.integers(1, 9), st.integers(1, 9), st.data())
def test_any_triangles_are_drawn_exactly(vertices, width, height, data):
    clip = np.array(vertices, np.float32)
    corner = st.integers(0, len(clip) - 1)
    triangles = data.draw(st.lists(st.tuples(corner, corner, corner), min_size=1, max_size=4))
    check_against_exact(clip, triangles, width, height)
    check_against_exact(clip, triangles, width, height, by_keys(clip, triangles, width, height))


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1e-3, 0.4]), st.booleans())
def test_shared_edges_are_covered_once(seed, jitter, in_perspective):
    """A jittered lattice over the whole picture, of triangles with random diagonals and windings."""
    random = np.random.default_rng(seed)
    size, cells = 24, int(random.integers(1, 14))
    step = np.linspace(-1.25, 1.25, cells + 1)
    points = np.stack(np.meshgrid(step, step, indexing="ij"), -1)
    points += jitter * random.uniform(-1, 1, points.shape) / cells * (2.5 / 2) * (np.abs(points) < 1.2)
    w = random.uniform(0.3, 3, (*points.shape[:2], 1)) if in_perspective else np.ones((*points.shape[:2], 1))
    clip = np.concatenate([points * w, 0 * w, w], 2).reshape(-1, 4).astype(np.float32)
    triangles = []
    for i, j in itertools.product(range(cells), range(cells)):
        a, b, c, d = (
            i * (cells + 1) + j,
            (i + 1) * (cells + 1) + j,
            (i + 1) * (cells + 1) + j + 1,
            i * (cells + 1) + j + 1,
        )
        pair = [[a, b, c], [a, c, d]] if random.random() < 0.5 else [[a, b, d], [b, c, d]]
        triangles += [t[:: random.choice([-1, 1])] for t in pair]
    triangles = np.array(triangles)
    first = faces_of(clip, triangles, size, size)
    last = len(triangles) - 1 - faces_of(clip, triangles[::-1], size, size)
    # Equal depths everywhere: of two triangles over one pixel the two orders would show one each.
    np.testing.assert_array_equal(first, last)
    assert (first >= 0).all()


@pytest.mark.parametrize("seed", range(3))
def test_bins_and_keys_agree(seed):
    clip, triangles, size = shuffled_soup(seed, size=150)
    bins, keys = wr.rasterize(clip, triangles, size, size), by_keys(clip, triangles, size, size)
    # Depths that differ in float32's last bit may change who is in front; coverage may not.
    np.testing.assert_array_equal(bins.face.numpy() >= 0, keys.face.numpy() >= 0)
    assert (bins.face.numpy() != keys.face.numpy()).mean() < 1e-3
    np.testing.assert_allclose(bins.depth.numpy(), keys.depth.numpy(), atol=1e-6)


def test_kernels_compile_for_cuda(tmp_path):
    for kernel in raster_kernels.keyed_kernels():
        wp.compile_aot_module(kernel.module, device=None, arch=90, use_ptx=True, module_dir=tmp_path)
    assert len(list(tmp_path.glob("*.ptx"))) == 3


def test_a_changed_header_is_another_module(monkeypatch):
    build = raster_kernels.fill_kernel.__wrapped__
    before, again = build().module.name, build().module.name
    monkeypatch.setattr(raster_kernels, "HEADER", raster_kernels.HEADER + "\n// changed\n")
    assert before == again != build().module.name
