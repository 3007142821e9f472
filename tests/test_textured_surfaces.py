"""Textures on surfaces: cut-outs, clear parts and their shadows, normal maps, and pictures from afar."""

import numpy as np
import pytest
import scenes
from pictures import outputs, picture

import warprender as wr
from warprender.scene import Scene

ST = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
MATT = {"useSpecularWorkflow": 1, "roughness": 1.0}


def textured_quad(material, st=ST, size=2.0, pose=None, light=None) -> Scene:
    scene = wr.Scene()
    scene.add_mesh("/quad", *scenes.quad(size), material=material, st=st, pose=pose)
    if light is not None:
        scene.add_light(light)
    return scene


def row(*values) -> np.ndarray:
    """A picture of one row of greys."""
    return np.array(values, np.float32).reshape(1, -1, 1)


def test_pictures_lie_the_right_way_up_on_surfaces():
    corners = np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 1, 1]]], np.float32)
    scene = textured_quad(wr.PreviewSurface(diffuseColor=wr.Texture(corners, wrapS="clamp", wrapT="clamp"), **MATT))
    albedo = outputs(scene, scenes.window(2.0), ("albedo",), 8)["albedo"]
    np.testing.assert_allclose(albedo[[0, 0, -1, -1], [0, -1, 0, -1]], [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)])


def test_primvars_feed_inputs():
    scene = textured_quad(wr.PreviewSurface(diffuseColor=wr.PrimvarReader("st", (1, 1, 1)), **MATT))
    albedo = outputs(scene, scenes.window(2.0), ("albedo",), 4)["albedo"]
    np.testing.assert_allclose(albedo[:, :, 0], np.tile([0.125, 0.375, 0.625, 0.875], (4, 1)), atol=1e-6)
    scene = textured_quad(wr.PreviewSurface(diffuseColor=wr.PrimvarReader("paint", (1, 0.5, 0.25)), **MATT))
    np.testing.assert_allclose(outputs(scene, scenes.window(2.0), ("albedo",), 1)["albedo"][0, 0], (1, 0.5, 0.25))


def test_a_distant_chequer_is_grey_at_one_sample():
    chequer = np.kron([[0, 1] * 4, [1, 0] * 4] * 4, np.ones((8, 8))).astype(np.float32)[..., None]
    wraps = {"wrapS": "repeat", "wrapT": "repeat"}
    scene = wr.Scene()
    points, faces = scenes.quad(2000.0)
    scene.add_mesh(
        "/floor", points, faces, wr.PreviewSurface(diffuseColor=wr.Texture(chequer, **wraps), **MATT), st=ST * 2000
    )
    camera = scenes.camera((0, -900, 20), (0, -700, 0), up=(0, 0, 1), fov=30)
    albedo = outputs(scene, camera, ("albedo", "cameraDepth"), 64)
    far = albedo["cameraDepth"] > 60
    assert far.sum() > 500
    np.testing.assert_allclose(albedo["albedo"][far], 0.5, atol=0.02)


@pytest.mark.parametrize("threshold, seen", [(0.0, 0.5), (0.25, 1.0), (0.5, 1.0), (0.51, 0.0)])
def test_a_cut_out_is_there_from_its_threshold_on(threshold, seen):
    # 1 · 0.75 - 0.25: the threshold is compared after scale and bias.
    opacity = wr.Texture(row(1.0), "r", "clamp", "clamp", scale=(0.75,) * 4, bias=(-0.25,) * 4)
    look = wr.PreviewSurface(emissiveColor=(1, 1, 1), opacity=opacity, opacityThreshold=threshold, **MATT)
    look.opacityMode = "presence"
    color, _ = picture(textured_quad(look), scenes.window(1.0), 8, 64, camera_light="off")
    assert color[..., 3].mean() == pytest.approx(seen, abs=1e-6 if threshold else 0.05)
    assert color[..., 0].mean() == pytest.approx(seen, abs=0.01 if threshold else 0.05)


@pytest.mark.parametrize(
    "opacities, threshold, shadow", [((1, 0), 0.5, (0, 1)), ((1, 0.25), 0.0, (0, 0.75)), ((0.5, 0.5), 0.0, (0.5, 0.5))]
)
def test_shadow_rays_pass_the_clear_parts_of_a_texture(opacities, threshold, shadow):
    opacity = wr.Texture(row(*opacities), "r", "clamp", "clamp")
    veil = wr.PreviewSurface(
        diffuseColor=(0, 0, 0), opacity=opacity, opacityThreshold=threshold, opacityMode="presence", **MATT
    )
    scene = wr.Scene()
    scene.add_mesh("/floor", *scenes.quad(2.0), color=scenes.WHITE)
    scene.add_mesh("/veil", *scenes.quad(2.0, 1.0), material=veil, st=ST)
    # A parallel light straight down; the camera looks in below the veil.
    scene.add_light(wr.DistantLight(intensity=np.pi, angle=0.0, normalize=True))
    camera = scenes.window(0.1, (-0.5, -4, 2), (-0.5, 0, 0), up=(0, 0, 1))
    for side, expected in zip((-0.75, 0.75), shadow, strict=True):
        camera.transform = scenes.look_at((side, -4, 1.0), (side, -0.4, 0), (0, 0, 1))
        color, _ = picture(scene, camera, 4, 16, bounces=0)
        np.testing.assert_allclose(color[..., 0].mean(), expected, atol=0.01)


TILTED = (0.6, 0.0, 0.8)


def normal_picture(normal) -> wr.Texture:
    """A map of one normal, stored as 0 … 1."""
    stored = (np.array(normal, np.float32).reshape(1, 1, 3) + 1) / 2
    return wr.Texture(stored, wrapS="repeat", wrapT="repeat", scale=(2, 2, 2, 1), bias=(-1, -1, -1, 0))


FRAMES = {
    "plain": (ST, np.eye(4), (0.6, 0, 0.8)),
    "mirrored picture": (ST * (-1, 1), np.eye(4), (-0.6, 0, 0.8)),
    "turned picture": (ST[[3, 0, 1, 2]], np.eye(4), (0, 0.6, 0.8)),
    "stretched": (ST, np.diag([3.0, 1, 1, 1]), (0.6, 0, 0.8)),
    "mirrored object": (ST, np.diag([-1.0, 1, 1, 1]), (-0.6, 0, 0.8)),
}


@pytest.mark.parametrize("frame", FRAMES)
def test_a_mapped_normal_leans_along_the_picture(frame):
    st, pose, expected = FRAMES[frame]
    scene = textured_quad(wr.PreviewSurface(normal=normal_picture(TILTED)), st, pose=pose)
    normal = outputs(scene, scenes.window(1.0), ("normal",), 2)["normal"]
    np.testing.assert_allclose(normal, np.broadcast_to(expected, normal.shape), atol=1e-6)


@pytest.mark.parametrize("pose", [np.eye(4), np.diag([-1.0, 1, 1, 1])], ids=["plain", "mirrored object"])
def test_the_second_tangent_follows_t(pose):
    scene = textured_quad(wr.PreviewSurface(normal=normal_picture((0, 0.6, 0.8))), pose=pose)
    normal = outputs(scene, scenes.window(1.0), ("normal",), 1)["normal"][0, 0]
    np.testing.assert_allclose(normal, (0, 0.6, 0.8), atol=1e-6)


def test_scale_and_bias_turn_the_green_channel_round():
    flipped = normal_picture((0, 0.6, 0.8))
    flipped.scale, flipped.bias = (2, -2, 2, 1), (-1, 1, -1, 0)
    scene = textured_quad(wr.PreviewSurface(normal=flipped))
    np.testing.assert_allclose(
        outputs(scene, scenes.window(1.0), ("normal",), 1)["normal"][0, 0], (0, -0.6, 0.8), atol=1e-6
    )


def test_the_other_side_has_the_mirrored_normal():
    scene = textured_quad(wr.PreviewSurface(normal=normal_picture(TILTED)))
    below = scenes.window(1.0, (0, 0, -5))
    normal = outputs(scene, below, ("normal",), 1)["normal"][0, 0]
    np.testing.assert_allclose(normal, (-0.6, 0, -0.8), atol=1e-6)


def test_a_normal_map_looks_like_the_bump_that_it_was_taken_from():
    # z = a sin(k x) cos(k y) over a unit square, as a fine mesh and as a map of its slopes on a flat square.
    a, k, n = 0.02, 2 * np.pi, 128
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    heights = a * np.sin(k * x) * np.cos(k * y)

    def normals(x, y):
        slope = np.stack([-a * k * np.cos(k * x) * np.cos(k * y), a * k * np.sin(k * x) * np.sin(k * y), x * 0 + 1], -1)
        return slope / np.linalg.norm(slope, axis=-1, keepdims=True)

    corner = np.arange(n * (n + 1)).reshape(n, n + 1)[:, :-1].reshape(-1, 1)
    bumps = wr.Scene()
    points = np.stack([x - 0.5, y - 0.5, heights], -1).reshape(-1, 3)
    bumps.add_mesh("/bump", points, corner + [0, 1, n + 2, n + 1], normals=normals(x, y).reshape(-1, 3))
    middles = (np.arange(n) + 0.5) / n
    stored = (normals(*np.meshgrid(middles, middles))[::-1].astype(np.float32) + 1) / 2
    mapped = textured_quad(
        wr.PreviewSurface(
            normal=wr.Texture(stored, wrapS="repeat", wrapT="repeat", scale=(2, 2, 2, 1), bias=(-1, -1, -1, 0))
        ),
        size=1.0,
    )
    camera = scenes.window(1.0)
    there, here = (outputs(scene, camera, ("normal",), 64)["normal"] for scene in (bumps, mapped))
    np.testing.assert_allclose(here, there, atol=2e-3)


def test_tangents_are_smooth_over_smooth_surfaces():
    # On a cylinder with st around it, a normal leaning along s is the normal of a turned cylinder: no facets.
    n = 24
    angle = np.arange(n + 1) * (np.pi / n)
    ring = np.stack([-np.cos(angle), np.zeros(n + 1), np.sin(angle)], 1)
    points = np.concatenate([ring - (0, 1, 0), ring + (0, 1, 0)])
    first = np.arange(n)[:, None]
    st = np.concatenate([np.stack([angle, angle * 0], 1), np.stack([angle, angle * 0 + 1], 1)])
    scene = wr.Scene()
    look = wr.PreviewSurface(normal=normal_picture((0.28, 0.0, 0.96)))
    scene.add_mesh(
        "/tube", points, first + [0, 1, n + 2, n + 1], material=look, normals=np.concatenate([ring, ring]), st=st
    )
    found = outputs(scene, scenes.window(1.2), ("normal", "position"), 32)
    around = np.arctan2(found["position"][..., 2], found["position"][..., 0]) - np.arctan2(0.28, 0.96)
    expected = np.stack([np.cos(around), around * 0, np.sin(around)], -1)
    np.testing.assert_allclose(found["normal"], expected, atol=3e-3)


def test_surfaces_without_coordinates_keep_their_normal():
    scene = wr.Scene()
    scene.add_mesh("/quad", *scenes.quad(2.0), material=wr.PreviewSurface(normal=normal_picture(TILTED)))
    scene.add_sphere("/ball", material=wr.PreviewSurface(normal=normal_picture(TILTED)), pose=(9, 0, 0, 0, 0, 0, 1))
    for x in (0, 9):
        camera = scenes.window(0.01, (x, 0, 5), (x, 0, 0))
        normal = outputs(scene, camera, ("normal",), 1)["normal"][0, 0]
        np.testing.assert_allclose(normal, (0, 0, 1), atol=1e-3)


def test_the_plan_names_the_inputs_that_vary():
    look = wr.PreviewSurface(diffuseColor=wr.Texture(row(1.0)), roughness=wr.PrimvarReader("gloss"))
    look.normal, look.opacityThreshold = normal_picture(TILTED), 0.5
    plan = wr.Renderer(textured_quad(look), scenes.window(1.0), (4, 4)).plan
    for name in ("texture diffuseColor", "primvar roughness", "texture normal", "cut-out"):
        assert plan.reasons[name] == "/quad"
    assert plan.path.features == ("normal map", "primvar", "texture") and not plan.path.straight_through
    plain = wr.Renderer(textured_quad(wr.PreviewSurface()), scenes.window(1.0), (4, 4)).plan
    assert plain.path.features == () and {"texture", "primvar", "normal map", "cut-out"} <= set(plain.absent)


@pytest.mark.parametrize("opacities, through", [((1, 1), False), ((1, 0.99), True)])
def test_opacity_textures_call_for_clear_surfaces_by_their_values(opacities, through):
    look = wr.PreviewSurface(opacity=wr.Texture(row(*opacities), "r", "clamp", "clamp"))
    assert wr.Renderer(textured_quad(look), scenes.window(1.0), (4, 4)).plan.path.straight_through == through
