"""A Newton model as a scene: where its shapes are, and that they follow the state. Skipped without Newton."""

import numpy as np
import pytest
import warp as wp

import warprender as wr

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
