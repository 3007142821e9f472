"""AOVs against closed forms: what a pixel's centre sees, through every kind of camera, and where nothing is."""

import numpy as np
import pytest
import scenes
import warp as wp
from pictures import outputs

import warprender as wr
from warprender.camera import camera_ray_function
from warprender.outputs import OUTPUTS
from warprender.records import CameraRecord
from warprender.shapes import Primvar

ALL = tuple(OUTPUTS)
SIZE = 16


def centres(size=SIZE):
    """X to the right and y up of the pixel centres of a window of size 2 about the axis."""
    c = (np.arange(size) + 0.5) / size * 2 - 1
    return np.meshgrid(c, -c)


def test_a_sphere_seen_through_a_perspective_camera():
    # Sphere of radius 1.5 about (0.2, -0.1, -4); the camera is at the origin with a window of ±1 at distance 1.
    scene = wr.Scene()
    scene.add_sphere("/ball", 1.5, color=(0.2, 0.4, 0.6), pose=(0.2, -0.1, -4, 0, 0, 0, 1))
    view = scenes.camera((0, 0, 0), (0, 0, -1), fov=90.0, clippingRange=(1.0, 100.0))
    got = outputs(scene, view, ALL, SIZE)
    x, y = centres()
    d = np.stack([x, y, -np.ones_like(x)], -1)
    length = np.linalg.norm(d, axis=-1)
    d /= length[..., None]
    c = np.array([0.2, -0.1, -4])
    along = d @ c
    square = 1.5**2 - (c @ c - along**2)
    hit = square > 0
    t = along - np.sqrt(np.maximum(square, 0))
    p = d * t[..., None]
    n = (p - c) / 1.5
    z = -p[..., 2]
    expected = {
        "distance": t,
        "cameraDepth": z,
        "depth": 100 / 99 * (z - 1) / z,
        "position": p,
        "Peye": p,
        "normal": n,
        "Neye": n,
        "albedo": np.broadcast_to((0.2, 0.4, 0.6), p.shape),
    }
    for name, value in expected.items():
        np.testing.assert_allclose(got[name][hit], value[hit], atol=3e-6, err_msg=name)
        assert (got[name][~hit] == OUTPUTS[name].clear).all(), name
    for name, value in {"primId": 0, "instanceId": -1, "elementId": 0}.items():
        np.testing.assert_array_equal(got[name], np.where(hit, value, -1))


def test_what_is_cleared_to():
    clear = {name: output.clear for name, output in OUTPUTS.items()}
    assert clear == {
        **dict.fromkeys(("cameraDepth", "distance", "position", "Peye", "albedo"), 0.0),
        **dict.fromkeys(("primId", "instanceId", "elementId", "semantic"), -1),
        "depth": 1.0,
        "normal": -1.0,
        "Neye": -1.0,
    }
    got = outputs(wr.Scene(), scenes.camera((0, 0, 0), (0, 0, -1)), ALL, 4)
    for name, value in clear.items():
        assert (got[name] == value).all()


def test_a_turned_orthographic_camera_sees_a_plane():
    # The plane y = 0 from 45 degrees: what is up in the picture is farther away, by as much as it is higher.
    scene = wr.Scene()
    ground = np.array([(-9, 0, -9), (-9, 0, 9), (9, 0, 9), (9, 0, -9)])
    scene.add_mesh("/ground", ground, [[0, 1, 2, 3]])
    view = scenes.window(2.0, eye=(0, 5, 5), clippingRange=(1.0, 21.0))
    got = outputs(scene, view, ALL, SIZE)
    x, y = centres()
    depth = 5 * np.sqrt(2) + y
    np.testing.assert_allclose(got["cameraDepth"], depth, atol=3e-6)
    np.testing.assert_allclose(got["distance"], depth, atol=3e-6)
    np.testing.assert_allclose(got["depth"], (depth - 1) / 20, atol=3e-6)
    np.testing.assert_allclose(got["position"], np.stack([x, 0 * x, -y * np.sqrt(2)], -1), atol=3e-6)
    np.testing.assert_allclose(got["Peye"], np.stack([x, y, -depth], -1), atol=3e-6)
    np.testing.assert_allclose(got["normal"], np.broadcast_to((0, 1.0, 0), (*x.shape, 3)), atol=1e-6)
    np.testing.assert_allclose(got["Neye"], np.broadcast_to((0, 0.5**0.5, 0.5**0.5), (*x.shape, 3)), atol=1e-6)


def test_normals_at_grazing_angles_are_the_surfaces_own():
    # Nothing is bent that has no shading normal of its own, down to the last degree before the horizon.
    scene = wr.Scene()
    ground = np.array([(-1, 0, -1e4), (-1, 0, 1), (1, 0, 1), (1, 0, -1e4)])
    scene.add_mesh("/ground", ground, [[0, 1, 2, 3]])
    got = outputs(scene, scenes.camera((0, 1, 0), (0, 0.999, -1), fov=0.05), ("normal", "primId"), 8)
    assert (got["primId"] == 0).all()
    np.testing.assert_allclose(got["normal"], np.broadcast_to((0, 1.0, 0), (8, 8, 3)), atol=1e-7)


def test_the_clipping_range_cuts():
    scene = wr.Scene()
    for distance in (1.0, 2.0, 3.0, 4.0):
        scene.add_mesh(f"/{distance}", *scenes.quad(20.0, -distance))
    for near, far, seen in (
        (0.5, 10, 0),
        (1.0 + 1e-6, 10, 1),
        (2.5, 10, 2),
        (2.5, 2.9, -1),
        (3.5, 4 - 1e-5, -1),
        (3.5, 4.1, 3),
    ):
        view = scenes.camera((0, 0, 0), (0, 0, -1), fov=90.0, clippingRange=(near, far))
        assert (outputs(scene, view, ("primId",), 8)["primId"] == seen).all(), (near, far)


def test_ids_count_prims_instances_and_faces():
    scene = wr.Scene()
    scene.add_mesh("/cube", *scenes.cube(1.0))
    scene.add_instances("/copies", "/cube", [(x, 0, 0, 0, 0, 0, 1) for x in (-3, 0, 3)])
    del scene.placements["/cube"]
    scene.add_sphere("/ball", 0.5, pose=(0, 3, 0, 0, 0, 0, 1))
    got = outputs(scene, scenes.window(8.0), ("primId", "instanceId", "elementId"), 32)
    x, y = centres(32)
    for i, at in enumerate((-3, 0, 3)):
        where = (np.abs(4 * x - at) < 0.45) & (np.abs(4 * y) < 0.45)
        assert (got["primId"][where] == 0).all() and (got["instanceId"][where] == i).all()
        # Face 5 of the cube looks to +Z.
        assert (got["elementId"][where] == 5).all()
    ball = np.hypot(4 * x, 4 * y - 3) < 0.45
    assert (got["primId"][ball] == 1).all() and (got["instanceId"][ball] == -1).all()


def test_primvars_of_every_interpolation():
    points = np.array([(-1, -1, 0), (0, -1, 0), (1, -1, 0), (-1, 1, 0), (0, 1, 0), (1, 1, 0)], np.float32)
    faces = [[0, 1, 4, 3], [1, 2, 5, 4]]
    x, y = centres()
    right = (x > 0)[..., None]
    colors = np.random.default_rng(0).random((8, 3)).astype(np.float32)

    def bilinear(values, u, v):
        # A quad is cut from its first corner to its third: two triangles, linear each.
        a, b, c, d = values
        u, v = u[..., None], v[..., None]
        return np.where(u > v, a + u * (b - a) + v * (c - b), a + v * (d - a) + u * (c - d))

    v = (y + 1) / 2
    left = [bilinear(colors[[0, 1, 4, 3]], x + 1, v), bilinear(colors[[1, 2, 5, 4]], x, v)]
    corners = [bilinear(colors[[0, 1, 2, 3]], x + 1, v), bilinear(colors[[4, 5, 6, 7]], x, v)]
    indices = np.array([3, 1, 0, 2, 7, 7, 5, 6])
    indexed = [bilinear(colors[indices[:4]], x + 1, v), bilinear(colors[indices[4:]], x, v)]
    cases = [
        (Primvar(colors[:1], "constant"), np.broadcast_to(colors[0], (*x.shape, 3))),
        (Primvar(colors[:2], "uniform"), np.where(right, colors[1], colors[0])),
        (Primvar(colors[:6], "vertex"), np.where(right, left[1], left[0])),
        (Primvar(colors[:6], "varying"), np.where(right, left[1], left[0])),
        (Primvar(colors, "faceVarying"), np.where(right, corners[1], corners[0])),
        (Primvar(colors, "faceVarying", indices), np.where(right, indexed[1], indexed[0])),
        (Primvar(colors, "uniform", np.array([5, 3])), np.where(right, colors[3], colors[5])),
    ]
    for primvar, expected in cases:
        scene = wr.Scene()
        scene.add_mesh("/mesh", points, faces).primvars["displayColor"] = primvar
        got = outputs(scene, scenes.window(2.0), ("albedo", "primId"), SIZE)["albedo"]
        np.testing.assert_allclose(got, expected, atol=1e-6, err_msg=primvar.interpolation)


@pytest.mark.parametrize(
    "normal",
    [(0, 0, 0), (np.nan, 0, 1), (np.inf, 0, 0), (1e-30, 0, 0), (0, 0, 1e30), (0, 0, -1), (0, 0, 1e-30)],
    ids=str,
)
def test_bad_normals_give_way_to_the_geometric_one(normal):
    # S7: zero, NaN, infinite, tiny, huge and reversed; (1e-30, 0, 0) is a direction, if an odd one.
    scene = wr.Scene()
    points, faces = scenes.quad(4.0)
    scene.add_mesh("/quad", points, faces, normals=np.tile(np.array(normal, np.float32), (4, 1)))
    got = outputs(scene, scenes.window(2.0), ("normal", "primId"), 4)["normal"]
    assert np.isfinite(got).all()
    np.testing.assert_allclose(np.linalg.norm(got, axis=-1), 1, atol=1e-6)
    if normal != (1e-30, 0, 0):
        np.testing.assert_allclose(got, np.broadcast_to((0, 0, 1.0), got.shape), atol=1e-6)


def test_vertex_normals_that_cancel_give_way_to_the_geometric_one():
    scene = wr.Scene()
    points = np.array([(-2, -2, 0), (2, -2, 0), (0, 2, 0)])
    around = np.array([(1, 0, 0), (-0.5, 0.75**0.5, 0), (-0.5, -(0.75**0.5), 0)])
    scene.add_mesh("/triangle", points, [[0, 1, 2]], normals=around)
    got = outputs(scene, scenes.window(0.5, target=(0, -2 / 3, 0), eye=(0, -2 / 3, 5)), ("normal", "primId"), 5)
    assert np.isfinite(got["normal"]).all()
    assert (got["normal"][..., 2] > 0).all()


@pytest.mark.parametrize("scale", [(-1, 1, 1), (1, -1, 1), (-1, -1, -1), (-2, 0.5, 1)])
def test_mirrored_prims_keep_their_outside(scale):
    # C2: normals of a mirrored sphere and mesh point outwards still, smooth or flat.
    points, faces = scenes.icosphere(4)
    pose = np.diag([*scale, 1.0])
    shapes = {
        "quadric": lambda scene: scene.add_sphere("/ball", pose=pose),
        "flat": lambda scene: scene.add_mesh("/ball", points, faces, pose=pose),
        "smooth": lambda scene: scene.add_mesh("/ball", points, faces, normals=points, pose=pose),
    }
    pictures = []
    for add in shapes.values():
        scene = wr.Scene()
        add(scene)
        pictures.append(outputs(scene, scenes.window(1.0), ("normal", "position"), 8))
    exact, *others = pictures
    p = exact["position"].astype(float)
    n = p / np.square(scale)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    np.testing.assert_allclose(exact["normal"], n, atol=1e-5)
    for other in others:
        # Facets of this icosphere lean by up to 0.04, more where it is stretched.
        np.testing.assert_allclose(other["normal"], n, atol=0.1)


def test_singular_placements_draw_nothing_and_say_so():
    # C3: scale 0 is legal.
    for s in (0.0, 1e-39, np.nan, np.inf):
        scene = wr.Scene()
        scene.add_mesh("/flat", *scenes.quad(4.0))
        scene.placements["/flat"].transforms = np.diag([1.0, s, 1.0, 1.0])
        got = outputs(scene, scenes.window(2.0), ("primId", "normal"), 4)
        assert (got["primId"] == -1).all()
        assert any("/flat" in warning for warning in scene.warnings)


def rays(view, width, height, x, y, u):
    names = view.effects()
    camera_ray = camera_ray_function(names)

    @wp.kernel(module="unique", enable_backward=False)
    def cast(
        camera: CameraRecord,
        place: wp.array(dtype=wp.vec2),
        u: wp.array(dtype=wp.vec2),
        origin: wp.array(dtype=wp.vec3),
        direction: wp.array(dtype=wp.vec3),
        reach: wp.array(dtype=wp.float32),
    ):
        i = wp.tid()
        ray = camera_ray(camera, place[i][0], place[i][1], u[i])
        origin[i] = ray.origin
        direction[i] = ray.direction
        reach[i] = ray.t_max

    n = len(x)
    out = [wp.empty(n, dtype=wp.vec3), wp.empty(n, dtype=wp.vec3), wp.empty(n, dtype=wp.float32)]
    places = wp.array(np.stack([x, y], 1).astype(np.float32), dtype=wp.vec2)
    record = view.record(width, height, np.zeros(3))
    wp.launch(cast, n, [record, places, wp.array(u.astype(np.float32), dtype=wp.vec2), *out])
    return [o.numpy().astype(float) for o in out]


@pytest.mark.parametrize("fields", [{}, {"fStop": 2.0, "focusDistance": 6.0}, {"projection": "orthographic"}], ids=str)
def test_camera_rays_against_the_schema(fields):
    view = wr.Camera(
        focalLength=35.0,
        horizontalAperture=24.0,
        verticalAperture=18.0,
        horizontalApertureOffset=3.0,
        verticalApertureOffset=-2.0,
        clippingRange=(0.5, 50.0),
        transform=scenes.look_at((1.0, 2.0, 3.0), (-2.0, 0.0, 1.0)) * [[2.0], [2.0], [2.0], [1.0]],
        **fields,
    )
    rng = np.random.default_rng(0)
    x, y = rng.random(1000) * 80, rng.random(1000) * 60
    x[:4], y[:4] = (0, 80, 0, 80), (0, 0, 60, 60)
    origin, direction, reach = rays(view, 80, 60, x, y, rng.random((1000, 2)))
    # To the camera's frame: unit axes, whatever its scale.
    axes = view.transform[:3, :3] / 2.0
    o, d = (origin - view.transform[3, :3]) @ axes.T, direction @ axes.T
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1, atol=3e-7)
    # Between the clipping planes.
    np.testing.assert_allclose(-o[:, 2], 0.5, atol=1e-6)
    np.testing.assert_allclose(-(o + d * reach[:, None])[:, 2], 50.0, rtol=1e-6)
    # The aperture is in tenths of a unit, as is the focal length; row 0 is at the top.
    window = np.stack([(x / 80 - 0.5) * 24 + 3, (0.5 - y / 60) * 18 - 2], 1)
    if fields.get("projection") == "orthographic":
        np.testing.assert_allclose(o[:, :2], window / 10, atol=1e-6)
        np.testing.assert_allclose(d[:, :2], 0, atol=1e-6)
        return
    focus = fields.get("focusDistance", 10.0)
    at_focus = o + d * ((focus - 0.5) / -d[:, 2:])
    np.testing.assert_allclose(at_focus[:, :2], window / 35 * focus, atol=5e-6)
    # Back to the lens: a point for a pinhole, else a disk of radius focal length / (2 fStop).
    at_lens = o - d * (0.5 / -d[:, 2:])
    radius = np.linalg.norm(at_lens[:, :2], axis=1)
    lens = 3.5 / (2 * 2.0) if "fStop" in fields else 0.0
    assert radius.max() <= lens + 1e-6
    if lens:
        # Even over the disk: r² is uniform.
        counts, _ = np.histogram((radius / lens) ** 2, 10, (0, 1))
        assert ((counts - 100) ** 2 / 100).sum() < 40


@pytest.mark.parametrize(
    ("policy", "aspect", "window"),
    [
        ("expandAperture", 2.0, (4.0, 2.0)),
        ("expandAperture", 0.5, (3.0, 6.0)),
        ("cropAperture", 2.0, (3.0, 1.5)),
        ("cropAperture", 0.5, (1.0, 2.0)),
        ("adjustApertureWidth", 0.5, (1.0, 2.0)),
        ("adjustApertureHeight", 2.0, (3.0, 1.5)),
        ("adjustPixelAspectRatio", 2.0, (3.0, 2.0)),
    ],
)
def test_what_happens_when_picture_and_aperture_differ_in_shape(policy, aspect, window):
    view = wr.Camera(focalLength=1.0, horizontalAperture=3.0, verticalAperture=2.0)
    left, bottom, right, top = view.window(aspect, policy)
    np.testing.assert_allclose((right - left, top - bottom), window)


@pytest.mark.parametrize("fov", [1e-6, 1e-2, 179.9])
def test_extreme_fields_of_view(fov):
    # C6: every column of 16384 has its own direction.
    view = scenes.camera((0, 0, 0), (0, 0, -1), fov=fov)
    x = np.arange(16384) + 0.5
    origin, direction, reach = rays(view, 16384, 16384, x, np.full(16384, 8192.0), np.zeros((16384, 2)))
    assert all(np.isfinite(v).all() for v in (origin, direction, reach))
    assert (np.diff(np.arctan2(direction[:, 0], -direction[:, 2])) > 0).all()


def test_a_scene_far_from_the_origin_gives_the_same_picture():
    # C1: everything moved by (1e7, -2e7, 3e7), where float32 has steps of 1 and 2 units.
    shift = np.array([1e7, -2e7, 3e7])
    pictures = []
    for move in (0 * shift, shift):
        scene = wr.Scene()
        pose = np.diag([1.0, 1.5, 0.7, 1.0])
        pose[3, :3] = move + (0.3, 0.2, 0.1)
        scene.add_mesh("/cube", *scenes.cube(1.0), pose=pose)
        scene.add_sphere("/ball", 0.4, pose=(*(move + (-0.9, 0.4, 0.3)), 0, 0, 0, 1))
        view = scenes.camera(move + (1.3, 2.2, 4.1), move)
        names = ("normal", "cameraDepth", "Peye", "primId")
        pictures.append(outputs(scene, view, names, 64))
    near, far = pictures
    np.testing.assert_array_equal(near["primId"], far["primId"])
    for name in ("normal", "cameraDepth", "Peye"):
        np.testing.assert_allclose(near[name], far[name], atol=1e-5)
