"""Textured domes: where a texel shines from, formats, and directions drawn in proportion to luminance."""

import numpy as np
import pytest
from chance import SIGMAS, chi_square, z_of
from light_scenes import assert_illuminance, floor, illuminance, pose
from test_lights import cosine_directions, irradiances, met, sampled

import warprender as wr
from warprender.lights import DomeLight, LightTexture, RectLight
from warprender.lights.environment import bins, to_latlong

N = 1 << 17

#: Directions of dome space, by where UsdLux puts them in a picture of latitude and longitude: column, row.
PLACES = {
    (0, 0, 1): (0.5, 0.5),
    (1, 0, 0): (0.25, 0.5),
    (-1, 0, 0): (0.75, 0.5),
    (0.001, 0, -1): (0.0, 0.5),
    (0, 1, 0.001): (0.5, 0.0),
    (0, -1, 0.001): (0.5, 1.0),
}


def colourful(height=16):
    """Texels that tell where they are: red by column, green by row; blue 1."""
    row, column = np.mgrid[0:height, 0 : 2 * height]
    return np.stack([(column + 0.5) / (2 * height), (row + 0.5) / height, np.ones_like(row)], -1).astype(np.float32)


def random_map(height=32, seed=0):
    """A picture with a bright spot, a black row and a strong tint."""
    texels = np.random.default_rng(seed).random((height, 2 * height, 3)).astype(np.float32) ** 4
    texels[5, 40] = 200.0, 150.0, 80.0
    texels[20] = 0.0
    return texels


def bilinear_sphere(texels, refine=8):
    """Radiance and directions at cells of a fine grid over the sphere, with their solid angles."""
    height, width = texels.shape[:2]
    v = (np.arange(height * refine) + 0.5) / (height * refine)
    u = (np.arange(width * refine) + 0.5) / (width * refine)
    y, x = np.clip(v * height - 0.5, 0, height - 1), u * width - 0.5
    j, i = np.floor(y).astype(int), np.floor(x).astype(int)
    t, s = (y - j)[:, None, None], (x - i)[None, :, None]
    below = np.minimum(j + 1, height - 1)
    rows = texels[j] * (1 - t) + texels[below] * t
    radiance = rows[:, i % width] * (1 - s) + rows[:, (i + 1) % width] * s
    polar, longitude = np.pi * v[:, None], np.pi * (1 - 2 * u[None])
    z, x, y = np.sin(polar) * np.cos(longitude), np.sin(polar) * np.sin(longitude), np.cos(polar) + 0 * longitude
    edges = np.cos(np.pi * np.arange(height * refine + 1) / (height * refine))
    solid = -np.diff(edges)[:, None] * 2 * np.pi / (width * refine) + 0 * x
    return radiance, np.stack([x, y, z], -1), solid


@pytest.mark.parametrize("direction", PLACES)
def test_texels_shine_from_where_usdlux_puts_them(direction):
    light = DomeLight(texture=LightTexture.of(colourful(256)))
    d = np.array(direction, float)[None] / np.linalg.norm(direction)
    radiance = met(light, (5, 6, 7), d)["radiance"][0]
    column, row = PLACES[direction]
    assert abs(radiance[1] - row) < 0.003
    # At the edge columns join: -Z is the first and the last.
    assert min(abs(radiance[0] - column), abs(radiance[0] - 0.5)) < 0.003 or direction[2] < 0


@pytest.mark.parametrize("axis", ["Y", "Z"])
def test_pole_and_rotation(axis):
    turn = np.array([(0, 0, -1), (0, 1, 0), (1, 0, 0)], float)
    light = DomeLight(texture=LightTexture.of(colourful(256)), poleAxis=axis, transform=pose((9, 9, 9), turn))
    pole = np.array([0, 1, 0] if axis == "Y" else [0, 0, 1.0]) @ turn
    middle = np.array([0, 0, 1.0] if axis == "Y" else [0, -1, 0]) @ turn
    top, centre = met(light, (0, 0, 0), np.stack([pole, middle]))["radiance"]
    assert top[1] < 0.003
    np.testing.assert_allclose(centre, (0.5, 0.5, 1.0), atol=0.003)


def test_directions_are_distributed_as_their_pdf():
    texels = random_map()
    light = DomeLight(texture=LightTexture.of(texels), transform=pose(rotation=[(0, 0, 1), (1, 0, 0), (0, 1, 0)]))
    samples = sampled(light, (1, 2, 3), N)
    local = samples["direction"].astype(float) @ np.linalg.inv(light.transform[:3, :3])
    u = 0.5 - np.arctan2(local[:, 0], local[:, 2]) / (2 * np.pi)
    v = np.arccos(np.clip(local[:, 1], -1, 1)) / np.pi
    observed, _, _ = np.histogram2d(v, u, (np.linspace(0, 1, 33), np.linspace(0, 1, 65)))
    rows, columns, density = bins(texels)
    expected = np.diff(rows)[:, None] * np.diff(columns, axis=1)
    assert chi_square(observed, expected, N) > 1e-5
    band = -np.diff(np.cos(np.linspace(0, np.pi, 33)))
    np.testing.assert_allclose((density * band[:, None] * 2 * np.pi / 64).sum(), 1.0)
    again = met(light, (0, 0, 0), samples["direction"])
    np.testing.assert_allclose(np.median(again["pdf"] / samples["pdf"]), 1.0, rtol=1e-5)
    assert (np.abs(again["pdf"] / samples["pdf"] - 1) > 1e-3).mean() < 1e-3


@pytest.mark.parametrize("normal", [(0, 0, 1), (0, 1, 0), (0.6, -0.8, 0), (-0.3, 0.1, -0.9)])
def test_both_ways_give_the_irradiance_of_the_map(normal):
    texels = random_map()
    normal = np.array(normal, float) / np.linalg.norm(normal)
    radiance, directions, solid = bilinear_sphere(texels)
    expected = (radiance[..., 0] * np.maximum(directions @ normal, 0) * solid).sum()
    light = DomeLight(texture=LightTexture.of(texels))
    aimed = irradiances(sampled(light, (0, 0, 0)), normal)
    assert abs(z_of(aimed, expected, floor=1e-4)) < SIGMAS
    by_chance = met(light, (0, 0, 0), cosine_directions(normal))["radiance"][:, 0] * np.pi
    assert abs(z_of(by_chance, expected, floor=1e-4)) < SIGMAS
    spot = directions[44, 324]
    if spot @ normal > 0:
        # Drawn in proportion to luminance: the tint and the cosine are all the spread that is left.
        assert aimed.std() < 0.25 * by_chance.std()


def test_a_picture_larger_than_the_table_is_still_sampled_right(monkeypatch):
    monkeypatch.setattr("warprender.lights.environment.MOST_BINS", 300)
    texels = random_map()
    assert bins(texels)[2].shape == (8, 16)
    light = DomeLight(texture=LightTexture.of(texels))
    normal = np.array([0, 1.0, 0])
    radiance, directions, solid = bilinear_sphere(texels)
    expected = (radiance[..., 1] * np.maximum(directions @ normal, 0) * solid).sum()
    values = sampled(light, (0, 0, 0))
    cosine = np.maximum(values["direction"] @ normal, 0)
    assert abs(z_of(values["radiance"][:, 1] * cosine / values["pdf"], expected, floor=1e-4)) < SIGMAS


@pytest.mark.parametrize("direction", [(0.3, 0.5, 0.8), (-0.7, 0.1, 0.2), (0.2, -0.9, 0.1), (0.4, 0.2, -0.6)])
def test_formats_look_up_the_same_world(direction):
    # A world whose radiance is the direction itself, pictured in each format by the format's own definition.
    size = 512
    d = np.array(direction) / np.linalg.norm(direction)
    y, x = np.mgrid[0:size, 0:size]
    x, y = (x + 0.5) / size * 2 - 1, 1 - (y + 0.5) / size * 2
    r = np.hypot(x, y)
    inside = np.minimum(r, 1 - 1e-9)
    nz = np.sqrt(1 - inside**2)
    ball = np.stack([2 * nz * x, 2 * nz * y, 2 * nz**2 - 1], -1)
    theta = inside * np.pi
    angular = np.stack([np.sin(theta) * x / r, np.sin(theta) * y / r, np.cos(theta)], -1)
    cross = np.zeros((4 * size // 4, 3 * size // 4, 3))
    face = size // 4
    b, a = np.mgrid[0:face, 0:face]
    a, b = (a + 0.5) / face * 2 - 1, (b + 0.5) / face * 2 - 1
    one = np.ones_like(a)
    faces = {(0, 1): (-a, one, b), (1, 0): (one, -b, a), (1, 1): (-a, -b, one), (1, 2): (-one, -b, -a)}
    faces |= {(2, 1): (-a, -one, -b), (3, 1): (-a, b, -one)}
    for (row, column), vectors in faces.items():
        vectors = np.stack(vectors, -1)
        vectors /= np.linalg.norm(vectors, axis=-1, keepdims=True)
        cross[row * face : (row + 1) * face, column * face : (column + 1) * face] = vectors
    for format, picture in {"mirroredBall": ball, "angular": angular, "cubeMapVerticalCross": cross}.items():
        texels = to_latlong((picture + 1).astype(np.float32), format)
        light = DomeLight(texture=LightTexture.of(texels))
        np.testing.assert_allclose(met(light, (0, 0, 0), d[None])["radiance"][0] - 1, d, atol=0.03, err_msg=format)


@pytest.mark.parametrize("row", [8, 20])
def test_l7_a_sun_in_one_texel(row):
    # the illuminance of a texel's worth of light, from 64 samples a pixel.
    texels = np.zeros((256, 512, 3), np.float32)
    texels[row, 300] = 1e6
    _, directions, solid = bilinear_sphere(texels, refine=1)
    expected = (texels[..., 0] * np.maximum(directions[..., 1], 0) * solid).sum()
    up = pose(rotation=[(1, 0, 0), (0, 0, 1), (0, -1, 0)])
    light = DomeLight(texture=LightTexture.of(texels), transform=up)
    assert_illuminance(floor(light), expected, within=0.1, slack=3e-3, samples=64)


def test_a_dark_sky_around_the_sun_is_not_lost():
    texels = np.full((128, 256, 3), 0.5, np.float32)
    texels[30, 99] = 1e5
    radiance, directions, solid = bilinear_sphere(texels, refine=4)
    expected = (radiance[..., 0] * np.maximum(directions[..., 1], 0) * solid).sum()
    up = pose(rotation=[(1, 0, 0), (0, 0, 1), (0, -1, 0)])
    scene = floor(DomeLight(texture=LightTexture.of(texels), transform=up))
    assert_illuminance(scene, expected, within=0.05, slack=1e-4)


def test_l7_bad_texels_are_black_and_said():
    texels = np.ones((8, 16, 3), np.float32)
    texels[0, 0, 1], texels[1, 1], texels[2, 2] = np.nan, np.inf, -1.0
    texture = LightTexture.of(texels)
    assert texture.warnings == ("3 texels are negative or not finite and count as black",)
    assert np.isfinite(texture.texels).all() and texture.texels.sum() == 3 * (128 - 3)
    scene = floor(DomeLight(texture=texture))
    illuminance(scene, samples=4)
    assert any("texels" in warning for warning in scene.warnings)


def test_l7_a_black_map_gives_no_light():
    mean, _ = illuminance(floor(DomeLight(texture=LightTexture.of(np.zeros((8, 16, 3))))), samples=4)
    assert mean.max() == 0


def test_l7_rows_and_poles_without_light():
    # a zero row at the pole, and all the light in the row beside it.
    texels = np.zeros((16, 32, 3), np.float32)
    texels[1] = 1.0
    rows, columns, density = bins(texels)
    assert np.isfinite(density).all() and (np.diff(columns) >= 0).all() and rows[-1] == 1
    texels[:] = 0
    texels[0] = 7.0
    light = DomeLight(texture=LightTexture.of(texels))
    samples = sampled(light, (0, 0, 0), 4096)
    assert np.isfinite(samples["pdf"]).all() and (samples["direction"][:, 1] > 0.5).all()


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (2, 1), (3, 7)])
def test_tiny_pictures(shape):
    light = DomeLight(texture=LightTexture.of(np.full((*shape, 3), 0.25, np.float32)))
    normal = np.array([0.6, 0, 0.8])
    values = irradiances(sampled(light, (0, 0, 0)), normal)
    assert abs(z_of(values, 0.25 * np.pi)) < SIGMAS


def test_rect_textures_read_right_from_the_lit_side():
    # The first texel is at (+X, +Y): seen from -Z with +Y up, +X is on the left.
    light = RectLight(width=2.0, height=1.0, texture=LightTexture.of(colourful(64)))
    p = np.array([0, 0, -1.0])
    for x, y, column, row in [(0.99, 0.49, 0, 0), (-0.99, 0.49, 1, 0), (0.99, -0.49, 0, 1), (0, 0, 0.5, 0.5)]:
        d = np.array([[x, y, 0]]) - p
        radiance = met(light, p, d / np.linalg.norm(d))["radiance"][0]
        np.testing.assert_allclose(radiance, (column, row, 1.0), atol=0.02)
    samples = sampled(light, p, 4096)
    place = p + samples["direction"] * samples["distance"][:, None]
    np.testing.assert_allclose(samples["radiance"][:, 0], np.clip(0.5 - place[:, 0] / 2, 1 / 256, 1), atol=0.01)


def test_lights_share_a_picture():
    texture = LightTexture.of(random_map())
    scene = wr.Scene()
    for path in ("/a", "/b"):
        scene.add_light(DomeLight(texture=texture), path)
    scene.add_light(RectLight(texture=LightTexture.of(colourful())), "/c")
    record = wr.upload.Upload(scene, scene.lights, np.zeros(3), "cpu").record
    assert len(record.images) == 2
    assert len(set(record.lights.numpy()["image"])) == 2
