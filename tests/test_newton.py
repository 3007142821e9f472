"""A Newton model as a scene: where its shapes are, and that they follow the state. Skipped without Newton."""

import numpy as np
import pytest
import scenes
import warp as wp

import warprender as wr
from warprender.color import srgb_encode

newton = pytest.importorskip("newton")


def depth_at(scene, place, worlds=None):
    """Distances down -Y from places (N, 3), 0 where nothing is met within 10."""
    lidar = wr.LidarSensor(scene, [0.0], [-90.0], range=(0.0, 10.0), worlds=worlds)
    poses = np.array([[*p, 0, 0, 0, 1] for p in place], np.float32)
    images = lidar.update(poses)
    return images.numpy("distance").reshape(-1)


def test_shapes_stand_where_newton_has_them():
    """One of each kind on a line, from straight above: their heights are closed forms."""
    builder = newton.ModelBuilder()
    up = wp.quat_from_axis_angle(wp.vec3(1, 0, 0), -np.pi / 2)
    at = [wp.transform((2.0 * i, 1.0, 0.0), up) for i in range(6)]
    builder.add_shape_sphere(body=-1, radius=0.3, xform=at[0])
    builder.add_shape_box(body=-1, hx=0.2, hy=0.3, hz=0.4, xform=at[1])
    builder.add_shape_capsule(body=-1, radius=0.2, half_height=0.3, xform=at[2])
    builder.add_shape_cylinder(body=-1, radius=0.2, half_height=0.3, xform=at[3])
    builder.add_shape_plane(body=-1, width=1.0, length=1.0, xform=at[4])
    points = np.array([(-1, -1, 0), (1, -1, 0), (0, 1, 0)], np.float32)
    mesh = newton.Mesh(points, np.array([0, 1, 2]), compute_inertia=False)
    builder.add_shape_mesh(body=-1, mesh=mesh, xform=at[5], scale=wp.vec3(0.5, 0.5, 2.0))
    found = wr.from_newton(builder.finalize(device="cpu"))
    tops = 5.0 - (1.0 + np.array([0.3, 0.4, 0.5, 0.3, 0.0, 0.0]))
    seen = depth_at(found.scene, [(2.0 * i + 0.01, 5.0, 0.01) for i in range(6)])
    np.testing.assert_allclose(seen, tops, atol=2e-3)
    assert depth_at(found.scene, [(10.45, 5.0, 0.4), (8.55, 5.0, 0.0)]).tolist() == [pytest.approx(4.0), 0.0]


def test_bodies_and_particles_follow_the_state():
    builder = newton.ModelBuilder()
    body = builder.add_body(xform=wp.transform((0, 1, 0), wp.quat_identity()))
    builder.add_shape_sphere(body=body, radius=0.2, xform=wp.transform((0.5, 0, 0), wp.quat_identity()))
    builder.add_particle(wp.vec3(3.0, 0.0, 0.0), wp.vec3(), 1.0, radius=0.25)
    model = builder.finalize(device="cpu")
    found, state = wr.from_newton(model), model.state()
    np.testing.assert_allclose(depth_at(found.scene, [(0.5, 5, 0), (3, 5, 0)]), [3.8, 4.75], rtol=1e-5)
    half = np.sqrt(0.5)
    state.body_q.assign(np.array([[0, 2, 0, 0, half, 0, half]], np.float32))
    state.particle_q.assign(np.array([[3, 1, 0]], np.float32))
    found.sync(state)
    np.testing.assert_allclose(depth_at(found.scene, [(0.5, 5, 0), (0, 5, -0.5), (3, 5, 0)]), [0, 2.8, 3.75], rtol=1e-5)


def test_cloth_follows_and_worlds_are_told_apart():
    one = newton.ModelBuilder()
    one.add_shape_sphere(body=-1, radius=0.2)
    main = newton.ModelBuilder()
    main.add_world(one)
    main.add_world(one)
    for x, z in ((-1, -1), (1, -1), (0, 1)):
        main.add_particle(wp.vec3(5.0 + x, 1.0, z), wp.vec3(), 1.0)
    main.add_triangle(0, 1, 2)
    model = main.finalize(device="cpu")
    found, state = wr.from_newton(model), model.state()
    assert found.worlds.tolist() == [0, 1, -1]
    state.particle_q.assign(state.particle_q.numpy() + np.float32([0, 1, 0]))
    found.sync(state)
    seen = depth_at(found.scene, [(5, 5, 0), (0, 5, 0)], found.worlds)
    np.testing.assert_allclose(seen, [3.0, 4.8], rtol=1e-5)


# ---------------------------------------------------------------- beside Newton's own camera

#: Chords of a circle leave it by this share of its radius: 1 - cos(π / 128).
SAGITTA = 3.02e-4
#: What the quadrics of Newton's camera round by at right angles; ours are held against float64.
ROUNDING = 5e-5
#: How far round shapes made of triangles lie inside the true ones: a chord's height, twice where it bends both ways. Of
#: a barrel, Newton's camera has an ellipsoid instead of the arc: they differ by up to h^4 / 8 R^3.
INSIDE = {
    "capsule": 2 * SAGITTA * 0.25,
    "cylinder": SAGITTA * 0.3,
    "cone": SAGITTA * 0.4,
    "barrel": SAGITTA * 0.32 + 0.4**4 / (8 * 4.0**3) + 2e-5,
    "particle": 2e-4,  # its quadric rounds the more the smaller the sphere
}


def zoo(axis):
    """One shape of each kind over an endless plane, each turned at random; names in the order of the shapes."""
    builder, rng = newton.ModelBuilder(up_axis=axis), np.random.default_rng(0)
    up, right = np.roll((1.0, 0, 0), int(axis)), np.array((1.0, 0, 0))
    names, across = [], np.cross(up, right)

    def place(name):
        i, j = len(names) % 4, len(names) // 4
        names.append(name)
        at = right * (1.6 * i - 2.4) + across * (1.6 * j - 1.6) + up * 0.6
        return wp.transform(wp.vec3(*at), wp.normalize(wp.quat(*rng.normal(size=4))))

    mesh = newton.Mesh.create_sphere(0.5, num_latitudes=8, num_longitudes=10, compute_inertia=False)
    heights = newton.Heightfield(rng.uniform(size=(6, 9)), nrow=6, ncol=9, hx=0.7, hy=0.5, min_z=-0.2, max_z=0.3)
    builder.add_shape_sphere(-1, xform=place("sphere"), radius=0.5)
    builder.add_shape_capsule(-1, xform=place("capsule"), radius=0.25, half_height=0.35)
    builder.add_shape_ellipsoid(-1, xform=place("ellipsoid"), rx=0.5, ry=0.3, rz=0.2)
    builder.add_shape_cylinder(-1, xform=place("cylinder"), radius=0.3, half_height=0.4)
    builder.add_shape_box(-1, xform=place("box"), hx=0.3, hy=0.4, hz=0.2, color=(0.9, 0.2, 0.5))
    builder.add_shape_cone(-1, xform=place("cone"), radius=0.4, half_height=0.4)
    builder.add_shape_mesh(-1, xform=place("mesh"), mesh=mesh, scale=wp.vec3(0.6, -1.0, 0.8))
    builder.add_shape_convex_hull(-1, xform=place("hull"), mesh=mesh, scale=wp.vec3(1.0, 0.5, 0.7))
    builder.add_shape_heightfield(xform=place("heights"), heightfield=heights, scale=wp.vec3(1.0, 1.2, 0.9))
    builder.add_shape_plane(body=-1, xform=place("plane"), width=0.9, length=0.5)
    builder.add_shape_cylinder(-1, xform=place("barrel"), radius=0.3, half_height=0.4, barrel_radius=4.0)
    hidden = newton.ModelBuilder.ShapeConfig(is_visible=False)
    builder.add_shape_box(-1, xform=place("hidden"), hx=0.3, hy=0.3, hz=0.3, cfg=hidden)
    builder.add_shape_sphere(-1, xform=wp.transform(wp.vec3(*(up * 1.9)), wp.quat_identity()), radius=0.2, opacity=0.0)
    names.append("clear")
    builder.add_ground_plane()
    names.append("ground")
    builder.add_particle(wp.vec3(*(up * 2.0)), wp.vec3(), 1.0, radius=0.2)
    return builder, names, up, across


def looking(eye, target, up):
    """A camera's pose (7,)."""
    matrix = scenes.look_at(eye, target, up)[:3, :3]
    return np.array([*eye, *wp.quat_from_matrix(wp.mat33(*matrix.T.reshape(-1)))], np.float32)


def newton_sees(model, state, poses, width, height, fov):
    """Distance, depth, shape index and albedo (0 … 255) as Newton's own camera has them, and the rays' directions."""
    from newton.sensors import SensorCamera

    camera, device = SensorCamera(model), "cpu"
    rays = SensorCamera.compute_camera_rays_pinhole(width, height, camera_fov=np.radians(fov), device=device)
    images = {
        "depth_image": camera.allocate_image_depth(len(poses), width, height),
        "forward_depth_image": camera.allocate_image_depth(len(poses), width, height),
        "normal_image": camera.allocate_image_normal(len(poses), width, height),
        "shape_index_image": camera.allocate_image_shape_index(len(poses), width, height),
        "albedo_image": camera.allocate_image_albedo(len(poses), width, height),
    }
    config = SensorCamera.RenderConfig(enable_backface_culling=False, enable_textures=True)
    worlds = wp.array(np.arange(len(poses), dtype=np.int32) % max(model.world_count, 1), dtype=wp.int32)
    camera.update(
        state, wp.array(poses, dtype=wp.transformf), rays, render_config=config, world_indices=worlds, **images
    )
    found = {name: image.numpy() for name, image in images.items()}
    packed = found.pop("albedo_image")
    found["albedo"] = np.stack([(packed >> shift) & 255 for shift in (0, 8, 16)], -1)
    found["shape_index_image"] = found["shape_index_image"].astype(np.int64)
    return found


@pytest.mark.parametrize("axis", [newton.Axis.Z, newton.Axis.Y], ids=str)
def test_every_kind_of_shape_is_where_newtons_own_camera_sees_it(axis):
    builder, names, up, across = zoo(axis)
    model = builder.finalize(device="cpu")
    width, height, fov = 160, 120, 46.0
    eye = across * -5.0 + up * 4.0 + (0.5, 0, 0)
    poses = looking(eye, up * 0.3, up)[None]
    theirs = newton_sees(model, model.state(), poses, width, height, fov)
    found = wr.from_newton(model)
    assert found.scene.up_axis == axis.name and not found.scene.warnings
    assert [name for name, path in zip(names, found.paths, strict=True) if not path] == ["hidden", "clear"]
    outputs = ("distance", "cameraDepth", "normal", "primId", "albedo")
    sensor = wr.CameraSensor(found.scene, width, height, fov=fov, outputs=outputs, transport="none", visibility="rays")
    ours = sensor.update(poses)
    index = {path: i for i, path in enumerate(found.paths) if path}
    numbers = np.array([index.get(path, 0xFFFFFFFE) for path in ours.prims] + [0xFFFFFFFF])
    shape, other = numbers[ours.numpy("primId")], theirs["shape_index_image"]
    # Outlines alone may fall on either side of a pixel's centre.
    assert (shape != other).sum() <= 3
    away = {"distance": theirs["depth_image"], "cameraDepth": theirs["forward_depth_image"]}
    away = {name: np.abs(ours.numpy(name) - values) for name, values in away.items()}
    directions = _directions(poses[0], width, height, fov)
    cosine = np.abs((ours.numpy("normal") * directions).sum(-1))
    for number, center, radius in ((0, model.shape_transform.numpy()[0, :3], 0.5), (0xFFFFFFFE, up * 2.0, 0.2)):
        exact, mine = _sphere_distances(poses[0, :3], directions, center, radius), shape[0] == number
        assert np.abs(ours.numpy("distance")[0] - exact)[mine].max() < 1e-5
    for number, name in [*enumerate(names), (0xFFFFFFFE, "particle")]:
        mine = (shape == number) & (other == number)
        assert mine.any() == (name not in ("hidden", "clear")), name
        # The surfaces lie apart by a chord, and rounding: along the ray more, the flatter it meets them. Facets are
        # turned from the true surface by 0.025 at most.
        bound = (INSIDE.get(name, 0.0) + ROUNDING) / np.maximum(cosine[mine] - 0.03, 0.1)
        bound = np.where(cosine[mine] > 0.2, bound, 1e-2)
        # A pixel at a rim may see the cap beside the side.
        rims = name in INSIDE
        assert all((values[mine] > bound).sum() <= rims for values in away.values()), name
        if name != "particle":
            encoded = srgb_encode(ours.numpy("albedo")[mine]) * 255
            assert np.abs(encoded - theirs["albedo"][mine]).max(initial=0.0) <= 1.01, name


def _sphere_distances(eye, directions, center, radius):
    """Distances (H, W) to a sphere in float64, along unit directions (H, W, 3) that meet it."""
    to_eye = eye.astype(np.float64) - center
    half = directions @ to_eye
    across = to_eye - half[..., None] * directions
    return -half - np.sqrt(np.maximum(radius**2 - (across**2).sum(-1), 0.0))


def _directions(pose, width, height, fov):
    """(H, W, 3) unit directions of a pinhole's rays in the world."""
    scale = np.tan(np.radians(fov) / 2) / (height / 2)
    x, y = np.meshgrid((np.arange(width) + 0.5 - width / 2) * scale, (height / 2 - np.arange(height) - 0.5) * scale)
    rays = np.stack([x, y, -np.ones_like(x)], -1)
    rays = rays @ wr.scene.pose_matrix(pose, "")[:3, :3]
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def test_replicated_worlds_show_what_newtons_own_camera_shows():
    one = newton.ModelBuilder()
    body = one.add_body(xform=wp.transform((0, 0, 1), wp.quat_identity()))
    one.add_shape_box(body, hx=0.3, hy=0.2, hz=0.4)
    for x, y in ((-0.5, -1), (0.5, -1), (0, -0.4)):
        one.add_particle(wp.vec3(x, y, 0.5), wp.vec3(), 1.0, radius=0.1)
    one.add_triangle(0, 1, 2)
    one.add_particle(wp.vec3(0.8, 0.0, 0.5), wp.vec3(), 1.0, radius=0.2)
    main = newton.ModelBuilder()
    main.add_ground_plane()
    for _ in range(3):
        main.add_world(one)
    model = main.finalize(device="cpu")
    state = model.state()
    rng = np.random.default_rng(4)
    state.body_q.assign(state.body_q.numpy() + np.float32([0.2, 0.1, 0.1, 0, 0, 0, 0]) * rng.normal(size=(3, 7)))
    state.particle_q.assign(state.particle_q.numpy() + rng.normal(size=(12, 3)).astype(np.float32) * 0.1)
    model.bvh_refit_shapes(state)
    model.bvh_refit_particles(state)
    poses = np.tile(looking(np.array([0.5, -4.0, 2.5]), np.array([0, 0, 0.6]), np.array([0.0, 0, 1])), (3, 1))
    theirs = newton_sees(model, state, poses, 48, 36, 40.0)
    found = wr.from_newton(model)
    found.sync(state)
    sensor = wr.CameraSensor(found.scene, 48, 36, fov=40.0, outputs=("distance",), worlds=found.worlds)
    ours, depth = sensor.update(poses).numpy("distance"), theirs["depth_image"]
    assert sorted(path for path in found.scene.meshes if "cloth" in path) == [f"/world{w}/cloth" for w in range(3)]
    assert (ours[0] != ours[1]).any() and (ours[1] != ours[2]).any()
    apart = np.abs(ours - depth) > 1e-4
    assert apart.sum() <= 3


def test_a_picture_on_a_mesh_and_what_shines():
    points = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float32)
    picture = np.zeros((2, 2, 3), np.uint8)
    picture[0, 0], picture[1, 1] = (255, 0, 0), (0, 255, 0)
    coordinates = (points[:, :2] + 1) / 2
    mesh = newton.Mesh(
        points, np.array([0, 1, 2, 0, 2, 3]), uvs=coordinates, texture=picture, roughness=0.3, compute_inertia=False
    )
    builder = newton.ModelBuilder()
    builder.add_shape_mesh(-1, mesh=mesh, color=(1.0, 1.0, 1.0))
    model = builder.finalize(device="cpu")
    poses = looking(np.array([0.0, 0.0, 4.0]), np.zeros(3), np.array([0.0, 1, 0]))[None]
    theirs = newton_sees(model, model.state(), poses, 16, 16, 25.0)["albedo"][0]
    found = wr.from_newton(model)
    look = next(m for path, m in found.scene.materials.items() if path)
    assert look.roughness == pytest.approx(0.3)
    ours = wr.CameraSensor(found.scene, 16, 16, fov=25.0, outputs=("albedo",), transport="none").update(poses)
    # What the surface reflects at its face is in our albedo too: 0.04 of a dielectric; 5 of 255 is 0.0015 in the dark.
    diffuse = ours.numpy("albedo")[0] - ours.numpy("albedo")[0].min()
    assert ours.numpy("albedo")[0].min() == pytest.approx(0.04, abs=2e-3)
    for row, column in ((3, 3), (3, 12), (12, 3), (12, 12)):
        np.testing.assert_allclose(srgb_encode(diffuse[row, column]) * 255, theirs[row, column], atol=5)
    assert (theirs[[3, 12], [3, 12]] > 250).tolist() == [[True, False, False], [False, True, False]]


def test_what_is_not_drawn_is_named_and_shapes_are_shared():
    builder = newton.ModelBuilder()
    for i in range(5):
        at = wp.transform((float(i), 0, 0), wp.quat_identity())
        builder.add_shape_box(-1, hx=0.1 + 0.01 * i, hy=0.2, hz=0.3, xform=at)
        builder.add_shape_cylinder(-1, radius=0.1, half_height=0.2 + 0.01 * i, xform=at)
    splats = newton.Gaussian(np.zeros((2, 3), np.float32))
    builder.add_shape_gaussian(-1, gaussian=splats)
    builder.add_shape_sphere(-1, radius=0.0)
    found = wr.from_newton(builder.finalize(device="cpu"))
    assert len({id(p.shape) for p in found.scene.placements.values()}) == 2
    assert [line.split(" ")[0] for line in found.scene.warnings] == ["/shape10", "/shape11"]
    assert found.paths[10:] == ["", ""] and len(found.worlds) == 10
