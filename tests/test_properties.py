"""Properties of the leaf functions over all inputs that float32 has, against float64 twins (hypothesis)."""

from functools import cache

import hypothesis
import numpy as np
import pytest
import warp as wp
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pxr import Gf

import warprender as wr
from warprender.camera import camera_ray_function
from warprender.color import LUMINANCE, blackbody_tint, srgb_decode, srgb_encode
from warprender.numerics import mat34, next_up, offset_origin, place_point, safe_normalize, tangent_of
from warprender.records import CameraRecord
from warprender.sampling import cosine_hemisphere, ggx_visible_normal, interval_of, one_minus_cos, uniform_cone
from warprender.sampling import unit_disk as disk
from warprender.scene import pose_matrix
from warprender.textures import WRAPS, folded, wrapped

#: Values drawn at once: a launch costs more than the arithmetic.
N = 32


def given(*strategies):
    """Hypothesis' decorator, with the same examples in every run."""
    return lambda test: settings(max_examples=40, deadline=None, derandomize=True)(hypothesis.given(*strategies)(test))


def floats(low=None, high=None, shape=N):
    """Float32 of every magnitude in a range, ends included."""
    return arrays(np.float32, shape, elements=st.floats(low, high, width=32, allow_nan=False, allow_infinity=False))


@cache
def kernel_of(func, result, *types):
    """Applies a function of up to three arguments to arrays."""
    kinds = [wp.array(dtype=t) for t in types]
    if len(types) == 1:

        @wp.kernel(module="unique", enable_backward=False)
        def apply(a: kinds[0], out: wp.array(dtype=result)):
            out[wp.tid()] = func(a[wp.tid()])

    elif len(types) == 2:

        @wp.kernel(module="unique", enable_backward=False)
        def apply(a: kinds[0], b: kinds[1], out: wp.array(dtype=result)):
            out[wp.tid()] = func(a[wp.tid()], b[wp.tid()])

    else:

        @wp.kernel(module="unique", enable_backward=False)
        def apply(a: kinds[0], b: kinds[1], c: kinds[2], out: wp.array(dtype=result)):
            out[wp.tid()] = func(a[wp.tid()], b[wp.tid()], c[wp.tid()])

    return apply


def applied(func, result, *inputs):
    """The function of each row of the inputs, which are numpy arrays."""
    types = [{(): wp.float32, (2,): wp.vec2, (3,): wp.vec3}[x.shape[1:]] for x in inputs]
    types = [wp.int32 if x.dtype == np.int32 else t for x, t in zip(inputs, types, strict=True)]
    out = wp.empty(len(inputs[0]), dtype=result, device="cpu")
    arguments = [wp.array(x, dtype=t, device="cpu") for x, t in zip(inputs, types, strict=True)]
    wp.launch(kernel_of(func, result, *types), len(out), [*arguments, out], device="cpu")
    return out.numpy()


def unit(v):
    v = np.asarray(v, np.float64)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


@given(floats(shape=(N, 3)))
def test_unit_vectors_of_any_length(v):
    found = applied(safe_normalize, wp.vec3, v)
    # Below the least normal number components have fewer digits to begin with.
    sound = np.abs(v).max(1) > 1e-37
    np.testing.assert_allclose(found[sound], unit(v[sound]), atol=3e-7)
    assert (found[(v == 0).all(1)] == 0).all() and np.isfinite(found).all()


@given(floats())
def test_the_next_float_up(x):
    x = x[np.abs(x) < 3.4e38]
    if len(x):
        np.testing.assert_array_equal(applied(next_up, wp.float32, x), np.nextafter(x, np.float32(np.inf)))


@given(floats(-1, 1, (N, 3)))
def test_tangents_are_across_and_unit(v):
    n = unit(v[np.abs(v).max(1) > 1e-20]).astype(np.float32)
    if len(n):
        t = applied(tangent_of, wp.vec3, n).astype(np.float64)
        np.testing.assert_allclose((t * n).sum(1), 0.0, atol=1e-6)
        np.testing.assert_allclose(np.linalg.norm(t, axis=1), 1.0, atol=1e-6)


BELOW_1 = float(np.float32(1 - 2**-24))


@given(floats(0, BELOW_1, (N, 2)))
def test_warps_stay_where_they_belong(u):
    p = applied(disk, wp.vec2, u).astype(np.float64)
    # Concentric: the square of half side r goes to the circle of radius r.
    np.testing.assert_allclose(np.linalg.norm(p, axis=1), np.abs(2.0 * u - 1).max(1), atol=3e-7)
    d = applied(cosine_hemisphere, wp.vec3, u).astype(np.float64)
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1.0, atol=4e-4)
    np.testing.assert_array_equal(d[:, :2].astype(np.float32), p.astype(np.float32))
    assert (d[:, 2] >= 0).all()


@given(floats(0, BELOW_1, (N, 2)), floats(0, 2))
def test_directions_of_a_cone_are_in_it(u, cone):
    d = applied(uniform_cone, wp.vec3, u, cone).astype(np.float64)
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1.0, atol=1e-6)
    assert (1 - d[:, 2] <= cone + 1e-7).all()


@given(floats(0, 1))
def test_narrow_angles_keep_their_digits(sin2):
    wide = sin2.astype(np.float64)
    exact = wide / (1 + np.sqrt(1 - wide))
    # Near sin² = 1 the root of what float32 leaves of 1 − sin² is exact: the difference is.
    np.testing.assert_allclose(applied(one_minus_cos, wp.float32, sin2), exact, rtol=1e-6, atol=1e-38)


@given(floats(-1, 1, (N, 3)), floats(9.5367431640625e-07, 1), floats(0, BELOW_1, (N, 2)))
def test_visible_normals_are_visible(v, alpha, u):
    v[:, 2] = np.abs(v[:, 2])
    kept = np.abs(v).max(1) > 1e-6
    wo = unit(v[kept]).astype(np.float32)
    if len(wo):
        n = applied(ggx_visible_normal, wp.vec3, wo, alpha[kept], u[kept]).astype(np.float64)
        assert np.isfinite(n).all() and (n[:, 2] >= 0).all()
        np.testing.assert_allclose(np.linalg.norm(n, axis=1), 1.0, atol=1e-6)
        assert ((n * wo).sum(1) >= -1e-6).all()


@given(arrays(np.float32, 9, elements=st.floats(0, 1, width=32)), floats(0, BELOW_1))
def test_intervals_of_a_distribution_hold_what_lies_in_them(weights, u):
    total = weights.astype(np.float64).cumsum()
    if total[-1] < 1e-30:
        return
    cdf = np.concatenate([[0], total / total[-1]]).astype(np.float32)
    out = wp.empty(N, dtype=wp.int32, device="cpu")
    places = [wp.array(x, dtype=wp.float32, device="cpu") for x in (cdf, u)]
    wp.launch(intervals_kernel(), N, [*places, out], device="cpu")
    found = out.numpy()
    assert (cdf[found] <= u).all() and (u < cdf[found + 1]).all()
    # So nothing without weight is ever chosen.
    assert (weights[found] > 0).all()


@cache
def intervals_kernel():
    @wp.kernel(module="unique", enable_backward=False)
    def intervals(cdf: wp.array(dtype=float), u: wp.array(dtype=float), out: wp.array(dtype=int)):
        out[wp.tid()] = interval_of(cdf, u[wp.tid()])

    return intervals


@given(floats(0, 100), st.floats(0, 1e9))
def test_colours_come_back_from_their_curve_in_order(x, kelvin):
    wide = np.sort(x.astype(np.float64))
    encoded = srgb_encode(wide)
    # The two pieces of the standard's curve meet to 8 digits only.
    np.testing.assert_allclose(srgb_decode(encoded), wide, rtol=1e-12, atol=4e-8)
    assert (np.diff(encoded) >= -1e-8).all()
    tint = blackbody_tint(kelvin)
    assert (tint >= 0).all() and tint @ LUMINANCE == pytest.approx(1.0, abs=0.01)


@given(floats(-1e4, 1e4), st.sampled_from(WRAPS))
def test_wrapped_coordinates_are_those_of_the_standard(x, wrap):
    found = applied(folded, wp.float32, x, np.full(N, WRAPS.index(wrap), np.int32))
    wide = x.astype(np.float64)
    expected = {
        "repeat": wide - np.floor(wide),
        "mirror": 1 - np.abs(np.mod(wide, 2.0) - 1),
        "clamp": np.clip(wide, -1, 2),
        "black": np.clip(wide, -1, 2),
    }[wrap]
    np.testing.assert_allclose(found, expected, atol=1e-6)


@given(st.integers(1, 64), st.sampled_from(WRAPS))
def test_neighbours_of_texels(size, wrap):
    i = np.arange(-size, 2 * size, dtype=np.int32)
    same = np.full(len(i), size, np.int32)
    found = applied(wrapped, wp.int32, i, same, np.full(len(i), WRAPS.index(wrap), np.int32))
    outside = (i < 0) | (i >= size)
    expected = {
        "repeat": i % size,
        "black": np.where(outside, -1, i),
        # A mirrored coordinate lies in the picture: its neighbour beyond the edge is the edge.
        "mirror": np.clip(i, 0, size - 1),
        "clamp": np.clip(i, 0, size - 1),
    }[wrap]
    np.testing.assert_array_equal(found, expected)


@given(arrays(np.float64, 7, elements=st.floats(-1e3, 1e3)), arrays(np.float64, 3, elements=st.floats(-1e3, 1e3)))
def test_poses_are_usds_rotations_and_translations(pose, point):
    if np.linalg.norm(pose[3:]) < 1e-3:
        return
    x, y, z, w = unit(pose[3:])
    expected = Gf.Rotation(Gf.Quatd(w, x, y, z)).TransformDir(Gf.Vec3d(*point)) + Gf.Vec3d(*pose[:3])
    found = np.append(point, 1) @ pose_matrix(pose, "/a")
    np.testing.assert_allclose(found[:3], expected, atol=1e-9)


@given(
    arrays(np.float64, (N, 3, 4), elements=st.floats(-1e3, 1e3, width=32)),
    floats(-1e3, 1e3, (N, 3)),
    floats(0, 1, (N, 3)),
)
def test_placed_points_are_within_their_bound(matrices, p, error):
    # The error of a point inside an object: at any corner of its box the true place is within the bound.
    rows = [wp.array(matrices.astype(np.float32), dtype=mat34, device="cpu")]
    rows += [wp.array(x, dtype=wp.vec3, device="cpu") for x in (p, error)]
    outs = [wp.empty(N, dtype=wp.vec3, device="cpu") for _ in range(2)]
    wp.launch(placing_kernel(), N, [*rows, *outs], device="cpu")
    q, bound = (out.numpy().astype(np.float64) for out in outs)
    for corner in np.ndindex(2, 2, 2):
        true = p + (2.0 * np.array(corner) - 1) * error.astype(np.float64)
        exact = (matrices[:, :, :3] @ true[..., None])[..., 0] + matrices[:, :, 3]
        assert (np.abs(exact - q) <= bound * (1 + 1e-6) + 1e-37).all()


@cache
def placing_kernel():
    @wp.kernel(module="unique", enable_backward=False)
    def place(
        matrices: wp.array(dtype=mat34),
        p: wp.array(dtype=wp.vec3),
        error: wp.array(dtype=wp.vec3),
        placed: wp.array(dtype=wp.vec3),
        bounds: wp.array(dtype=wp.vec3),
    ):
        i = wp.tid()
        q, bound = place_point(matrices[i], matrices[i], p[i], error[i])
        placed[i] = q
        bounds[i] = bound

    return place


@given(floats(-1e6, 1e6, (N, 3)), floats(-1, 1, (N, 3)), floats(-1, 1, (N, 3)), st.floats(0, 2**-10, width=32))
def test_rays_leave_from_beyond_the_error_box(p, v, towards, relative):
    kept = np.abs(v).max(1) > 1e-3
    p, n, towards = p[kept], unit(v[kept]).astype(np.float32), towards[kept]
    if not len(p):
        return
    error = (np.abs(p) * np.float32(relative)).astype(np.float32)
    rows = [wp.array(x, dtype=wp.vec3, device="cpu") for x in (p, error, n, towards)]
    out = wp.empty(len(p), dtype=wp.vec3, device="cpu")
    wp.launch(offset_kernel(), len(p), [*rows, out], device="cpu")
    moved = (out.numpy().astype(np.float64) - p) * np.where((towards * n).sum(1) < 0, -1.0, 1.0)[:, None]
    reach = (np.abs(n).astype(np.float64) * error).sum(1)
    assert ((moved * n).sum(1) >= reach * (1 - 1e-6)).all()


@cache
def offset_kernel():
    @wp.kernel(module="unique", enable_backward=False)
    def offset(
        p: wp.array(dtype=wp.vec3),
        error: wp.array(dtype=wp.vec3),
        n: wp.array(dtype=wp.vec3),
        d: wp.array(dtype=wp.vec3),
        out: wp.array(dtype=wp.vec3),
    ):
        i = wp.tid()
        out[i] = offset_origin(p[i], error[i], n[i], d[i])

    return offset


@given(
    st.floats(1.0, 500.0),
    st.floats(1.0, 100.0),
    st.floats(-20.0, 20.0),
    arrays(np.float64, (N, 2), elements=st.floats(0, 1)),
)
def test_camera_rays_go_through_their_pixels(focal, aperture, shift, place):
    width, height = 64, 48
    view = wr.Camera(
        focalLength=focal, horizontalAperture=aperture, verticalAperture=aperture * 0.75, horizontalApertureOffset=shift
    )
    pixels = (place * (width, height)).astype(np.float32)
    out = wp.empty(N, dtype=wp.vec3, device="cpu")
    record = view.record(width, height, np.zeros(3))
    wp.launch(rays_kernel(), N, [record, wp.array(pixels, dtype=wp.vec2, device="cpu"), out], device="cpu")
    d = out.numpy().astype(np.float64)
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1.0, atol=1e-6)
    # Where the ray meets the film plane, in apertures: USD's own definition of the window.
    x = (d[:, 0] / -d[:, 2] * focal - shift) / aperture * width + width / 2
    y = height / 2 - d[:, 1] / -d[:, 2] * focal / (aperture * 0.75) * height
    reach = 1 + (abs(shift) + aperture) / aperture
    np.testing.assert_allclose(np.stack([x, y], 1), pixels, atol=2e-5 * width * reach)


@cache
def rays_kernel():
    camera_ray = camera_ray_function(("perspective",))

    @wp.kernel(module="unique", enable_backward=False)
    def rays(record: CameraRecord, pixels: wp.array(dtype=wp.vec2), out: wp.array(dtype=wp.vec3)):
        i = wp.tid()
        out[i] = camera_ray(record, pixels[i][0], pixels[i][1], wp.vec2(0.5, 0.5)).direction

    return rays
