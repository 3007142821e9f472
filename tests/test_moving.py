"""Scenes that move: what a renderer that followed shows is what a new one shows, to the bit."""

import numpy as np
import pytest
import scenes
import warp as wp
from pictures import prepare
from usd_stage import stage_of

import warprender as wr

OUTPUTS = ("cameraDepth", "normal", "position", "primId", "instanceId", "elementId")
CAMERA = scenes.camera((0.3, -2.0, 7.0))
VISIBILITIES = ("rays", "raster")

#: Positions and quaternions xyzw, not normalised, as simulations have them.
POSES = np.array(
    [[-1.2, 0.3, 0.2, 0.1, 0.2, 0.3, 0.9], [1.0, 0.3, 0.1, 0.0, 0.0, 0.0, 2.0], [0.2, 1.0, -0.4, 0.5, 0.5, 0.5, 0.5]],
    np.float32,
)


def ball(level=2):
    points, faces = scenes.icosphere(level)
    return points.astype(np.float32), faces


def bodies(poses=(None, None, None)):
    """A ball of triangles, a sphere and a cube over a floor, under a lamp, a sun and a sky."""
    scene = wr.Scene()
    scene.add_mesh("/floor", *scenes.quad(10.0, -1.5))
    scene.add_mesh("/ball", *ball(), pose=poses[0], color=(0.8, 0.2, 0.2))
    scene.add_sphere("/sphere", 0.5, pose=poses[1])
    scene.add_mesh("/cube", *scenes.cube(1.0), pose=poses[2])
    scene.add_light(wr.SphereLight(radius=0.3, intensity=20.0), "/lamp", pose=(0, 0, 4, 0, 0, 0, 1))
    scene.add_light(wr.DistantLight(intensity=1.0), "/sun")
    return scene


BODIES = ("/ball", "/sphere", "/cube")


def device_poses(poses=POSES):
    return wp.array(np.asarray(poses, np.float32), dtype=wp.transformf)


def aovs(scene, camera=CAMERA, visibility="rays", size=48, outputs=OUTPUTS):
    return wr.Renderer(scene, camera, (size, size), outputs=outputs, visibility=visibility, transport="none")


def values(renderer, **options):
    frame = renderer.render(**options)
    return {name: frame.numpy(name).copy() for name in frame.outputs}


def assert_same(one, other):
    assert one.keys() == other.keys()
    for name in one:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)


def differ(one, other):
    return any((one[name] != other[name]).any() for name in one)


# ---------------------------------------------------------------- poses


@pytest.mark.parametrize("visibility", VISIBILITIES)
def test_poses_on_the_device_give_the_bits_of_transforms_on_the_host(visibility):
    scene = bodies()
    renderer = aovs(scene, visibility=visibility)
    before = values(renderer)
    scene.set_poses(BODIES, device_poses())
    renderer.update()
    after = values(renderer)
    assert differ(before, after)
    assert_same(after, values(aovs(bodies(POSES), visibility=visibility)))


def test_paths_follow_posed_bodies_to_the_bit():
    scene = bodies()
    renderer = prepare(scene, CAMERA, 24)
    renderer.render(samples=1)
    scene.set_poses(BODIES, device_poses())
    renderer.update()
    assert_same(values(renderer, samples=4), values(prepare(bodies(POSES), CAMERA, 24), samples=4))


@pytest.mark.parametrize("visibility", VISIBILITIES)
def test_colour_without_paths_follows_to_the_bit(visibility):
    def renderer(scene):
        return prepare(scene, CAMERA, 24, visibility=visibility, transport="local")

    scene = bodies()
    moving = renderer(scene)
    before = values(moving, samples=2)
    scene.set_poses(BODIES, device_poses())
    moving.update()
    after = values(moving, samples=2)
    assert differ(before, after)
    assert_same(after, values(renderer(bodies(POSES)), samples=2))


def test_there_and_back_is_where_it_was():
    scene = bodies(POSES)
    renderer = aovs(scene)
    first = values(renderer)
    ids = scene.ids(BODIES)
    for poses in (POSES[::-1].copy(), POSES * np.float32(1.5), POSES):
        scene.set_poses(ids, device_poses(poses))
        renderer.update()
    assert_same(first, values(renderer))


def test_authored_scale_shear_and_mirroring_are_kept():
    turn = scenes.look_at((1.0, 2.0, 3.0))[:3, :3]
    shear = np.array([[1.0, 0.0, 0.0], [0.3, 2.0, 0.0], [0.0, 0.0, 0.5]])
    for stretch in (np.diag([2.0, 0.5, 1.5]), shear @ shear.T, -np.diag([1.0, 1.0, 3.0])):
        for rest in (stretch, stretch @ turn):
            matrix = np.eye(4)
            matrix[:3, :3], matrix[3, :3] = rest, (5.0, 6.0, 7.0)
            scene = wr.Scene()
            scene.add_mesh("/ball", *ball(), pose=matrix)
            renderer = aovs(scene)
            scene.set_poses("/ball", device_poses(POSES[:1]))
            renderer.update()
            expected = np.eye(4)
            expected[:3, :3] = stretch
            still = wr.Scene()
            still.add_mesh("/ball", *ball(), pose=expected @ wr.scene.pose_matrix(POSES[0], ""))
            assert_same(values(renderer), values(aovs(still)))


def test_what_is_below_a_posed_prim_moves_with_it_unless_it_is_posed_itself():
    stage = stage_of(
        """
        def Xform "arm" {
            double3 xformOp:translate = (1, 2, 3)
            float3 xformOp:scale = (2, 2, 2)
            uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
            def Sphere "elbow" { double radius = 0.25 }
            def Xform "hand" {
                double3 xformOp:translate = (0, 1, 0)
                uniform token[] xformOpOrder = ["xformOp:translate"]
                def Sphere "finger" { double radius = 0.125 }
            }
        }
        """
    )
    scene = wr.load(stage)
    renderer = aovs(scene)
    quarter = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))  # about z: x becomes y, y becomes -x
    scene.set_poses("/arm", np.array([(0.0, 0.5, 0.0, *quarter)]))
    renderer.update()
    spheres = {"/elbow": (0.5, (0.0, 0.5, 0.0)), "/finger": (0.25, (-2.0, 0.5, 0.0))}

    def expected():
        still = wr.Scene()
        for path, (radius, place) in spheres.items():
            pose = np.eye(4)
            pose[3, :3] = place
            still.add_sphere(path, radius, pose=pose)
        return values(aovs(still, outputs=("cameraDepth", "primId")))

    def seen():
        frame = values(renderer)
        return {name: frame[name] for name in ("cameraDepth", "primId")}

    same, now = expected(), seen()
    np.testing.assert_array_equal(now["primId"], same["primId"])
    np.testing.assert_allclose(now["cameraDepth"], same["cameraDepth"], rtol=1e-5)
    scene.set_poses("/arm/hand", np.array([(1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0)]))
    renderer.update()
    spheres["/finger"] = (0.25, (1.0, 1.0, 1.0))
    np.testing.assert_array_equal(seen()["primId"], expected()["primId"])


def test_copies_of_an_instancer_move_one_by_one():
    def scene_of(poses):
        scene = wr.Scene()
        scene.add_mesh("/ball", *ball(1), pose=(0, 0, -50, 0, 0, 0, 1))
        scene.add_instances("/copies", "/ball", poses)
        return scene

    rest = np.array([(x, 0, 0, 0, 0, 0, 1) for x in (-2.0, 0.0, 2.0)])
    scene = scene_of(rest)
    renderer = aovs(scene)
    moved = np.array([(-1.0, 1.0, 0.5, 0.1, 0.2, 0.3, 0.4), (2.0, -1.0, 0.5, 0.0, 0.0, 0.0, 1.0)], np.float32)
    scene.set_poses([("/copies", 2), ("/copies", 0)], device_poses(moved))
    renderer.update()
    assert_same(values(renderer), values(aovs(scene_of([moved[1], rest[1], moved[0]]))))


def test_far_from_the_origin_double_precision_poses_keep_their_digits():
    far = np.array((1e6, -2e6, 3e6)) + 0.123456
    camera = scenes.camera(far + (0.3, -2.0, 7.0), far)
    poses = POSES.astype(np.float64)
    poses[:, :3] += far
    scene = bodies()
    renderer = aovs(scene, camera, outputs=("cameraDepth", "primId"))
    scene.set_poses(BODIES, poses)
    renderer.update()
    still = bodies(poses)
    assert_same(values(renderer), values(aovs(still, camera, outputs=("cameraDepth", "primId"))))
    assert (values(renderer)["primId"] >= 1).sum() > 100


# ---------------------------------------------------------------- points


def wave(step):
    points, _ = ball(3)
    return (points * (1 + 0.2 * np.sin(5 * points[:, :1] + step))).astype(np.float32)


def cloth(points):
    scene = wr.Scene()
    scene.add_mesh("/floor", *scenes.quad(10.0, -1.5))
    scene.add_mesh("/cloth", points, ball(3)[1])
    scene.add_light(wr.RectLight(width=2.0, height=2.0, intensity=5.0), "/lamp", pose=(0, 0, 4, 0, 0, 0, 1))
    return scene


@pytest.mark.parametrize("visibility", VISIBILITIES)
@pytest.mark.parametrize("given", ["numpy", "warp"])
def test_points_written_in_place_are_followed_to_the_bit(visibility, given):
    start = wave(0.0) if given == "numpy" else wp.array(wave(0.0), dtype=wp.vec3)
    scene = cloth(start)
    renderer = aovs(scene, visibility=visibility)
    points = scene.meshes["/cloth"].points
    assert isinstance(points, wp.array) and points.dtype == wp.vec3
    assert given == "numpy" or points is start
    before = values(renderer)
    for step in (1.0, 2.0, 3.0):
        points.assign(wave(step))
        renderer.update()
    after = values(renderer)
    assert differ(before, after)
    assert_same(after, values(aovs(cloth(wave(3.0)), visibility=visibility)))


def test_paths_follow_written_points_to_the_bit():
    scene = cloth(wave(0.0))
    renderer = prepare(scene, CAMERA, 24)
    scene.meshes["/cloth"].points.assign(wave(2.0))
    renderer.update()
    assert_same(values(renderer, samples=4), values(prepare(cloth(wave(2.0)), CAMERA, 24), samples=4))


def test_a_mesh_from_a_stage_is_written_in_place_too():
    stage = stage_of(
        """
        def Mesh "m" {
            int[] faceVertexCounts = [4]
            int[] faceVertexIndices = [0, 1, 2, 3]
            point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
            uniform token subdivisionScheme = "none"
        }
        """
    )
    scene = wr.load(stage)
    renderer = wr.Renderer(scene, scenes.window(2.0), (8, 8), outputs="cameraDepth")
    assert (values(renderer)["cameraDepth"] == 5.0).all()
    points = scene.meshes["/m"].points
    points.assign(points.numpy() + np.float32([0, 0, 0.5]))
    renderer.update()
    assert (values(renderer)["cameraDepth"] == 4.5).all()


def drifted(step, count=2000):
    """Small tetrahedra, each moved by `step` half-sizes of the scene at random (hard_cases M1)."""
    rng = np.random.default_rng(5)
    centres = rng.uniform(-1, 1, (count, 1, 3))
    corners = rng.normal(size=(count, 4, 3)) * 0.01
    drift = rng.normal(size=(count, 1, 3))
    points = (centres + corners + step * drift).reshape(-1, 3).astype(np.float32)
    faces = np.array([(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)])
    return points, (np.arange(count)[:, None, None] * 4 + faces).reshape(-1, 3)


def test_M1_a_tree_that_has_degraded_is_built_anew_and_shows_the_same():
    scene = wr.Scene()
    points, faces = drifted(0.0)
    scene.add_mesh("/cloud", points, faces)
    renderer = aovs(scene)
    tree = renderer._live.upload.parts[0].tree
    for step in (0.01, 0.05, 0.2, 1.0):
        built = tree._wide
        scene.meshes["/cloud"].points.assign(drifted(step)[0])
        renderer.update()
        assert not tree._wide.has_degraded
        assert (tree._wide is not built) == (step >= 0.2)
        still = wr.Scene()
        still.add_mesh("/cloud", drifted(step)[0], faces)
        assert_same(values(renderer), values(aovs(still)))


@pytest.mark.parametrize("fled", [False, True])
def test_the_tree_of_instances_is_built_anew_even_when_one_of_them_has_fled(fled):
    rng = np.random.default_rng(6)
    rest = np.concatenate([rng.uniform(-2, 2, (300, 3)), np.tile((0, 0, 0, 1), (300, 1))], 1)

    def scene_of(poses):
        scene = wr.Scene()
        scene.add_sphere("/ball", 0.1)
        scene.add_instances("/copies", "/ball", poses)
        return scene

    scene = scene_of(rest)
    renderer = aovs(scene)
    world = renderer._live.upload.world
    moved = rest[rng.permutation(300)]
    if fled:
        moved[0, :3] = 1e5
    built = world._wide
    scene.set_poses([("/copies", k) for k in range(300)], moved)
    renderer.update()
    assert world._wide is not built
    assert_same(values(renderer), values(aovs(scene_of(moved))))


# ---------------------------------------------------------------- what explodes, what is empty


@pytest.mark.parametrize("visibility", VISIBILITIES)
def test_M2_a_body_with_a_bad_pose_is_not_drawn_and_comes_back(visibility):
    without = bodies(POSES)
    without.remove("/cube")
    alone = values(aovs(without, visibility=visibility))
    scene = bodies(POSES)
    renderer = aovs(scene, visibility=visibility)
    complete = values(renderer)
    for bad in ((np.nan,) * 7, (0, 0, np.inf, 0, 0, 0, 1), (0, 0, 0, 0, 0, 0, 0), (1e38, 0, 0, 0, 0, 0, 1)):
        scene.set_poses("/cube", device_poses([bad]))
        renderer.update()
        assert_same(values(renderer), alone)
        scene.set_poses("/cube", device_poses(POSES[2:]))
        renderer.update()
        assert_same(values(renderer), complete)


@pytest.mark.parametrize("visibility", VISIBILITIES)
def test_M3_points_that_are_not_finite_take_their_triangles_alone(visibility):
    scene = cloth(wave(0.0))
    renderer = aovs(scene, visibility=visibility)
    points = scene.meshes["/cloth"].points
    bad = wave(1.0)
    bad[3], bad[77] = np.nan, np.inf
    points.assign(bad)
    renderer.update()
    faces = ball(3)[1]
    whole = np.flatnonzero(~np.isin(faces, (3, 77)).any(1))
    still = wr.Scene()
    still.add_mesh("/floor", *scenes.quad(10.0, -1.5))
    still.add_mesh("/cloth", np.where(np.isfinite(bad), bad, 0).astype(np.float32), faces[whole])
    expected, seen = values(aovs(still, visibility=visibility)), values(renderer)
    on_cloth = expected["primId"] == 1
    expected["elementId"][on_cloth] = whole[expected["elementId"][on_cloth]]
    assert_same(seen, expected)
    renderer.update()
    warnings = [line for line in scene.warnings if line.startswith("/cloth")]
    assert len(warnings) == 1 and str(len(faces) - len(whole)) in warnings[0]
    points.assign(wave(1.0))
    renderer.update()
    assert_same(values(renderer), values(aovs(cloth(wave(1.0)), visibility=visibility)))


def test_M3_all_points_may_go_and_come_back():
    scene = cloth(wave(0.0))
    renderer = aovs(scene)
    first = values(renderer)
    points = scene.meshes["/cloth"].points
    points.fill_(wp.vec3(np.nan, np.nan, np.nan))
    renderer.update()
    assert (values(renderer)["primId"] != 1).all()
    points.assign(wave(0.0))
    renderer.update()
    assert_same(values(renderer), first)


def test_a_replaced_array_is_refused_by_the_name_of_its_prim():
    for other in (wave(1.0), wp.array(wave(1.0), dtype=wp.vec3), wp.zeros(3, dtype=wp.vec3)):
        scene = cloth(wave(0.0))
        renderer = aovs(scene)
        scene.meshes["/cloth"].points = other
        with pytest.raises(wr.SceneError, match=r"^/cloth: .*replaced"):
            renderer.update()


def test_M5_pictures_without_an_update_stay_sound():
    # The rule is broken: points are written and the trees still stand. Nothing but what is there may be seen.
    scene = cloth(wave(0.0))
    renderer = aovs(scene)
    first = values(renderer)
    points = scene.meshes["/cloth"].points
    points.assign(wave(2.0) * np.float32(1.5))
    torn = values(renderer)
    assert all(np.isfinite(torn[name]).all() for name in torn)
    np.testing.assert_array_equal(torn["primId"], first["primId"])
    points.assign(wave(0.0))
    assert_same(values(renderer), first)


# ---------------------------------------------------------------- coming, going, hiding, changing


def test_bodies_come_and_go():
    scene = bodies(POSES)
    renderer = aovs(scene)
    first = values(renderer)
    tree = renderer._live.upload.parts[1].tree
    points, faces = ball(1)
    scene.add_mesh("/new", points, faces, pose=(0, -1.5, 1.5, 0, 0, 0, 1))
    scene.remove("/cube")
    renderer.update()
    assert renderer._live.upload.parts[1].tree is tree
    still = bodies(POSES)
    still.add_mesh("/new", points, faces, pose=(0, -1.5, 1.5, 0, 0, 0, 1))
    still.remove("/cube")
    assert_same(values(renderer), values(aovs(still)))
    scene.remove("/new")
    cube = scenes.cube(1.0)
    scene.add_mesh("/cube", *cube, pose=POSES[2])
    renderer.update()
    assert_same(values(renderer), first)


def test_a_scene_may_start_empty_and_end_empty():
    scene = wr.Scene()
    renderer = aovs(scene)
    assert (values(renderer)["primId"] == -1).all()
    scene.add_sphere("/sphere", 1.0)
    renderer.update()
    assert (values(renderer)["primId"] == 0).sum() > 100
    placement = scene.placements["/sphere"]
    for count in (0, 500, 1, 0):
        placement.transforms = np.tile(np.eye(4), (count, 1, 1))
        placement.instance_ids = np.full(count, -1, np.int32)
        renderer.update()
        assert (values(renderer)["primId"] == 0).any() == (count > 0)
    scene.remove("/sphere")
    renderer.update()
    assert (values(renderer)["primId"] == -1).all()


@pytest.mark.parametrize("visibility", VISIBILITIES)
def test_what_is_hidden_is_not_there_and_compiles_nothing(visibility):
    scene = bodies(POSES)
    renderer = aovs(scene, visibility=visibility)
    complete, key = values(renderer), renderer.plan.outputs
    scene.set_visible(["/sphere", "/cube"], False)
    renderer.update()
    without = bodies(POSES)
    without.remove("/sphere")
    without.remove("/cube")
    assert_same(values(renderer), values(aovs(without, visibility=visibility)))
    assert renderer.plan.outputs == key
    scene.set_visible(["/sphere", "/cube"], True)
    renderer.update()
    assert_same(values(renderer), complete)


def test_a_kernel_is_kept_when_what_it_is_for_goes():
    scene = bodies(POSES)
    renderer = aovs(scene)
    key = renderer.plan.outputs
    scene.remove("/sphere")
    renderer.update()
    assert renderer.plan.outputs is key
    assert renderer.plan.absent["shape Sphere"]
    without = bodies(POSES)
    without.remove("/sphere")
    assert_same(values(renderer), values(aovs(without)))


def test_transforms_on_the_host_are_assigned_not_written():
    scene = bodies()
    renderer = aovs(scene)
    placement = scene.placements["/ball"]
    with pytest.raises(ValueError, match="read-only"):
        placement.transforms[0, 3, 0] = 1.0
    for path, pose in zip(BODIES, POSES, strict=True):
        scene.placements[path].transforms = wr.scene.pose_matrix(pose, path)[None]
    renderer.update()
    assert_same(values(renderer), values(aovs(bodies(POSES))))


def test_a_prim_may_have_more_copies_or_none():
    scene = bodies()
    renderer = aovs(scene, size=16)
    matrices = [wr.scene.pose_matrix([x, 1, 1, 0, 0, 0, 1], "") for x in (-1, 1)]
    for given in (matrices, np.zeros((0, 4, 4)), matrices[0]):
        scene.placements["/cube"].transforms = given
        renderer.update()
        assert_same(values(renderer), values(aovs(scene, size=16)))
        assert (values(renderer)["primId"] == 3).any() == (len(given) > 0)


@pytest.mark.parametrize("given", ["x", None, np.zeros((2, 3)), [1.0]])
def test_transforms_that_are_no_matrices_are_named(given):
    with pytest.raises(wr.SceneError, match=r"/cube: its transforms are .*, not"):
        bodies().placements["/cube"].transforms = given


def test_a_material_that_is_gone_is_named():
    scene = bodies()
    renderer = aovs(scene, size=16)
    scene.placements["/ball"].material = "/gone"
    with pytest.raises(wr.SceneError, match="/ball: there is no material /gone"):
        renderer.update()


def test_visibility_that_does_not_go_with_the_copies_is_named():
    scene = bodies()
    renderer = aovs(scene, size=16)
    scene.placements["/ball"].visible = np.array([True, False])
    with pytest.raises(wr.SceneError, match=r"/ball: visible has the shape \(2,\), but there are 1 transforms"):
        renderer.update()


def test_lights_and_materials_change_to_the_bit():
    def change(scene):
        scene.lights["/lamp"].intensity = 5.0
        scene.lights["/lamp"].radius = 0.5
        scene.lights["/sun"].color = (1.0, 0.5, 0.2)
        scene.materials["/red/material"].diffuseColor = (0.1, 0.2, 0.9)
        scene.materials["/red/material"].emissiveColor = (0.0, 0.3, 0.0)

    def scene_of():
        scene = bodies(POSES)
        scene.add_mesh("/red", *ball(1), wr.PreviewSurface(diffuseColor=(0.9, 0.1, 0.1)), (0, -2, 0, 0, 0, 0, 1))
        return scene

    scene = scene_of()
    renderer = prepare(scene, CAMERA, 24)
    change(scene)
    renderer.update()
    other = scene_of()
    change(other)
    assert_same(values(renderer, samples=4), values(prepare(other, CAMERA, 24), samples=4))
    scene.remove("/lamp")
    scene.set_visible("/red", False)
    renderer.update()
    other.remove("/lamp")
    other.remove("/red")
    assert_same(values(renderer, samples=4), values(prepare(other, CAMERA, 24), samples=4))


@pytest.mark.parametrize(
    "look, changed",
    [
        (wr.PreviewSurface(), {"diffuseColor": (0.1, 0.2, 0.9)}),
        (wr.Phong(), {"diffuseColor": (0.1, 0.2, 0.9), "exponent": 3.0}),
        (wr.Dielectric(), {"specularColor": (0.5, 0.9, 0.1)}),
        (wr.DisplayColor(), {"color": (0.7, 0.1, 0.1)}),
    ],
    ids=lambda value: type(value).__name__,
)
def test_every_kind_of_material_is_followed(look, changed):
    scene = wr.Scene()
    scene.add_sphere("/ball", material=look)
    renderer = aovs(scene, outputs=("albedo",))
    before = values(renderer)["albedo"]
    for name, value in changed.items():
        setattr(look, name, value)
    renderer.update()
    after = values(renderer)["albedo"]
    assert (before != after).any()
    np.testing.assert_array_equal(after, values(aovs(scene, outputs=("albedo",)))["albedo"])


def test_posed_lights_and_glowing_bodies_light_from_where_they_are():
    glow = wr.PreviewSurface(diffuseColor=(0, 0, 0), emissiveColor=(6.0, 4.0, 2.0))

    def scene_of(lamp, glowing):
        scene = bodies()
        scene.lights["/lamp"].transform = wr.scene.pose_matrix(lamp, "")
        scene.add_mesh("/glow", *scenes.cube(0.5), glow, glowing)
        return scene

    rest, lamp, glowing = (0, 0, 4, 0, 0, 0, 1), POSES[0] * (2, 2, 9, 1, 1, 1, 1), POSES[2] * (1, 1, -4, 1, 1, 1, 1)
    scene = scene_of(rest, rest)
    renderer = prepare(scene, CAMERA, 24)
    scene.set_poses(["/lamp", "/glow"], np.stack([lamp, glowing]))
    renderer.update()
    expected = prepare(scene_of(lamp, glowing), CAMERA, 24)
    assert_same(values(renderer, samples=4), values(expected, samples=4))


# ---------------------------------------------------------------- cameras


@pytest.mark.parametrize("visibility", VISIBILITIES)
@pytest.mark.parametrize("view", [scenes.camera, scenes.window])
def test_a_camera_moves_by_pose_or_by_hand(visibility, view):
    eyes = ((0.0, -1.0, 8.0), (3.0, 2.0, 6.0), (-40.0, 30.0, 60.0))

    def camera(eye):
        return view(eye=eye, **({"size": 6.0} if view is scenes.window else {}))

    scene = bodies(POSES)
    scene.cameras["/eye"] = camera(eyes[0])
    renderer = aovs(scene, "/eye", visibility)
    for eye in eyes[1:]:
        target = camera(eye)
        renderer.set_camera(target.transform)
        assert_same(values(renderer), values(aovs(bodies(POSES), target, visibility)))
        scene.cameras["/eye"].transform = target.transform
        renderer.set_camera("/eye")
        assert_same(values(renderer), values(aovs(bodies(POSES), target, visibility)))
    renderer.set_camera("/eye")
    scene.set_poses("/eye", np.array([(0.5, -1.0, 8.0, 0.1, 0.05, 0.0, 1.0)]))
    renderer.update()
    target = camera(eyes[0])
    target.transform = wr.scene.pose_matrix((0.5, -1.0, 8.0, 0.1, 0.05, 0.0, 1.0), "")
    assert_same(values(renderer), values(aovs(bodies(POSES), target, visibility)))


def test_the_light_at_the_camera_moves_with_it():
    def scene_of():
        scene = wr.Scene()
        scene.add_mesh("/ball", *ball())
        return scene

    other = scenes.camera((4.0, 3.0, 5.0))
    renderer = prepare(scene_of(), CAMERA, 16)
    renderer.set_camera(other)
    assert_same(values(renderer, samples=2), values(prepare(scene_of(), other, 16), samples=2))


def test_a_camera_that_sees_nothing_is_refused():
    renderer = aovs(bodies())
    with pytest.raises(wr.SceneError, match="singular"):
        renderer.set_camera(np.zeros((4, 4)))


# ---------------------------------------------------------------- bad input


def test_bad_arguments_are_one_line_that_names_them():
    scene = bodies()
    one = device_poses(POSES[:1])
    for paths, poses, words in (
        ("/nobody", one, "/nobody"),
        (("/ball", 3), one, "/ball.*copy 3"),
        (["/ball", "/ball"], device_poses(POSES[:2]), "/ball.*twice"),
        (["/ball", "/cube"], one, "1 poses for 2"),
        ("/ball", np.zeros((1, 6)), r"\(1, 6\)"),
        ("/ball", wp.zeros(1, dtype=wp.vec3), "vec3"),
        (wp.zeros(1, dtype=float), one, "ids"),
    ):
        with pytest.raises(wr.SceneError, match=words):
            scene.set_poses(paths, poses)
    with pytest.raises(wr.SceneError, match="/nobody"):
        scene.set_visible("/nobody", False)
    with pytest.raises(wr.SceneError, match="/nobody"):
        scene.remove("/nobody")


def test_the_same_paths_have_the_same_ids():
    scene = bodies()
    ids = scene.ids(BODIES)
    assert scene.ids(list(BODIES)) is ids
    assert scene.ids(("/cube", "/ball")).numpy().tolist() == [ids.numpy()[2], ids.numpy()[0]]


# ---------------------------------------------------------------- a long run


@pytest.mark.parametrize("visibility", VISIBILITIES)
def test_M4_a_static_scene_looks_the_same_after_many_frames(visibility):
    scene = bodies(POSES)
    renderer = aovs(scene, visibility=visibility, size=8)
    ids, poses = scene.ids(BODIES), device_poses()
    first = values(renderer)
    for _ in range(300):
        scene.set_poses(ids, poses)
        renderer.update()
        renderer.render()
    assert_same(values(renderer), first)


def test_statistics_of_kept_frames_are_their_own():
    renderer = prepare(bodies(POSES), CAMERA, 12)
    kept = [renderer.render(samples=n, seed=n) for n in (1, 2, 4, 8)]
    alone = [prepare(bodies(POSES), CAMERA, 12).render(samples=n, seed=n) for n in (1, 2, 4, 8)]
    for one, other in zip(kept, alone, strict=True):
        for key in ("samples", "rays", "error", "dropped samples"):
            assert one.stats[key] == other.stats[key]
        assert dict(one.stats).keys() == dict(other.stats).keys()
        assert one.receipt["samples"] == other.receipt["samples"]
