"""Frames: access by name, files with a receipt, and the notebook."""

import json

import numpy as np
import pytest
import warp as wp

import warprender as wr
from warprender import images
from warprender.frame import Frame

RECEIPT = {"seed": 3, "samples": 16, "stage": "Würfel.usda", "flags": ["--samples", "16"]}


@pytest.fixture
def frame() -> Frame:
    color = np.random.default_rng(0).random((4, 6, 4), np.float32)
    ids = np.arange(24, dtype=np.int32).reshape(4, 6) - 1
    outputs = {
        "color": wp.array(color, dtype=wp.vec4, device="cpu"),
        "cameraDepth": wp.array(color[..., 0], dtype=float, device="cpu"),
        "normal": wp.array(color[..., :3], dtype=wp.vec3, device="cpu"),
        "primId": wp.array(ids, dtype=int, device="cpu"),
    }
    return Frame(outputs, {"samples": 16}, RECEIPT)


def test_outputs_are_attributes_without_a_copy(frame):
    assert frame.cameraDepth is frame.outputs["cameraDepth"]
    assert "cameraDepth" in dir(frame)
    shared = np.from_dlpack(frame.cameraDepth)
    frame.cameraDepth.fill_(42.0)
    assert (shared == 42.0).all()


def test_numpy_has_channels_last(frame):
    assert frame.numpy("color").shape == (4, 6, 4)
    assert frame.numpy("normal").shape == (4, 6, 3)
    assert frame.numpy("primId").dtype == np.int32


def test_a_missing_output_is_named_with_those_that_exist(frame):
    with pytest.raises(AttributeError, match=r"'depth'; it has color, cameraDepth, normal, primId"):
        frame.depth  # noqa: B018


def test_exr_holds_every_output_and_the_receipt(frame, tmp_path):
    frame.save(tmp_path / "a.exr")
    layers, metadata = images.read(tmp_path / "a.exr")
    for name in frame.outputs:
        np.testing.assert_array_equal(layers[name], frame.numpy(name), err_msg=name)
    assert json.loads(metadata["warprender"]) == {**RECEIPT, "file": {"color_correction": "sRGB", "half": False}}
    assert metadata["Software"] == "warprender"


def test_png_holds_colour_and_the_receipt(frame, tmp_path):
    frame.save(str(tmp_path / "a.png"))
    layers, metadata = images.read(tmp_path / "a.png")
    np.testing.assert_array_equal(np.round(layers["color"] * 255), images.display_bytes(frame.numpy("color")))
    assert RECEIPT.items() <= json.loads(metadata["warprender"]).items()


def test_a_notebook_gets_the_picture(frame):
    assert frame._repr_png_().startswith(b"\x89PNG")
    assert Frame({"primId": frame.primId})._repr_png_() is None


def test_repr_is_one_line(frame):
    assert repr(frame) == "Frame(6x4: color, cameraDepth, normal, primId; 16 samples)"
    frame.stats["interrupted"] = True
    assert repr(frame).endswith("16 samples; interrupted)")


def test_a_render_says_in_its_receipt_how_to_repeat_it():
    scene = wr.Scene()
    scene.add_sphere("/ball")
    renderer = wr.Renderer(scene, resolution=(4, 3), outputs="cameraDepth", filter="gaussian", sampler="independent")
    receipt = json.loads(json.dumps(renderer.render(seed=7).receipt))
    assert receipt["request"]["filter"] == "gaussian" and receipt["request"]["sampler"] == "independent"
    assert receipt["resolution"] == [4, 3] and receipt["seed"] == 7
    assert receipt["camera"]["focalLength"] == renderer.camera.focalLength
    np.testing.assert_array_equal(receipt["camera"]["transform"], renderer.camera.transform)


def test_numbers_of_numpy_are_kept_as_pythons(tmp_path):
    scene = wr.Scene()
    scene.add_sphere("/ball")
    asked = {"bounces": np.int64(1), "adaptive": np.bool_(False), "texture_bytes": np.float32(2**20)}
    camera = wr.Camera(focalLength=np.float32(50), clippingRange=np.array([1.0, 9.0]))
    renderer = wr.Renderer(scene, camera, (4, 3), outputs="cameraDepth", filter="gaussian", **asked)
    frame = renderer.render(samples=np.int64(2), seed=np.int16(5))
    frame.save(tmp_path / "a.exr")
    receipt = json.loads(images.read(tmp_path / "a.exr")[1]["warprender"])
    assert receipt["seed"] == 5 and receipt["request"]["bounces"] == 1 and receipt["camera"]["clippingRange"] == [1, 9]
    assert renderer.render(seed=5.0).receipt["seed"] == 5
