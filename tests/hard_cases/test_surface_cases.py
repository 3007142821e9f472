"""Cases S2 and S4 to S7 of the catalogue of hard cases, and U8 for the pictures of materials.

S1, S3 and S9 are in `tests/test_materials.py`, S8 in `tests/test_sampling.py`, S10 in `tests/test_pictures.py`, further
furnaces for S5 in `tests/test_pictures_furnace.py` and `tests/test_energy_compensation.py`.
"""

import numpy as np
import pytest
import scenes
from bsdfs import SCATTER, evaluated, hemisphere, sampled, towards, weights
from pictures import outputs, picture

import warprender as wr
from warprender.checks import check
from warprender.textures import Texture

#: Roughnesses from a mirror to the widest lobe.
ROUGHNESSES = (0.0, 1e-3, 0.05, 0.3, 1.0)
LOBES = {
    "metal": {"diffuseColor": (1.0, 1.0, 1.0), "metallic": 1.0},
    "dielectric": {"diffuseColor": (1.0, 1.0, 1.0)},
    "specular workflow": {"diffuseColor": (1.0, 1.0, 1.0), "useSpecularWorkflow": 1, "specularColor": (0.5, 0.5, 0.5)},
    "coat": {"diffuseColor": (1.0, 1.0, 1.0), "clearcoat": 1.0},
}


def lobe(name, roughness):
    look = {**LOBES[name], "roughness": roughness}
    return wr.PreviewSurface(**look, **({"clearcoatRoughness": roughness} if name == "coat" else {}))


@pytest.mark.parametrize("roughness", [1e-3, 1e-2])
@pytest.mark.parametrize("cosine", [1.0, 0.6, 0.1])
def test_s2_small_roughness_is_a_mirror_in_the_limit(roughness, cosine):
    tint = (0.9, 0.6, 0.3)
    samples = sampled(wr.PreviewSurface(diffuseColor=tint, metallic=1.0, roughness=roughness), towards(cosine))
    mirror = sampled(wr.PreviewSurface(diffuseColor=tint, metallic=1.0, roughness=0.0), towards(cosine))
    np.testing.assert_allclose(weights(samples).mean(0), weights(mirror).mean(0), rtol=1e-2)
    reflected = mirror["direction"][0].astype(float)
    angle = np.arccos(np.clip(samples["direction"] @ reflected, -1, 1))
    # The facets' slopes have the scale alpha; a reflection turns twice as far.
    assert np.median(angle) < 4 * roughness**2 + 1e-3


@pytest.mark.parametrize("cosine", [1.0, 0.5, 1e-3, 1e-6])
def test_s4_an_index_of_one_reflects_nothing_head_on_and_never_more_than_all(cosine):
    look = wr.PreviewSurface(diffuseColor=(0.0, 0.0, 0.0), ior=1.0, roughness=0.0)
    share = weights(sampled(look, towards(cosine), 1 << 10)).mean(0)
    # Schlick's term, which the specification names: (1 - cos)^5 for F0 = 0.
    np.testing.assert_allclose(share, (1 - cosine) ** 5, atol=1e-5)


@pytest.mark.parametrize("roughness", ROUGHNESSES)
@pytest.mark.parametrize("name", LOBES)
def test_s5_every_lobe_gives_at_most_what_arrives(name, roughness):
    for cosine in (1.0, 0.5, 0.1):
        share = weights(sampled(lobe(name, roughness), towards(cosine), 1 << 14)).mean(0)
        assert (share < 1.01).all() and (share > 0.3).all()
        if name == "metal" and roughness < 0.1:
            np.testing.assert_allclose(share, 1.0, atol=5e-3)


@pytest.mark.parametrize("roughness", ROUGHNESSES[2:])
@pytest.mark.parametrize("name", LOBES)
def test_s5_every_lobe_is_reciprocal(name, roughness):
    a, b = hemisphere(2048, 5), hemisphere(2048, 6)
    there, back = (evaluated(lobe(name, roughness), *pair) for pair in ((a, b), (b, a)))
    for part in ("diffuse", "specular"):
        np.testing.assert_allclose(there[part] / b[:, 2:], back[part] / a[:, 2:], rtol=3e-3, atol=1e-6)


@pytest.mark.parametrize("roughness", ROUGHNESSES[2:])
@pytest.mark.parametrize("name", LOBES)
def test_s5_weights_are_bounded(name, roughness):
    samples = sampled(lobe(name, roughness), towards(0.3))
    scattered = weights(samples)[samples["event"] == SCATTER]
    assert np.isfinite(scattered).all() and scattered.max() < 4


def coarse_sphere():
    """A unit sphere of 12 × 6 quads with smooth normals."""
    theta, phi = np.meshgrid(np.linspace(0, np.pi, 7), np.arange(12) * np.pi / 6, indexing="ij")
    points = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), -np.sin(theta) * np.sin(phi)], -1).reshape(-1, 3)
    faces = [
        (12 * i + j, 12 * (i + 1) + j, 12 * (i + 1) + (j + 1) % 12, 12 * i + (j + 1) % 12)
        for i in range(6)
        for j in range(12)
    ]
    return points.astype(np.float32), faces


def test_s6_no_light_on_faces_that_are_turned_away_and_none_missing_on_the_others():
    points, faces = coarse_sphere()
    scene = wr.Scene()
    mesh = scene.add_mesh("/ball", points, faces, normals=points, color=(1.0, 1.0, 1.0))
    # The camera looks along -Z; light comes from 5 degrees behind the sphere's silhouette.
    towards_light = np.array([np.cos(np.radians(5)), 0.2, np.sin(np.radians(5))])
    towards_light /= np.linalg.norm(towards_light)
    pose = np.eye(4)
    z = towards_light
    x = np.cross([0, 1, 0], z) / np.linalg.norm(np.cross([0, 1, 0], z))
    pose[:3, :3] = [x, np.cross(z, x), z]
    scene.add_light(wr.DistantLight(angle=0.0, intensity=np.pi), pose=pose)
    camera = scenes.camera((0, 0, 4), fov=35)
    color, _ = picture(scene, camera, 48, 16, bounces=0)
    seen = outputs(scene, camera, ("elementId", "normal"), 48)
    assert np.isfinite(color).all()
    corners = points[mesh.triangles].astype(float)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = np.full(72, -np.inf)
    np.maximum.at(facing, mesh.faces, normals @ towards_light)
    face = seen["elementId"]
    # Pixels that see one face alone: as do all of their neighbours.
    whole = face >= 0
    for step in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        whole &= np.roll(face, step, (0, 1)) == face
    smooth = seen["normal"] @ towards_light
    away = whole & (facing[face] <= 0)
    assert away.sum() > 50 and not color[away, :3].any()
    lit = whole & (facing[face] > 0) & (smooth > 0.1)
    # Lambert of the smooth normal: no face that looks towards the light lies in the shadow of another.
    assert lit.sum() > 50
    np.testing.assert_allclose(color[lit, 0], smooth[lit], atol=0.06)


@pytest.mark.parametrize(
    "normal",
    [(0, 0, 0), (np.nan, 0, 1), (np.inf, 0, 0), (1e-30, 0, 1e-30), (1e30, 0, 1e30), (0, 0, -1)],
    ids=["zero", "nan", "inf", "tiny", "huge", "reversed"],
)
def test_s7_bad_normals_light_as_the_surface_itself(normal):
    points = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float32)
    scene = wr.Scene()
    scene.add_mesh("/wall", points, [[0, 1, 2, 3]], normals=np.tile(np.float32(normal), (4, 1)), color=(0.5,) * 3)
    scene.add_light(wr.DistantLight(angle=0.0, intensity=np.pi))
    color, _ = picture(scene, scenes.camera((0, 0, 3), fov=20), 4, 16)
    cosine = np.sqrt(0.5) if np.isfinite(normal).all() and normal[0] else 1.0
    np.testing.assert_allclose(color[..., 0], 0.5 * cosine, rtol=2e-6)


def textured(picture_of):
    points = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float32)
    texture = Texture(picture_of, wrapS="clamp", wrapT="clamp", fallback=(0.0, 0.25, 0.0, 1.0), sourceColorSpace="raw")
    look = wr.PreviewSurface(diffuseColor=(0, 0, 0), emissiveColor=texture, ior=1.0)
    scene = wr.Scene()
    scene.add_mesh("/wall", points, [[0, 1, 2, 3]], look, st=(points[:, :2] + 1) / 2)
    return scene


@pytest.mark.parametrize("kind", ["distant", "small sphere"])
def test_s10_a_mirror_reflects_no_light_that_only_aiming_finds(kind):
    mirror = wr.PreviewSurface(diffuseColor=(1, 1, 1), metallic=1.0, roughness=0.0)
    points = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float32)
    scene = wr.Scene()
    scene.add_mesh("/wall", points, [[0, 1, 2, 3]], mirror)
    towards_lamp = np.eye(4)
    towards_lamp[3, :3] = 0.3, 0.2, 2.5
    light = wr.DistantLight(angle=0.0) if kind == "distant" else wr.SphereLight(radius=1e-7, intensity=1e12)
    scene.add_light(light, pose=towards_lamp)
    color, error = picture(scene, scenes.camera((0, 0, 3), fov=20), 8, 16)
    assert np.isfinite(color).all() and np.isfinite(error).all()
    assert color[..., :3].max() == 0


@pytest.mark.parametrize("size", [(1, 1), (1, 16384), (16384, 1)])
def test_u8_pictures_of_one_texel_or_row(size):
    pixels = np.full((*size, 3), (0.25, 0.5, 1.0), np.float32)
    color, _ = picture(textured(pixels), scenes.camera((0, 0, 3), fov=20), 4, 4)
    np.testing.assert_allclose(color[..., :3], np.broadcast_to((0.25, 0.5, 1.0), (4, 4, 3)), rtol=1e-6)


@pytest.mark.parametrize("content", [None, b"", b"\x89PNG\r\n\x1a\n", b"not a picture"])
def test_u8_pictures_that_are_missing_or_broken_leave_their_fallback(tmp_path, content):
    file = tmp_path / "bad.png"
    if content is not None:
        file.write_bytes(content)
    scene = textured(str(file))
    color, _ = picture(scene, scenes.camera((0, 0, 3), fov=20), 4, 4)
    np.testing.assert_allclose(color[..., :3], np.broadcast_to((0.0, 0.25, 0.0), (4, 4, 3)), atol=1e-6)
    assert check(scene) == [] or "bad.png" in str(check(scene)[0])
