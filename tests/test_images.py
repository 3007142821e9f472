"""Image files: what comes back is what went in, and what cannot be written is named."""

import numpy as np
import pytest

from warprender import images

WIDTH, HEIGHT = 5, 3


def gradient(channels: int) -> np.ndarray:
    values = np.linspace(0.0, 1.0, HEIGHT * WIDTH * channels, dtype=np.float32)
    return values.reshape(HEIGHT, WIDTH, channels)


def test_exr_keeps_every_layer_bit_for_bit(tmp_path):
    layers = {
        "color": gradient(4) * 1e5,
        "depth": gradient(1)[..., 0],
        "normal": gradient(3) - 0.5,
        "albedo": gradient(3),
        "motion": gradient(2),
        "primId": np.arange(HEIGHT * WIDTH, dtype=np.int32).reshape(HEIGHT, WIDTH) - 1,
        "instanceId": np.full((HEIGHT, WIDTH), -1, np.int32),
    }
    # Values that a detour over 32-bit floats, or a signed reading, would change.
    layers["primId"][0, 1:4] = 2**24 + 1, 2**31 - 1, -(2**31)
    layers["color"][0, 0] = np.inf, -np.inf, np.nan, 3.0e38
    images.write_exr(tmp_path / "a.exr", layers, {"warprender": "{}", "Software": "warprender"})

    read, metadata = images.read(tmp_path / "a.exr")
    assert set(read) == set(layers)
    for name, expected in layers.items():
        assert read[name].dtype == expected.dtype
        np.testing.assert_array_equal(read[name], expected, err_msg=name)
    assert metadata["warprender"] == "{}"
    assert metadata["Software"] == "warprender"


def test_exr_of_integers_alone(tmp_path):
    ids = np.array([[-1, 0], [7, -2]], np.int32)
    images.write_exr(tmp_path / "a.exr", {"elementId": ids}, {"warprender": "x"})
    read, metadata = images.read(tmp_path / "a.exr")
    np.testing.assert_array_equal(read["elementId"], ids)
    assert metadata["warprender"] == "x"


def test_A6_half_floats_clamp_what_is_finite_and_leave_integers(tmp_path):
    color = np.zeros((1, 4, 4), np.float32)
    color[0, :, 0] = 65519.0, 65520.0, -1e9, np.inf
    layers = {"color": color, "primId": np.array([[1, 2, 70000, -1]], np.int32)}
    images.write_exr(tmp_path / "a.exr", layers, half=True)
    read, _ = images.read(tmp_path / "a.exr")
    np.testing.assert_array_equal(read["color"][0, :, 0], [65504.0, 65504.0, -65504.0, np.inf])
    np.testing.assert_array_equal(read["primId"], layers["primId"])


def test_png_has_the_srgb_curve_on_premultiplied_colour_and_linear_alpha(tmp_path):
    rgba = np.array([[[0.5, 0.0, 1.0, 0.5], [0.002, 0.18, 0.2, 0.0]]], np.float32)
    images.write_png(tmp_path / "a.png", rgba, {"warprender": '{"seed": 0}'})
    read, metadata = images.read(tmp_path / "a.png")
    expected = [[[188, 0, 255, 128], [7, 118, 124, 0]]]
    np.testing.assert_array_equal(np.round(read["color"] * 255), expected)
    assert metadata["warprender"] == '{"seed": 0}'


def test_png_without_colour_correction_is_linear(tmp_path):
    rgba = np.full((1, 1, 4), 0.5, np.float32)
    images.write_png(tmp_path / "a.png", rgba, color_correction="disabled")
    read, metadata = images.read(tmp_path / "a.png")
    np.testing.assert_array_equal(np.round(read["color"] * 255), 128)
    assert metadata.get("oiio:Gamma", 1.0) == 1.0


def test_A6_pixels_that_no_byte_can_hold():
    values = np.array([[[np.nan, np.inf, -np.inf, np.nan], [-0.1, 1e30, 1.0, 2.0]]], np.float32)
    expected = [[[0, 255, 0, 0], [0, 255, 255, 255]]]
    np.testing.assert_array_equal(images.display_bytes(values), expected)
    np.testing.assert_array_equal(images.display_bytes(values, "disabled"), expected)


@pytest.mark.parametrize(("name", "channels"), [("a.jpg", 3), ("a.tif", 4), ("a.PNG", 4), ("a.hdr", 3)])
def test_other_formats_hold_the_colour(tmp_path, name, channels):
    images.write(tmp_path / name, {"color": np.full((8, 8, 4), 1.0, np.float32)})
    read, _ = images.read(tmp_path / name)
    assert read["color"].shape == (8, 8, channels)
    np.testing.assert_allclose(read["color"], 1.0, atol=1 / 255)


@pytest.mark.parametrize(
    ("name", "message"),
    [("a.xyz", "unknown image extension"), ("a", "unknown image extension"), ("no/a.png", "does not exist")],
)
def test_destinations_that_cannot_be(tmp_path, name, message):
    with pytest.raises(ValueError, match=message) as problem:
        images.write(tmp_path / name, {"color": gradient(4)})
    assert str(tmp_path / name) in str(problem.value)
    assert "\n" not in str(problem.value)


@pytest.mark.parametrize("name", ["png", "exr", "hdr", "jpg"])
def test_a_file_that_cannot_be_written_is_named(tmp_path, name):
    # A dangling link into a folder that is not there: nobody, not even root, can open it for writing.
    path = tmp_path / f"a.{name}"
    path.symlink_to(tmp_path / "missing" / "b")
    with pytest.raises(ValueError, match="cannot be written") as problem:
        images.write(path, {"color": gradient(4)})
    assert str(path) in str(problem.value)
    assert "\n" not in str(problem.value)


def test_layers_of_an_exr_can_be_written_as_a_picture(tmp_path):
    images.write(tmp_path / "a.exr", {"color": gradient(4)})
    images.write(tmp_path / "a.png", images.read(tmp_path / "a.exr")[0])


def test_a_folder_is_no_destination(tmp_path):
    (tmp_path / "a.png").mkdir()
    with pytest.raises(ValueError, match="is a folder"):
        images.check_destination(tmp_path / "a.png")


def test_a_picture_needs_colour(tmp_path):
    with pytest.raises(ValueError, match="color"):
        images.write(tmp_path / "a.png", {"depth": gradient(1)})


def test_layers_of_two_sizes_are_refused(tmp_path):
    with pytest.raises(ValueError, match="one height and width"):
        images.write_exr(tmp_path / "a.exr", {"a": np.zeros((2, 2)), "b": np.zeros((2, 3))})


def test_what_is_no_image_is_named(tmp_path):
    (tmp_path / "a.exr").write_bytes(b"no image")
    for name in ("a.exr", "missing.png"):
        with pytest.raises(ValueError, match="cannot be read") as problem:
            images.read(tmp_path / name)
        assert str(tmp_path / name) in str(problem.value)


CONFIGURATION = """ocio_profile_version: 2
roles: { scene_linear: aces, default: aces }
displays:
  screen: [ !<View> {name: root, colorspace: root} ]
file_rules: [ !<Rule> {name: Default, colorspace: aces} ]
colorspaces:
  - !<ColorSpace>
    name: aces
  - !<ColorSpace>
    name: lin_rec709
    to_scene_reference: !<MatrixTransform> {matrix: [0.25, 0, 0, 0, 0, 0.25, 0, 0, 0, 0, 0.25, 0, 0, 0, 0, 1]}
  - !<ColorSpace>
    name: root
    from_scene_reference: !<ExponentTransform> {value: [0.5, 0.5, 0.5, 1]}
"""


def test_open_color_io_takes_the_default_view_of_linear_rec709(tmp_path, monkeypatch):
    (tmp_path / "config.ocio").write_text(CONFIGURATION)
    monkeypatch.setenv("OCIO", str(tmp_path / "config.ocio"))
    rgba = np.random.default_rng(0).random((5, 4, 4)).astype(np.float32) * 4
    rgba[..., 3] = 0.5
    expected = np.sqrt(rgba[..., :3].astype(np.float64) / 4) * 255
    seen = images.display_bytes(rgba, "openColorIO")
    assert np.abs(seen[..., :3] - expected).max() <= 0.5 + 255 * 2**-15, "half a step and OpenColorIO's fast roots"
    assert (seen[..., 3] == 128).all()


@pytest.mark.parametrize(("value", "message"), [("", "OCIO names no configuration"), ("/no/such.ocio", "such.ocio")])
def test_open_color_io_needs_a_configuration(monkeypatch, value, message):
    monkeypatch.setenv("OCIO", value)
    with pytest.raises(ValueError, match=message):
        images.check_color_correction("openColorIO")
