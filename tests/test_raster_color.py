"""Colour whose first hits are rasterized: pixel centres first, the filter's distribution, and the pictures of rays."""

import numpy as np
import pytest
import scenes
from pictures import prepare
from test_first_hits import STAGES
from test_specialised import BUILDERS

import warprender as wr
from warprender.filters import FILTERS, filter_table, pixel_offset
from warprender.sampling import REPLICATES
from warprender.visibility.first_hits import FARTHEST_OFFSET


@pytest.mark.parametrize("name", FILTERS)
def test_offsets_are_distributed_as_the_filter(name):
    """Their mean and variance, over a thousand points that are well spread."""
    table = filter_table(name)
    assert pixel_offset(table, 5, 0) == pytest.approx((0.0, 0.0), abs=1e-7)
    offsets = np.array([pixel_offset(table, 5, i) for i in range(1024)])
    uniform = np.interp((np.arange(4096) + 0.5) / 4096, np.linspace(0, 1, len(table)), table)
    assert np.abs(offsets).max() <= FARTHEST_OFFSET
    np.testing.assert_allclose(offsets.mean(0), 0.0, atol=0.002)
    np.testing.assert_allclose(offsets.var(0), uniform.var(), rtol=0.01)
    assert pixel_offset(table, 6, 1) != pixel_offset(table, 5, 1)


def test_offsets_fill_the_pixel_evenly_within_each_power_of_two():
    """Of 2^k points of a sequence each of 2^a columns by 2^(k − a) rows has one, so that their mean is right."""
    table, step = filter_table("box"), int(REPLICATES)
    for seed in (0, 3, 2**31 + 5):
        points = np.array([pixel_offset(table, seed, i) for i in range(64 * step)]) + 0.5
        for first in range(step):
            own = points[first::step]
            for k, a in [(digits, x) for digits in range(7) for x in range(digits + 1)]:
                for block in range(0, 64, 1 << k):
                    cells = np.floor(own[block : block + (1 << k)] * (1 << a, 1 << (k - a))).astype(int)
                    assert len({tuple(cell) for cell in cells}) == 1 << k
        for n in (4, 8, 16, 32, 64):
            # One point in each n/2-th of a sequence: its mean is off by half of that at most.
            assert np.abs(points[:n].mean(0) - 0.5).max() <= 0.5 * step / n
    # In sixteen samples the mean is right to a hundredth of a pixel (the deviation of 8 random places in eighths, of
    # two sequences: 1/8 / √12 / √16 = 0.009; one in a thousand is beyond 3.5).
    found = [np.mean([pixel_offset(table, seed, i) for i in range(16)], axis=0) for seed in range(50)]
    assert np.std(found) < 0.011


def z_scores(scene, view, samples, **options):
    """Difference of the pictures of raster and rays over its standard error, a pixel and channel."""
    color, spread = [], 0.0
    for visibility in ("raster", "rays"):
        renderer = prepare(scene, view, 32, visibility=visibility, **options)
        assert renderer.plan.color_visibility == visibility
        color.append(renderer.render(samples=samples).numpy("color")[..., :3].astype(np.float64))
        spread = spread + renderer.standard_error() ** 2
    unsure = spread > 1e-12
    return ((color[0] - color[1])[unsure] / np.sqrt(spread[unsure])), np.abs(color[0] - color[1])[~unsure]


@pytest.mark.parametrize("transport", ["local", "direct"])
@pytest.mark.parametrize("build", [BUILDERS[0], BUILDERS[3]])
def test_rasterized_pictures_are_those_of_rays(build, transport):
    """The raster's offsets are better spread than independent ones: z has at most a normal number's deviation."""
    z, same = z_scores(*build(), 256, transport=transport)
    assert z.size > 300
    assert np.abs(z).max() < 5.0 and z.std() < 1.1
    assert same.max(initial=0.0) < 1e-5


@pytest.mark.parametrize("name", list(STAGES)[:4])
def test_at_the_centres_raster_and_rays_shade_the_same(name):
    """One rasterized sample against the lights of the very hit that a ray through the centre finds: by AOV."""
    build, view = STAGES[name]
    scene = build()
    scene.add_light(wr.DistantLight(intensity=np.pi, angle=0.0), pose=scenes.look_at((0.3, 0.5, 1.0)))
    towards = np.array([0.3, 0.5, 1.0]) / np.linalg.norm([0.3, 0.5, 1.0])
    names = ("color", "normal", "albedo")
    renderer = wr.Renderer(scene, view, (48, 48), names, visibility="raster", transport="local")
    frame = renderer.render(samples=1)
    color, normal, albedo = (frame.numpy(n).astype(np.float64) for n in names)
    seen = color[..., 3] > 0
    assert seen.any()
    expected = albedo * np.maximum(normal @ towards, 0.0)[..., None]
    np.testing.assert_allclose(color[seen][:, :3], expected[seen], rtol=1e-5, atol=1e-6)


def test_what_the_rasterizer_cannot_see_is_made_of_rays():
    scene = wr.Scene()
    scene.add_mesh("/floor", *scenes.quad(2.0), material=wr.DisplayColor(opacity=0.5))
    for view, transport, reason in (
        (scenes.camera((0, 0, 5), focusDistance=4.0, fStop=2.0), "local", "depth of field"),
        (scenes.camera((0, 0, 5)), "path", "/floor lets paths straight through"),
    ):
        plan = wr.Renderer(scene, view, (8, 8), visibility="raster", transport=transport).plan
        assert plan.color_visibility == "rays" and reason in plan.reasons["color by rays"]
    assert wr.Renderer(scene, scenes.camera((0, 0, 5)), (8, 8), transport="local").plan.color_visibility == "raster"
