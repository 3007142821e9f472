"""Measured BRDFs: files, look-up, reciprocity, energy, sampling, pictures and bad input."""

import struct

import numpy as np
import pytest
import scenes
import warp as wp
from brdf_tables import centres, constant, few_cells, lobes, spike
from bsdfs import evaluated, hemisphere, sampled, towards, weights
from chance import SIGMAS
from pictures import mean_and_error, outputs, picture
from pxr import Sdf
from usd_stage import scene_of, stage_of

import warprender as wr
from warprender.material_tables import MaterialTables
from warprender.materials.brdf_table import albedo_angles, angles, directions
from warprender.materials.measured_brdf import brdf_at
from warprender.records import BrdfRecord
from warprender.usd import load


def about(vector, axis, angle):
    """Rodrigues' rotation of vectors (N, 3) about an axis by angles (N,)."""
    axis = np.asarray(axis, float)
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return vector * cosine + np.cross(axis, vector) * sine + axis * (vector @ axis)[:, None] * (1 - cosine)


def rusinkiewicz(wo, wi):
    """The angles as they are defined: the half-vector is turned to the pole, the light with it."""
    h = (wo + wi) / np.linalg.norm(wo + wi, axis=1, keepdims=True)
    theta_half, phi_half = np.arccos(h[:, 2]), np.arctan2(h[:, 1], h[:, 0])
    turned = about(about(wi, (0, 0, 1), -phi_half), (0, 1, 0), -theta_half)
    return theta_half, np.arccos(turned[:, 2]), np.arctan2(turned[:, 1], turned[:, 0]) % np.pi


def test_half_and_difference_angles_are_rusinkiewiczs():
    wo, wi = hemisphere(4096, 3), hemisphere(4096, 4)
    expected = rusinkiewicz(wo, wi)
    for found, exact in zip(angles(wo, wi)[:2], expected, strict=False):
        np.testing.assert_allclose(found, exact, atol=1e-7)
    # φ_diff is an angle modulo π.
    np.testing.assert_allclose(np.sin(angles(wo, wi)[2] - expected[2]), 0.0, atol=1e-6)


def test_directions_have_the_angles_of_their_cells():
    cells = (9, 7, 12)
    wo, wi = directions(cells)
    for w in (wo, wi):
        np.testing.assert_allclose(np.linalg.norm(w, axis=-1), 1.0, atol=1e-12)
    for found, centre in zip(angles(wo, wi), centres(cells), strict=True):
        np.testing.assert_allclose(found, np.broadcast_to(centre, cells), atol=1e-9)


def merl_bytes(cells, planes):
    return struct.pack("<3i", *cells) + np.asarray(planes, "<f8").tobytes()


def test_a_file_is_read_as_merls_program_reads_it(tmp_path):
    # BRDFRead.cpp: index = φ_diff + θ_diff · 180 + θ_half · 180 · 90 in each plane, times the plane's scale.
    cells, file = (4, 3, 6), tmp_path / "numbered.binary"
    count = 4 * 3 * 6
    file.write_bytes(merl_bytes(cells, np.arange(3 * count)))
    table = wr.BrdfTable.read(file)
    for i, j, k in ((0, 0, 0), (3, 2, 5), (2, 1, 4), (0, 2, 3)):
        index = k + j * 6 + i * 6 * 3
        expected = [index / 1500, (index + count) * 1.15 / 1500, (index + 2 * count) * 1.66 / 1500]
        np.testing.assert_allclose(table.values[i, j, k], expected, rtol=1e-6)


def test_at_centres_a_cell_says_its_own_value(tmp_path):
    table = lobes()
    wo, wi = directions(table.cells)
    above = (wo[..., 2] > 1e-6) & (wi[..., 2] > 1e-6)
    # The device rounds angles to float32: 2e-7 of a radian is 2e-5 of the smallest cell's width.
    found = evaluated(wr.MeasuredBRDF(table), wo[above], wi[above])["diffuse"] / wi[above][:, 2:]
    steepest = max(np.abs(np.diff(table.filled, axis=axis)).max() for axis in range(3))
    np.testing.assert_allclose(found, table.values[above], rtol=1e-5, atol=1e-4 * steepest)
    np.testing.assert_allclose(table.at(wo[above], wi[above]), table.values[above], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("make", [lobes, few_cells])
def test_between_centres_it_is_linear_in_the_stored_coordinates(make):
    # An independent float64 trilinear look-up at the angles as they are defined.
    table = make()
    wo, wi = hemisphere(20000, 5), hemisphere(20000, 6)
    count = table.cells
    theta_half, theta_diff, phi_diff = rusinkiewicz(wo, wi)
    places = [
        np.clip(np.sqrt(theta_half / (np.pi / 2)) * count[0] - 0.5, 0, count[0] - 1),
        np.clip(theta_diff / (np.pi / 2) * count[1] - 0.5, 0, count[1] - 1),
        phi_diff / np.pi * count[2] - 0.5,
    ]
    below = [np.floor(place).astype(int) for place in places]
    expected = np.zeros((len(wo), 3))
    for corner in np.indices((2, 2, 2)).reshape(3, -1).T:
        weight, index = 1.0, []
        for axis in range(3):
            share = places[axis] - below[axis]
            weight = weight * (share if corner[axis] else 1 - share)
            index.append((below[axis] + corner[axis]) % count[axis])
        expected += weight[:, None] * table.filled[tuple(index)]
    found = evaluated(wr.MeasuredBRDF(table), wo, wi)
    np.testing.assert_allclose(found["diffuse"] / wi[:, 2:], expected, rtol=2e-4, atol=2e-4 * expected.max())
    np.testing.assert_allclose(table.at(wo, wi), expected, rtol=1e-6, atol=1e-6)
    assert (found["specular"] == 0).all()


def test_swapped_directions_give_the_same_bits():
    @wp.kernel(module="unique", enable_backward=False)
    def look_up(
        brdf: BrdfRecord,
        wo: wp.array(dtype=wp.vec3),
        wi: wp.array(dtype=wp.vec3),
        there: wp.array(dtype=wp.vec3),
        back: wp.array(dtype=wp.vec3),
    ):
        i = wp.tid()
        there[i] = brdf_at(brdf, wo[i], wi[i])
        back[i] = brdf_at(brdf, wi[i], wo[i])

    n = 1 << 16
    wo, wi = hemisphere(n, 7).astype(np.float32), hemisphere(n, 8).astype(np.float32)
    # Mirror pairs, pairs in one plane, equal ones, and the normal.
    wi[:1000] = wo[:1000] * np.float32([-1, -1, 1])
    wi[1000:2000] = towards(np.linspace(0.001, 1, 1000), 0.3)
    wo[1000:2000] = towards(np.linspace(1, 0.001, 1000) ** 2, 0.3 + np.pi)
    wi[2000:3000] = wo[2000:3000]
    wo[3000:4000] = (0, 0, 1)
    wo[4000:5000, 1] = wi[4000:5000, 1] = 0
    for table in (lobes(), few_cells()):
        record, kept = table.upload("cpu")
        there, back = wp.empty(n, dtype=wp.vec3), wp.empty(n, dtype=wp.vec3)
        wp.launch(look_up, n, [record, wp.array(wo, dtype=wp.vec3), wp.array(wi, dtype=wp.vec3), there, back])
        assert len(kept) == 3 and np.isfinite(there.numpy()).all()
        np.testing.assert_array_equal(there.numpy(), back.numpy())


def test_below_the_horizon_it_is_black():
    look = wr.MeasuredBRDF(constant(0.3))
    up, down = towards(0.5), towards(-1e-3)
    for wo, wi in ((up, down), (down, up), (down, down), (up, towards(0.0)), (towards(0.0), up)):
        value = evaluated(look, wo[None], wi[None])
        assert (value["diffuse"] == 0).all() and value["pdf"][0] == 0
        assert (look.table.at(wo, wi) == 0).all()


@pytest.mark.parametrize("cosine", [1.0, 0.8, 0.3, 0.05, 0.02])
@pytest.mark.parametrize("make", [lobes, few_cells])
def test_samples_add_up_to_the_albedo_by_quadrature(make, cosine):
    table = make()
    weight = weights(sampled(wr.MeasuredBRDF(table), towards(cosine), 1 << 17))
    # Midpoints in sin²(θ/2) and φ of the light, without the half-vector that both ways of the code go through.
    half2 = (np.arange(600) + 0.5) / 600 / 2
    phi = (np.arange(600) + 0.5) / 600 * 2 * np.pi
    z = np.broadcast_to(1 - 2 * half2[:, None], (600, 600))
    wi = towards(z, phi)
    expected = (table.at(towards(cosine), wi) * z[..., None]).mean((0, 1)) * 2 * np.pi
    error = weight.std(0) / np.sqrt(len(weight))
    assert (np.abs(weight.mean(0) - expected) < SIGMAS * error + 2e-3 * expected).all()
    assert (expected <= table.largest_albedo() * (1 + 1e-3)).all()
    # Drawn from the data, samples spread far less than cosine-weighted ones.
    assert (weight.std(0) < 0.6 * weight.mean(0)).all()


def test_the_albedo_of_a_constant_is_exact():
    table = constant((0.5 / np.pi, 0.25 / np.pi, 1 / np.pi))
    np.testing.assert_allclose(table.albedos, np.broadcast_to((0.5, 0.25, 1.0), table.albedos.shape), rtol=2e-4)
    assert 1.0 <= table.largest_albedo() < 1.011


def test_a_spike_keeps_its_light():
    look = wr.MeasuredBRDF(spike())
    wo = towards(np.cos(np.radians(30.5)))
    weight = weights(sampled(look, wo, 1 << 20))
    # All of its light lies within 0.4° of the mirror's direction: uniform directions of that cap.
    n, radius = 1 << 20, 0.007
    u, angle = np.random.default_rng(0).random((2, n))
    height = 1 - u * (1 - np.cos(radius))
    sine, angle = np.sqrt(1 - height**2), 2 * np.pi * angle
    mirror = wo * (-1, -1, 1)
    tangent = np.cross(mirror, (0, 0, 1)) / np.linalg.norm(np.cross(mirror, (0, 0, 1)))
    wi = (sine * np.cos(angle))[:, None] * tangent + (sine * np.sin(angle))[:, None] * np.cross(mirror, tangent)
    wi += height[:, None] * mirror
    reflected = look.table.at(wo, wi)[:, 0] * wi[:, 2] * 2 * np.pi * (1 - np.cos(radius))
    error = np.hypot(reflected.std(), weight[:, 0].std()) / np.sqrt(n)
    assert error < 0.05 * reflected.mean()
    assert abs(reflected.mean() - weight[:, 0].mean()) < SIGMAS * error


def test_black_data_reflect_nothing():
    black = wr.MeasuredBRDF(constant(0.0))
    samples = sampled(black, towards(0.7), 1 << 14)
    assert (weights(samples) == 0).all()
    # With nothing to draw from, all samples are cosine-weighted.
    np.testing.assert_allclose(samples["pdf"], samples["direction"][:, 2] / np.pi, rtol=1e-5)
    assert black.largest_albedo() == 0.0 and black.table.warnings == []
    scene, camera = ball(black)
    plan = wr.Renderer(scene, camera, (8, 8)).plan
    assert plan.bounds["bounces"] == 0
    color, _ = picture(scene, camera, 8, 4)
    assert color[4, 4, 3] == 1.0 and (color[..., :3] == 0).all()


def test_missing_cells_are_as_their_neighbours():
    whole = constant((0.2, 0.3, 0.1), (8, 9, 10)).values.copy()
    whole[3, 4:, 2] = -1.0
    whole[3, 0, 2] = -0.5
    whole[5] = -1e-3
    whole[0, :, 1, 1] = -1.0  # one channel is enough
    table = wr.BrdfTable(whole)
    np.testing.assert_array_equal(table.filled, np.broadcast_to(np.float32([0.2, 0.3, 0.1]), table.filled.shape))
    count = int(table.warnings[0].split()[0])
    wo, wi = directions(table.cells)
    assert count == ((wo[..., 2] > 0) & (wi[..., 2] > 0) & (whole < 0).any(-1)).sum() > 0
    found = evaluated(wr.MeasuredBRDF(table), towards(0.4), hemisphere(500))
    np.testing.assert_allclose(found["diffuse"] / hemisphere(500)[:, 2:], [[0.2, 0.3, 0.1]] * 500, rtol=1e-5)


def test_the_nearest_along_theta_diff_stands_in():
    values = np.full((1, 5, 1, 3), -1.0)
    values[0, 1], values[0, 4] = 0.1, 0.4
    filled = wr.BrdfTable(values).filled[0, :, 0, 0]
    np.testing.assert_allclose(filled, [0.1, 0.1, 0.1, 0.4, 0.4])


def test_too_bright_data_are_said_to_be():
    table = constant(1.5 / np.pi)
    assert len(table.warnings) == 1 and "1.5" in table.warnings[0]
    scene, camera = ball(wr.MeasuredBRDF(table))
    renderer = wr.Renderer(scene, camera, (8, 8))
    assert renderer.plan.bounds["albedo"] == 1.0
    assert any("/ball" in warning and "reflects up to" in warning for warning in scene.warnings)


def ball(material, **light):
    scene = wr.Scene()
    scene.add_sphere("/ball", material=material)
    scene.add_light(wr.DomeLight(**light))
    return scene, scenes.window(1.9)


def test_a_white_measured_ball_disappears_in_a_white_dome():
    scene, camera = ball(wr.MeasuredBRDF(constant(1 / np.pi)))
    color, error = picture(scene, camera, 24, 64, dome_light_visible=True)
    mean, sigma = mean_and_error(color, error)
    assert abs(mean - 1) < SIGMAS * sigma + 1e-5 and sigma < 2e-3
    assert (np.abs(color[..., :3] - 1) < 5 * error + 1e-5).all()


def test_a_ball_in_a_dome_shows_the_directional_albedo():
    table = lobes()
    scene, camera = ball(wr.MeasuredBRDF(table))
    color, error = picture(scene, camera, 24, 256)
    y, x = np.indices((24, 24))
    radius2 = ((x - 11.5) / 24 * 1.9) ** 2 + ((y - 11.5) / 24 * 1.9) ** 2
    # Away from the rim a pixel's directions lie within 4° of its centre's.
    inner = radius2 < 0.6
    theta = np.arcsin(np.sqrt(radius2[inner]))
    expected = np.stack([np.interp(theta, albedo_angles(), table.albedos[:, c]) for c in range(3)], -1)
    z = (color[..., :3][inner] - expected) / np.hypot(error[inner], 3e-3 * expected)
    assert np.abs(z).max() < 5 and abs(z.mean()) < 0.3


def test_lights_and_chance_agree_on_measured_gloss():
    # The lamp is aimed at (independent estimates of the shadow ray) and met by the drawn directions; where the lamp
    # fills much of the lobe the two must weigh to one. Against quadrature over the lamp's solid angle.
    table = lobes()
    scene = wr.Scene()
    points, faces = scenes.quad(0.01)
    scene.add_mesh("/floor", points, faces, material=wr.MeasuredBRDF(table))
    scene.add_light(wr.SphereLight(radius=0.8, intensity=2.0), pose=(1.5, 0, 2, 0, 0, 0, 1))
    view = scenes.camera((-1.5, 0, 2), up=(0, 0, 1), fov=0.05)
    color, error = picture(scene, view, 8, 1024, bounces=0)
    wo = np.array([-1.5, 0, 2]) / 2.5
    sine = 0.8 / 2.5
    u, v = ((np.arange(400) + 0.5) / 400 for _ in range(2))
    height = 1 - u[:, None] * (1 - np.sqrt(1 - sine**2))
    across = np.sqrt(1 - height**2)
    axis, side, up = np.array([1.5, 0, 2]) / 2.5, np.array([0, 1.0, 0]), np.array([-2, 0, 1.5]) / 2.5
    angle = 2 * np.pi * v
    wi = (
        (across * np.cos(angle))[..., None] * side + (across * np.sin(angle))[..., None] * up + height[..., None] * axis
    )
    expected = 2.0 * (table.at(wo, wi) * wi[..., 2:]).mean((0, 1)) * 2 * np.pi * (1 - np.sqrt(1 - sine**2))
    spread = np.sqrt((error**2).sum((0, 1))) / 64
    z = (color[..., :3].mean((0, 1)) - expected) / np.hypot(spread, 5e-4 * expected)
    assert (np.abs(z) < SIGMAS).all() and (spread < 2e-3 * expected).all()


def test_the_albedo_output_is_the_albedo_along_the_normal():
    table = lobes()
    scene, camera = ball(wr.MeasuredBRDF(table))
    found = outputs(scene, camera, ("albedo",))["albedo"][8, 8]
    np.testing.assert_allclose(found, table.albedos[0], rtol=1e-6)


BAD_FILES = {
    "empty": (b"", "it has 0 bytes"),
    "a picture": (b"\x89PNG\r\n", "it has 6 bytes"),
    "no cells": (merl_bytes((0, 90, 180), []), "0 × 90 × 180 cells"),
    "negative sizes": (merl_bytes((-90, 90, 180), []), "-90 × 90 × 180 cells"),
    "cut short": (merl_bytes((4, 3, 6), np.zeros(215)), "4 × 3 × 6 cells take 1740 bytes, and it has 1732"),
    "too long": (merl_bytes((4, 3, 6), np.zeros(217)), "4 × 3 × 6 cells take 1740 bytes, and it has 1748"),
    "huge": (merl_bytes((2**31 - 1, 2**31 - 1, 2**31 - 1), np.zeros(3)), "cells take"),
    "nan": (merl_bytes((1, 1, 2), [0, 0, 0, np.nan, 0, 0]), "1 of its 6 numbers are not finite"),
    "infinite": (merl_bytes((1, 1, 1), [np.inf, 0, 1e300]), "2 of its 3 numbers are not finite"),
    "all missing": (merl_bytes((1, 1, 2), [-1.0] * 6), "all of its cells are marked missing"),
}


@pytest.mark.parametrize("fault", BAD_FILES)
def test_a_bad_file_is_one_line_with_its_name(fault, tmp_path):
    content, message = BAD_FILES[fault]
    file = tmp_path / "bad.binary"
    file.write_bytes(content)
    with pytest.raises(ValueError) as caught:
        wr.MeasuredBRDF(file)
    text = str(caught.value)
    assert text.startswith(f"{file}: ") and message in text and "\n" not in text


def test_no_file_and_no_table_are_said(tmp_path):
    for path in (tmp_path / "none.binary", tmp_path, str(tmp_path / "s.usdz[a.binary]")):
        with pytest.raises(ValueError, match="cannot be read"):
            wr.MeasuredBRDF(path)
    with pytest.raises(ValueError, match=r"shape .*not \(3, 3\)"):
        wr.BrdfTable(np.zeros((3, 3)))


def test_what_is_written_reads_back_bit_for_bit(tmp_path):
    table = lobes()
    table.write(tmp_path / "lobes.binary")
    again = wr.BrdfTable.read(tmp_path / "lobes.binary")
    np.testing.assert_array_equal(again.values, table.values)
    assert again.cells == (40, 30, 24)
    # A file that changes is read anew.
    few_cells().write(tmp_path / "lobes.binary")
    assert wr.BrdfTable.read(tmp_path / "lobes.binary").cells == (4, 3, 2)


def stage_text(file="./brass.binary", more=""):
    return f"""def Material "A" {{ token outputs:surface.connect = </A/s.outputs:surface>
            {more}
            def Shader "s" {{ uniform token info:id = "warprender:MeasuredBRDF"
                {file and f"asset inputs:file = @{file}@"}
                token outputs:surface }} }}
        def Sphere "x" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {{ rel material:binding = </A> }}"""


def write_stage(text, path):
    stage = stage_of(text)
    stage.GetRootLayer().Export(str(path))


def test_a_stage_refers_to_a_file_beside_it_or_in_its_package(tmp_path):
    few_cells().write(tmp_path / "brass.binary")
    write_stage(stage_text(), tmp_path / "s.usda")
    loose = load(tmp_path / "s.usda")
    assert isinstance(loose.materials["/A"], wr.MeasuredBRDF) and loose.placements["/x"].material == "/A"
    with Sdf.ZipFileWriter.CreateNew(str(tmp_path / "s.usdz")) as archive:
        for name in ("s.usda", "brass.binary"):
            archive.AddFile(str(tmp_path / name), name)
    packed = load(str(tmp_path / "s.usdz"))
    for scene in (loose, packed):
        assert scene.warnings == []
        np.testing.assert_array_equal(scene.materials["/A"].table.values, few_cells().values)
    plan = wr.Renderer(loose, scenes.window(3.0), (8, 8)).plan
    assert plan.reasons["material MeasuredBRDF"] == "/x"
    assert "MeasuredBRDF" in plan.path.materials and "material MeasuredBRDF" not in plan.absent


def test_what_is_odd_about_the_data_is_said_once_with_prim_and_file(tmp_path):
    values = constant(1.5 / np.pi, (4, 3, 2)).values.copy()
    values[0, 0, 0] = -1.0
    wr.BrdfTable(values).write(tmp_path / "brass.binary")
    write_stage(stage_text(), tmp_path / "s.usda")
    scene = load(tmp_path / "s.usda")
    assert len(scene.warnings) == 2
    for warning, words in zip(scene.warnings, ("1 of ", "it reflects up to 1.5"), strict=True):
        assert warning.startswith(f"/A: {tmp_path / 'brass.binary'}: {words}")
    wr.Renderer(scene, scenes.window(3.0), (8, 8))
    assert len(scene.warnings) == 2


def test_materials_share_the_table_of_a_file(tmp_path):
    few_cells().write(tmp_path / "brass.binary")
    scene = wr.Scene()
    for k in range(3):
        scene.add_sphere(f"/{k}", material=wr.MeasuredBRDF(tmp_path / "brass.binary"))
    scene.add_sphere("/other", material=wr.MeasuredBRDF(few_cells()))
    tables = MaterialTables(scene.materials, scene.materials)
    assert len(tables.brdfs) == 2 and list(tables.materials["table"]) == [-1, 0, 0, 0, 1]


def test_the_file_comes_through_the_material_interface(tmp_path):
    few_cells().write(tmp_path / "brass.binary")
    text = stage_text("", f"asset inputs:data = @{tmp_path / 'brass.binary'}@").replace(
        "token outputs:surface }", "asset inputs:file.connect = </A.inputs:data>\ntoken outputs:surface }"
    )
    assert scene_of(text).materials["/A"].table.cells == (4, 3, 2)


@pytest.mark.parametrize("file", ["./none.binary", "./bad.binary", ""])
def test_a_stage_with_a_bad_file_is_drawn_without_it(file, tmp_path):
    (tmp_path / "bad.binary").write_bytes(b"none")
    write_stage(stage_text(file), tmp_path / "s.usda")
    scene = load(tmp_path / "s.usda")
    assert scene.placements["/x"].material == ""
    (warning,) = scene.warnings
    assert warning.startswith("/A/s: ") and file.removeprefix("./") in warning and "as if unbound" in warning
