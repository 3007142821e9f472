"""Materials measured into tables, written, read back and drawn: what comes out is what went in, as far as cells go."""

import numpy as np
import pytest
import scenes
from brdf_tables import few_cells
from bsdfs import evaluated, hemisphere, sampled, towards, weights
from chance import SIGMAS
from pictures import mean_and_error, picture
from usd_stage import stage_of

import warprender as wr
from warprender.cli import main
from warprender.materials.brdf_table import MERL_CELLS, directions
from warprender.scene import SceneError

LAMBERT = wr.DisplayColor(color=(0.2, 0.5, 0.8))


def metal(roughness):
    return wr.PreviewSurface(diffuseColor=(0.9, 0.7, 0.3), metallic=1.0, roughness=roughness)


def coated(roughness):
    return wr.PreviewSurface(diffuseColor=(0.6, 0.1, 0.1), roughness=0.6, clearcoat=1.0, clearcoatRoughness=roughness)


def brdf(material, wo, wi):
    value = evaluated(material, wo, wi)
    return (value["diffuse"].astype(float) + value["specular"]) / wi[:, 2:].astype(np.float32)


def cosine_directions(n, seed):
    rng = np.random.default_rng(seed)
    return towards(np.sqrt(rng.random(n)), 2 * np.pi * rng.random(n))


def test_lambert_is_the_same_everywhere():
    table = wr.measure_brdf(LAMBERT)
    assert table.cells == MERL_CELLS and table.remarks == ()
    wo, wi = directions(MERL_CELLS)
    above = (wo[..., 2] > 0) & (wi[..., 2] > 0)
    np.testing.assert_array_equal(table.measured, above)
    np.testing.assert_allclose(table.values[above] * np.pi, np.tile((0.2, 0.5, 0.8), (above.sum(), 1)), rtol=1e-6)
    found = brdf(wr.MeasuredBRDF(table), hemisphere(20000, 3), hemisphere(20000, 4))
    np.testing.assert_allclose(found * np.pi, np.tile((0.2, 0.5, 0.8), (20000, 1)), rtol=3e-6)
    np.testing.assert_allclose(table.albedos, np.tile((0.2, 0.5, 0.8), (len(table.albedos), 1)), rtol=1e-3)


@pytest.mark.parametrize("look", [metal(0.2), coated(0.3)], ids=["metal", "coated"])
def test_a_cell_holds_the_value_at_its_centre(look):
    table = wr.measure_brdf(look, (12, 10, 16))
    wo, wi = directions((12, 10, 16))
    above = (wo[..., 2] > 0) & (wi[..., 2] > 0)
    np.testing.assert_allclose(table.values[above], brdf(look, wo[above], wi[above]), rtol=1e-5)
    # θ_half, θ_diff and φ_diff run as the file's planes do: nothing is transposed.
    assert table.values[0, 0].max() > 3 * table.values[8, 0].max()


#: Material; RMS of the difference over the RMS of the BRDF, for cosine-weighted viewers and lights, all of them and
#: those more than 6° above the horizon (cosines above 0.1); share of the albedo that is off up to 75°. The limits are
#: about 1.3 times what MERL's cells leave. 85 % and more of it lies along the horizon, where BRDFs grow without bound.
GRID_ERRORS = {
    "metal 0.2": (metal(0.2), 0.019, 0.0085, 7.5e-3),
    "metal 0.3": (metal(0.3), 0.013, 0.0045, 4e-3),
    "metal 0.5": (metal(0.5), 0.0045, 0.0014, 2e-3),
    "metal 1.0": (metal(1.0), 0.022, 0.0015, 1.5e-3),
    "coated 0.3": (coated(0.3), 0.028, 0.012, 6e-3),
    "plastic 0.4": (wr.PreviewSurface(diffuseColor=(0.2, 0.5, 0.8), roughness=0.4), 0.02, 0.007, 3.5e-3),
}


@pytest.mark.parametrize("name", GRID_ERRORS)
def test_what_is_read_back_agrees_with_the_material(name, tmp_path):
    material, rms, rms_above, share = GRID_ERRORS[name]
    wr.measure_brdf(material).write(tmp_path / "look.binary")
    assert (tmp_path / "look.binary").stat().st_size == 12 + 24 * 90 * 90 * 180
    copy = wr.MeasuredBRDF(tmp_path / "look.binary")
    wo, wi = cosine_directions(1 << 18, 5), cosine_directions(1 << 18, 6)
    exact, found = brdf(material, wo, wi), brdf(copy, wo, wi)
    above = np.minimum(wo[:, 2], wi[:, 2]) > 0.1
    for where, limit in ((slice(None), rms), (above, rms_above)):
        assert np.sqrt(((found - exact)[where] ** 2).mean() / (exact[where] ** 2).mean()) < limit
    for degrees in (0, 45, 75):
        wo = towards(np.cos(np.radians(degrees)))
        theirs, ours = (weights(sampled(look, wo, 1 << 19)) for look in (material, copy))
        expected = theirs.mean(0)
        error = np.hypot(theirs.std(0), ours.std(0)) / np.sqrt(1 << 19)
        assert (np.abs(ours.mean(0) - expected) < share * expected + SIGMAS * error).all()


def test_a_measured_copy_draws_the_materials_picture():
    # Pixel by pixel in standard errors of the difference; at this roughness albedos are off by 0.1 %.
    material = metal(0.5)
    pictures = []
    for number, look in enumerate((material, wr.MeasuredBRDF(wr.measure_brdf(material)))):
        scene = wr.Scene()
        scene.add_sphere("/ball", material=look)
        scene.add_mesh("/floor", *scenes.quad(6.0, -1.0), material=look)
        scene.add_light(wr.DomeLight(intensity=0.5))
        scene.add_light(wr.SphereLight(radius=0.5, intensity=9.0), pose=(2, 2, 3, 0, 0, 0, 1))
        view = scenes.camera((0, -4, 2.5), up=(0, 0, 1))
        pictures.append(picture(scene, view, 24, 256, seed=number))
    (color, error), (copied, other) = pictures
    lit = (color[..., 3] == 1.0) & (copied[..., 3] == 1.0)
    z = (copied - color)[lit][:, 0] / np.hypot(error, other)[lit][:, 0]
    assert len(z) > 200
    assert abs(z.mean()) < SIGMAS / len(z) ** 0.5 and abs(z.std() - 1) < SIGMAS / (2 * len(z)) ** 0.5
    assert np.abs(z).max() < 5
    mean, sigma = mean_and_error(copied - color, np.hypot(error, other))
    assert abs(mean) < SIGMAS * sigma + 1e-3 * color[..., :3].mean() and sigma < 2e-3 * color[..., :3].mean()


def test_measuring_a_measurement_gives_it_back():
    table = few_cells()
    again = wr.measure_brdf(wr.MeasuredBRDF(table), table.cells)
    np.testing.assert_allclose(again.values[again.measured], table.values[again.measured], rtol=1e-4)


def test_energy_compensation_is_measured_too():
    # White facets of alpha 1, seen from above, scatter 1 - ln 2 once, and all of it in the end.
    white = wr.PreviewSurface(diffuseColor=scenes.WHITE, metallic=1.0, roughness=1.0)
    plain, full = (wr.measure_brdf(white, (90, 45, 18), energy_compensation=on) for on in (False, True))
    np.testing.assert_allclose(plain.albedos[0], 1 - np.log(2), rtol=5e-3)
    np.testing.assert_allclose(full.albedos[:30], 1.0, rtol=1e-2)


def test_what_no_table_can_hold_is_said():
    cells = (8, 8, 8)
    mirror = wr.measure_brdf(wr.PreviewSurface(metallic=1.0, roughness=0.0), cells)
    assert (mirror.values[mirror.measured] == 0).all() and "mirror" in mirror.warnings[0]
    clear = wr.measure_brdf(wr.PreviewSurface(opacity=0.5, roughness=0.5), cells)
    assert len(clear.remarks) == 1 and "goes through" in clear.remarks[0]
    assert wr.measure_brdf(metal(0.5), cells).remarks == ()
    smooth, rough = (wr.measure_brdf(wr.Dielectric(roughness=roughness), cells) for roughness in (0.0, 0.5))
    assert len(smooth.remarks) == 2 and "mirror" in smooth.remarks[0] and "goes through" in smooth.remarks[1]
    assert len(rough.remarks) == 1 and "goes through" in rough.remarks[0] and rough.values.max() > 0


def test_what_varies_is_refused():
    for name in ("diffuseColor", "roughness", "normal"):
        varying = wr.PreviewSurface(**{name: wr.PrimvarReader("tint")})
        with pytest.raises(SceneError, match=f"^{name} varies"):
            wr.measure_brdf(varying)
    for cells in ((0, 9, 9), (9, 9), (-1, 2, 2)):
        with pytest.raises(SceneError, match="three numbers"):
            wr.measure_brdf(LAMBERT, cells)


@pytest.mark.parametrize("cells", [(1, 1, 1), (1, 2, 3), (2, 1, 7)])
def test_the_fewest_cells_are_taken(cells, tmp_path):
    table = wr.measure_brdf(LAMBERT, cells)
    table.write(tmp_path / "few.binary")
    copy = wr.MeasuredBRDF(tmp_path / "few.binary")
    found = brdf(copy, hemisphere(100, 3), hemisphere(100, 4))
    np.testing.assert_allclose(found * np.pi, np.tile((0.2, 0.5, 0.8), (100, 1)), rtol=3e-6)


def test_the_planes_have_merls_scales(tmp_path):
    wr.measure_brdf(LAMBERT, (1, 1, 1)).write(tmp_path / "one.binary")
    planes = np.frombuffer((tmp_path / "one.binary").read_bytes(), "<f8", offset=12)
    np.testing.assert_allclose(planes * (1, 1.15, 1.66) / 1500 * np.pi, (0.2, 0.5, 0.8), rtol=1e-6)


STAGE = """def Material "A" { token outputs:surface.connect = </A/s.outputs:surface>
        def Shader "s" { uniform token info:id = "UsdPreviewSurface"
            float inputs:roughness = 0.5
            token outputs:surface } }
    def Sphere "x" ( prepend apiSchemas = ["MaterialBindingAPI"] ) { rel material:binding = </A> }"""


@pytest.fixture
def stage(tmp_path):
    stage = stage_of(STAGE)
    path = str(tmp_path / "s.usda")
    stage.GetRootLayer().Export(path)
    return path


def test_the_command_measures_a_stages_material(stage, tmp_path, capfd):
    output = str(tmp_path / "a.binary")
    assert main(["measure", stage, "/A", output, "--cells", "12x10x16"]) == 0
    streams = capfd.readouterr()
    assert streams.err == "" and streams.out.startswith(f"{output}: 12 x 10 x 16 cells, albedo along the normal 0.")
    expected = wr.measure_brdf(wr.PreviewSurface(roughness=0.5), (12, 10, 16))
    np.testing.assert_array_equal(wr.BrdfTable.read(output).values, expected.values)


@pytest.mark.parametrize(
    ("material", "output", "message"),
    [
        ("/B", "a.binary", "/B: no drawn prim is bound to such a material; there is /A"),
        ("", "a.binary", "no drawn prim is bound"),
        ("/A", "nowhere/a.binary", "nowhere/a.binary"),
    ],
)
def test_the_command_says_what_is_wrong_in_one_line(material, output, message, stage, tmp_path, capfd):
    output = str(tmp_path / output)
    assert main(["measure", stage, material, output, "--cells", "4x4x4"]) == 1
    err = capfd.readouterr().err
    assert err.count("\n") == 1 and err.startswith("warprender: error: ") and message in err


@pytest.mark.parametrize("cells", ["90", "90x90", "0x1x1", "axbxc", "90,90,180"])
def test_cells_of_another_form_are_wrong_usage(cells, stage, capfd):
    with pytest.raises(SystemExit) as caught:
        main(["measure", stage, "/A", "a.binary", "--cells", cells])
    assert caught.value.code == 2 and "90x90x180" in capfd.readouterr().err
