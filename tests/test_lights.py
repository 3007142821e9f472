"""Lights: what `sample` and `meet` say of each other, and of closed forms (facts §5.2, hard cases L1 to L4)."""

import numpy as np
import pytest
import scenes
import warp as wp
from chance import SIGMAS, chi_square, polygon_irradiance, solid_angle, z_of

import warprender as wr
from warprender.emitters import lit
from warprender.lights import Light
from warprender.lights.dispatch import FUNCTIONS, light_functions
from warprender.records import DeviceScene, LightSample
from warprender.upload import Upload

ALL = tuple(sorted(FUNCTIONS))
N = 1 << 17


def kernels():
    sample_light, meet_light = light_functions(ALL)

    @wp.kernel(module="unique", enable_backward=False)
    def sample(
        scene: DeviceScene,
        p: wp.vec3,
        u: wp.array(dtype=wp.vec2),
        out: wp.array(dtype=LightSample),
    ):
        i = wp.tid()
        out[i] = sample_light(scene, scene.lights[0], p, u[i])

    @wp.kernel(module="unique", enable_backward=False)
    def meet(
        scene: DeviceScene,
        p: wp.vec3,
        direction: wp.array(dtype=wp.vec3),
        out: wp.array(dtype=LightSample),
    ):
        i = wp.tid()
        out[i] = meet_light(scene, scene.lights[0], p, direction[i])

    return sample, meet


SAMPLE, MEET = kernels()


def uploaded(light: Light):
    return Upload(wr.Scene(), {"/light": light}, np.zeros(3), "cpu")


def run(kernel, light, p, values, dtype):
    held = uploaded(light)
    out = wp.empty(len(values), dtype=LightSample)
    wp.launch(kernel, len(values), [held.record, wp.vec3(*p), wp.array(values, dtype=dtype), out])
    return out.numpy()


def sampled(light, p, n=N, seed=0):
    """LightSamples towards a light for jittered stratified numbers, which keep z tests conservative."""
    return run(SAMPLE, light, p, np.random.default_rng(seed).random((n, 2), np.float32), wp.vec2)


def met(light, p, directions):
    return run(MEET, light, p, directions, wp.vec3)


def irradiances(samples, normal):
    """Estimates of the irradiance at a surface with this normal, one a sample."""
    cosine = np.maximum(samples["direction"].astype(float) @ normal, 0)
    pdf = samples["pdf"].astype(float)
    return np.divide(samples["radiance"][:, 0] * cosine, pdf, out=np.zeros(len(samples)), where=pdf > 0)


def cosine_directions(normal, n=N, seed=1):
    """Directions about a normal with density cos θ / π."""
    u = np.random.default_rng(seed).random((2, n))
    side = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    side /= np.linalg.norm(side)
    r, phi = np.sqrt(u[0]), 2 * np.pi * u[1]
    around = np.outer(r * np.cos(phi), side) + np.outer(r * np.sin(phi), np.cross(normal, side))
    return around + np.outer(np.sqrt(1 - u[0]), normal)


RING = np.exp(2j * np.pi * np.arange(4096) / 4096)


def outline(light, p):
    """Corners in the world of what a light looks like from p."""
    m = light.transform
    q = (p - m[3, :3]) @ np.linalg.inv(m[:3, :3])
    if isinstance(light, wr.RectLight):
        w, h = light.width / 2, light.height / 2
        local = np.array([(-w, -h, 0), (w, -h, 0), (w, h, 0), (-w, h, 0)])
    elif isinstance(light, wr.DiskLight):
        local = light.radius * np.stack([RING.real, RING.imag, 0 * RING.real], 1)
    else:
        # The circle where the cone from q touches the sphere.
        d = np.linalg.norm(q)
        axis, r = q / d, light.radius
        side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        side /= np.linalg.norm(side)
        around = np.outer(RING.real, side) + np.outer(RING.imag, np.cross(axis, side))
        local = axis * r * r / d + around * r * np.sqrt(1 - (r / d) ** 2)
    return local @ m[:3, :3] + m[3, :3]


PLACES = {
    "plain": np.eye(3),
    "turned": scenes.look_at((1.0, 2.0, 3.0))[:3, :3],
    "scaled": np.diag([2.0, 0.5, 1.5]),
    "turned and scaled": np.diag([0.7, 1.9, 1.2]) @ scenes.look_at((-1.0, 0.4, 2.0))[:3, :3],
    "sheared": np.array([(1, 0.4, 0), (0.3, 1, -0.5), (0.2, 0.6, 1)]),
    "mirrored": np.diag([-1.0, 1.0, 1.0]),
    "mirrored through its plane": np.diag([1.3, 1.0, -1.0]) @ scenes.look_at((1.0, 0.2, 0.3))[:3, :3],
}
KINDS = {
    "rect": lambda: wr.RectLight(width=1.2, height=0.8, intensity=2.0),
    "disk": lambda: wr.DiskLight(radius=0.6, intensity=2.0),
    "sphere": lambda: wr.SphereLight(radius=0.6, intensity=2.0),
}


def placed(kind, place):
    """The light, and a point that it lights, 2.5 in front of it and to the side, with a normal that faces it."""
    light = KINDS[kind]()
    light.transform = np.eye(4)
    light.transform[:3, :3] = PLACES[place]
    light.transform[3, :3] = 0.5, -0.25, 0.75
    x, y, z = PLACES[place]
    front = np.cross(x, y) / np.linalg.norm(np.cross(x, y))
    front = front if front @ z < 0 else -front
    p = light.transform[3, :3] + 2.5 * front + np.array([0.3, -0.4, 0.2])
    towards = light.transform[3, :3] - p
    return light, p, towards / np.linalg.norm(towards)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("kind", KINDS)
def test_both_ways_to_a_light_give_its_closed_form(kind, place):
    light, p, normal = placed(kind, place)
    expected = 2.0 * polygon_irradiance(p, normal, outline(light, p))
    assert abs(z_of(irradiances(sampled(light, p), normal), expected)) < SIGMAS
    by_chance = met(light, p, cosine_directions(normal))["radiance"][:, 0] * np.pi
    assert abs(z_of(by_chance, expected)) < SIGMAS


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("kind", KINDS)
def test_sampling_and_meeting_agree(kind, place):
    light, p, _ = placed(kind, place)
    aimed = sampled(light, p, 4096)
    hit = met(light, p, aimed["direction"])
    # A direction rounds by 6e-8, which moves it over the rim of a light that is 0.3 across in few of 4096 cases.
    seen = hit["pdf"] > 0
    assert (~seen).sum() <= 8
    np.testing.assert_allclose(hit["pdf"][seen], aimed["pdf"][seen], rtol=1e-5)
    # Distances to the rim of a sphere are worth half the digits.
    np.testing.assert_allclose(hit["distance"][seen], aimed["distance"][seen], rtol=2e-3 if kind == "sphere" else 1e-5)
    np.testing.assert_array_equal(hit["radiance"][seen], aimed["radiance"][seen])


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("kind", KINDS)
def test_the_back_of_a_flat_light_is_dark(kind, place):
    light, p, _ = placed(kind, place)
    behind = 2 * light.transform[3, :3] - p
    lit = sampled(light, behind, 16)["pdf"] > 0
    towards = light.transform[3, :3] - behind
    seen = met(light, behind, (towards / np.linalg.norm(towards))[None])["pdf"] > 0
    assert lit.all() == seen.all() == (kind == "sphere")


@pytest.mark.parametrize("place", ["plain", "sheared"])
@pytest.mark.parametrize("distance", [0.02, 0.3, 1.2, 2.0, 6.0])
def test_directions_to_a_rectangle_are_distributed_as_their_pdf(distance, place):
    # Bins are 8 × 8 parts of the rectangle. Near it samples are uniform in the solid angle of light space, from two
    # half diagonals on in its area.
    light = wr.RectLight(width=1.2, height=0.8)
    light.transform = np.eye(4)
    light.transform[:3, :3] = PLACES[place]
    to_world = light.local_to_world()
    p = np.array([0.3, 0.1, -distance]) @ to_world
    samples = sampled(light, p)
    local = (p + samples["direction"] * samples["distance"][:, None]) @ np.linalg.inv(to_world)
    assert np.abs(local[:, 2]).max() < 1e-5
    edges = np.linspace(-0.6, 0.6, 9), np.linspace(-0.4, 0.4, 9)
    observed, _, _ = np.histogram2d(np.clip(local[:, 0], -0.6, 0.6), np.clip(local[:, 1], -0.4, 0.4), edges)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (0.6, 0.4)
    local_p = np.array([0.3, 0.1, -distance])
    whole = solid_angle(local_p, np.c_[corners, np.zeros(4)])
    expected = np.full((8, 8), 1 / 64)
    if np.linalg.norm(local_p) < 2 * np.hypot(0.6, 0.4):
        assert whole > 0.02
        for i, j in np.ndindex(8, 8):
            x, y = edges[0][i : i + 2], edges[1][j : j + 2]
            cell = [(x[0], y[0], 0), (x[1], y[0], 0), (x[1], y[1], 0), (x[0], y[1], 0)]
            expected[i, j] = solid_angle(local_p, cell) / whole
    assert chi_square(observed, expected, N) > 1e-5


@pytest.mark.parametrize("ratio", [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
def test_l1_small_spheres_keep_their_light(ratio):
    # E = π L (r/d)², by light sampling without any noise to speak of.
    light = wr.SphereLight(radius=ratio, intensity=1.0)
    values = irradiances(sampled(light, (0, 0, -1.0), 4096), np.array([0, 0, 1.0]))
    assert abs(z_of(values, np.pi * ratio**2)) < SIGMAS
    assert values.std() < 0.01 * values.mean() + 0.5 * np.pi * ratio**4


def test_l2_a_sphere_light_from_inside_and_from_its_surface():
    # it emits outwards only; a surface that touches it sees at most half a sphere of it, E = π L.
    light = wr.SphereLight(radius=0.5, intensity=3.0)
    assert (sampled(light, (0.1, 0.2, 0.1), 64)["pdf"] == 0).all()
    for distance in (0.5, np.nextafter(np.float32(0.5), np.float32(1)), 0.5001):
        values = irradiances(sampled(light, (0, 0, -distance), 4096), np.array([0, 0, 1.0]))
        assert np.isfinite(values).all() and (values <= 2 * np.pi * 3.0 * (1 + 1e-5)).all()
    assert abs(z_of(values, np.pi * 3.0 * (0.5 / 0.5001) ** 2)) < SIGMAS


@pytest.mark.parametrize("height", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize(("x", "expected"), [(0.0, np.pi), (0.5, np.pi / 2), (0.45, np.pi)])
def test_l3_a_rectangle_just_above_the_surface(x, expected, height):
    # under its middle E is that of the whole hemisphere, under its edge half of it.
    light = wr.RectLight(width=1.0, height=1.0)
    p = np.array([x, 0.0, -height])
    normal = np.array([0, 0, 1.0])
    exact = polygon_irradiance(p, normal, outline(light, p))
    assert abs(exact - expected) < 30 * height
    values = irradiances(sampled(light, p), normal)
    assert np.isfinite(values).all() and (values < 2 * np.pi * (1 + 1e-5)).all()
    assert abs(z_of(values, exact, floor=2e-6)) < SIGMAS


def test_l3_a_thin_strip():
    # 2 m by 1e-6 m, 1 m away.
    light = wr.RectLight(width=2.0, height=1e-6)
    p, normal = np.array([0.2, 0.0, -1.0]), np.array([0, 0, 1.0])
    expected = polygon_irradiance(p, normal, outline(light, p))
    assert abs(z_of(irradiances(sampled(light, p), normal), expected)) < SIGMAS


@pytest.mark.parametrize("p", [(0.2, 0.1, 0.0), (0.2, 0.1, -0.0), (3.0, 0.0, 0.0), (3.0, 0.0, -1e-12)])
@pytest.mark.parametrize("kind", ["rect", "disk"])
def test_l2_points_in_the_plane_of_a_flat_light(kind, p):
    # finite, and no brighter than the light allows.
    light = KINDS[kind]()
    samples = sampled(light, p, 4096)
    assert np.isfinite(samples["pdf"]).all() or (samples["pdf"] > 0).all()
    values = irradiances(samples, np.array([1.0, 0, 0]))
    assert np.isfinite(values).all() and values.mean() <= 2 * np.pi * 2.0


@pytest.mark.parametrize("angle", [0.01, 0.53, 10.0, 90.0, 180.0, 270.0, 360.0])
def test_distant_lights_of_any_angle(angle):
    light = wr.DistantLight(intensity=2.0, angle=angle, transform=scenes.look_at((1.0, 2.0, 3.0)))
    normal = light.transform[2, :3]
    half = np.radians(angle) / 2
    expected = 2 * np.pi * np.sin(min(half, np.pi / 2)) ** 2
    samples = sampled(light, (4.0, 5.0, 6.0))
    assert abs(z_of(irradiances(samples, normal), expected)) < SIGMAS
    assert (samples["direction"] @ normal > np.cos(half) - 1e-5).all()
    if angle > 5:
        hit = met(light, (0, 0, 0), cosine_directions(normal))
        assert abs(z_of(hit["radiance"][:, 0] * np.pi, expected)) < SIGMAS
    seen = met(light, (4.0, 5.0, 6.0), samples["direction"][:4096])["pdf"]
    assert (seen > 0).mean() > 0.998
    np.testing.assert_allclose(seen[seen > 0], samples["pdf"][0], rtol=1e-6)
    # Normalised, the intensity is the illuminance of a facing surface, up to a half sphere.
    light.normalize = True
    if angle <= 180:
        assert abs(z_of(irradiances(sampled(light, (0, 0, 0)), normal), 2.0)) < SIGMAS


def test_a_distant_light_without_an_angle_is_one_direction():
    light = wr.DistantLight(intensity=2.0, angle=0.0)
    (sample,) = sampled(light, (1, 2, 3), 1)
    np.testing.assert_array_equal(sample["direction"], (0, 0, 1))
    assert (sample["pdf"], sample["delta"], sample["radiance"][0]) == (1, 1, 2)
    assert np.isinf(sample["distance"])
    assert met(light, (1, 2, 3), np.array([(0, 0, 1.0)]))[0]["pdf"] == 0


@pytest.mark.parametrize(
    "light",
    [
        wr.SphereLight(radius=0.0),
        wr.RectLight(width=0.0),
        wr.RectLight(height=0.0, normalize=True),
        wr.DiskLight(radius=0.0),
        wr.SphereLight(intensity=0.0),
        wr.SphereLight(color=(0, 0, 0)),
        wr.SphereLight(transform=np.diag([1.0, 0.0, 1.0, 1.0])),
    ],
    ids=lambda light: type(light).__name__,
)
def test_l4_a_light_without_size_or_power_is_never_chosen(light):
    # L4; beside it, the light that has power is chosen always.
    scene = wr.Scene()
    good = wr.SphereLight()
    upload = Upload(scene, {"/a": light, "/b": good, "/c": light}, np.zeros(3), "cpu")
    np.testing.assert_array_equal(upload.record.lights.numpy()["choice"], (0, 1, 0))
    np.testing.assert_array_equal(upload.record.light_cdf.numpy(), 1)
    np.testing.assert_array_equal(upload.record.light_leaves.numpy()["light"], 1)
    scene.lights = {"/a": light, "/b": good}
    singular = light.transform[1, 1] == 0
    assert list(lit(scene, camera_light=False)) == (["/a", "/b"] if singular else ["/b"])


def test_a_thousand_distant_lights_share_the_choice_without_a_gap():
    lights = {f"/{i}": wr.DistantLight(intensity=float(i % 7)) for i in range(1000)}
    upload = Upload(wr.Scene(), lights, np.zeros(3), "cpu")
    choice = np.append(upload.record.lights.numpy()["choice"].astype(float), 0.0)
    cdf = upload.record.light_cdf.numpy()
    np.testing.assert_allclose(choice.sum(), 1.0, rtol=1e-6)
    np.testing.assert_allclose(np.diff(cdf, prepend=0), choice, atol=1e-7)
    assert (np.diff(cdf) >= 0).all()


def test_the_camera_light_lights_a_facing_white_surface_to_1_at_any_distance():
    for distance in (1e-3, 1.0, 1e6):
        (sample,) = sampled(wr.CameraLight(), (0, 0, -distance), 1)
        np.testing.assert_allclose(sample["radiance"] / sample["pdf"] / np.pi, 1.0, rtol=1e-6)
        np.testing.assert_array_equal(sample["direction"], (0, 0, 1))
