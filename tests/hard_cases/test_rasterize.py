"""What users of `rasterize` ask of it besides coverage: attributes, culling, copies, and sizes that do not fit."""

import exact_raster
import numpy as np
import pytest
import warp as wp

import warprender as wr
from warprender.visibility.raster import DrawList
from warprender.visibility.raster_kernels import Triangles


def soup(seed, count, w=(0.3, 3.0)):
    random = np.random.default_rng(seed)
    ndc, w = random.uniform(-1.2, 1.2, (3 * count, 3)), random.uniform(*w, (3 * count, 1))
    clip = np.concatenate([ndc * w, w], 1).astype(np.float32)
    return clip, np.arange(3 * count).reshape(-1, 3)


# ---------------------------------------------------------------- attributes


@pytest.mark.parametrize("shape", [(), (1,), (2,), (3,), (4,)])
@pytest.mark.parametrize("threads", [1, 2])
def test_values_are_weighed_by_the_barycentrics(shape, threads):
    clip, triangles = soup(1, 40)
    seen = wr.rasterize(clip, triangles, 67, 41)
    values = np.random.default_rng(2).normal(size=(len(clip), *shape)).astype(np.float32)
    got = wr.interpolate(seen, triangles, values, threads=threads).numpy().reshape(41, 67, -1)
    face, u, v = (a.numpy() for a in seen[:3])
    p, q, r = (values.reshape(len(clip), -1)[triangles[face, k]].astype(float) for k in range(3))
    want = p + (q - p) * u[..., None] + (r - p) * v[..., None]
    assert 0.1 < (face < 0).mean() < 0.9
    np.testing.assert_allclose(got, np.where((face >= 0)[..., None], want, 0), atol=2e-6)


def test_values_in_perspective():
    """A floor's own coordinates are where the ray through each centre meets it."""
    points = np.array([(-50, -1, 5), (50, -1, 5), (50, -1, -900), (-50, -1, -900)], np.float32)
    x, y, z = points.T
    clip = np.stack([x, y, -0.001 * z, -z], 1)
    triangles = [[0, 1, 2], [0, 2, 3]]
    seen = wr.rasterize(clip, triangles, 64, 64)
    got = wr.interpolate(seen, triangles, points).numpy()
    row, column = np.nonzero(seen.face.numpy() >= 0)
    depth = 1 / ((2 * row + 1) / 64 - 1)
    want = np.stack([depth * ((2 * column + 1) / 64 - 1), -np.ones(len(row)), -depth], 1)
    assert len(row) > 1000
    np.testing.assert_allclose(got[row, column], want, rtol=1e-4, atol=1e-4)


def test_normals_are_unit_vectors_where_something_is_seen():
    clip, triangles = soup(3, 30)
    seen = wr.rasterize(clip, triangles, 50, 40)
    normals = wp.array(np.random.default_rng(4).normal(size=(len(clip), 3)), dtype=wp.vec3, device="cpu")
    got = wr.interpolate(seen, triangles, normals, normalize=True)
    assert got.dtype == wp.vec3
    np.testing.assert_allclose(np.linalg.norm(got.numpy(), axis=2), seen.face.numpy() >= 0, atol=1e-6)
    again = wr.interpolate(seen, triangles, normals, normalize=True, into=got)
    assert again is got


def test_values_without_length_stay_zero():
    clip = np.array([[-1, -1, 0, 1], [3, -1, 0, 1], [-1, 3, 0, 1]], np.float32)
    seen = wr.rasterize(clip, [[0, 1, 2]], 4, 4)
    got = wr.interpolate(seen, [[0, 1, 2]], np.zeros((3, 3), np.float32), normalize=True).numpy()
    assert (got == 0).all()


def test_values_that_do_not_fit():
    clip, triangles = soup(5, 1)
    clip[:] = [[-1, -1, 0, 1], [3, -1, 0, 1], [-1, 3, 0, 1]]
    seen = wr.rasterize(clip, triangles, 8, 8)
    with pytest.raises(ValueError, match="triangle 0 has no three indices of 2 values"):
        wr.interpolate(seen, triangles, np.zeros((2, 3), np.float32))
    with pytest.raises(ValueError, match="values must be"):
        wr.interpolate(seen, triangles, np.zeros((3, 5), np.float32))
    with pytest.raises(ValueError, match="into must be"):
        wr.interpolate(seen, triangles, np.zeros(3, np.float32), into=wp.empty((8, 8), wp.vec3, device="cpu"))


# ---------------------------------------------------------------- culling


@pytest.mark.parametrize("pixels", [3.0, 40.0, 400.0])
@pytest.mark.parametrize("in_perspective", [False, True])
def test_culling_leaves_what_turns_the_other_way(pixels, in_perspective):
    """Small, middling and large triangles: fragments of each sign alone, and the nearer of both without culling."""
    random, count, size = np.random.default_rng(6), 600, 128
    points = random.uniform(-1, 1, (count, 1, 2)) + random.uniform(-1, 1, (count, 3, 2)) * pixels / size
    w = random.uniform(0.5, 2, (count, 3, 1)) if in_perspective else np.ones((count, 3, 1))
    z = np.broadcast_to(random.uniform(-0.9, 0.9, (count, 1, 1)), w.shape)
    clip = np.concatenate([points * w, z * w, w], 2).astype(np.float32)
    (x1, y1), (x2, y2) = ((clip[:, k, :2] / clip[:, k, 3:] - clip[:, 0, :2] / clip[:, 0, 3:]).T for k in (1, 2))
    front = x1 * y2 - x2 * y1 > 0
    clip, triangles = clip.reshape(-1, 4), np.arange(3 * count).reshape(-1, 3)
    for cull, left in (("back", front), ("front", ~front)):
        whole = wr.rasterize(clip, triangles, size, size, cull=cull)
        alone = wr.rasterize(clip, triangles[left], size, size)
        face = alone.face.numpy()
        np.testing.assert_array_equal(whole.face.numpy(), np.where(face >= 0, np.flatnonzero(left)[face], -1))
        np.testing.assert_array_equal(whole.depth.numpy(), alone.depth.numpy())
        assert (face >= 0).any()


def test_culling_by_another_name():
    with pytest.raises(ValueError, match="cull 'both' is not one of none, back, front"):
        wr.rasterize(*soup(7, 1), 4, 4, cull="both")


# ---------------------------------------------------------------- copies


def test_copies_without_copied_geometry():
    """500 draws of one mesh of points are the picture of 500 meshes of clip positions."""
    random, count = np.random.default_rng(8), 500
    points = random.uniform(-0.1, 0.1, (12, 3)).astype(np.float32)
    indices = np.arange(12, dtype=np.int32)
    matrices = np.tile(np.eye(4), (count, 1, 1))
    matrices[:, :3, 3] = random.uniform(-1, 1, (count, 3))
    mesh, none = Triangles(), Triangles()
    mesh.points, mesh.indices = (wp.array(points, dtype=wp.vec3, device="cpu"), wp.array(indices, device="cpu"))
    none.points, none.indices = (wp.empty(0, wp.vec3, device="cpu"), wp.empty(0, wp.int32, device="cpu"))
    # Draws of nothing between the others, as spheres are.
    draws = DrawList([mesh, none], np.tile([1, 0, 1], count), "cpu")
    draws.matrices.assign(np.repeat(matrices, 3, 0))
    seen = draws.rasterize(200, 150, threads=2)
    clip = (points @ matrices[:, :3, :3].transpose(0, 2, 1) + matrices[:, None, :3, 3]).astype(np.float32)
    clip = np.concatenate([clip, np.ones((count, 12, 1), np.float32)], 2).reshape(-1, 4)
    want = wr.rasterize(clip, np.arange(12 * count), 200, 150)
    assert (want.face.numpy() >= 0).mean() > 0.5
    for a, b in zip(seen, want, strict=True):
        np.testing.assert_array_equal(a.numpy(), b.numpy())


# ---------------------------------------------------------------- combinations of large and crossing


@pytest.mark.parametrize("size", [(16384, 3), (3, 16384)])
def test_long_pictures_with_triangles_across_the_eye_plane(size):
    """Vertices behind the eye, before it and in its plane."""
    width, height = size
    clip = np.array([[-3, -2, 0.5, -1], [2, -1, 0.25, 4], [1, 3, 0.5, 2], [-1, 0.5, 0, 0]], np.float32)
    triangles = np.array([[0, 1, 2], [1, 2, 3], [3, 0, 2]])
    seen = wr.rasterize(clip, triangles, width, height)
    assert all(np.isfinite(a.numpy()).all() for a in seen)
    face = seen.face.numpy()
    assert (face >= 0).any()
    # In rationals, at 200 of the centres.
    random = np.random.default_rng(9)
    for column, row in zip(random.integers(0, width, 200), random.integers(0, height, 200), strict=True):
        hits = [
            (float(sum(l * float(z) for l, z in zip(found, clip[t, 2], strict=True))), k)
            for k, t in enumerate(triangles)
            if (found := exact_raster.weights(clip[t], int(column), int(row), width, height)) is not None
        ]
        assert face[row, column] == (min(hits)[1] if hits else -1)


def test_a_picture_of_pixels_in_one_line():
    clip = np.array([[-1, -1, 0, 1], [1, -1, 0, 1], [1, 1, 0, 1], [-1, 1, 0, 1]], np.float32)
    for width, height in ((1, 9), (9, 1), (1, 1)):
        seen = wr.rasterize(clip, [[0, 1, 2], [0, 2, 3]], width, height)
        assert (seen.face.numpy() >= 0).all() and seen.face.shape == (height, width)


def test_an_empty_index_list():
    clip = np.array([[-1, -1, 0, 1], [3, -1, 0, 1], [-1, 3, 0, 1]], np.float32)
    for indices in (np.zeros((0, 3), np.int32), [], wp.empty(0, wp.int32, device="cpu")):
        seen = wr.rasterize(clip, indices, 5, 4)
        assert (seen.face.numpy() == -1).all() and (seen.depth.numpy() == 1).all()
        assert (wr.interpolate(seen, indices, clip).numpy() == 0).all()
