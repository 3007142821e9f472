"""Sampled volumes: NanoVDB grids as solids, in Python and in stages; and what bounds the steps of rays through them."""

import re

import numpy as np
import pytest
import scenes
import warp as wp
from test_sdf import aovs
from usd_stage import scene_of

import warprender as wr
from warprender.shapes.sdf import sampled_lipschitz
from warprender.shapes.volume import dense

SPACING, REACH = 0.05, 1.3


def ball_values(sign=1.0):
    x = np.arange(-REACH, REACH + SPACING / 2, SPACING)
    return sign * (np.linalg.norm(np.stack(np.meshgrid(x, x, x, indexing="ij")), axis=0) - 1.0)


def volume(values, spacing=SPACING, place=(-REACH,) * 3):
    """The grid; outside of the values it holds 0.3, which is outside of the ball too."""
    values = np.ascontiguousarray(values, np.float32)
    return wp.Volume.load_from_numpy(values, place, spacing, bg_value=0.3, device="cpu")


def lit(scene):
    scene.add_light(wr.RectLight(intensity=6.0), pose=scenes.look_at((2, 3, 4)))
    scene.add_mesh(
        "/ground", *scenes.quad(6.0, -1.0), color=(0.6,) * 3, pose=scenes.look_at((0, 0, 0), (0, -1, 0), (0, 0, 1))
    )
    return scene


def test_a_grid_is_made_dense_where_it_is():
    values, bounds = dense(volume(ball_values()))
    points = [np.linspace(*bounds[:, axis], values.shape[axis]) for axis in range(3)]
    assert all(np.allclose(np.diff(p), SPACING, atol=1e-6) for p in points)
    place = np.stack(np.meshgrid(*points, indexing="ij"))
    given = (np.abs(place) < REACH + 1e-5).all(0)
    assert given.sum() == ball_values().size
    np.testing.assert_allclose(values[given], np.linalg.norm(place, axis=0)[given] - 1.0, atol=1e-6)
    assert (values[~given] == np.float32(0.3)).all()


def test_a_volume_and_its_samples_are_one_solid():
    seen = []
    for given in (volume(ball_values()), ball_values()):
        scene = wr.Scene()
        bounds = () if isinstance(given, wp.Volume) else ([(-REACH,) * 3, (REACH,) * 3],)
        scene.add_sdf("/ball", given, *bounds)
        seen.append(aovs(scene, scenes.camera((1, 2, 4))))
    # The gradient is taken over a step that follows from the bounds.
    for name, tolerance in (("cameraDepth", 1e-4), ("normal", 5e-3)):
        np.testing.assert_allclose(seen[0][name], seen[1][name], atol=tolerance)


def test_interpolation_never_changes_faster_than_its_bound():
    """Hostile samples: white noise on a grid of unequal spacing; float64 trilinear interpolation in pairs of places."""
    rng = np.random.default_rng(7)
    for values in (rng.normal(size=(6, 4, 5)), ball_values(), rng.normal(size=(2, 2, 2)) ** 5):
        bounds = np.array([(-1.0, 0.0, 2.0), (1.0, 0.5, 5.0)])
        bound = sampled_lipschitz(values.astype(np.float32), bounds)
        p = rng.uniform(*bounds, size=(200_000, 3))
        q = np.clip(p + rng.normal(size=p.shape) * 10 ** rng.uniform(-4, 0, (len(p), 1)), *bounds)
        apart = np.linalg.norm(p - q, axis=1)
        steepest = (np.abs(trilinear(values, bounds, p) - trilinear(values, bounds, q)) / np.maximum(apart, 1e-9)).max()
        assert steepest <= bound * (1 + 1e-4)
        assert steepest > 0.3 * bound


def trilinear(values, bounds, p):
    cells = np.array(values.shape) - 1
    x = (p - bounds[0]) / (bounds[1] - bounds[0]) * cells
    i = np.minimum(x.astype(int), cells - 1)
    w = x - i
    total = np.zeros(len(p))
    for corner in np.ndindex(2, 2, 2):
        share = np.prod(np.where(corner, w, 1 - w), axis=1)
        total += share * values[tuple((i + corner).T)]
    return total


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        (lambda: wp.Volume.allocate([0, 0, 0], [7, 7, 7], 1.0, bg_value=0, device="cpu"), "holds int32, not float"),
        (lambda: wp.Volume.allocate([0, 0, 0], [7, 7, 7], 1.0, bg_value=(0.0,) * 3, device="cpu"), "holds Vec3f"),
    ],
)
def test_volumes_that_cannot_be_drawn_name_why(given, reason):
    with pytest.raises(wr.SceneError, match=f"/solid: .*{reason}"):
        wr.Scene().add_sdf("/solid", given())


@pytest.mark.parametrize("matrix", [np.eye(3)[[1, 0, 2]], np.diag([1.0, 1.0, -1.0]), np.eye(3) + np.eye(3, k=1)])
def test_grids_that_are_turned_mirrored_or_sheared_are_not_drawn(matrix, monkeypatch):
    info = wp.Volume.get_grid_info
    monkeypatch.setattr(wp.Volume, "get_grid_info", lambda v: info(v)._replace(transform_matrix=wp.mat33f(matrix)))
    with pytest.raises(wr.SceneError, match="/solid: its grid is turned, sheared or mirrored"):
        wr.Scene().add_sdf("/solid", volume(ball_values()))


def stage(file, field="OpenVDBAsset", more="", fields="rel field:surface = </v/surface>"):
    return f"""
        def Volume "v" {{ {fields}
            color3f[] primvars:displayColor = [(0.8, 0.3, 0.2)]
            double3 xformOp:translate = (0.5, 0, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
            def {field} "surface" {{ asset filePath = @{file}@
                {more} }} }}"""


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("volumes")
    for name, values in (
        ("ball", ball_values()),
        ("fog", np.maximum(ball_values(-1.0), 0)),
        ("inverse", ball_values(-1.0)),
    ):
        volume(values).save_to_nvdb(str(folder / f"{name}.nvdb"), codec="zip" if name == "ball" else "none")
    (folder / "broken.nvdb").write_bytes((folder / "fog.nvdb").read_bytes()[:5000])
    (folder / "ball.vdb").write_bytes(b" BDV" + bytes(100))
    return folder


def test_a_stage_s_level_set_is_drawn_and_shadows_its_ground(files):
    scene = scene_of(stage(files / "ball.nvdb", more='token fieldClass = "levelSet"'))
    assert not scene.warnings
    solid, reference = scene.placements["/v"], wr.Scene()
    np.testing.assert_array_equal(solid.shape.primvars["displayColor"].values, np.float32([[0.8, 0.3, 0.2]]))
    reference.add_sphere("/v", 1.0, pose=(0.5, 0, 0, 0, 0, 0, 1), color=(0.8, 0.3, 0.2))
    view = scenes.camera((1, 2, 5))
    drawn, exact = aovs(scene, view), aovs(reference, view)
    both = (drawn["primId"] == 0) & (exact["primId"] == 0)
    assert ((drawn["primId"] == 0) != (exact["primId"] == 0)).sum() < 0.03 * both.sum()
    # Linear interpolation is off by h²/8 for each of the two directions in which the distance is curved, by 1/r = 1.
    off = np.linalg.norm(drawn["position"][both] - (0.5, 0, 0), axis=1) - 1.0
    assert np.abs(off).max() < 1.05 * 2 * SPACING**2 / 8
    pictures = [wr.render(lit(s), (24, 24), 16, camera=view, bounces=1).numpy("color") for s in (scene, reference)]
    ground = ~both.reshape(24, 2, 24, 2).any((1, 3))
    assert np.abs(pictures[0] - pictures[1])[ground].mean() < 0.02 * pictures[1][ground].mean()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (lambda f: stage(f / "ball.vdb"), r"only NanoVDB files \(.nvdb\) are read"),
        (lambda f: stage(f / "fog.nvdb"), "no level set"),
        (lambda f: stage(f / "ball.nvdb", more='token fieldClass = "fogVolume"'), "fog is not drawn"),
        (lambda f: stage(f / "none.nvdb"), "cannot be opened"),
        (lambda f: stage(f / "broken.nvdb"), "broken.nvdb: "),
        (lambda f: stage(f / "ball.nvdb", more='token fieldName = "other"'), "there is no grid 'other'"),
        (lambda f: stage(f / "ball.nvdb", field="Field3DAsset"), "Field3DAsset is not read"),
        (lambda f: stage(f / "ball.nvdb", fields=""), "it has no field"),
        (lambda f: stage(f / "ball.nvdb", fields="rel field:a = </nothing>"), "field a: nothing is not read"),
        (lambda f: stage(""), "no file"),
    ],
)
def test_what_is_no_level_set_is_one_warning(files, text, reason):
    scene = scene_of(text(files) + 'def Sphere "ball" {}')
    assert list(scene.placements) == ["/ball"]
    (warning,) = scene.warnings
    assert warning.startswith("/v: Volume is not drawn yet: ")
    assert re.search(reason, warning)


def test_of_several_fields_the_level_set_is_drawn(files):
    fields = "rel field:density = </v/surface>\n rel field:hull = </hull>"
    hull = f'def OpenVDBAsset "hull" {{ asset filePath = @{files / "ball.nvdb"}@ }}'
    scene = scene_of(stage(files / "fog.nvdb", fields=fields) + hull)
    assert list(scene.placements) == ["/v"] and not scene.warnings
