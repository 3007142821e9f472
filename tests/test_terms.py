"""Outputs color:N, the terms of the unfolded rendering equation: what arrives after N scatterings."""

import numpy as np
import pytest
import scenes
from pictures import prepare

import warprender as wr
from warprender import images
from warprender.plan import everything

#: Float32 sums of a few dozen contributions, and the rounding of each mean to float32.
FLOAT32 = 4e-6


def names(count):
    return tuple(f"color:{n}" for n in range(count))


def terms_of(frame, count):
    """The first terms (count, H, W, 3), float64."""
    return np.stack([frame.numpy(name) for name in names(count)]).astype(np.float64)


def grey_box(albedo, emission):
    """A closed box of Lambert walls that glow, seen from inside."""
    scene = wr.Scene()
    scene.add_mesh("/box", *scenes.cube(4.0), material=wr.Phong(diffuseColor=albedo))
    scene.add_light(wr.MeshLight(prim="/box", color=emission, bothSides=True))
    return scene, scenes.camera((0.3, 0.2, 0.1), (1, 0.3, -1))


def lit_room():
    """Glass, a mirror, a clear pane and a glowing ball under a lamp that the camera sees."""
    scene = wr.Scene()
    floor = np.array([(-3, -1, 3), (3, -1, 3), (3, -1, -3), (-3, -1, -3)], float)
    scene.add_mesh("/floor", floor, [[0, 1, 2, 3]], color=(0.6, 0.5, 0.4))
    scene.add_mesh("/back", *scenes.quad(6.0, -2.0), color=(0.3, 0.6, 0.8))
    scene.add_sphere("/glass", 0.6, material=wr.Dielectric(), pose=(-0.9, -0.3, 0, 0, 0, 0, 1))
    mirror = wr.PreviewSurface(metallic=1.0, roughness=0.0)
    scene.add_sphere("/mirror", 0.6, material=mirror, pose=(0.9, -0.3, 0, 0, 0, 0, 1))
    glow = wr.PreviewSurface(diffuseColor=(0.2,) * 3, emissiveColor=(2.0, 1.0, 0.5))
    scene.add_sphere("/glow", 0.3, material=glow, pose=(0, -0.6, 0.8, 0, 0, 0, 1))
    scene.add_mesh("/pane", *scenes.quad(2.0, 1.5), material=wr.PreviewSurface(opacity=0.4, opacityMode="presence"))
    scene.add_light(wr.SphereLight(radius=0.4, intensity=9.0), pose=(0, 1.2, 0, 0, 0, 0, 1))
    return scene, scenes.camera((0, 0.3, 5))


def mirror_box(albedo, emission, size=4.0):
    """The same of perfect mirrors."""
    look = wr.PreviewSurface(metallic=1.0, roughness=0.0, diffuseColor=albedo, emissiveColor=emission)
    scene = wr.Scene()
    scene.add_mesh("/box", *scenes.cube(size), material=look)
    return scene, scenes.camera((0.075 * size, 0.05 * size, 0.025 * size), (1, 0.3, -1))


ALBEDO, EMISSION = np.array([0.2, 0.5, 0.8]), np.array([0.3, 0.2, 0.1])


@pytest.mark.parametrize("transport", ["path", "whitted"])
def test_terms_of_a_closed_box_of_mirrors_are_exact(transport):
    # Each wall emits e and mirrors ρ of what it gets at every angle: e ρ^n after n reflections, without noise.
    scene, view = mirror_box(tuple(ALBEDO), tuple(EMISSION))
    options = {"camera_light": "off", "transport": transport, "bounces": 6}
    frame = prepare(scene, view, 8, outputs=names(4), **options).render(samples=4)
    for n, term in enumerate(terms_of(frame, 4)):
        np.testing.assert_allclose(term, np.broadcast_to(EMISSION * ALBEDO**n, term.shape), rtol=1e-5)


def test_terms_of_a_closed_grey_box_are_a_geometric_series():
    scene, view = grey_box(tuple(ALBEDO), tuple(EMISSION))
    renderer = prepare(scene, view, 16, outputs=("color", *names(8)))
    frame = renderer.render(samples=256)
    terms = terms_of(frame, 8)
    for n, term in enumerate(terms):
        expected = EMISSION * ALBEDO**n
        if n <= 3:
            # Before the roulette there is no noise: nothing can be aimed at from within, and every ray hits the same.
            np.testing.assert_allclose(term, np.broadcast_to(expected, term.shape), rtol=1e-5)
        # Pixels are independent: their spread is the error of their mean.
        mean, error = term.mean((0, 1)), term.std((0, 1), ddof=1) / 16.0
        assert (np.abs(mean - expected) < 4.5 * error + 1e-5 * mean).all(), n
        assert (error <= 0.02 * mean).all(), n


@pytest.mark.parametrize("transport", ["path", "whitted", "direct", "local"])
def test_terms_sum_to_color(transport):
    scene, view = lit_room()
    options = {"transport": transport, "lights_visible": True}
    if transport in ("path", "whitted"):
        options["bounces"] = 6
    renderer = prepare(scene, view, 24, outputs=("color", *names(10)), **options)
    frame = renderer.render(samples=8)
    color, terms = frame.numpy("color")[..., :3].astype(np.float64), terms_of(frame, 10)
    np.testing.assert_allclose(terms.sum(0), color, rtol=FLOAT32, atol=1e-7)
    last = {"path": 7, "whitted": 7, "direct": 1, "local": 1}[transport]
    assert (terms[last + 1 :] == 0.0).all()
    assert (terms[: min(last, 4) + 1].mean((1, 2, 3)) > 1e-5).all()


def test_color_keeps_its_bits_with_its_terms():
    scene, view = lit_room()
    alone = wr.Renderer(scene, view, (24, 24)).render(samples=8)
    with_terms = wr.Renderer(scene, view, (24, 24), ("color:2", "color", "color:0")).render(samples=8)
    np.testing.assert_array_equal(alone.numpy("color"), with_terms.numpy("color"))
    assert list(with_terms.outputs) == ["color:2", "color", "color:0"]


def test_transports_agree_on_the_first_terms():
    # Nothing is clear and no lobe is sharp: what is seen directly is the same, what is scattered once by z-test.
    scene, view = wr.Scene(), scenes.camera((0, 0, 5))
    scene.add_mesh("/wall", *scenes.quad(6.0, -1.0), color=(0.5, 0.7, 0.6))
    scene.add_sphere("/ball", 0.8, color=(0.8, 0.2, 0.2))
    scene.add_light(wr.SphereLight(radius=0.4, intensity=9.0), pose=(1.5, 1.5, 1, 0, 0, 0, 1))
    found = {}
    for transport in ("path", "direct"):
        options = {"transport": transport, "lights_visible": True, "visibility": "rays"}
        renderer = prepare(scene, view, 16, outputs=("color", *names(2)), **options)
        frames = [renderer.render(samples=64, seed=seed) for seed in range(4)]
        found[transport] = np.stack([terms_of(frame, 2) for frame in frames])
    np.testing.assert_array_equal(found["path"][:, 0], found["direct"][:, 0])
    once = [found[transport][:, 1].mean((1, 2, 3)) for transport in found]
    error = np.sqrt(sum(values.var(ddof=1) / 4 for values in once))
    assert abs(once[0].mean() - once[1].mean()) < 7.0 * error  # Student's t, 6 degrees: one false alarm in 2 000
    assert error < 0.01 * once[0].mean()


def test_fewer_bounces_are_the_sum_of_the_first_terms():
    # Up to three bounces no roulette is played: the same paths, cut off.
    scene, view = lit_room()
    options = {"resolution": (24, 24), "lights_visible": True, "samples": 8}
    whole = wr.render(scene, camera=view, outputs=names(5), bounces=6, **options)
    for bounces in range(3):
        cut = wr.render(scene, camera=view, bounces=bounces, **options).numpy("color")[..., :3]
        terms = terms_of(whole, 5)[: bounces + 2]
        np.testing.assert_allclose(terms.sum(0), cut, rtol=FLOAT32, atol=1e-7)


def test_terms_alone_follow_no_further_bounce():
    scene, view = lit_room()
    renderer = wr.Renderer(scene, view, (24, 24), ("color:0", "color:1"), lights_visible=True)
    options = {"camera": view, "resolution": (24, 24), "lights_visible": True, "samples": 4}
    both = wr.render(scene, outputs=("color", "color:1"), **options)
    assert renderer.plan.bounds["bounces"] == 0
    np.testing.assert_array_equal(renderer.render(samples=4).numpy("color:1"), both.numpy("color:1"))
    seen = wr.Renderer(scene, view, (24, 24), "color:0", lights_visible=True)
    frame = seen.render(samples=4)
    assert frame.stats["rays"]["bounce"] == frame.stats["rays"]["shadow"] == 0
    assert not seen.plan.path.sampled_lights


def test_light_through_clear_surfaces_keeps_its_term():
    # A pane lets 70 % straight through from a glowing wall: all of it is seen directly.
    scene = wr.Scene()
    glow = wr.PreviewSurface(diffuseColor=(0, 0, 0), emissiveColor=(1, 1, 1), ior=1.0)
    scene.add_mesh("/wall", *scenes.quad(4.0, -1.0), material=glow)
    pane = wr.PreviewSurface(diffuseColor=(0, 0, 0), opacity=0.3, ior=1.0)
    scene.add_mesh("/pane", *scenes.quad(4.0), material=pane)
    frame = prepare(scene, scenes.window(2.0), 16, outputs=names(3)).render(samples=256)
    seen, once, _ = terms_of(frame, 3)
    assert abs(seen.mean() - 0.7) < 4.5 * np.sqrt(0.21 / (256 * 256))
    # What the pane reflects of the wall's own dim reflection: Schlick's weight at 0° is rounding.
    assert once.max() < 1e-9


def test_cornell_box():
    scene = wr.load("scenes_usd/cornell_box.usda")
    frame = prepare(scene, None, 24, outputs=("color", *names(9)), bounces=7, lights_visible=True).render(samples=16)
    color, terms = frame.numpy("color")[..., :3].astype(np.float64), terms_of(frame, 9)
    np.testing.assert_allclose(terms.sum(0), color, rtol=FLOAT32, atol=1e-7)
    energy = terms[1:].mean((1, 2, 3))
    assert (energy[1:] < energy[:-1]).all()


def test_terms_go_into_exr_and_resumed_passes(tmp_path):
    scene, view = grey_box((0.5,) * 3, (1.0,) * 3)
    frame = prepare(scene, view, 8, outputs=("color", "color:0", "color:1")).render(samples=4)
    frame.save(tmp_path / "terms.exr")
    layers, _ = images.read(tmp_path / "terms.exr")
    assert set(layers) == {"color", "color:0", "color:1"}
    np.testing.assert_array_equal(layers["color:1"], frame.numpy("color:1"))


def test_a_dropped_sample_is_in_no_term():
    scene, view = mirror_box((0.5,) * 3, (2e38,) * 3, size=0.1)
    frame = prepare(scene, view, 8, outputs=("color", *names(2))).render(samples=4)
    assert frame.stats["dropped samples"] > 0
    assert np.isfinite(terms_of(frame, 2)).all()


@pytest.mark.parametrize("name", ["color:", "color:-1", "color:01", "color:x", "color:1 ", "colour:0"])
def test_what_is_no_term_is_refused(name):
    scene, view = grey_box((0.5,) * 3, (1.0,) * 3)
    with pytest.raises(wr.SceneError, match="color:0"):
        wr.Renderer(scene, view, (8, 8), name)


def test_nothing_is_kept_that_is_not_asked_for():
    scene, view = grey_box((0.5,) * 3, (1.0,) * 3)
    plain, one, two = (
        wr.Renderer(scene, view, (8, 8), outputs) for outputs in ("color", ("color", "color:3"), names(2))
    )
    assert not plain.plan.path.terms and plain._films.last.terms.sums.size == 0
    assert "single terms" in plain.plan.absent and "color:3" in one.plan.reasons["single terms"]
    assert one.plan.path == two.plan.path != everything()
    assert one._films.last.terms.sums.shape == (1, 64)
