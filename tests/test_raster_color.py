"""Colour whose first hits are rasterized: pixel centres first, the filter's distribution, and the pictures of rays."""

import numpy as np
import pytest
import scenes
from pictures import prepare
from test_first_hits import STAGES
from test_specialised import BUILDERS

import warprender as wr
from warprender.film import FILTERS, filter_table, pixel_offset
from warprender.visibility.first_hits import FARTHEST_OFFSET


@pytest.mark.parametrize("name", FILTERS)
def test_offsets_are_distributed_as_the_filter(name):
    """Their mean and variance; a thousand points of R2 integrate smooth functions to 1 %."""
    table = filter_table(name)
    assert pixel_offset(table, 5, 0) == pytest.approx((0.0, 0.0), abs=1e-7)
    offsets = np.array([pixel_offset(table, 5, i) for i in range(1024)])
    uniform = np.interp((np.arange(4096) + 0.5) / 4096, np.linspace(0, 1, len(table)), table)
    assert np.abs(offsets).max() <= FARTHEST_OFFSET
    np.testing.assert_allclose(offsets.mean(0), 0.0, atol=0.01)
    np.testing.assert_allclose(offsets.var(0), uniform.var(), rtol=0.02)
    assert pixel_offset(table, 6, 1) != pixel_offset(table, 5, 1)


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
