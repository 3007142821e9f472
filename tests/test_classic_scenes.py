"""The scenes of "Ray Tracing in One Weekend" and of the card ray tracer: what they are made of, and known values."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
import scenes
from pictures import picture

import warprender as wr
from warprender.images import read_picture

ROOT = Path(__file__).parent.parent
NAMES = ("one_weekend", "card")


def example(name):
    spec = importlib.util.spec_from_file_location(f"example_{name}", ROOT / "examples" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


ONE_WEEKEND, CARD = map(example, NAMES)
SHOWN = {"dome_light_visible": True, "camera_light": "off"}


def stored(name):
    return wr.load(str(ROOT / "scenes_usd" / f"{name}.usda"))


@pytest.mark.parametrize("name", NAMES)
def test_the_stored_stage_is_the_examples(name, tmp_path):
    example(name).write_stage(tmp_path / f"{name}.usda")
    folder = ROOT / "scenes_usd"
    assert (tmp_path / f"{name}.usda").read_text() == (folder / f"{name}.usda").read_text()
    skies = [read_picture(str(place / f"{name}_sky.exr")).pixels for place in (tmp_path, folder)]
    np.testing.assert_array_equal(*skies)
    # Written again over itself it stays the same.
    example(name).write_stage(tmp_path / f"{name}.usda")
    assert (tmp_path / f"{name}.usda").read_text() == (folder / f"{name}.usda").read_text()


def test_the_weekends_balls_follow_the_books_rules():
    scene = stored("one_weekend")
    assert not scene.warnings
    rows = ONE_WEEKEND.balls()
    small = [row for kind in rows.values() for row in kind if row[1] == 0.2]
    # 22 × 22 places less those that lie within 0.9 of (4, 0.2, 0), of which there are at most 4.
    assert 480 <= len(small) <= 484 and sum(map(len, rows.values())) == len(small) + 4
    centres = np.array([row[0] for row in small])
    assert (np.linalg.norm(centres - (4, 0.2, 0), axis=1) > 0.9).all()
    places = np.floor(centres[:, [0, 2]])
    assert len(np.unique(places, axis=0)) == len(small) and places.min() >= -11 and places.max() <= 10
    # Shares of 0.8, 0.15 and 0.05, within 4.5 standard deviations.
    for kind, share in (("diffuse", 0.8), ("metal", 0.15), ("glass", 0.05)):
        count = sum(row[1] == 0.2 for row in rows[kind])
        assert abs(count - share * len(small)) < 4.5 * np.sqrt(len(small) * share * (1 - share))
    assert all(0.5 <= c <= 1 for row in rows["metal"] if row[1] == 0.2 for c in row[2])
    placed = {path.split("/")[-1]: placement for path, placement in scene.placements.items()}
    assert {name: len(p.transforms) for name, p in placed.items()} == {name: len(r) for name, r in rows.items()}
    assert scene.materials[placed["glass"].material] == wr.Dielectric(ior=1.5)


def cosines_of(view, size):
    """How high each pixel's centre looks: the component of its direction along an axis, (H, W, 3)."""
    place = ((np.arange(size) + 0.5) / size * 2 - 1) * 0.5 * view.horizontalAperture / view.focalLength
    local = np.stack(np.broadcast_arrays(place[None, :], -place[:, None], -1.0), -1)
    world = local @ view.transform[:3, :3]
    return world / np.linalg.norm(world, axis=-1, keepdims=True)


@pytest.mark.parametrize("name", NAMES)
def test_where_only_sky_is_seen_it_is_the_gradient(name):
    scene = stored(name)
    scene.placements.clear()
    for path, light in list(scene.lights.items()):
        if not isinstance(light, wr.DomeLight):
            del scene.lights[path]
    target, up = ((0.3, 0.6, 1.0), (0, 1, 0)) if name == "one_weekend" else ((0.3, 1.0, 0.8), (0, 0, 1))
    view = scenes.camera((0, 0, 0), target, fov=30.0, up=up)
    # Rays, whose places in a pixel are each pixel's own: raster shifts all pixels alike.
    color, _ = picture(scene, view, 32, 16, visibility="rays", **SHOWN)
    direction = cosines_of(view, 32)
    if name == "one_weekend":
        expected = (1 + direction[..., 1:2]) / 2 * (0.5, 0.7, 1.0) + (1 - direction[..., 1:2]) / 2
    else:
        expected = (1 - direction[..., 2:]) ** 4 * (0.7, 0.6, 1.0)
    # 16 places in a pixel that the gradient crosses: the sky changes by 3 % from one pixel to the next.
    np.testing.assert_allclose(color[..., :3], expected, rtol=0.02, atol=1e-3)
    np.testing.assert_allclose(color[..., :3].mean((0, 1)), expected.mean((0, 1)), rtol=1e-3)


def test_the_card_spells_its_letters():
    scene = stored("card")
    assert not scene.warnings
    centres = scene.placements["/World/letters"].transforms[:, 3, :3]
    # Bits 0 … 18 of nine numbers, the lowest row first, as they stand on the card.
    rows = [247570, 280596, 280600, 249748, 18578, 18577, 231184, 16, 16]
    bits = {(k, 0, j + 4) for j, row in enumerate(rows) for k in range(19) if row >> k & 1}
    assert {tuple(c) for c in centres.round().astype(int).tolist()} == bits and len(centres) == len(bits) == 49


def test_the_cards_floor_is_red_and_white():
    # Under a white dome alone each square shows its own reflectance.
    scene = stored("card")
    del scene.placements["/World/letters"]
    scene.lights.clear()
    scene.add_light(wr.DomeLight())
    view = scenes.window(20.0, eye=(0, 0, 5), target=(0, 0, 0))
    color, _ = picture(scene, view, 32, 64, camera_light="off")
    centre = (np.arange(32) + 0.5) / 32 * 20 - 10
    expected = np.array([[CARD.tile_color(x, y) for x in centre] for y in centre[::-1]])
    # The card asks for the parity of ceil(x / 5) + ceil(y / 5).
    assert CARD.tile_color(2.5, 2.5) == CARD.WHITE and CARD.tile_color(-2.5, 2.5) == CARD.RED
    np.testing.assert_allclose(color[..., :3], expected, rtol=1e-5)


def test_the_cards_balls_reflect_half():
    # One ball alone under the sky, looked at from straight ahead: (1 - h)⁴ of the mirrored direction, halved.
    scene = stored("card")
    del scene.placements["/World/floor"], scene.lights["/World/lamp"]
    letters = scene.placements["/World/letters"]
    letters.transforms, letters.instance_ids = letters.transforms[:1], letters.instance_ids[:1]
    centre = letters.transforms[0, 3, :3]
    for angle in (20.0, 40.0, 60.0):
        # Where the normal stands this high above the horizontal view, the sky twice as high is seen.
        normal = np.array([0, np.cos(np.radians(angle / 2)), np.sin(np.radians(angle / 2))])
        eye = centre + normal + (0, 10, 0)
        view = scenes.window(1e-3, eye=eye, target=centre + normal, up=(0, 0, 1))
        color, _ = picture(scene, view, 4, 16, camera_light="off")
        expected = 0.5 * (1 - np.sin(np.radians(angle))) ** 4 * np.array([0.7, 0.6, 1.0])
        np.testing.assert_allclose(color[..., :3].mean((0, 1)), expected, rtol=3e-3)
