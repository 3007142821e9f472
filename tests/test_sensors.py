"""Sensors: many views in one launch, worlds, lenses, lidar; against closed forms and against `Renderer`."""

import numpy as np
import pytest
import scenes
import warp as wp
from usd_stage import scene_of

import warprender as wr
from warprender.color import srgb_encode
from warprender.lenses import distorted_rays, fisheye_rays

AOVS = ("cameraDepth", "normal", "primId")
#: Relative rounding of a point that is a sum of three corners, which lie 100 units away on a wall.
GAMMA_7 = 7 * 2.0**-24
STRAIGHT = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
K = np.array([[30.0, 0, 17.5], [0, 28.0, 12.25], [0, 0, 1]])


def pose(x=0.0, y=0.0, z=0.0, axis=(0, 1, 0), degrees=0.0):
    half = np.radians(degrees) / 2
    return [x, y, z, *(np.sin(half) * np.asarray(axis, float)), np.cos(half)]


def balls(radii=(0.5,), floor=True):
    """Spheres of meshes and exact ones, and a floor under them."""
    scene = wr.Scene()
    points, faces = scenes.icosphere(2)
    for i, radius in enumerate(radii):
        scene.add_mesh(f"/ball{i}", radius * points, faces, pose=pose(1.2 * i - 0.6))
    if floor:
        corners, quad = scenes.quad(8.0)
        scene.add_mesh("/floor", corners, quad, pose=pose(0, -1, 0, (1, 0, 0), -90))
    return scene


def wall(color=(1.0, 1.0, 1.0)):
    scene = wr.Scene()
    points, faces = scenes.quad(200.0)
    scene.add_mesh("/wall", points, faces, color=color)
    return scene


@pytest.mark.parametrize("visibility", ["rays", "raster"])
def test_views_see_what_renderers_see(visibility):
    scene = balls((0.5, 0.3))
    poses = np.array([pose(0, 0, 4), pose(0.5, 0.2, 3, (0, 1, 0), 10), pose(0, 3, 0.1, (1, 0, 0), -90)])
    sensor = wr.CameraSensor(scene, 40, 24, fov=50, outputs=AOVS, visibility=visibility)
    images = sensor.update(poses)
    for view, place in enumerate(poses):
        aperture = 2 * 50 * np.tan(np.radians(25))
        camera = wr.Camera(horizontalAperture=aperture * 40 / 24, verticalAperture=aperture, clippingRange=(0.01, 1e6))
        camera.transform = wr.scene.pose_matrix(place, "")
        frame = wr.render(scene, (40, 24), camera=camera, outputs=AOVS, visibility=visibility)
        same = images.numpy("primId")[view] == frame.numpy("primId")
        # A view's rotation is rounded from a quaternion: pixels at an edge may change sides.
        assert same.mean() > 0.995
        for name in ("cameraDepth", "normal"):
            a, b = images.numpy(name)[view][same], frame.numpy(name)[same]
            flat = np.abs(a - b) > 1e-4 * np.maximum(1, np.abs(b))
            assert flat.mean() < 0.01, name
    assert images.prims == ["/ball0", "/ball1", "/floor"]


def test_a_sphere_has_one_element_whatever_is_beside_it():
    scene = wr.Scene()
    corners = [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0], [0, 0, 9]]
    scene.add_mesh("/wall", corners, [[4, 4, 4], [0, 1, 2, 3]])
    scene.add_sphere("/ball", 0.5, pose=pose(0, 0, 1))
    images = wr.CameraSensor(scene, 16, 16, fov=40, outputs=("elementId", "primId")).update([pose(0, 0, 4)])
    found = np.stack([images.numpy("primId"), images.numpy("elementId")], -1).reshape(-1, 2)
    assert {tuple(row) for row in found.tolist()} == {(0, 1), (1, 0)}


@pytest.mark.parametrize("visibility", ["rays", "raster"])
def test_each_view_has_its_own_camera_light(visibility):
    """A white wall under a light at the camera reads the cosine at which it is seen, from any distance."""
    poses = np.array([pose(0, 0, 1), pose(3, -2, 7), pose(1, 1, 2, (0, 1, 0), 20)])
    sensor = wr.CameraSensor(
        wall(), 16, 16, fov=40, outputs=("color", "rgba8", "position"), visibility=visibility, threads=1
    )
    images = sensor.update(poses)
    to_eye = poses[:, None, None, :3] - images.numpy("position")
    cosine = to_eye[..., 2] / np.linalg.norm(to_eye, axis=-1)
    np.testing.assert_allclose(images.numpy("color")[..., 1], cosine, rtol=2e-6)
    assert (images.numpy("color")[..., 3] == 1).all()
    expected = 255 * srgb_encode(images.numpy("color")[..., :3])
    bytes_ = images.numpy("rgba8")
    assert bytes_.dtype == np.uint8 and bytes_.shape == (3, 16, 16, 4) and (bytes_[..., 3] == 255).all()
    assert np.abs(bytes_[..., :3] - expected).max() <= 0.501


def test_shadow_of_a_sphere_has_its_outline():
    """Under light from straight above, the shadow is the disk of the sphere's radius."""
    scene = wr.Scene()
    scene.add_sphere("/ball", 0.5, pose=pose(0, 1, 0))
    corners, quad = scenes.quad(8.0)
    scene.add_mesh("/floor", corners, quad, pose=pose(0, 0, 0, (1, 0, 0), -90), color=(1, 1, 1))
    light = wr.DistantLight(intensity=np.pi, angle=0.0, normalize=True)
    scene.add_light(light, pose=pose(0, 0, 0, (1, 0, 0), -90))
    names = ("color", "position", "primId")
    for visibility in ("rays", "raster"):
        sensor = wr.CameraSensor(scene, 48, 48, fov=60, outputs=names, transport="direct", visibility=visibility)
        images = sensor.update([pose(0, 1.6, 2.8, (1, 0, 0), -30)])
        floor = images.numpy("primId")[0] == 1
        radius = np.hypot(images.numpy("position")[0, ..., 0], images.numpy("position")[0, ..., 2])
        clear = floor & (np.abs(radius - 0.5) > 1e-4)
        lit = images.numpy("color")[0, ..., 0]
        np.testing.assert_allclose(lit[clear], np.where(radius[clear] < 0.5, 0.0, 1.0), atol=2e-6)
        assert (radius[clear] < 0.5).sum() > 20


def test_intrinsics_project_positions_to_pixel_centres():
    sensor = wr.CameraSensor(wall(), 36, 24, intrinsics=K, outputs=("Peye", "position"))
    images = sensor.update([pose(0.3, -0.2, 3, (0, 1, 0), 15)])
    x, y, z = np.moveaxis(images.numpy("Peye")[0].astype(float), -1, 0)
    u, v = K[0, 0] * x / -z + K[0, 2], K[1, 1] * -y / -z + K[1, 2]
    np.testing.assert_allclose(u, np.arange(36)[None] + 0.5 + 0 * u, atol=2e-4)
    np.testing.assert_allclose(v, np.arange(24)[:, None] + 0.5 + 0 * v, atol=2e-4)


def test_distorted_rays_are_inverse_to_opencv():
    k1, k2, p1, p2, k3 = distortion = (-0.2, 0.05, 0.003, -0.002, 0.01)
    rays = distorted_rays(K, distortion, 36, 24)
    x, y = rays[..., 0] / -rays[..., 2], -rays[..., 1] / -rays[..., 2]
    r = x * x + y * y
    radial = 1 + k1 * r + k2 * r**2 + k3 * r**3
    u = K[0, 0] * (x * radial + 2 * p1 * x * y + p2 * (r + 2 * x * x)) + K[0, 2]
    v = K[1, 1] * (y * radial + p1 * (r + 2 * y * y) + 2 * p2 * x * y) + K[1, 2]
    np.testing.assert_allclose(u, np.arange(36)[None] + 0.5 + 0 * u, atol=1e-9)
    np.testing.assert_allclose(v, np.arange(24)[:, None] + 0.5 + 0 * v, atol=1e-9)
    # r (1 - r²) has its fold at 1/√3, where it is 2/(3√3): what lies farther out shows nothing.
    folded = distorted_rays(K, (-1.0,), 36, 24)
    px, py = np.meshgrid((np.arange(36) + 0.5 - 17.5) / 30, (np.arange(24) + 0.5 - 12.25) / 28)
    assert (np.isfinite(folded[..., 0]) == (np.hypot(px, py) < 2 / 27**0.5)).all()


def test_fisheye_rays_are_inverse_to_opencv():
    k = (0.05, -0.01, 0.002, -0.0003)
    matrix = np.array([[8.0, 0, 18], [0, 8.0, 12], [0, 0, 1]])
    rays = fisheye_rays(matrix, k, 36, 24)
    seen = np.isfinite(rays[..., 0])
    x, y, z = np.moveaxis(rays[seen] * (1, -1, -1), -1, 0)
    theta = np.arctan2(np.hypot(x, y), z)
    radius = theta * (1 + sum(c * theta ** (2 * i + 2) for i, c in enumerate(k)))
    u = matrix[0, 0] * radius * x / np.hypot(x, y) + 18
    expected = np.broadcast_to(np.arange(36)[None] + 0.5, (24, 36))[seen]
    np.testing.assert_allclose(u, expected, atol=1e-8)
    assert theta.max() > np.pi / 2 and seen.mean() > 0.9


def test_table_lenses_see_along_their_rays():
    """A sphere around the eye is met by all rays, and nothing where the lens shows nothing."""
    scene = wr.Scene()
    scene.add_sphere("/sky", 5.0)
    matrix = np.array([[4.0, 0, 18], [0, 4.0, 12], [0, 0, 1]])
    sensor = wr.CameraSensor(scene, 36, 24, intrinsics=matrix, lens="fisheye", outputs=("distance", "Peye", "primId"))
    images = sensor.update([STRAIGHT])
    rays = fisheye_rays(matrix, (), 36, 24)
    seen = np.isfinite(rays[..., 0])
    assert 0.5 < seen.mean() < 1.0
    np.testing.assert_allclose(images.numpy("Peye")[0][seen], 5 * rays[seen], atol=1e-5)
    assert (images.numpy("primId")[0] == np.where(seen, 0, -1)).all()
    assert (images.numpy("distance")[0][~seen] == 0).all()


def test_orthographic_views():
    sensor = wr.CameraSensor(wall(), 8, 4, fov=2.0, lens="orthographic", outputs=("cameraDepth", "position"))
    images = sensor.update([pose(1, 2, 3)])
    np.testing.assert_array_equal(images.numpy("cameraDepth")[0], 3.0)
    x = 1 + (np.arange(8) + 0.5) / 8 * 4 - 2
    np.testing.assert_allclose(images.numpy("position")[0, :, :, 0], np.tile(x, (4, 1)), atol=GAMMA_7 * 300)


def test_lidar_in_a_sphere_and_its_range():
    """From a place p inside a sphere about the origin: t = -p·d + √((p·d)² + R² - p²)."""
    scene = wr.Scene()
    scene.add_sphere("/room", 4.0)
    azimuths, elevations = np.linspace(-180, 150, 12), np.linspace(-60, 60, 5)
    place = np.array([0.7, -0.4, 1.1])
    lidar = wr.LidarSensor(scene, azimuths, elevations, range=(0.0, 20.0))
    images = lidar.update([[*place, 0, 0, 0, 1], [*place, *pose(0, 0, 0, (0, 1, 0), 90)[3:]]])
    a, e = np.radians(azimuths)[None], np.radians(elevations)[:, None]
    d = np.stack(np.broadcast_arrays(-np.cos(e) * np.sin(a), np.sin(e), -np.cos(e) * np.cos(a)), -1)
    expected = -d @ place + np.sqrt((d @ place) ** 2 + 16 - place @ place)
    np.testing.assert_allclose(images.numpy("distance")[0], expected, rtol=1e-6)
    # Turned to the left by 90 degrees: three of twelve columns.
    np.testing.assert_allclose(images.numpy("distance")[1], np.roll(expected, -3, 1), rtol=1e-5)
    assert images.distance.shape == images.primId.shape == (2, 5, 12) and (images.numpy("primId") == 0).all()
    short = wr.LidarSensor(scene, azimuths, elevations, range=(0.0, 4.0)).update([[*place, 0, 0, 0, 1]])
    np.testing.assert_array_equal(short.numpy("distance")[0] > 0, expected < 4.0)


def test_azimuth_grows_to_the_left():
    scene = wr.Scene()
    for name, x, z in (("ahead", 0, -3), ("left", -3, 0), ("behind", 0, 3), ("right", 3, 0)):
        scene.add_sphere(f"/{name}", 1.0, pose=pose(x, 0, z))
    images = wr.LidarSensor(scene, [0, 90, 180, 270], [0]).update([STRAIGHT])
    assert [images.prims[i] for i in images.numpy("primId")[0, 0]] == ["/ahead", "/left", "/behind", "/right"]
    np.testing.assert_allclose(images.numpy("distance")[0, 0], 2.0, rtol=1e-6)


def worlds_scene(radii):
    scene = wr.Scene()
    points, faces = scenes.icosphere(2)
    corners, quad = scenes.quad(8.0)
    for i, radius in enumerate(radii):
        scene.add_mesh(f"/world{i}/ball", (radius * points), faces)
        scene.add_sphere(f"/world{i}/moon", 0.2, pose=pose(1.0, 0.1 * i))
    scene.add_mesh("/floor", corners, quad, pose=pose(0, -1, 0, (1, 0, 0), -90), color=(1, 1, 1))
    light = wr.DistantLight(intensity=np.pi, angle=0.0, normalize=True)
    scene.add_light(light, pose=pose(0, 0, 0, (1, 0, 0), -90))
    return scene


@pytest.mark.parametrize("visibility", ["rays", "raster"])
def test_views_see_their_world_alone(visibility):
    """Each view of many worlds has the bits of a scene that holds its world alone, shadows too."""
    radii = (0.3, 0.7, 0.5)
    names = ("color", "cameraDepth", "normal")
    options = {"fov": 50, "outputs": names, "transport": "direct", "visibility": visibility}
    scene = worlds_scene(radii)
    place = pose(0, 1.5, 4, (1, 0, 0), -20)
    sensor = wr.CameraSensor(scene, 32, 24, worlds=[f"/world{i}" for i in range(3)], **options)
    seen = {name: sensor.update([place] * 4, worlds=[2, 0, 1, 2]).numpy(name).copy() for name in names}
    for view, world in enumerate((2, 0, 1, 2)):
        alone = worlds_scene(radii)
        for other in {0, 1, 2} - {world}:
            alone.remove(f"/world{other}/ball")
            alone.remove(f"/world{other}/moon")
        images = wr.CameraSensor(alone, 32, 24, **options).update([place])
        for name in names:
            np.testing.assert_array_equal(seen[name][view], images.numpy(name)[0], err_msg=name)
    assert (seen["cameraDepth"][0] != seen["cameraDepth"][1]).any()
    owners = np.array([0, 0, 1, 1, 2, 2, -1])
    by_number = wr.CameraSensor(scene, 32, 24, worlds=owners, **options).update([place] * 3)
    np.testing.assert_array_equal(by_number.numpy("color")[1], seen["color"][2])


def test_sensors_of_a_scene_share_what_is_on_the_device():
    scene = balls((0.5, 0.3))
    depth = wr.CameraSensor(scene, 24, 16, fov=50, outputs=AOVS, visibility="rays")
    second = wr.CameraSensor(scene, 24, 16, fov=50, outputs=AOVS, visibility="rays")
    depth.update([pose(0, 0, 4)])
    second.update([pose(0, 0, 5)])
    assert depth.live is second.live
    ids, moved = scene.ids(["/ball0"]), wp.array([pose(-0.6, 0.4, 0)], dtype=wp.transformf)
    before = depth.images.numpy("cameraDepth").copy()
    scene.set_poses(ids, moved)
    steps = []
    update = depth.live.live.update
    depth.live.live.update = lambda *a: (steps.append(1), update(*a))
    after = depth.update([pose(0, 0, 4)]).numpy("cameraDepth").copy()
    second.update([pose(0, 0, 4)], refit=False)
    assert len(steps) == 1, "the second sensor of a step finds the scene in step"
    np.testing.assert_array_equal(second.images.numpy("cameraDepth"), after)
    assert (before != after).any()


def test_points_written_in_place_are_seen_and_late_updates_are_harmless():
    """Without `refit` a view has the points of the last one, whole; the next update sees them."""
    scene = wall()
    points = wp.array(scene.meshes["/wall"].host_points(), dtype=wp.vec3)
    scene.remove("/wall")
    scene.add_mesh("/wall", points, [[0, 1, 2, 3]])
    sensor = wr.CameraSensor(scene, 8, 8, fov=40, outputs=("cameraDepth", "primId"), visibility="rays")
    sensor.update([pose(0, 0, 3)])
    points.assign(points.numpy() + np.float32([0, 0, 1]))
    late = sensor.update([pose(0, 0, 3)], refit=False)
    depth = late.numpy("cameraDepth")
    assert (late.numpy("primId") == 0).all()
    assert (np.minimum(abs(depth - 2), abs(depth - 3)) < GAMMA_7 * 300).all()
    np.testing.assert_allclose(sensor.update([pose(0, 0, 3)]).numpy("cameraDepth"), 2.0, atol=GAMMA_7 * 300)
    scene.meshes["/wall"].points = wp.array(points.numpy(), dtype=wp.vec3)
    with pytest.raises(wr.SceneError, match="/wall"):
        sensor.update([pose(0, 0, 3)])


def test_pictures_stay_where_they_are_and_cross_without_a_copy():
    sensor = wr.CameraSensor(balls(), 24, 16, fov=50, outputs=AOVS, visibility="rays")
    images = sensor.update([pose(0, 0, 4)])
    place, view = images.cameraDepth.ptr, np.from_dlpack(images.cameraDepth)
    first = view.copy()
    again = sensor.update([pose(0, 0, 5)])
    assert again.cameraDepth.ptr == place == view.ctypes.data
    assert (view != first).any(), "the view shows the new picture"
    assert images.cameraDepth.shape == (1, 16, 24) and images.normal.numpy().shape == (1, 16, 24, 3)
    torch = pytest.importorskip("torch")
    assert torch.from_dlpack(again.cameraDepth).data_ptr() == place


def test_threads_change_no_bit():
    scene, place = balls((0.5, 0.3)), [pose(0, 0, 4), pose(0, 0, 3)]
    options = {"fov": 50, "outputs": AOVS, "visibility": "rays"}
    one, two = (wr.CameraSensor(scene, 40, 30, threads=n, **options).update(place) for n in (1, 2))
    for name in AOVS:
        np.testing.assert_array_equal(one.numpy(name), two.numpy(name))


@pytest.mark.parametrize("visibility", ["rays", "raster"])
@pytest.mark.parametrize("bad", [[np.nan] * 7, [0, 0, 4, 0, 0, 0, 0], [np.inf, 0, 0, 0, 0, 0, 1]])
def test_poses_that_are_none_see_nothing(bad, visibility):
    sensor = wr.CameraSensor(balls(), 24, 16, fov=50, outputs=AOVS, visibility=visibility)
    images = sensor.update(np.array([bad, pose(0, 0, 4)], np.float32))
    assert (images.numpy("primId")[0] == -1).all() and (images.numpy("primId")[1] >= 0).any()
    assert (images.numpy("cameraDepth")[0] == 0).all()


def test_path_traced_views_agree_with_the_renderer():
    """The means over the picture differ by no more than four standard errors of both."""
    scene = balls((0.5,))
    scene.add_light(wr.DomeLight(intensity=0.7))
    sensor = wr.CameraSensor(scene, 16, 16, fov=50, transport="path", samples=64, seed=3)
    mean = sensor.update([pose(0, 0, 4)]).numpy("color")[0, ..., :3]
    aperture = 2 * 50 * np.tan(np.radians(25))
    camera = wr.Camera(horizontalAperture=aperture, verticalAperture=aperture, clippingRange=(0.01, 1e6))
    camera.transform = wr.scene.pose_matrix(pose(0, 0, 4), "")
    renderer = wr.Renderer(scene, camera, (16, 16), transport="path")
    frame = renderer.render(samples=64)
    error = np.sqrt(2 * (renderer.standard_error() ** 2).mean()) / 16
    assert 0 < error < 0.01
    assert abs(mean.mean() - frame.numpy("color")[..., :3].mean()) < 4 * error


def test_semantic_labels_are_inherited():
    scene = scene_of("""
        def Xform "car" (prepend apiSchemas = ["SemanticsLabelsAPI:class"]) {
            token[] semantics:labels:class= ["car"]
            def Sphere "body" { double radius = 1 }
            def Sphere "wheel" (prepend apiSchemas = ["SemanticsLabelsAPI:class"]) {
                token[] semantics:labels:class= ["wheel", "round"]
                double radius = 0.5
                double3 xformOp:translate = (3, 0, 0)
                uniform token[] xformOpOrder = ["xformOp:translate"]
            }
        }
        def Sphere "old" (prepend apiSchemas = ["SemanticsAPI:Semantics"]) {
            string semantic:Semantics:params:semanticType = "class"
            string semantic:Semantics:params:semanticData = "car"
            double3 xformOp:translate = (-3, 0, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }
        def Sphere "plain" {
            double3 xformOp:translate = (0, 3, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }
    """)
    assert scene.semantics == {0: "car", 1: "round,wheel"}
    sensor = wr.CameraSensor(scene, 40, 40, fov=60, outputs=("primId", "semantic"))
    images = sensor.update([pose(0, 0, 12)])
    prims, labels = images.numpy("primId"), images.numpy("semantic")
    expected = {"/car/body": "car", "/car/wheel": "round,wheel", "/old": "car", "/plain": ""}
    assert set(np.unique(prims)) == {-1, 0, 1, 2, 3}
    for number, path in enumerate(images.prims):
        seen = np.unique(labels[prims == number])
        assert [images.labels.get(int(i), "") for i in seen] == [expected[path]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"fov": 0}, "fov"),
        ({"fov": None}, "fov or intrinsics"),
        ({"intrinsics": np.eye(3)}, "fov or intrinsics"),
        ({"fov": None, "intrinsics": np.eye(4)}, "intrinsics"),
        ({"fov": None, "intrinsics": [[1, 2, 3], [0, 1, 0], [0, 0, 1]]}, "intrinsics"),
        ({"outputs": "colour"}, "colour"),
        ({"outputs": "sampleCount"}, "sampleCount"),
        ({"outputs": ()}, "outputs"),
        ({"lens": "wide"}, "wide"),
        ({"distortion": (0.1,)}, "distortion"),
        ({"near": 2.0, "far": 1.0}, "near"),
        ({"width": 0}, "width"),
        ({"samples": 0}, "samples"),
        ({"visibility": "raster", "lens": "orthographic"}, "orthographic"),
        ({"transport": "fast"}, "fast"),
        ({"worlds": 3}, "worlds are 3"),
        ({"worlds": "/ball0"}, "worlds are '/ball0'"),
        ({"worlds": [0.5, 1.5]}, "worlds are"),
        ({"worlds": ["/ball0", 1]}, "worlds are"),
    ],
)
def test_bad_arguments_are_named(change, message):
    arguments = {"width": 8, "height": 8, "fov": 40.0, **change}
    with pytest.raises(wr.SceneError, match=message):
        wr.CameraSensor(balls(), **arguments)


def test_bad_poses_and_worlds_are_named():
    scene = worlds_scene((0.5, 0.4))
    sensor = wr.CameraSensor(scene, 8, 8, fov=40, outputs="primId", worlds=["/world0", "/world1"])
    for poses, worlds, message in (
        (np.zeros((0, 7)), None, "no poses"),
        (np.zeros((2, 6)), None, "shape"),
        ([STRAIGHT] * 3, None, "3 views of 2 worlds"),
        ([STRAIGHT] * 2, [0, 2], "0 to 1"),
        ([STRAIGHT] * 2, [0], "2 numbers"),
    ):
        with pytest.raises(wr.SceneError, match=message):
            sensor.update(poses, worlds=worlds)
    with pytest.raises(wr.SceneError, match="instances"):
        wr.CameraSensor(scene, 8, 8, fov=40, outputs="primId", worlds=np.zeros(3, int)).update([STRAIGHT])
    with pytest.raises(wr.SceneError, match="azimuth"):
        wr.LidarSensor(scene, [], [0])
    with pytest.raises(wr.SceneError, match="range"):
        wr.LidarSensor(scene, [0], [0], range=(2, 1))
