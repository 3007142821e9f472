"""A plan's own kernel and the one with every effect compiled in draw the same picture, bit for bit on the CPU."""

import numpy as np
import pytest
import scenes
from brdf_tables import lobes

import warprender as wr
from warprender.plan import everything


def mesh_under_a_rect_light():
    scene = wr.Scene()
    scene.add_mesh("/box", *scenes.cube(1.0), color=(0.7, 0.5, 0.3))
    ground = np.array([(-3, -0.5, 3), (3, -0.5, 3), (3, -0.5, -3), (-3, -0.5, -3)])
    scene.add_mesh("/ground", ground, [[0, 1, 2, 3]], color=(0.6,) * 3)
    scene.add_light(wr.RectLight(intensity=5.0), pose=scenes.look_at((1, 2, 1)))
    return scene, scenes.camera((2, 2, 4))


def glossy_spheres_in_a_dome():
    scene = wr.Scene()
    coat = wr.PreviewSurface(diffuseColor=(0.6, 0.1, 0.1), clearcoat=1.0, clearcoatRoughness=0.0, roughness=0.4)
    scene.add_sphere("/left", 0.8, material=coat, pose=(-0.9, 0, 0, 0, 0, 0, 1))
    scene.add_sphere("/right", 0.8, material=wr.PreviewSurface(metallic=1, roughness=0.2), pose=(0.9, 0, 0, 0, 0, 0, 1))
    scene.add_light(wr.DomeLight(intensity=0.7))
    return scene, scenes.window(4.0)


def glass_through_a_lens():
    scene = wr.Scene()
    points, faces = scenes.icosphere(2)
    scene.add_mesh("/glass", points, faces, normals=points, material=wr.PreviewSurface(opacity=0.3, roughness=0.1))
    scene.add_sphere("/ball", 0.5, color=(0.2, 0.7, 0.4), pose=(0, 0, -2, 0, 0, 0, 1))
    scene.add_light(wr.SphereLight(radius=0.3, intensity=9.0), pose=(2, 2, 2, 0, 0, 0, 1))
    scene.add_light(wr.DistantLight(intensity=500.0, angle=5.0))
    return scene, scenes.camera((0, 0, 5), focusDistance=4.0, fStop=8.0)


def textures_under_the_camera_light():
    noise = np.random.default_rng(0).random((16, 16, 4)).astype(np.float32)
    wraps = {"wrapS": "repeat", "wrapT": "mirror"}
    look = wr.PreviewSurface(
        diffuseColor=wr.Texture(noise, **wraps),
        roughness=wr.Texture(noise, "g", **wraps),
        opacity=wr.Texture(noise, "a", **wraps),
        normal=wr.Texture(noise, scale=(1, 1, 1, 1), bias=(-0.5, -0.5, 0.5, 0), **wraps),
    )
    scene = wr.Scene()
    points, faces = scenes.quad(4.0)
    scene.add_mesh("/near", points, faces, material=look, st=points[:, :2])
    scene.add_mesh("/far", points - (0, 0, 1), faces, material=wr.PreviewSurface(metallic=1.0))
    return scene, scenes.camera((0, -3, 2))


def a_measured_ball_under_a_lamp():
    scene = wr.Scene()
    scene.add_sphere("/ball", material=wr.MeasuredBRDF(lobes()))
    scene.add_light(wr.SphereLight(radius=0.5, intensity=9.0), pose=(2, 2, 2, 0, 0, 0, 1))
    scene.add_light(wr.DomeLight(intensity=0.3))
    return scene, scenes.camera((0, 0, 5))


def coloured_glass_around_a_lamp():
    scene = wr.Scene()
    amber = {"attenuationColor": (0.9, 0.6, 0.2), "attenuationDistance": 0.5}
    scene.add_sphere("/smooth", 0.8, material=wr.Dielectric(**amber), pose=(-0.9, 0, 0, 0, 0, 0, 1))
    scene.add_mesh("/rough", *scenes.cube(1.0), material=wr.Dielectric(roughness=0.5), pose=(0.9, 0, 0, 0, 0, 0, 1))
    points, faces = scenes.quad(3.0, -1.0)
    scene.add_mesh("/behind", points, faces, color=(0.5, 0.7, 0.6))
    scene.add_light(wr.SphereLight(radius=0.4, intensity=9.0), pose=(0, 2, 2, 0, 0, 0, 1))
    scene.add_light(wr.SphereLight(radius=0.2, intensity=5.0), pose=(-0.9, 0, 0, 0, 0, 0, 1))
    return scene, scenes.camera((0, 0, 5))


BUILDERS = (
    mesh_under_a_rect_light,
    glossy_spheres_in_a_dome,
    glass_through_a_lens,
    textures_under_the_camera_light,
    a_measured_ball_under_a_lamp,
    coloured_glass_around_a_lamp,
)


@pytest.mark.parametrize("build", BUILDERS)
def test_specialised_is_everything(build):
    scene, view = build()
    renderer = wr.Renderer(scene, view, (48, 48))
    own, all_effects = renderer.plan.path, everything()
    assert own != all_effects
    for field in ("shapes", "materials", "lights", "camera", "features"):
        assert set(getattr(own, field)) <= set(getattr(all_effects, field))
    special = renderer.render(samples=16)
    renderer.plan.path = all_effects
    general = renderer.render(samples=16)
    assert special.numpy("color")[..., :3].mean() > 0.01
    np.testing.assert_array_equal(special.numpy("color"), general.numpy("color"))
    assert special.stats["rays"] == general.stats["rays"]
