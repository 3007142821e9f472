"""Many worlds in one sensor: each view sees its own, with the bits of a scene that holds that world alone."""

import numpy as np
import pytest
import scenes
import warp as wp

import warprender as wr

OUTPUTS = ("cameraDepth", "elementId", "normal", "primId")
WAYS = pytest.mark.parametrize("visibility", ["rays", "raster"])
SIZE = 40, 24
#: Half the window's height at distance 1 is 1/2, which floats hold.
FIELD = float(np.degrees(2 * np.arctan(0.5)))
EYE = (0.25, 0.5, 4.0)


def turned(axis, degrees, place=EYE):
    half = np.radians(degrees) / 2
    return [*place, *(np.sin(half) * np.asarray(axis, float)), np.cos(half)]


POSES = np.array([turned((0, 1, 0), 0), turned((0, 1, 0), 12.5), turned((1, 0, 0), -10), turned((0.6, 0, 0.8), 20)])


def add_world(scene, name, seed, bodies=5):
    """Boxes and icosahedra at random places, and an exact sphere."""
    rng = np.random.default_rng(seed)
    shapes = scenes.cube(0.5), scenes.icosphere(0)
    for body in range(bodies):
        points, faces = shapes[body % 2]
        half = rng.uniform(0, 3)
        pose = [*rng.uniform(-1.2, 1.2, 3), np.sin(half), 0, 0, np.cos(half)]
        scene.add_mesh(f"{name}/body{body}", np.asarray(points) * rng.uniform(0.3, 0.8), faces, pose=pose)
    scene.add_sphere(f"{name}/ball", 0.3, pose=[*rng.uniform(-1, 1, 3), 0, 0, 0, 1])


def add_floor(scene):
    points, faces = scenes.quad(8.0)
    scene.add_mesh("/floor", points, faces, pose=[0, -1, 0, -np.sqrt(0.5), 0, 0, np.sqrt(0.5)])


def many(seeds, bodies=5, floor=True):
    scene = wr.Scene()
    for number, seed in enumerate(seeds):
        add_world(scene, f"/world{number}", seed, bodies)
    if floor:
        add_floor(scene)
    return scene


def sensor_of(scene, visibility, worlds=None, **options):
    return wr.CameraSensor(scene, *SIZE, fov=FIELD, outputs=OUTPUTS, visibility=visibility, worlds=worlds, **options)


def pictures(images):
    """Copies of all outputs, with ids as paths."""
    found = {name: images.numpy(name).copy() for name in OUTPUTS}
    found["primId"] = np.array([*images.prims, ""])[found["primId"]]
    return found


def assert_same(a, b):
    for name in OUTPUTS:
        np.testing.assert_array_equal(a[name], b[name], err_msg=name)


def view(found, number):
    return {name: values[number] for name, values in found.items()}


def by_renderer(scene, pose, visibility):
    camera = wr.Camera(focalLength=1.0, horizontalAperture=SIZE[0] / SIZE[1], verticalAperture=1.0)
    camera.clippingRange = (0.01, 1e6)
    camera.transform = wr.scene.pose_matrix(pose, "")
    frame = wr.render(scene, SIZE, camera=camera, outputs=OUTPUTS, visibility=visibility)
    found = {name: frame.numpy(name).copy() for name in OUTPUTS}
    found["primId"] = np.array([*scene.prims, ""])[found["primId"]]
    return found


def without_ball(scene):
    """Renderers look into the box of an exact sphere by rays alone, sensors by both."""
    for path in [path for path in scene.placements if path.endswith("ball")]:
        scene.placements[path].visible = False
    return scene


@WAYS
def test_worlds_and_views_have_the_bits_of_a_renderer(visibility):
    """A view of each of four worlds, and four views of one world; from one place, about which renderers place all."""
    prepare = without_ball if visibility == "raster" else lambda scene: scene
    seeds = 1, 2, 3, 4
    scene = prepare(many(seeds))
    seen = pictures(sensor_of(scene, visibility, [f"/world{i}" for i in range(4)]).update(POSES))
    for number, seed in enumerate(seeds):
        alone = wr.Scene()
        add_world(alone, f"/world{number}", seed)
        add_floor(alone)
        expected = by_renderer(prepare(alone), POSES[number], visibility)
        assert len(np.unique(expected["primId"])) > 4
        assert_same(view(seen, number), expected)
    one = prepare(many((7,)))
    seen = pictures(sensor_of(one, visibility).update(POSES))
    for number, pose in enumerate(POSES):
        assert_same(view(seen, number), by_renderer(one, pose, visibility))


@WAYS
@pytest.mark.parametrize("bodies", [0, 6, 7, 8, 70])
def test_trees_of_worlds_hide_nothing(visibility, bodies):
    """From none to many bodies in a world, beside one of another size, against a scene that holds it alone."""
    scene = wr.Scene()
    add_world(scene, "/a", 5, bodies)
    add_world(scene, "/b", 6, 3)
    seen = pictures(sensor_of(scene, visibility, ["/a", "/b"]).update(POSES[[1, 0, 3]], worlds=[0, 1, 0]))
    for name, seed, count, places in (("/a", 5, bodies, (0, 2)), ("/b", 6, 3, (1,))):
        alone = wr.Scene()
        add_world(alone, name, seed, count)
        for number in places:
            pose = POSES[[1, 0, 3]][number : number + 1]
            assert_same(view(seen, number), view(pictures(sensor_of(alone, visibility).update(pose)), 0))


@WAYS
def test_bodies_in_one_place_are_all_there(visibility):
    """Twenty cubes that coincide have no middle that parts them; of equally near hits the first is seen."""
    scene, (points, faces) = wr.Scene(), scenes.cube(1.0)
    for number in range(20):
        scene.add_mesh(f"/a/body{number}", points, faces)
    scene.add_sphere("/b/ball", 0.5)
    ids = scene.ids([f"/a/body{number}" for number in range(20)])
    sensor, seen = sensor_of(scene, visibility, ["/a", "/b"]), set()
    for gone in range(20):
        found = pictures(sensor.update(POSES[:1], worlds=[0]))["primId"]
        assert set(np.unique(found)) == {"", f"/a/body{gone}"}
        seen |= set(np.unique(found))
        poses = np.zeros((20, 7))
        poses[:, 6], poses[: gone + 1, 0] = 1, 100.0
        scene.set_poses(ids, wp.array(poses, dtype=wp.transformd))
    assert len(seen) == 21
    assert (pictures(sensor.update(POSES[:1], worlds=[0]))["primId"] == "").all()


@WAYS
def test_what_moves_in_one_world_moves_in_no_other(visibility):
    scene = many((1, 2, 3))
    worlds = [f"/world{i}" for i in range(3)]
    sensor = sensor_of(scene, visibility, worlds)
    before = pictures(sensor.update(POSES[[0, 0, 0]]))
    # In front of all else, then among it, then far away.
    for place in ((0.25, 0.5, 2.5), (0.0, 0.0, 0.0), (0.0, 1e7, 0.0)):
        scene.set_poses("/world1/body0", np.array([[*place, 0, 0, 0, 1]]))
        after = pictures(sensor.update(POSES[[0, 0, 0]]))
        assert_same(view(after, 0), view(before, 0))
        assert_same(view(after, 2), view(before, 2))
        assert not np.isin("/world1/body0", after["primId"][[0, 2]])
        assert np.isin("/world1/body0", after["primId"][1]) == (place[1] < 1e7)
    # Views choose their worlds anew in each call.
    assert_same(view(pictures(sensor.update(POSES[[0, 0]], worlds=[2, 0])), 0), view(before, 2))


@WAYS
def test_bodies_come_and_go_in_their_world_alone(visibility):
    scene = many((1, 2))
    sensor = sensor_of(scene, visibility, ["/world0", "/world1"])
    before = pictures(sensor.update(POSES[[0, 0]]))
    scene.add_mesh("/world1/guest", *scenes.cube(0.6), pose=[0.25, 0.5, 2.5, 0, 0, 0, 1])
    with_guest = pictures(sensor.update(POSES[[0, 0]]))
    assert_same(view(with_guest, 0), view(before, 0))
    assert np.isin("/world1/guest", with_guest["primId"][1])
    scene.remove("/world1/guest")
    assert_same(pictures(sensor.update(POSES[[0, 0]])), before)
    scene.set_visible("/world1/body0", False)
    hidden = pictures(sensor.update(POSES[[0, 0]]))
    assert_same(view(hidden, 0), view(before, 0))
    assert not np.isin("/world1/body0", hidden["primId"])
    scene.set_visible("/world1/body0", True)
    assert_same(pictures(sensor.update(POSES[[0, 0]])), before)


@WAYS
def test_empty_worlds_and_a_single_one(visibility):
    scene = many((1,), floor=False)
    seen = pictures(sensor_of(scene, visibility, ["/world0", "/nothing"]).update(POSES[[0, 0]]))
    assert [line for line in scene.warnings if "/nothing" in line]
    assert (seen["primId"][1] == "").all() and (seen["cameraDepth"][1] == 0).all()
    assert (seen["elementId"][1] == -1).all() and (seen["normal"][1] == -1).all()
    one = pictures(sensor_of(scene, visibility, ["/world0"]).update(POSES[:1]))
    assert_same(one, pictures(sensor_of(scene, visibility).update(POSES[:1])))
    assert_same(view(seen, 0), view(one, 0))
    by_number = sensor_of(scene, visibility, np.zeros(6, int)).update(POSES[:1])
    assert_same(one, pictures(by_number))


@WAYS
def test_poses_of_every_kind_show_the_same(visibility):
    """Numbers that float32 holds, in each form that poses are taken in, and arrays that take turns."""
    host = np.float32(POSES)
    forms = [
        host,
        host.astype(np.float64),
        host.tolist(),
        wp.array(host, dtype=wp.transformf),
        wp.array(host.astype(np.float64), dtype=wp.transformd),
        wp.array(host, dtype=wp.float32),
        wp.array(host.astype(np.float64), dtype=wp.float64),
    ]
    sensor = sensor_of(many((1, 2)), visibility, ["/world0", "/world1"])
    worlds = [0, 1, 1, 0]
    first = pictures(sensor.update(forms[0], worlds=worlds))
    for form in (*forms[1:], *forms):
        given = wp.array(worlds, dtype=wp.int32) if isinstance(form, wp.array) else worlds
        assert_same(pictures(sensor.update(form, worlds=given)), first)
    other = wp.array(host[::-1].copy(), dtype=wp.transformf)
    turned_round = pictures(sensor.update(other, worlds=worlds[::-1]))
    assert_same({name: values[::-1] for name, values in turned_round.items()}, first)
    with pytest.raises(wr.SceneError, match="no poses"):
        sensor.update(np.zeros((0, 7)))
    with pytest.raises(wr.SceneError, match="no poses"):
        sensor.update(wp.empty(0, dtype=wp.transformf))
    with pytest.raises(wr.SceneError, match="4 numbers from 0 to 1"):
        sensor.update(host, worlds=[0, 1, 2, 0])
    assert_same(pictures(sensor.update(host, worlds=worlds)), first)


@WAYS
def test_worlds_threads_and_company_change_no_bit(visibility):
    scene = many((1, 2, 3))
    worlds = [f"/world{i}" for i in range(3)]
    one = pictures(sensor_of(scene, visibility, worlds, threads=1).update(POSES[:3]))
    for threads in (2, 5):
        assert_same(pictures(sensor_of(scene, visibility, worlds, threads=threads).update(POSES[:3])), one)
    crowd = pictures(sensor_of(scene, visibility, worlds).update(np.tile(POSES[:3], (7, 1)), worlds=[0, 1, 2] * 7))
    for number in range(21):
        assert_same(view(crowd, number), view(one, number % 3))


def test_many_triangles_in_small_views_are_drawn_alike():
    """Sorted into bins or not, the rasterizer has the same bits."""
    points, faces = scenes.icosphere(5)
    scene = wr.Scene()
    scene.add_mesh("/world0/ball", points, faces)
    scene.add_sphere("/world0/beside", 0.2, pose=[1.2, 0, 0, 0, 0, 0, 1])
    scene.add_mesh("/world1/box", *scenes.cube(1.0))
    both = pictures(sensor_of(scene, "raster", ["/world0", "/world1"]).update(POSES[[0, 0, 1]], worlds=[1, 0, 0]))
    scene.remove("/world0/ball")
    few = pictures(sensor_of(scene, "raster", ["/world0", "/world1"]).update(POSES[[0]], worlds=[1]))
    assert_same(view(both, 0), view(few, 0))
    by_rays = wr.Scene()
    by_rays.add_mesh("/world0/ball", points, faces)
    by_rays.add_sphere("/world0/beside", 0.2, pose=[1.2, 0, 0, 0, 0, 0, 1])
    expected = pictures(sensor_of(by_rays, "rays").update(POSES[[0, 1]]))
    assert (both["primId"][1:] == expected["primId"]).mean() > 0.99
    close = both["primId"][1:] == expected["primId"]
    np.testing.assert_allclose(both["cameraDepth"][1:][close], expected["cameraDepth"][close], rtol=2e-4)
