"""Many lights: the tree's probabilities, noise against that of few lights, and sums over all of them."""

import numpy as np
import pytest
import warp as wp
from chance import SIGMAS, chi_square
from light_scenes import pose
from pictures import picture
from scenes import window

import warprender as wr
from warprender.lights import DiskLight, DistantLight, DomeLight, LightTexture, RectLight, Shaping, SphereLight
from warprender.lights.choice import choose_light, probability_of
from warprender.lights.dispatch import FUNCTIONS, light_functions, shaping_function
from warprender.lights.tree import LightBounds, build
from warprender.records import DeviceScene
from warprender.upload import Upload

FLOOR = [(-10, -10, 0), (10, -10, 0), (10, 10, 0), (-10, 10, 0)]


@wp.kernel(module="unique", enable_backward=False)
def choices(scene: DeviceScene, p: wp.vec3, n: wp.vec3, u: wp.array(dtype=wp.vec2), out: wp.array(dtype=wp.vec2)):
    i = wp.tid()
    choice = choose_light(scene, p, n, u[i])
    out[i] = wp.vec2(wp.float32(choice.index), choice.probability)


@wp.kernel(module="unique", enable_backward=False)
def probabilities(scene: DeviceScene, p: wp.vec3, n: wp.vec3, out: wp.array(dtype=wp.float32)):
    i = wp.tid()
    out[i] = probability_of(scene, p, n, scene.lights[i], scene.lights[i].leaf)


def arriving_kernel():
    sample_light, _ = light_functions(tuple(sorted(FUNCTIONS)))
    shape = shaping_function(("ies", "shaping"))

    @wp.kernel(module="unique", enable_backward=False)
    def arriving(
        scene: DeviceScene, p: wp.vec3, n: wp.vec3, u: wp.array(dtype=wp.vec2), out: wp.array(dtype=wp.float32)
    ):
        i = wp.tid()
        for k in range(u.shape[0]):
            found = sample_light(scene, scene.lights[i], p, u[k])
            if found.pdf > 0.0:
                factor = shape(scene, scene.lights[i], found.direction)
                out[i] = wp.max(out[i], factor[0] * wp.dot(n, found.direction))

    return arriving


ARRIVING = arriving_kernel()


def mixed_lights(count, seed=0):
    """Lights of several kinds, sizes and directions in a box, two at infinity."""
    rng = np.random.default_rng(seed)
    lights = {}
    for i in range(count):
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        transform = pose((*rng.uniform(-10, 10, 2), rng.uniform(0.2, 4.0)), turn)
        power = {"intensity": rng.random() ** 4 * 10, "transform": transform}
        lights[f"/{i}"] = (
            SphereLight(radius=rng.uniform(0.01, 0.2), **power),
            DiskLight(radius=rng.uniform(0.01, 0.2), **power),
            RectLight(width=rng.uniform(0.01, 0.5), shaping=Shaping(coneAngle=60.0), **power),
            SphereLight(radius=0.05, shaping=Shaping(coneAngle=30.0), **power),
        )[i % 4]
    lights["/sun"] = DistantLight(intensity=0.1, angle=2.0)
    lights["/sky"] = DomeLight(texture=LightTexture.of(np.random.default_rng(1).random((8, 16, 3))))
    return lights


def launched(kernel, upload, p, n, size, *arguments, dtype=wp.float32):
    out = wp.zeros(size, dtype=dtype)
    wp.launch(kernel, size, [upload.record, wp.vec3(*p), wp.vec3(*n), *arguments, out])
    return out.numpy()


@pytest.mark.parametrize("p", [(0.0, 0.0, 0.0), (9.0, -3.0, 2.0), (200.0, 0.0, 5.0)])
@pytest.mark.parametrize("count", [1, 2, 3, 60])
def test_lights_are_chosen_as_often_as_is_said(count, p):
    upload = Upload(wr.Scene(), mixed_lights(count), np.zeros(3), "cpu")
    n = np.array([0.0, 0.6, 0.8])
    said = launched(probabilities, upload, p, n, count + 2).astype(float)
    assert (said >= 0).all() and said.sum() <= 1 + 1e-5
    u = wp.array(np.random.default_rng(2).random((1 << 17, 2), np.float32), dtype=wp.vec2)
    index, probability = launched(choices, upload, p, n, len(u), u, dtype=wp.vec2).T
    index = index.astype(int)
    observed = np.bincount(index[index >= 0], minlength=count + 2)
    assert chi_square(observed, said, len(u)) > 1e-5
    np.testing.assert_allclose(probability[index >= 0], said[index[index >= 0]], rtol=1e-5)


def test_no_light_that_reaches_a_surface_has_probability_0():
    lights = mixed_lights(200)
    upload = Upload(wr.Scene(), lights, np.zeros(3), "cpu")
    rng = np.random.default_rng(3)
    u = wp.array(rng.random((64, 2), np.float32), dtype=wp.vec2)
    dark = 0
    for _ in range(50):
        p, n = rng.uniform(-12, 12, 3), rng.normal(size=3)
        n /= np.linalg.norm(n)
        said = launched(probabilities, upload, p, n, len(lights))
        arrives = launched(ARRIVING, upload, p, n, len(lights), u)
        assert (said[arrives > 1e-6] > 0).all()
        dark += (said == 0).sum()
    # And many that do not reach it are known not to.
    assert dark > 1000


def test_the_tree_holds_every_light_once_and_its_boxes_hold_it():
    rng = np.random.default_rng(4)
    count = 3000
    lower = rng.uniform(-1, 1, (count, 3)) * (10, 1, 0)
    axis = rng.normal(size=(count, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    sides = rng.random(count) < 0.5
    power = rng.random(count)
    bounds = LightBounds(lower, lower + 0.1, axis, np.full(count, 0.3), np.full(count, 1.0), power, sides, ~sides)
    nodes, trails = build(bounds)
    leaves = nodes["children"] == 0
    assert sorted(-1 - nodes["child"][leaves]) == list(range(count))
    inner = nodes[~leaves]
    assert ((inner["children"] >= 2) & (inner["children"] <= 4)).all()
    # Every node but the root is the child of one.
    children = np.concatenate([np.arange(n["child"], n["child"] + n["children"]) for n in inner])
    assert sorted(children) == list(range(1, len(nodes)))
    np.testing.assert_allclose(nodes["power"][0], bounds.power.sum(), rtol=1e-5)
    for light in range(0, count, 97):
        at, trail, depth = 0, int(trails[light]), 0
        while nodes["children"][at]:
            assert (nodes["lower"][at] <= lower[light] + 1e-6).all()
            assert (nodes["upper"][at] >= lower[light] + 0.1 - 1e-6).all()
            assert nodes["two_sided"][at] or not sides[light]
            cosine = nodes["axis"][at] @ axis[light]
            apart = np.arccos(np.clip(abs(cosine) if nodes["two_sided"][at] else cosine, -1, 1)) + 0.3
            assert np.cos(min(apart, np.pi)) >= nodes["cos_spread"][at] - 1e-5
            at = nodes["child"][at] + (trail & 3)
            trail, depth = trail >> 2, depth + 1
        assert nodes["child"][at] == -1 - light and depth < 20


@pytest.mark.parametrize("count", [2, 3, 500])
def test_lights_in_one_place_make_a_tree_too(count):
    zero = np.zeros((count, 3))
    ones = np.ones(count)
    bounds = LightBounds(zero, zero, zero + (0, 0, 1), 0 * ones, 1.5 * ones, ones, ones > 1, ones > 0)
    nodes, _ = build(bounds)
    assert sorted(-1 - nodes["child"][nodes["child"] < 0]) == list(range(count))


def lamps(count, seed=1):
    """A floor under lamps of one total power."""
    rng = np.random.default_rng(seed)
    scene = wr.Scene()
    scene.add_mesh("/floor", FLOOR, [[0, 1, 2, 3]], color=(0.5, 0.5, 0.5))
    for i in range(count):
        place = (*rng.uniform(-10, 10, 2), rng.uniform(0.5, 1.5))
        light = SphereLight(radius=0.02, intensity=100.0 / count / 0.02**2, transform=pose(place))
        scene.add_light(light, path=f"/l{i}")
    return scene


def sum_over_all(scene, size):
    """Radiance of the floor in each pixel, every lamp summed as a point."""
    grid = (np.arange(3 * size) + 0.5) / (3 * size) * 20 - 10
    x, y = np.meshgrid(grid, -grid)
    total = np.zeros(x.shape)
    for light in scene.lights.values():
        px, py, pz = light.transform[3, :3]
        square = (x - px) ** 2 + (y - py) ** 2 + pz**2
        total += light.intensity * np.pi * light.radius**2 * pz / square**1.5
    return total.reshape(size, 3, size, 3).mean((1, 3)) * 0.5 / np.pi


def test_ten_thousand_lamps_converge_as_ten_do():
    noise = {}
    for count in (10, 10_000):
        scene = lamps(count)
        color, error = picture(scene, window(20.0, (0, 0, 20.0)), 32, 64, bounces=0)
        reference = sum_over_all(scene, 32)
        z = (color[..., 0].mean() - reference.mean()) / np.hypot(
            np.sqrt((error[..., 0] ** 2).sum()) / error[..., 0].size, 5e-4 * reference.mean()
        )
        assert abs(z) < SIGMAS
        noise[count] = np.sqrt(np.mean((error[..., 0] / reference) ** 2))
    # Chosen by power alone it would be 30 times, one in ten thousand being near.
    assert noise[10_000] < 1.1 * noise[10]


def test_lamps_are_met_by_their_boxes_as_one_by_one():
    # A mirror shows lamps that only chance finds: through the tree of boxes, what a loop over all of them shows.
    mirror = wr.PreviewSurface(diffuseColor=(1, 1, 1), metallic=1.0, roughness=0.0)
    pictures = []
    for extra in (0, 40):
        scene = wr.Scene()
        scene.add_mesh("/floor", FLOOR, [[0, 1, 2, 3]], material=mirror)
        for i, place in enumerate([(-3, 2, 1), (4, -1, 2), (0, 5, 3)]):
            scene.add_light(SphereLight(radius=0.8, intensity=i + 1.0, transform=pose(place)), f"/l{i}")
        for i in range(extra):
            scene.add_light(SphereLight(radius=0.1, intensity=1e-9, transform=pose((i, 60, -5))), f"/far{i}")
        pictures.append(picture(scene, window(20.0, (0, 0, 20.0)), 32, 16, bounces=0)[0])
    assert pictures[0].max() > 1
    np.testing.assert_allclose(pictures[0], pictures[1], atol=1e-6)
