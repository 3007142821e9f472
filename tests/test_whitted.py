"""Transport "whitted": mirrors, refraction and total internal reflection in closed form, and against path tracing."""

import numpy as np
import pytest
import scenes
from pictures import picture, prepare

import warprender as wr

#: Emits, and reflects nothing.
LAMP = wr.PreviewSurface(emissiveColor=(3.0, 2.0, 1.0), diffuseColor=(0,) * 3, metallic=1.0)
EMITTED = np.array([3.0, 2.0, 1.0])
OFF = {"camera_light": "off", "transport": "whitted"}


def fresnel(cosine, eta):
    """Reflected share of unpolarised light, from Fresnel's amplitudes."""
    beyond = np.sqrt(1 - (1 - cosine**2) / eta**2)
    s = (cosine - eta * beyond) / (cosine + eta * beyond)
    p = (eta * cosine - beyond) / (eta * cosine + beyond)
    return (s * s + p * p) / 2


def looking_along(direction, size=0.05, distance=5.0, **options):
    """A narrow orthographic camera that looks at the origin."""
    return scenes.window(size, eye=-np.asarray(direction, float) * distance, **options)


def test_a_mirror_shows_the_lamp_in_its_colour():
    """Schlick's reflectance of a metal at 45°."""
    scene = wr.Scene()
    mirror = wr.PreviewSurface(diffuseColor=(0.9, 0.6, 0.3), metallic=1.0, roughness=0.0)
    scene.add_mesh("/mirror", *scenes.quad(1.0), material=mirror)
    wall = np.array([(2, -9, -9), (2, 9, -9), (2, 9, 9), (2, -9, 9)])
    scene.add_mesh("/lamp", wall, [[0, 1, 2, 3]], material=LAMP)
    view = looking_along((1 / 2**0.5, 0, -1 / 2**0.5), distance=1.0)
    color, error = picture(scene, view, 4, 4, **OFF)
    tint = np.array([0.9, 0.6, 0.3])
    np.testing.assert_allclose(color[..., :3], np.broadcast_to(tint * EMITTED, (4, 4, 3)), rtol=1e-5)
    assert error.max() < 1e-6 and (color[..., 3] == 1.0).all()


@pytest.mark.parametrize("angle", [0.0, 30.0, 75.0])
def test_a_slab_of_glass_lets_through_what_fresnel_says(angle):
    """(1 - R)² (1 + R² + R⁴ + R⁶): three pairs of reflections inside fit into 8 bounces."""
    scene = wr.Scene()
    points, faces = scenes.cube(1.0)
    scene.add_mesh("/slab", points * (40, 40, 0.1), faces, material=wr.Dielectric(ior=1.5))
    scene.add_mesh("/lamp", *scenes.quad(90.0, -1.0), material=LAMP)
    view = looking_along((np.sin(np.radians(angle)), 0, -np.cos(np.radians(angle))))
    color, error = picture(scene, view, 4, 4, **OFF)
    r = fresnel(np.cos(np.radians(angle)), 1.5)
    expected = (1 - r) ** 2 * (1 + r**2 + r**4 + r**6) * EMITTED
    np.testing.assert_allclose(color[..., :3], np.broadcast_to(expected, (4, 4, 3)), rtol=2e-5)
    assert error.max() < 1e-4


def test_a_prism_reflects_all_inside():
    """A right-angled prism turns the view by 90°: 45° is beyond the critical angle of 41.8°."""
    scene = wr.Scene()
    section = np.array([(-1, -1), (1, -1), (-1, 1)], float)
    points = np.concatenate([np.insert(section, 1, y, axis=1) for y in (-1.0, 1.0)])
    # In the XZ plane: legs on x = -1 and z = -1, the long side x + z = 0; seen from -X, the lamp lies below.
    faces = [[0, 1, 2], [5, 4, 3], [0, 3, 4, 1], [1, 4, 5, 2], [2, 5, 3, 0]]
    scene.add_mesh("/prism", points, faces, material=wr.Dielectric(ior=1.5))
    normals = [np.cross(points[f[1]] - points[f[0]], points[f[2]] - points[f[0]]) for f in faces]
    centre = points.mean(0)
    assert all(n @ (points[f].mean(0) - centre) > 0 for n, f in zip(normals, faces, strict=True))
    scene.add_mesh("/lamp", *scenes.quad(50.0, -3.0), material=LAMP)
    view = scenes.window(0.05, eye=(-5, 0, -0.5), target=(0, 0, -0.5))
    color, _ = picture(scene, view, 4, 4, **OFF)
    r = fresnel(1.0, 1.5)
    expected = (1 - r) ** 2 * (1 + r**2) * EMITTED
    np.testing.assert_allclose(color[..., :3], np.broadcast_to(expected, (4, 4, 3)), rtol=2e-5)


def test_shadows_and_rough_lobes_are_those_of_direct():
    scene = wr.Scene()
    scene.add_mesh("/floor", *scenes.quad(4.0), color=(0.5, 0.4, 0.3))
    scene.add_mesh("/roof", *scenes.quad(0.7, 0.5), material=wr.PreviewSurface(roughness=0.5))
    scene.add_light(wr.SphereLight(radius=0.3, intensity=5.0), pose=scenes.look_at((0.5, 0.3, 2)))
    view = scenes.camera((0, -3, 3))
    a, _ = picture(scene, view, 24, 4, transport="direct")
    b, _ = picture(scene, view, 24, 4, transport="whitted")
    np.testing.assert_array_equal(a, b)


def balls():
    """Glass and mirrors around emission alone: path tracing has nothing to scatter that Whitted leaves out."""
    scene = wr.Scene()
    scene.add_sphere("/glass", 0.8, material=wr.Dielectric(attenuationColor=(0.5, 0.8, 0.9), attenuationDistance=1.0))
    mirror = wr.PreviewSurface(diffuseColor=(0.9, 0.8, 0.7), metallic=1.0, roughness=0.0)
    scene.add_sphere("/mirror", 0.6, material=mirror, pose=(1.2, 0.3, -1.2, 0, 0, 0, 1))
    pane = wr.PreviewSurface(opacity=0.3, roughness=0.0, diffuseColor=(0,) * 3)
    scene.add_mesh("/pane", *scenes.quad(1.0, 1.2), material=pane)
    for i, x in enumerate((-3, -1, 1)):
        points = np.array([(x, -1, -4), (x + 1, -1, -4), (x + 1, -1, 4), (x, -1, 4)])
        scene.add_mesh(f"/stripe{i}", points, [[3, 2, 1, 0]], material=LAMP)
    return scene, scenes.camera((0, 1.5, 5))


def test_perfect_lobes_are_those_of_path_tracing():
    """By blocks of 6 × 6 pixels: what path tracing seldom draws in a pixel it draws often enough in a block."""
    scene, view = balls()
    a, a_error = picture(scene, view, 24, 256, **OFF)
    b, b_error = picture(scene, view, 24, 4096, transport="path", bounces=8, camera_light="off", seed=1)

    def blocks(values):
        return values.reshape(4, 6, 4, 6, -1).sum((1, 3))

    spread = np.sqrt(blocks(a_error**2 + b_error**2))
    z = (blocks(a[..., :3]) - blocks(b[..., :3]))[spread > 1e-6] / spread[spread > 1e-6]
    assert z.size > 24 and np.abs(z).max() < 4.5
    np.testing.assert_allclose(a[..., 3].mean(), b[..., 3].mean(), atol=0.01)
    assert b_error.mean() < 0.01 * b.mean()


def test_rays_without_room_are_counted():
    """Panes that mirror: each leaves a ray that waits while the view goes on."""
    pane = wr.PreviewSurface(opacity=0.0, roughness=0.0)
    for many, full in ((12, False), (24, True)):
        scene = wr.Scene()
        for i in range(many):
            scene.add_mesh(f"/pane{i}", *scenes.quad(4.0, -0.1 * i), material=pane)
        renderer = prepare(scene, scenes.window(1.0), 4, transport="whitted", bounces=0)
        stats = renderer.render(samples=1).stats
        assert (stats["unfollowed rays"] > 0) == full
        assert not full or stats["unfollowed rays"] == 16 * (many - 16)


def test_a_plans_own_kernel_is_the_one_with_every_effect():
    scene, view = balls()
    own = wr.Renderer(scene, view, (24, 24), **OFF).render(samples=4)
    general = prepare(scene, view, 24, sampler="sobol", threads=1, **OFF).render(samples=4)
    np.testing.assert_array_equal(own.numpy("color"), general.numpy("color"))
    assert own.stats["rays"] == general.stats["rays"]
    assert own.stats["plan"]["bounds"] == {"bounces": 8}


def nested_glass():
    """Three spheres of glass in each other about a mirror, in a white furnace: each point reads 1 in the end."""
    scene = wr.Scene()
    for number, radius in enumerate((1.0, 0.8, 0.6)):
        scene.add_sphere(f"/glass{number}", radius, material=wr.Dielectric())
    mirror = wr.PreviewSurface(metallic=1.0, roughness=0.0, diffuseColor=scenes.WHITE)
    scene.add_sphere("/mirror", 0.3, material=mirror)
    scene.add_light(wr.DomeLight())
    return scene, scenes.window(0.4)


def test_more_bounces_bring_more_light_and_no_more_rays_than_can_be_followed():
    """2^100 rays would end in darkness: those that weigh something must come first, and all of them."""
    scene, view = nested_glass()
    means, cut = [], []
    for bounces in (2, 8, 30, 100):
        frame = prepare(scene, view, 6, transport="whitted", bounces=bounces).render(samples=1)
        means.append(frame.numpy("color")[..., :3].mean())
        cut.append(frame.stats["unfollowed rays"] / 36)
        assert frame.stats["rays"]["bounce"] / 36 < 4096
    assert means[0] < means[1] < means[2] <= means[3] <= 1.0 + 1e-5
    # What is cut weighs 1e-4 at most, and radiance is 1.
    assert means[3] > 1.0 - 1e-4 * cut[3] - 1e-3
    assert cut[0] == cut[1] == 0.0
