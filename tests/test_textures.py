"""Look-ups give what UsdUVTexture says: places, wraps, curves, channels, tiles, and means over footprints."""

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
import warp as wp

from warprender.color import srgb_decode
from warprender.material_tables import MaterialTables
from warprender.materials import PreviewSurface
from warprender.records import DeviceScene
from warprender.texels import halvings_within, reduced
from warprender.textures import Footprint, Texture, texture_at

# Rows from the top: red green / blue white. Lower left is blue.
CORNERS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
LOWER_LEFT, UPPER_RIGHT = (0.25, 0.25), (0.75, 0.75)


@wp.kernel(module="unique", enable_backward=False)
def look_up(scene: DeviceScene, st: wp.array2d(dtype=wp.float32), axes: wp.vec4, out: wp.array(dtype=wp.vec4)):
    i = wp.tid()
    place = Footprint()
    place.st = wp.vec2(st[i, 0], st[i, 1])
    place.along = wp.vec2(axes[0], axes[1])
    place.across = wp.vec2(axes[2], axes[3])
    out[i] = texture_at(scene, 0, place)


def seen(texture: Texture, st, axes=(0, 0, 0, 0), tables: MaterialTables | None = None) -> np.ndarray:
    """(N, 4) results of a texture at coordinates (N, 2)."""
    tables = tables or MaterialTables({"/m": PreviewSurface(diffuseColor=texture)}, ["/m"])
    scene = DeviceScene()
    kept = tables.fill(scene, "cpu")
    st = np.asarray(st, np.float32).reshape(-1, 2)
    out = wp.zeros(len(st), wp.vec4, device="cpu")
    wp.launch(look_up, len(st), [scene, wp.array(st, device="cpu"), wp.vec4(*axes), out], device="cpu")
    assert kept
    return out.numpy()


def write(path: Path, pixels: np.ndarray, **attributes) -> str:
    kinds = {"u1": oiio.UINT8, "u2": oiio.UINT16, "f2": oiio.HALF, "f4": oiio.FLOAT}
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, kinds[pixels.dtype.str[1:]])
    if channels in (2, 4):
        spec.attribute("oiio:UnassociatedAlpha", 1)
    for name, value in attributes.items():
        spec.attribute(name, value)
    target = oiio.ImageOutput.create(str(path))
    assert target.open(str(path), spec) and target.write_image(pixels) and target.close()
    return str(path)


def test_the_origin_of_coordinates_is_the_lower_left_corner():
    quarters = [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)]
    np.testing.assert_array_equal(
        seen(Texture(CORNERS), quarters), [(0, 0, 1, 1), (1, 1, 1, 1), (1, 0, 0, 1), (0, 1, 0, 1)]
    )


def test_between_texels_values_are_interpolated_after_decoding():
    grey = np.array([[[0, 0, 0], [188, 188, 188]]], np.uint8)
    assert seen(Texture(grey), (0.5, 0.5))[0, 0] == pytest.approx(srgb_decode(188 / 255) / 2, rel=1e-6)


WRAPPED = {
    # The texels of a row [0.1, 0.2, 0.3, 0.4] at s = -1.125, -0.375, 0.375, 1.125, 2.625.
    "repeat": (0.4, 0.3, 0.2, 0.1, 0.3),
    "mirror": (0.4, 0.2, 0.2, 0.4, 0.3),
    "clamp": (0.1, 0.1, 0.2, 0.4, 0.4),
    "black": (0.0, 0.0, 0.2, 0.0, 0.0),
    "useMetadata": (0.0, 0.0, 0.2, 0.0, 0.0),
}


@pytest.mark.parametrize("wrap", WRAPPED)
@pytest.mark.parametrize("axis", (0, 1))
def test_wrap_modes(wrap, axis):
    row = np.array([0.1, 0.2, 0.3, 0.4], np.float32)
    picture = row.reshape(1, 4, 1) if axis == 0 else row[::-1].reshape(4, 1, 1)
    st = np.full((5, 2), 0.5)
    st[:, axis] = (-1.125, -0.375, 0.375, 1.125, 2.625)
    texture = Texture(picture, **{("wrapS", "wrapT")[axis]: wrap, ("wrapT", "wrapS")[axis]: "clamp"})
    np.testing.assert_allclose(seen(texture, st)[:, 0], WRAPPED[wrap], atol=1e-6)
    outside = np.array(WRAPPED[wrap]) == 0
    np.testing.assert_array_equal(seen(texture, st)[:, 3] == 0, outside)


@pytest.mark.parametrize("wrap", ("repeat", "mirror", "clamp", "black"))
def test_coordinates_of_any_size_are_safe(wrap):
    st = [(v, v) for v in (np.nan, np.inf, -np.inf, 1e30, -1e30, -1e-30, 1.0, 0.0, 16777217.0)]
    assert np.isfinite(seen(Texture(CORNERS, wrapS=wrap, wrapT=wrap), st, axes=(np.nan, 0, 1e30, np.inf))).all()


def curve_taken(file) -> bool:
    value = float(seen(Texture(file), (0.5, 0.5))[0, 0])
    assert value == pytest.approx(0.5, abs=0.003) or value == pytest.approx(0.214, abs=0.003)
    return value < 0.4


@pytest.mark.parametrize("dtype, half", [(np.uint8, 128), (np.uint16, 32768), (np.float16, 0.5), (np.float32, 0.5)])
@pytest.mark.parametrize("channels", (1, 2, 3, 4))
def test_auto_takes_the_curve_for_8_bit_colours_alone(dtype, half, channels):
    assert curve_taken(np.full((2, 2, channels), half, dtype)) == (dtype is np.uint8 and channels >= 3)


def test_what_a_file_says_of_its_colours_goes_first(tmp_path):
    deep, flat = np.full((2, 2, 3), 32768, np.uint16), np.full((2, 2, 3), 128, np.uint8)
    assert not curve_taken(write(tmp_path / "linear.png", flat, **{"oiio:ColorSpace": "lin_rec709"}))
    assert curve_taken(write(tmp_path / "plain.png", flat))
    assert not curve_taken(write(tmp_path / "deep.png", deep))
    assert curve_taken(write(tmp_path / "exif.tif", deep, **{"Exif:ColorSpace": 1}))


@pytest.mark.parametrize("dtype, half", [(np.uint8, 128), (np.uint16, 32768), (np.float16, 0.5), (np.float32, 0.5)])
def test_stated_colour_spaces_hold_for_all_types(dtype, half):
    picture = np.full((1, 1, 4), half, dtype)
    value = 128 / 255 if dtype is np.uint8 else (32768 / 65535 if dtype is np.uint16 else 0.5)
    raw = seen(Texture(picture, sourceColorSpace="raw"), (0.5, 0.5))[0]
    curved = seen(Texture(picture, sourceColorSpace="sRGB"), (0.5, 0.5))[0]
    np.testing.assert_allclose(raw, value, rtol=1e-6)
    np.testing.assert_allclose(curved, [srgb_decode(value)] * 3 + [value], rtol=1e-6)


def test_missing_channels_are_grey_and_opaque():
    expected = {1: (0.1, 0.1, 0.1, 1), 2: (0.1, 0.1, 0.1, 0.2), 3: (0.1, 0.2, 0.3, 1), 4: (0.1, 0.2, 0.3, 0.4)}
    for channels, values in expected.items():
        picture = np.array([0.1, 0.2, 0.3, 0.4], np.float32)[:channels].reshape(1, 1, channels)
        np.testing.assert_allclose(seen(Texture(picture), (0.5, 0.5))[0], values, rtol=1e-6)


def test_scale_comes_before_bias():
    texture = Texture(CORNERS, sourceColorSpace="raw", scale=(2, 2, 2, 1), bias=(-1, -1, -1, 0))
    np.testing.assert_array_equal(seen(texture, UPPER_RIGHT)[0], (-1, 1, -1, 1))


def test_the_transform_moves_coordinates():
    # A quarter turn and a shift: (s, t) → (1 - t, s).
    texture = Texture(CORNERS, transform=[[0, -1, 1], [1, 0, 0]])
    np.testing.assert_array_equal(seen(texture, LOWER_LEFT)[0], (1, 1, 1, 1))


def test_tiles(tmp_path):
    for tile, value in ((1001, 10), (1002, 20), (1011, 30)):
        write(tmp_path / f"t.{tile}.png", np.full((2, 2, 3), value, np.uint8))
    texture = Texture(str(tmp_path / "t.<UDIM>.png"), sourceColorSpace="raw", fallback=(0.5, 0.5, 0.5, 1))
    found = seen(texture, [(0.01, 0.99), (1.01, 0.01), (0.5, 1.5), (1.5, 1.5), (-0.5, 0.5), (10.5, 0.5)])[:, 0]
    np.testing.assert_allclose(found * 255, (10, 20, 30, 127.5, 127.5, 127.5), rtol=1e-5)


def test_a_missing_file_gives_the_fallback_and_one_warning(tmp_path):
    texture = Texture(str(tmp_path / "no.png"), scale=(9, 9, 9, 9), fallback=(0.1, 0.2, 0.3, 0.4))
    tables = MaterialTables({"/m": PreviewSurface(diffuseColor=texture)}, ["/m"])
    np.testing.assert_allclose(seen(texture, (0.5, 0.5), tables=tables)[0], (0.1, 0.2, 0.3, 0.4))
    assert len(tables.warnings) == 1 and tables.warnings[0].startswith("/m: diffuseColor: ")
    assert "no.png" in tables.warnings[0]


@pytest.mark.parametrize("content", (b"", b"not a picture"))
def test_a_broken_file_gives_the_fallback(tmp_path, content):
    (tmp_path / "x.png").write_bytes(content)
    texture = Texture(tmp_path / "x.png", fallback=(0.5, 0, 0, 1))
    assert seen(texture, (0.5, 0.5))[0, 0] == 0.5


@pytest.mark.parametrize("size", [(8, 8), (7, 5), (1, 9), (6, 1), (1, 1)])
def test_levels_keep_the_mean(size):
    picture = np.random.default_rng(0).random((*size, 4)).astype(np.float32)
    coarsest = seen(Texture(picture, wrapS="clamp", wrapT="clamp"), (0.5, 0.5), axes=(1e4, 0, 0, 1e4))[0]
    np.testing.assert_allclose(coarsest, picture.mean((0, 1)), rtol=1e-5)


def test_reduction_weighs_cut_texels_by_their_parts():
    row = np.array([1, 2, 3, 4, 5], np.float32).reshape(1, 5, 1).repeat(4, 2)
    expected = [(1 + 2 + 0.5 * 3) / 2.5, (0.5 * 3 + 4 + 5) / 2.5]
    np.testing.assert_allclose(reduced(row, 1, 2)[0, :, 0], expected, rtol=1e-6)


def box_means(picture: np.ndarray, st: np.ndarray, width: float, height: float) -> np.ndarray:
    """Exact means of a repeated one-channel picture, rows from the bottom, over boxes about places."""
    fine = 16
    dense = picture.repeat(fine, 0).repeat(fine, 1)
    size = np.array(picture.shape[::-1]) * fine
    half = np.round(np.array([width, height]) * size / 2).astype(int)
    means = []
    for x, y in np.round(st * size).astype(int):
        rows, columns = np.arange(y - half[1], y + half[1]) % size[1], np.arange(x - half[0], x + half[0]) % size[0]
        means.append(dense[np.ix_(rows, columns)].mean())
    return np.array(means)


@pytest.mark.parametrize("texels", [(2, 2), (4, 4), (8, 8), (13, 13), (16, 4), (3, 24)])
def test_a_footprint_is_near_the_exact_mean_and_not_brighter(texels):
    size = 64
    picture = np.random.default_rng(1).random((size, size, 1)).astype(np.float32)
    st = np.random.default_rng(2).random((400, 2))
    width, height = texels[0] / size, texels[1] / size
    exact = box_means(picture[::-1, :, 0], st, width, height)
    found = seen(Texture(picture, wrapS="repeat", wrapT="repeat"), st, axes=(width, 0, 0, height))[:, 0]
    # White noise is the hardest picture: a box of n texels has a deviation of 0.29 / √n, two unrelated ones √2 of it.
    deviation = 0.29 / np.sqrt(texels[0] * texels[1])
    assert np.std(found - exact) < 0.9 * deviation
    assert abs(np.mean(found) - picture.mean()) < 0.02
    assert 0.6 * deviation < np.std(found) < 1.4 * deviation


def test_stripes_below_the_footprint_do_not_alias():
    stripes = np.tile(np.array([[0, 1]], np.float32), (64, 32))[..., None]
    st = np.stack([np.linspace(0, 1, 997), np.full(997, 0.5)], 1)
    found = seen(Texture(stripes, wrapS="repeat", wrapT="repeat"), st, axes=(6 / 64, 0, 0, 6 / 64))[:, 0]
    np.testing.assert_allclose(found, 0.5, atol=1e-3)


def test_8_bit_levels_are_rounded_to_the_nearest_code():
    picture = np.random.default_rng(3).integers(0, 256, (32, 32, 3)).astype(np.uint8)
    means = srgb_decode(picture / 255.0).mean((0, 1))
    found = seen(Texture(picture, wrapS="repeat", wrapT="repeat"), (0.5, 0.5), axes=(9, 0, 0, 9))[0, :3]
    codes = np.searchsorted(srgb_decode(np.arange(256) / 255), means)
    steps = srgb_decode(codes / 255) - srgb_decode((codes - 1) / 255)
    assert (np.abs(found - means) <= 0.51 * steps + 1e-6).all()


def test_textures_stay_within_the_budget():
    pictures = [np.zeros((256, 256, 3), np.uint8), np.zeros((64, 64, 3), np.uint8)]
    materials = {f"/{k}": PreviewSurface(diffuseColor=Texture(p)) for k, p in enumerate(pictures)}
    tables = MaterialTables(materials, materials, budget=200_000)
    assert tables.pool.words.nbytes <= 200_000
    assert [(width, height) for _, width, height in tables.pool.levels if width >= 64] == [
        (128, 128),
        (64, 64),
        (64, 64),
    ]
    assert len(tables.warnings) == 1 and tables.warnings[0].startswith("/0: diffuseColor")
    assert halvings_within([100, 10], 1000) == [0, 0]


def test_one_picture_is_stored_once():
    texture = Texture(CORNERS)
    tables = MaterialTables({"/m": PreviewSurface(diffuseColor=texture, emissiveColor=Texture(CORNERS))}, ["/m"])
    assert len(tables.pool.pictures) == 1 and len(tables.inputs) == 2
    assert not MaterialTables({"/m": PreviewSurface(diffuseColor=texture)}, []).pool.pictures
