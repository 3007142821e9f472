"""What studies vary and pictures show in their noise alone: how lights are aimed at, how textures are averaged."""

import numpy as np
import pytest
import scenes
from pictures import prepare

import warprender as wr
from warprender.shapes.primvar import Primvar
from warprender.study.analysis import bias_and_deviation
from warprender.study.kept import Reference


def lamps():
    """A floor under lamps of unequal power, a sun without size and a square that glows."""
    scene = wr.Scene()
    floor = np.array([(-3, 0, 3), (3, 0, 3), (3, 0, -3), (-3, 0, -3)], float)
    scene.add_mesh("/floor", floor, [[0, 1, 2, 3]], material=wr.PreviewSurface(diffuseColor=(0.6, 0.6, 0.6)))
    scene.add_mesh(
        "/glow",
        0.2 * floor + (0, 1.5, -2.5),
        [[0, 1, 2, 3]],
        material=wr.PreviewSurface(diffuseColor=(0, 0, 0), emissiveColor=(3, 2, 1)),
    )
    rng = np.random.default_rng(0)
    for number, (x, z) in enumerate(rng.uniform(-2.5, 2.5, (6, 2))):
        scene.add_light(wr.SphereLight(radius=0.4, intensity=2.0 + 3.0 * number), pose=scenes.look_at((x, 1.2, z)))
    scene.add_light(wr.DistantLight(angle=0.0, intensity=0.2), pose=scenes.look_at((1, 3, 1)))
    scene.add_light(wr.DomeLight(intensity=0.1))
    return scene, scenes.camera((0, 4, 4), fov=50.0)


def test_every_way_of_aiming_gives_the_same_picture():
    scene, view = lamps()

    def shots(samples, seeds, **options):
        renderer = prepare(scene, view, 24, bounces=1, **options)
        return np.stack([renderer.render(samples=samples, seed=s).numpy("color")[..., :3] for s in seeds]).astype(float)

    halves = shots(512, (1001, 1002))
    reference = Reference(halves.mean(0), float(np.mean((halves[0] - halves[1]) ** 2)) / 4, "")
    noise = {}
    for name in ("tree", "power", "none"):
        _, sigmas, noise[name] = bias_and_deviation(shots(64, range(6), light_sampling=name), reference)
        assert abs(sigmas) < 4, name
    # The lamps are round and near: the tree knows which of them is.
    assert noise["tree"] < 0.8 * noise["power"] < noise["none"]


def test_lights_that_nothing_can_meet_are_aimed_at_all_the_same():
    scene = wr.Scene()
    floor = np.array([(-3, 0, 3), (3, 0, 3), (3, 0, -3), (-3, 0, -3)], float)
    scene.add_mesh("/floor", floor, [[0, 1, 2, 3]], color=(0.5, 0.5, 0.5))
    scene.add_light(wr.DistantLight(angle=0.0, intensity=1.0), pose=scenes.look_at((1e-9, 1, 0)))
    view = scenes.camera((0, 2, 0.01), fov=20.0)
    aimed, chance = (
        prepare(scene, view, 16, bounces=0, light_sampling=name).render(samples=4).numpy("color")
        for name in ("tree", "none")
    )
    assert aimed[..., 0].min() > 0.1
    np.testing.assert_array_equal(chance, aimed)


def test_textures_without_a_filter_have_the_same_mean_and_more_noise():
    # Squares of black and white, 1/32 of a pixel wide.
    chequer = np.kron([[0, 1] * 4, [1, 0] * 4] * 4, np.ones((4, 4))).astype(np.float32)[..., None]
    glow = wr.Texture(chequer, wrapS="repeat", wrapT="repeat")
    scene, size = wr.Scene(), 16
    points, faces = scenes.quad(2.0)
    st = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float) * size * 4
    scene.add_mesh("/quad", points, faces, wr.PreviewSurface(diffuseColor=(0, 0, 0), emissiveColor=glow), st=st)
    view = scenes.window(2.0)
    filtered, sharp = (
        prepare(scene, view, size, bounces=0, camera_light="off", filter_textures=on)
        .render(samples=64)
        .numpy("color")[..., 0]
        .astype(float)
        for on in (True, False)
    )
    assert sharp.std() > 1.5 * filtered.std()
    for picture in (filtered, sharp):
        # Radiance of 0 or 1, 64 × 256 samples.
        assert abs(picture.mean() - 0.5) < 4 * 0.5 / np.sqrt(64 * size**2)


def shells():
    """Two glassy balls of triangles, one in the other, with colours and normals at their vertices, on a floor."""
    scene = wr.Scene()
    points, faces = scenes.icosphere(3)
    for name, size in (("inner", 0.6), ("outer", 1.0)):
        mesh = scene.add_mesh(f"/{name}", size * points, faces, wr.DisplayColor(opacity=0.5), normals=points)
        mesh.primvars["displayColor"] = Primvar(np.float32(0.5 + 0.4 * points), "vertex")
    floor = np.array([(-3, -1, 3), (3, -1, 3), (3, -1, -3), (-3, -1, -3)], float)
    scene.add_mesh("/floor", floor, [[0, 1, 2, 3]], color=(0.6, 0.6, 0.6))
    scene.add_light(wr.DistantLight(angle=0.0, intensity=1.0), pose=scenes.look_at((1, 3, 1)))
    return scene, scenes.camera((0, 1, 4))


def test_fast_rays_see_what_watertight_ones_see_but_at_edges():
    scene, view = shells()
    options = {"transport": "direct", "sampler": "independent"}
    fast = wr.Renderer(scene, view, (48, 48), ray_accuracy="fast", **options)
    assert fast.plan.reasons["fast rays"] == "asked for"
    seen = fast.render(samples=4).numpy("color")
    expected = prepare(scene, view, 48, transport="direct").render(samples=4).numpy("color")
    # The same random numbers: nothing but a ray that slips through differs by more than rounding.
    apart = (np.abs(seen - expected) > 1e-4 * expected.max()).any(-1)
    assert apart.mean() < 0.01 and expected[..., 3].mean() > 0.4


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"light_sampling": "best"}, "'best' is not one of tree, power, none"),
        ({"ray_accuracy": "slow"}, "'slow' is not one of watertight, fast"),
    ],
)
def test_unknown_ways_are_named(options, message):
    with pytest.raises(wr.SceneError, match=message):
        wr.Renderer(*lamps(), (4, 4), **options)
