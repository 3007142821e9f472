"""Rays that leave a surface do not meet it again (hard case I11), and lose nothing that is near (I12)."""

import numpy as np
import pytest
import scenes
import warp as wp

import warprender as wr
from warprender.numerics import from_frame, offset_origin, tangent_of
from warprender.records import DeviceScene, Hit, Ray
from warprender.sampling import cosine_hemisphere
from warprender.shapes.surface import surface_function
from warprender.upload import Upload
from warprender.visibility.rays import device_functions

SHAPES = ("Mesh", "Sphere")
N = 1 << 16


def kernel():
    surface_at, (closest, _, _) = surface_function(SHAPES), device_functions()

    @wp.kernel(module="unique", enable_backward=False)
    def bounce(
        scene: DeviceScene,
        origin: wp.array(dtype=wp.vec3),
        direction: wp.array(dtype=wp.vec3),
        u: wp.array(dtype=wp.vec2),
        first: wp.array(dtype=Hit),
        second: wp.array(dtype=Hit),
    ):
        i = wp.tid()
        ray = Ray()
        ray.origin = origin[i]
        ray.direction = direction[i]
        ray.t_max = wp.inf
        first[i] = closest(scene, ray)
        second[i].instance = -1
        if first[i].instance >= 0:
            surface = surface_at(scene, ray, first[i])
            n = surface.geometric_normal
            away = from_frame(tangent_of(n), n, cosine_hemisphere(u[i]))
            ray.origin = offset_origin(surface.position, surface.error, n, away)
            ray.direction = away
            second[i] = closest(scene, ray)

    return bounce


BOUNCE = kernel()


def bounced(scene, targets, seed=0):
    """First and second hits of rays from outside at points in the world."""
    held = Upload(scene, {}, np.zeros(3), "cpu")
    rng = np.random.default_rng(seed)
    boxes = held.world.boxes()
    low, high = boxes[:, 0].min(0), boxes[:, 1].max(0)
    centre, size = (low + high) / 2, np.linalg.norm(high - low)
    away = rng.normal(size=(len(targets), 3))
    origin = centre + away / np.linalg.norm(away, axis=1, keepdims=True) * size * 2
    direction = targets - origin
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    inputs = [wp.array(v.astype(np.float32), dtype=wp.vec3) for v in (origin, direction)]
    u = wp.array(rng.random((len(targets), 2), np.float32), dtype=wp.vec2)
    hits = [wp.zeros(len(targets), dtype=Hit) for _ in range(2)]
    wp.launch(BOUNCE, len(targets), [held.record, *inputs, u, *hits])
    return [hit.numpy() for hit in hits]


def pose(turn, size, move, stretch=(1.0, 0.6, 1.4)):
    matrix = np.diag([*stretch, 1.0]) @ scenes.look_at(turn)
    matrix[:3, :3] *= size
    matrix[3, :3] = move
    return matrix


POSES = {
    "plain": np.eye(4),
    "turned": pose((1, 2, 4), 1.0, (0, 0, 0)),
    "away": pose((1, 2, 4), 1.0, (300, -200, 100)),
    "tiny": pose((3, -1, 3), 1e-4, (1, 2, 3)),
    "huge": pose((-3, 1, 2), 1e4, (5, 5, 5)),
    "thin": pose((1, 1, 1), 1.0, (2, 0, 1), (1.0, 0.02, 1.0)),
}


@pytest.mark.parametrize("place", POSES)
@pytest.mark.parametrize("kind", ["quadric", "icosphere", "cube"])
def test_no_ray_meets_the_convex_body_that_it_leaves(kind, place):
    scene = wr.Scene()
    if kind == "quadric":
        scene.add_sphere("/body", pose=POSES[place])
    else:
        scene.add_mesh("/body", *(scenes.icosphere(3) if kind == "icosphere" else scenes.cube()), pose=POSES[place])
    inside = np.random.default_rng(1).uniform(-0.5, 0.5, (N, 3))
    first, second = bounced(scene, inside @ POSES[place][:3, :3] + POSES[place][3, :3])
    assert (first["instance"] == 0).mean() > 0.99
    # On the way out there is nothing but the faces beside the one that was left, which rounding may bring up.
    again = (second["instance"] >= 0) & (second["face"] == first["face"])
    assert again.sum() == 0


@pytest.mark.parametrize("height", [0.0, 1.0, -300.0])
def test_floors_are_left_whatever_their_height(height):
    # A floor at height 0 has no rounding across, but its rays have along it.
    scene = wr.Scene()
    points = np.array([(-10, height, 10), (10, height, 10), (10, height, -10), (-10, height, -10)])
    scene.add_mesh("/floor", points, [[0, 1, 2, 3]])
    targets = np.random.default_rng(1).uniform(-9, 9, (N, 3))
    targets[:, 1] = height
    first, second = bounced(scene, targets)
    assert (first["instance"] == 0).mean() > 0.99
    assert (second["instance"] >= 0).sum() == 0


def test_a_gap_of_four_micrometres_is_not_jumped():
    # I12: two squares of 1 m, 4e-6 m apart; what leaves the lower one meets the upper one.
    scene = wr.Scene()
    points, faces = scenes.quad(1.0)
    flat = points[:, [0, 2, 1]] * (1, 1, -1)
    scene.add_mesh("/lower", flat, faces)
    scene.add_mesh("/upper", flat + (0, 4e-6, 0), faces)
    held = Upload(scene, {}, np.zeros(3), "cpu")
    rng = np.random.default_rng(2)
    start = np.stack([rng.uniform(-0.4, 0.4, N), np.full(N, 2e-6), rng.uniform(-0.4, 0.4, N)], 1)
    arrays = [start, np.broadcast_to((0, -1.0, 0), start.shape)]
    inputs = [wp.array(np.ascontiguousarray(v, np.float32), dtype=wp.vec3) for v in arrays]
    u = wp.array(rng.random((N, 2), np.float32) * 0.25, dtype=wp.vec2)
    first, second = (wp.zeros(N, dtype=Hit) for _ in range(2))
    wp.launch(BOUNCE, N, [held.record, *inputs, u, first, second])
    assert (first.numpy()["instance"] == 0).all()
    assert (second.numpy()["instance"] == 1).all()
