"""Signed distance functions: the same hits as exact shapes, whole solids under light, and faults by name."""

from functools import cache

import numpy as np
import pytest
import scenes
import warp as wp
from hypothesis import given, settings
from hypothesis import strategies as st

import warprender as wr
from warprender.records import DeviceScene, Ray
from warprender.shapes.sdf import sampled_lipschitz
from warprender.visibility.sdf import ray_functions

WHITE = (1.0, 1.0, 1.0)
BOUNDS = [(-1.1,) * 3, (1.1,) * 3]


@wp.func
def ball(p: wp.vec3) -> float:
    return wp.length(p) - 1.0


@wp.func
def ring(p: wp.vec3, radii: wp.vec4) -> float:
    return wp.length(wp.vec2(wp.length(wp.vec2(p[0], p[2])) - radii[0], p[1])) - radii[1]


@wp.func
def not_a_number(p: wp.vec3) -> float:
    return wp.sqrt(-1.0 - wp.dot(p, p))


@wp.func
def of_an_angle(p: wp.vec2) -> float:
    return p[0]


@wp.func
def sphere_at(p: wp.vec3, ball: wp.vec4) -> float:
    return wp.length(p - wp.vec3(ball[0], ball[1], ball[2])) - ball[3]


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def aovs(scene, view, visibility="rays", size=48, names=("cameraDepth", "normal", "position", "primId")):
    frame = wr.Renderer(scene, view, (size, size), outputs=names, visibility=visibility).render()
    return {name: frame.numpy(name) for name in names}


def with_ball(exact, pose=None, **arguments):
    scene = wr.Scene()
    if exact:
        scene.add_sphere("/ball", 1.0, pose=pose)
    else:
        scene.add_sdf("/ball", ball, BOUNDS, pose=pose, **arguments)
    return scene


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
@pytest.mark.parametrize("away", [0.0, 1e3])
def test_a_ball_by_distance_is_the_quadric(scale, away):
    pose = np.diag([scale, 2 * scale, scale, 1.0])
    pose[3, :3] = away * scale
    eye = np.array([1.0, 2.0, 4.0]) * scale + away * scale
    view = scenes.camera(eye, pose[3, :3], clippingRange=(1e-6 * scale, 1e6 * scale))
    exact, marched = (aovs(with_ball(kind, pose), view) for kind in (True, False))
    both = (exact["primId"] >= 0) & (marched["primId"] >= 0)
    # Only centres that graze the outline may differ.
    assert ((exact["primId"] >= 0) != (marched["primId"] >= 0)).sum() <= 2 and both.sum() > 400
    assert np.abs(exact["cameraDepth"] - marched["cameraDepth"])[both].max() < 2e-5 * 4 * scale
    assert np.abs(exact["normal"] - marched["normal"])[both].max() < 2e-3


@given(
    st.lists(st.tuples(*[st.floats(-1, 1)] * 3, st.floats(0.05, 0.4)), min_size=1, max_size=4), st.integers(0, 2**31)
)
@settings(max_examples=20, deadline=None)
def test_no_ray_steps_over_a_sphere(balls, seed):
    """Against the nearest of the spheres in float64: the step bound does not pass a surface."""
    rng = np.random.default_rng(seed)
    aims = rng.uniform(-1, 1, (256, 3))
    origins = 3 * unit(rng.normal(size=(256, 3)))
    directions = unit(aims - origins)
    centres, radii = np.array(balls)[:, :3], np.array(balls)[:, 3]
    found = march_spheres(centres, radii, origins, directions)
    along = np.einsum("sj,rj->rs", centres, directions) - (origins * directions).sum(1)[:, None]
    beside = (centres**2).sum(1)[None] - 2 * origins @ centres.T + (origins**2).sum(1)[:, None] - along**2
    inner = radii**2 - beside
    exact = np.where(inner > 0, along - np.sqrt(np.maximum(inner, 0)), np.inf).min(1)
    clear = np.abs(inner).min(1) > 1e-3
    assert (np.isfinite(found) == np.isfinite(exact))[clear].all()
    hit = clear & np.isfinite(exact)
    assert np.abs(found[hit] - exact[hit]).max(initial=0.0) < 1e-3


def march_spheres(centres, radii, origins, directions):
    """First distances to the union of spheres."""
    scene = wr.Scene()
    for i, (centre, radius) in enumerate(zip(centres, radii, strict=True)):
        scene.add_sdf(f"/s{i}", sphere_at, [(-2,) * 3, (2,) * 3], parameters=(*centre, radius))
    renderer = wr.Renderer(scene, scenes.camera((0, 0, 5)), (4, 4), outputs="primId")
    return cast(renderer, origins, directions)[0][:, 0]


def cast(renderer, origins, directions):
    """First and second hit along rays given in the world: distances (R, 2), and whether each is occluded."""
    origins = wp.array((origins - renderer._live.upload.origin).astype(np.float32), dtype=wp.vec3)
    directions = wp.array(directions.astype(np.float32), dtype=wp.vec3)
    found, blocked = wp.empty(len(origins), dtype=wp.vec2), wp.empty(len(origins), dtype=wp.bool)
    inputs = [renderer._live.record, origins, directions, found, blocked]
    wp.launch(casting(renderer.plan.sdfs), len(origins), inputs)
    return found.numpy(), blocked.numpy()


@cache
def casting(sdfs):
    closest, closest_after, occluded = ray_functions(sdfs)

    @wp.kernel(module="unique", enable_backward=False)
    def cast_rays(
        scene: DeviceScene,
        origins: wp.array(dtype=wp.vec3),
        directions: wp.array(dtype=wp.vec3),
        found: wp.array(dtype=wp.vec2),
        blocked: wp.array(dtype=wp.bool),
    ):
        i = wp.tid()
        ray = Ray()
        ray.origin = origins[i]
        ray.direction = directions[i]
        ray.t_max = wp.inf
        hit = closest(scene, ray)
        behind = hit
        if hit.instance >= 0:
            behind = closest_after(scene, ray, hit)
        found[i] = wp.vec2(hit.t, behind.t)
        blocked[i] = occluded(scene, ray)

    return cast_rays


def test_a_ball_has_a_front_and_a_back():
    rng = np.random.default_rng(5)
    directions = unit(rng.normal(size=(4000, 3)))
    origins = unit(rng.normal(size=(4000, 3))) * 0.9 - 3 * directions
    renderer = wr.Renderer(with_ball(False), scenes.camera((0, 0, 5)), (4, 4), outputs="primId")
    found, blocked = cast(renderer, origins, directions)
    along = -(origins * directions).sum(1)
    half = np.sqrt(np.maximum(1 - (origins**2).sum(1) + along**2, 0))
    deep = half > 0.05
    assert blocked[deep].all()
    assert np.abs(found - np.stack([along - half, along + half], 1))[deep].max() < 2e-5


@pytest.mark.parametrize("distance, parameters", [(ball, ()), (ring, (0.7, 0.25))], ids=["ball", "ring"])
@pytest.mark.parametrize("pose", [None, (100, 2000, -30, 0.5, 0.5, 0.5, 0.5)], ids=["here", "far"])
def test_a_white_solid_in_a_white_furnace_vanishes(distance, parameters, pose):
    """A path that started inside by mistake would see black."""
    scene = wr.Scene()
    scene.add_sdf("/solid", distance, BOUNDS, color=WHITE, parameters=parameters, pose=pose)
    scene.add_light(wr.DomeLight())
    middle = np.zeros(3) if pose is None else np.array(pose[:3])
    frame = wr.render(scene, (32, 32), 16, camera=scenes.camera(middle + (0, 3, 3), middle))
    color = frame.numpy("color")
    seen = color[..., 3] > 0
    assert seen.sum() > 150
    assert np.abs(color[seen][:, :3] - color[seen][:, 3:]).max() < 1e-4


def test_its_shadow_is_the_sphere_s():
    pictures = []
    for exact in (True, False):
        scene = with_ball(exact)
        ground, faces = scenes.quad(8.0, -1.5)
        scene.add_mesh("/ground", ground, faces, color=(0.5,) * 3)
        scene.add_light(wr.DistantLight(intensity=2.0, angle=0.0), pose=scenes.look_at((2, 0, 3)))
        pictures.append(wr.render(scene, (48, 48), 16, camera=scenes.camera((0, -5, 5)), bounces=0).numpy("color"))
    exact, marched = pictures
    # Samples that graze the outline or the shadow's edge are few, and each is at most the whole light.
    assert (np.abs(exact - marched).max(-1) > 1e-3).mean() < 0.01
    assert abs(exact.mean() - marched.mean()) < 1e-3 * exact.mean()


def test_half_clear_solids_let_a_quarter_through():
    scene = with_ball(False, material=wr.PreviewSurface(diffuseColor=(0, 0, 0), opacity=0.5, ior=1.0))
    back, faces = scenes.quad(20.0, -3.0)
    scene.add_mesh("/back", back, faces, material=wr.PreviewSurface(diffuseColor=(0, 0, 0), emissiveColor=WHITE))
    color = wr.render(scene, (8, 8), 512, camera=scenes.window(1.0), camera_light="off").numpy("color")[..., :3]
    assert abs(color.mean() - 0.25) < 4.5 * np.sqrt(0.25 * 0.75 / (64 * 512))


def test_raster_and_rays_see_the_same():
    scene = with_ball(False)
    points, faces = scenes.icosphere(2)
    scene.add_mesh("/mesh", 0.7 * points, faces, pose=(0.8, 0, 0.5, 0, 0, 0, 1))
    rays, raster = (aovs(scene, scenes.camera((0, 1, 5)), visibility) for visibility in ("rays", "raster"))
    assert (rays["primId"] == raster["primId"]).mean() > 0.998
    assert set(np.unique(rays["primId"])) == {-1, 0, 1}


def test_samples_of_a_plane_are_the_plane():
    """Trilinear interpolation of a linear function is that function, and so is its slope."""
    x, y, z = np.meshgrid(*[np.linspace(-1, 1, n) for n in (5, 7, 4)], indexing="ij")
    values = (2 * x + 3 * y + 6 * z) / 7 - 0.1
    slope = sampled_lipschitz(values.astype(np.float32), np.array([(-1.0,) * 3, (1.0,) * 3]))
    assert slope == pytest.approx(1, rel=1e-6)
    scene = wr.Scene()
    scene.add_sdf("/plane", values, [(-1,) * 3, (1,) * 3])
    seen = aovs(scene, scenes.window(0.2, (0.0, 0.0, 5.0)))
    p = seen["position"].astype(float)
    assert (seen["primId"] == 0).all()
    assert np.abs(p @ (2, 3, 6) / 7 - 0.1).max() < 1e-5
    # Rounding of the distance, about 2^-22, over the step of the gradient, 8 times the precision.
    assert np.abs(seen["normal"] - np.array([2, 3, 6]) / 7).max() < 2.0**-22 / (8 * 2.0**-16 * 12**0.5)


def test_two_kinds_of_functions_in_one_scene_keep_apart():
    scene = wr.Scene()
    scene.add_sdf("/ring", ring, BOUNDS, parameters=(0.8, 0.2), pose=(0, 2, 0, 0.7071068, 0, 0, 0.7071068))
    scene.add_sdf("/ball", ball, BOUNDS, pose=(0, -2, 0, 0, 0, 0, 1))
    scene.add_sdf("/small", ring, BOUNDS, parameters=(0.5, 0.1), pose=(3, 0, 0, 0.7071068, 0, 0, 0.7071068))
    seen = aovs(scene, scenes.window(8.0), size=256)["primId"]
    area = np.array([(seen == i).sum() for i in range(3)]) / 1024.0
    assert area == pytest.approx(np.pi * np.array([1 - 0.36, 1, 0.36 - 0.16]), rel=0.02)


def test_parameters_compile_nothing():
    keys = []
    for radius in (0.2, 0.3):
        scene = wr.Scene()
        scene.add_sdf("/ring", ring, BOUNDS, parameters=(0.7, radius))
        keys.append(wr.Renderer(scene, scenes.camera((0, 0, 5)), (4, 4), outputs="primId").plan.outputs)
    assert keys[0] == keys[1]


def test_what_is_no_number_is_not_there():
    scene = wr.Scene()
    scene.add_sdf("/nothing", not_a_number, BOUNDS)
    assert (aovs(scene, scenes.camera((0, 0, 5)))["primId"] == -1).all()


@pytest.mark.parametrize(
    "arguments, reason",
    [
        ((of_an_angle, BOUNDS), "not a wp.func of a vec3"),
        ((ball, [(1, 1, 1), (0, 2, 2)]), "lower and an upper corner"),
        ((ball, [(-np.inf,) * 3, (np.inf,) * 3]), "need a precision"),
        ((np.zeros((2, 2)), BOUNDS), "not (X, Y, Z)"),
        ((np.full((2, 2, 2), np.nan), BOUNDS), "not all finite"),
    ],
)
def test_faults_are_named(arguments, reason):
    with pytest.raises(wr.SceneError, match="/solid") as caught:
        wr.Scene().add_sdf("/solid", *arguments)
    assert reason in str(caught.value)


def test_a_painter_needs_triangles():
    with pytest.raises(wr.SceneError, match="/ball is a sdf"):
        wr.Renderer(with_ball(False), scenes.camera((0, 0, 5)), (4, 4), outputs="depth", visibility="painter")


def test_update_follows_parameters():
    scene = wr.Scene()
    solid = scene.add_sdf("/ring", ring, BOUNDS, parameters=(0.7, 0.2))
    points, faces = scenes.icosphere(1)
    scene.add_mesh("/mesh", points, faces, pose=(3, 0, 0, 0, 0, 0, 1))
    renderer = wr.Renderer(scene, scenes.camera((0, 2, 6)), (32, 32), outputs=("cameraDepth", "primId"))
    before = renderer.render().numpy("cameraDepth")
    key = renderer.plan.outputs
    solid.parameters = (0.5, 0.3)
    renderer.update()
    after = renderer.render().numpy("cameraDepth")
    anew = wr.Renderer(scene, scenes.camera((0, 2, 6)), (32, 32), outputs=("cameraDepth", "primId")).render()
    assert renderer.plan.outputs == key and (before != after).any()
    np.testing.assert_array_equal(after, anew.numpy("cameraDepth"))
