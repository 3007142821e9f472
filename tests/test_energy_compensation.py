"""What rough metals lose by scattering once, and get back with energy compensation; never more than arrives."""

import numpy as np
import pytest
import scenes
import warp as wp
from bsdfs import towards
from chance import chi_square_of_directions
from pictures import mean_and_error, picture

import warprender as wr
from warprender.materials.dispatch import material_functions
from warprender.records import BsdfSample, BsdfValue, DeviceScene, Surface
from warprender.upload import Upload

WHITE_METAL = {"diffuseColor": (1, 1, 1), "metallic": 1.0}
ROUGHNESSES = (0.0, 1e-3, 0.05, 0.3, 1.0)
ABSORB, SCATTER = 0, 1


def kernels():
    prepare, evaluate, sample = material_functions(("PreviewSurface",), ("energy compensation",))

    @wp.func
    def surface_of(wo: wp.vec3, material: int) -> Surface:
        surface = Surface()
        surface.normal = wp.vec3(0.0, 0.0, 1.0)
        surface.geometric_normal = surface.normal
        surface.outgoing = wo
        surface.material = material
        return surface

    @wp.kernel(module="unique", enable_backward=False)
    def sample_all(
        scene: DeviceScene,
        wo: wp.array(dtype=wp.vec3),
        u: wp.array(dtype=wp.vec3),
        materials: wp.array(dtype=wp.int32),
        out: wp.array(dtype=BsdfSample),
    ):
        i = wp.tid()
        bsdf = prepare(scene, surface_of(wo[i], materials[i]))
        out[i] = sample(scene, bsdf, wo[i], wp.vec2(u[i][0], u[i][1]), u[i][2])

    @wp.kernel(module="unique", enable_backward=False)
    def evaluate_all(
        scene: DeviceScene,
        wo: wp.array(dtype=wp.vec3),
        wi: wp.array(dtype=wp.vec3),
        materials: wp.array(dtype=wp.int32),
        out: wp.array(dtype=BsdfValue),
    ):
        i = wp.tid()
        out[i] = evaluate(scene, prepare(scene, surface_of(wo[i], materials[i])), wo[i], wi[i])

    return sample_all, evaluate_all


SAMPLE, EVALUATE = kernels()


def run(kernel, looks, wo, values, dtype, compensated=True):
    """Rows of results (M, N), for materials, directions (N, 3) and values (N, 3)."""
    scene = wr.Scene()
    for k, look in enumerate(looks):
        scene.materials[f"/{k}"] = look
    held = Upload(scene, {}, np.zeros(3), "cpu")
    held.record.energy_compensation = int(compensated)
    count, n = len(looks), len(values)
    wo = np.tile(np.broadcast_to(np.asarray(wo, np.float32), (n, 3)), (count, 1))
    values = np.tile(np.asarray(values, np.float32), (count, 1))
    numbers = np.repeat(np.arange(1, count + 1, dtype=np.int32), n)
    out = wp.empty(len(values), dtype=dtype)
    arrays = [wp.array(wo, dtype=wp.vec3), wp.array(values, dtype=wp.vec3), wp.array(numbers), out]
    wp.launch(kernel, len(values), [held.record, *arrays])
    return out.numpy().reshape(count, n)


def albedos(looks, cosine, compensated=True, n=1 << 14):
    """(M, 3) share of the light from one direction that is reflected or let through."""
    u = np.random.default_rng(5).random((n, 3), np.float32)
    samples = run(SAMPLE, looks, towards(cosine), u, BsdfSample, compensated)
    weight = samples["diffuse"].astype(float) + samples["specular"]
    return np.where((samples["event"] == ABSORB)[..., None], 0.0, weight).mean(1)


@pytest.mark.parametrize("cosine", (1.0, 0.7, 0.3, 0.1))
def test_white_metals_reflect_all_that_arrives(cosine):
    looks = [wr.PreviewSurface(**WHITE_METAL, roughness=r) for r in ROUGHNESSES]
    np.testing.assert_allclose(albedos(looks, cosine, n=1 << 16), 1.0, atol=0.01)


def test_without_compensation_rough_metals_lose_what_bounces_between_facets():
    looks = [wr.PreviewSurface(**WHITE_METAL, roughness=r) for r in ROUGHNESSES]
    found = albedos(looks, 1.0, compensated=False)[:, 0]
    np.testing.assert_allclose(found[:3], 1.0, atol=1e-3)
    # Mean of G2 / G1 over the visible normals of GGX at α = 1 and normal incidence, by quadrature.
    assert found[4] == pytest.approx(single_scattering(1.0), abs=0.01)


def single_scattering(alpha: float) -> float:
    """Directional albedo at normal incidence of white GGX facets, height-correlated, by quadrature over normals."""
    theta = (np.arange(200_000) + 0.5) / 200_000 * np.pi / 4
    z = np.cos(theta)
    density = alpha**2 / (np.pi * (z**2 * (alpha**2 - 1) + 1) ** 2)
    cos_i = np.cos(2 * theta)
    shadow = (np.sqrt(1 + alpha**2 * np.tan(2 * theta) ** 2) - 1) / 2
    # f cos θi dωi = D G2 / (4 cos θi) cos θi · 4 cos θh dωh.
    return float((density / (1 + shadow) * z * (cos_i > 0) * 2 * np.pi * np.sin(theta)).sum() * theta[0] * 2)


def random_looks(count: int) -> list[wr.PreviewSurface]:
    rng = np.random.default_rng(11)
    looks = []
    for _ in range(count):
        numbers = rng.random(6) * rng.integers(0, 2, 6)
        looks.append(
            wr.PreviewSurface(
                diffuseColor=tuple(rng.random(3) ** 0.25),
                useSpecularWorkflow=int(rng.integers(0, 2)),
                specularColor=tuple(rng.random(3)),
                metallic=numbers[0],
                roughness=float(rng.choice([*ROUGHNESSES, rng.random()])),
                clearcoat=numbers[1],
                clearcoatRoughness=float(rng.choice([*ROUGHNESSES, rng.random()])),
                opacity=1 - numbers[2],
                opacityMode=str(rng.choice(["transparent", "presence"])),
                ior=float(rng.choice([1.0, 1.33, 1.5, 2.4, 5.0])),
            )
        )
    return looks


@pytest.mark.parametrize("compensated", (False, True))
@pytest.mark.parametrize("cosine", (1.0, 0.6, 0.2, 0.05))
def test_no_surface_gives_more_than_arrives(cosine, compensated):
    # The table of albedos is bilinear: 1 % is what it may be off at grazing angles.
    assert albedos(random_looks(200), cosine, compensated, n=1 << 12).max() < 1.015


def test_compensated_surfaces_are_reciprocal():
    looks = random_looks(50)
    rng = np.random.default_rng(12)
    a, b = (towards(rng.random(512), 2 * np.pi * rng.random(512)) for _ in range(2))
    there, back = run(EVALUATE, looks, a, b, BsdfValue), run(EVALUATE, looks, b, a, BsdfValue)
    for part in ("diffuse", "specular"):
        np.testing.assert_allclose(there[part] * a[:, 2:], back[part] * b[:, 2:], rtol=2e-3, atol=1e-6)


def test_compensated_samples_weigh_what_evaluation_says():
    look = wr.PreviewSurface(diffuseColor=(0.9, 0.7, 0.3), metallic=0.8, roughness=0.9, clearcoat=0.5)
    u = np.random.default_rng(6).random((1 << 14, 3), np.float32)
    samples = run(SAMPLE, [look], towards(0.4), u, BsdfSample)[0]
    samples = samples[samples["event"] == SCATTER]
    values = run(EVALUATE, [look], towards(0.4), samples["direction"], BsdfValue)[0]
    np.testing.assert_allclose(samples["pdf"], values["pdf"], rtol=1e-4)
    np.testing.assert_allclose(samples["specular"], values["specular"] / values["pdf"][:, None], rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("roughness", [0.3, 1.0])
@pytest.mark.parametrize("cosine", [1.0, 0.3])
def test_compensated_directions_are_distributed_as_their_pdf(roughness, cosine):
    look = wr.PreviewSurface(
        diffuseColor=(0.9, 0.7, 0.3), metallic=0.9, roughness=roughness, clearcoat=0.3, clearcoatRoughness=0.4
    )
    n = 1 << 17
    u = np.random.default_rng(9).random((n, 3), np.float32)
    samples = run(SAMPLE, [look], towards(cosine), u, BsdfSample)[0]
    directions = samples["direction"][samples["event"] == SCATTER]

    def pdf(wi):
        return run(EVALUATE, [look], towards(cosine), wi, BsdfValue)[0]["pdf"]

    assert chi_square_of_directions(pdf, directions, n) > 1e-5


@pytest.mark.parametrize("roughness", ROUGHNESSES)
def test_a_white_metal_ball_disappears_in_a_white_dome(roughness):
    scene = wr.Scene()
    scene.add_light(wr.DomeLight())
    scene.add_sphere("/ball", material=wr.PreviewSurface(**WHITE_METAL, roughness=roughness))
    color, error = picture(scene, scenes.camera((0, 0, 4)), 16, 256, dome_light_visible=True, energy_compensation=True)
    mean, sigma = mean_and_error(color, error)
    assert abs(mean - 1) < 0.01 + 4.5 * sigma and sigma < 0.005
