"""Phong's model, I = Σ (k_a + k_d (l·n) + k_s (r·v)^α) L, at pixel centres against float64."""

import numpy as np
import pytest
import scenes
from pictures import mean_and_error, picture
from usd_stage import scene_of

import warprender as wr

SIZE = 24
LOOK = {"ambientColor": (0.1, 0.2, 0.05), "diffuseColor": (0.5, 0.3, 0.7), "specularColor": (0.4, 0.6, 0.2)}
STAGE = """
def Camera "camera" {
    token projection = "perspective"
    float horizontalAperture = 20
    float verticalAperture = 20
    float focalLength = 20
    float2 clippingRange = (0.01, 1000)
    double3 xformOp:translate = (0.3, -0.2, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Material "look" {
    token outputs:surface.connect = </look/shader.outputs:surface>
    def Shader "shader" {
        uniform token info:id = "warprender:Phong"
        color3f inputs:ambientColor = (0.1, 0.2, 0.05)
        color3f inputs:diffuseColor = (0.5, 0.3, 0.7)
        color3f inputs:specularColor = (0.4, 0.6, 0.2)
        float inputs:exponent = %EXPONENT
        token outputs:surface
    }
}
def Mesh "floor" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)]
    uniform token subdivisionScheme = "none"
    rel material:binding = </look>
}
def DistantLight "sun" {
    float inputs:angle = 0
    float inputs:intensity = 1.5
    color3f inputs:color = (1, 0.5, 0.25)
    float3 xformOp:rotateXYZ = (-20, 35, 10)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
}
"""


def from_usd(exponent):
    scene = scene_of(STAGE.replace("%EXPONENT", str(exponent)))
    (light,) = scene.lights.values()
    return scene, "/camera", -np.asarray((0, 0, -1.0)) @ light.transform[:3, :3]


def from_python(exponent):
    scene = wr.Scene()
    scene.add_mesh("/floor", *scenes.quad(4.0), material=wr.Phong(**LOOK, exponent=exponent))
    towards = np.array([0.3, 0.4, 0.8])
    sun = wr.DistantLight(intensity=1.5, color=(1, 0.5, 0.25), angle=0.0, direction=tuple(-towards))
    scene.add_light(sun)
    return scene, scenes.camera((0.3, -0.2, 3.0), (0.3, -0.2, 0.0), fov=53.0), towards


def at_centres(scene, view, transport="local", **options):
    """Colour, position and normal of what the pixels' centres see: the first rasterized sample is there."""
    outputs = ("color", "position", "normal")
    renderer = wr.Renderer(scene, view, (SIZE, SIZE), outputs, "raster", transport, **options)
    frame = renderer.render(samples=1)
    return renderer, [frame.numpy(name).astype(np.float64) for name in outputs]


def formula(eye, position, normal, towards, exponent, look=LOOK):
    """The lecture's formula for L = 1: (H, W, 3)."""
    light = towards / np.linalg.norm(towards)
    view = (eye - position) / np.linalg.norm(eye - position, axis=-1, keepdims=True)
    cosine = normal @ light
    mirrored = 2 * cosine[..., None] * normal - light
    highlight = np.maximum((mirrored * view).sum(-1), 0) ** exponent * (cosine > 0)
    ka, kd, ks = (np.array(look[f"{name}Color"]) for name in ("ambient", "diffuse", "specular"))
    return ka + kd * np.maximum(cosine, 0)[..., None] + ks * highlight[..., None]


@pytest.mark.parametrize("build", [from_usd, from_python])
@pytest.mark.parametrize("exponent", [0.0, 1.0, 7.5, 150.0])
def test_the_lectures_formula_under_a_sun(build, exponent):
    scene, view, towards = build(exponent)
    renderer, (color, position, normal) = at_centres(scene, view)
    expected = formula(renderer.camera.transform[3, :3], position, normal, towards, exponent)
    expected *= 1.5 * np.array([1, 0.5, 0.25])
    assert not scene.warnings and (color[..., 3] == 1.0).all()
    assert exponent == 0.0 or np.ptp(expected[..., 0]) > 0.1
    np.testing.assert_allclose(color[..., :3], expected, rtol=(10 + exponent) * 2e-7)


def test_lights_add_up_and_those_behind_give_their_ambient_part():
    scene, view, towards = from_python(10.0)
    scene.add_light(wr.DistantLight(intensity=2.0, angle=0.0, direction=(0, 0, 1)))
    _, (color, position, normal) = at_centres(scene, view)
    expected = formula((0.3, -0.2, 3.0), position, normal, towards, 10.0) * 1.5 * np.array([1, 0.5, 0.25])
    np.testing.assert_allclose(color[..., :3], expected + 2.0 * np.array(LOOK["ambientColor"]), rtol=4e-6)
    # With shadows, L is the visible light: nothing comes from below.
    _, (direct, _, _) = at_centres(scene, view, "direct")
    np.testing.assert_allclose(direct[..., :3], expected, rtol=4e-6)


def test_a_dome_is_summed_over_its_directions():
    """Seen along the normal: 4π k_a + π k_d + 2π k_s / (α + 1), with shadows 2π k_a; 4.5 standard errors."""
    scene = wr.Scene()
    scene.add_mesh("/floor", *scenes.quad(4.0), material=wr.Phong((0.1,) * 3, (0.2,) * 3, (0.3,) * 3, 5.0))
    scene.add_light(wr.DomeLight())
    for transport, ambient in (("local", 4 * np.pi), ("direct", 2 * np.pi)):
        value, error = mean_and_error(*picture(scene, scenes.window(2.0), 8, 64, transport=transport))
        expected = 0.1 * ambient + 0.2 * np.pi + 0.3 * 2 * np.pi / 6
        assert abs(value - expected) < 4.5 * error + 1e-5
        assert error < 0.01 * expected


def test_path_tracing_takes_the_formula_over_pi_without_its_ambient_part():
    scene, view, towards = from_python(10.0)
    _, (color, position, normal) = at_centres(scene, view, "path", bounces=0)
    look = {**LOOK, "ambientColor": (0, 0, 0)}
    # The largest channel reflects at most 0.7 + 2 · 0.2 / 11: nothing is scaled down.
    expected = formula((0.3, -0.2, 3.0), position, normal, towards, 10.0, look) * 1.5 / np.pi * np.array([1, 0.5, 0.25])
    np.testing.assert_allclose(color[..., :3], expected, rtol=4e-6)


def test_inputs_may_be_textures():
    picture_of_two = np.array([[[0.25, 0.25, 0.25, 1.0], [0.75, 0.75, 0.75, 1.0]]], np.float32)
    scene = wr.Scene()
    points, faces = scenes.quad(4.0)
    look = wr.Phong(diffuseColor=wr.Texture(picture_of_two, wrapS="clamp", wrapT="clamp", sourceColorSpace="raw"))
    scene.add_mesh("/floor", points, faces, material=look, st=points[:, :2] / 4 + 0.5)
    scene.add_light(wr.DistantLight(intensity=1.0, angle=0.0))
    _, (color, position, _) = at_centres(scene, scenes.window(3.9))
    assert "texture diffuseColor" in wr.Renderer(scene, scenes.window(3.9), (4, 4)).plan.reasons
    np.testing.assert_allclose(color[position[..., 0] < -1.0][..., 0], 0.25, rtol=1e-5)
    np.testing.assert_allclose(color[position[..., 0] > 1.0][..., 0], 0.75, rtol=1e-5)


def test_bad_inputs_are_named():
    scene = scene_of(STAGE.replace("%EXPONENT", "nan"))
    (warning,) = scene.warnings
    assert "/look/shader" in warning and "exponent" in warning
    assert scene.materials["/look"].exponent == wr.Phong().exponent
