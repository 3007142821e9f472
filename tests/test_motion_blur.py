"""Motion blur: samples are taken while the shutter is open, each at a time of its own."""

import numpy as np
import pytest
import scenes
from chance import z_of
from pictures import prepare
from usd_stage import scene_of, stage_of

import warprender as wr
from warprender.sampling import REPLICATES
from warprender.shutter import MOST_TIMES, shutter_share
from warprender.usd import StageReader

GLOW = wr.PreviewSurface(diffuseColor=(0, 0, 0), emissiveColor=(1, 1, 1), ior=1.0)
#: Emission seen directly: nothing is scattered.
SEEN = "color:0"

MATERIAL = """def Material "glow" { token outputs:surface.connect = </glow/s.outputs:surface>
    def Shader "s" { uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0, 0, 0)
        color3f inputs:emissiveColor = (1, 1, 1)
        token outputs:surface } }
"""
QUAD = """int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    rel material:binding = </glow>
    """
CORNERS = "point3f[] points = [(-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0)]\n"
#: Sees -2 to 2 both ways, in 16 by 16 pixels of 1/4.
CAMERA = """def Camera "cam" {{ token projection = "orthographic"
    float horizontalAperture = 40
    float verticalAperture = 40
    float2 clippingRange = (0.1, 100)
    double shutter:open = {0}
    double shutter:close = {1}
    double3 xformOp:translate = (0, 0, 5)
    uniform token[] xformOpOrder = ["xformOp:translate"] }}
"""
SLIDE = """double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 10: (10, 0, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
    """


def stage_text(body, opens=0.0, closes=1.0):
    return MATERIAL + CAMERA.format(opens, closes) + body


def seen(scene, samples=64, seed=0, size=16, camera="cam", **options):
    """What is seen directly: (H, W) float64."""
    frame = prepare(scene, camera, size, outputs=SEEN, **options).render(samples=samples, seed=seed)
    return frame.numpy(SEEN)[..., 0].astype(np.float64)


def slide(step=(1.0, 0.0, 0.0), size=1.0, opens=0.0, closes=1.0):
    """A square that goes one step a frame, and what looks at it."""
    scene = wr.Scene()
    points, faces = scenes.quad(size)
    placement = scene.placements
    scene.add_mesh("/quad", points, faces, material=GLOW)

    def motion(time):
        matrix = np.eye(4)
        matrix[3, :3] = time * np.array(step)
        placement["/quad"].transforms = matrix[None]

    scene.motion = motion
    return scene, scenes.window(4.0, shutterOpen=opens, shutterClose=closes)


def columns(left, right, size=16, extent=4.0):
    """The share of each of `size` columns of a picture `extent` wide that an interval covers."""
    edges = np.linspace(-extent / 2, extent / 2, size + 1)
    return np.clip(np.minimum(right, edges[1:]) - np.maximum(left, edges[:-1]), 0, None) / np.diff(edges)


def ramp(width=1.0, step=1.0, opens=0.0, closes=1.0):
    """Columns of a square of this width that slides: the mean over the time, by midpoints."""
    times = opens + (closes - opens) * (np.arange(20000) + 0.5) / 20000
    return np.mean([columns(t * step - width / 2, t * step + width / 2) for t in times], axis=0)


def assert_blurred(draw, expected, seeds=3):
    """Columns of the rows in the middle have these means, over 64 samples of each seed.

    An edge crosses a column in 8 of a replicate's 32 parts of the time, and there are two: the variance of a pixel is
    at most 16/4 / 32² / 2, however its own samples lie, and 4.5 of its roots are allowed.
    """
    found = np.mean([draw(seed)[7:9].mean(0) for seed in range(seeds)], axis=0)
    np.testing.assert_allclose(found, expected, atol=4.5 * np.sqrt(16 / 4 / 32**2 / 2 / seeds))


def test_times_are_spread_evenly_and_differ_between_replicates():
    each = MOST_TIMES // int(REPLICATES)
    for seed in (0, 7, 2**32 + 7):
        shares = np.array([shutter_share(seed, sample) for sample in range(MOST_TIMES)])
        assert ((shares >= 0) & (shares < 1)).all() and len(set(shares)) == MOST_TIMES
        for replicate in range(int(REPLICATES)):
            own = shares[replicate :: int(REPLICATES)]
            for count in (1, 2, 4, 8, 16, each):
                assert sorted((own[:count] * count).astype(int)) == list(range(count))
        assert shutter_share(seed, MOST_TIMES + 5) == shares[5]
    assert shutter_share(7, 3) == shutter_share(2**32 + 7, 3) != shutter_share(8, 3)


def test_a_sliding_square_is_a_linear_ramp():
    scene, camera = slide()
    expected = ramp()
    # By hand: from the first column touched, x from -0.5 to 0.5 fades in over one unit of four columns.
    np.testing.assert_allclose(expected[6:10], [0.125, 0.375, 0.625, 0.875], atol=1e-3)
    found = np.array([seen(scene, seed=seed, camera=camera)[7:9].mean(0) for seed in range(12)])
    for column in np.flatnonzero(expected):
        # Student's t of 11 degrees: one false alarm in 1e4.
        assert abs(z_of(found[:, column], expected[column])) < 6.0, column
    assert (found[:, expected == 0.0] == 0.0).all()
    # Times lie one in each 32nd for each of two replicates: no seed may be far off.
    assert np.abs(found - expected).max() < 2 / 32


@pytest.mark.parametrize("visibility", ["raster", "rays"])
def test_other_transports_are_blurred_alike(visibility):
    scene, camera = slide()
    options = {"transport": "local", "visibility": visibility, "sampler": "sobol"}
    renderer = prepare(scene, camera, 16, camera_light="off", **options)
    assert_blurred(lambda seed: renderer.render(64, seed=seed).numpy("color")[..., 0].astype(float), ramp())


def test_the_shutter_may_open_before_the_frame_and_close_after():
    scene, camera = slide(opens=-0.75, closes=0.25)
    assert_blurred(lambda seed: seen(scene, seed=seed, camera=camera), ramp(opens=-0.75, closes=0.25))


BODIES = {
    "transform": f'def Mesh "quad" {{ {QUAD}{CORNERS}{SLIDE} }}',
    "points": f"""def Mesh "quad" {{ {QUAD} point3f[] points.timeSamples = {{
        0: [(-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0)],
        1: [(0.5, -0.5, 0), (1.5, -0.5, 0), (1.5, 0.5, 0), (0.5, 0.5, 0)] }} }}""",
    "parent": f'def Xform "group" {{ {SLIDE} def Mesh "quad" {{ {QUAD}{CORNERS} }} }}',
    "instances": f"""def PointInstancer "many" {{ rel prototypes = [</many/quad>]
        int[] protoIndices = [0]
        point3f[] positions.timeSamples = {{ 0: [(0, 0, 0)], 1: [(1, 0, 0)] }}
        def Mesh "quad" {{ {QUAD}{CORNERS} }} }}""",
    "instance": f"""class Xform "asset" {{ {MATERIAL.replace("/glow", "/asset/glow")}
            def Mesh "quad" {{ {QUAD.replace("/glow", "/asset/glow")}{CORNERS} }} }}
        def Xform "copy" ( instanceable = true
            references = </asset> ) {{ {SLIDE} }}""",
}


@pytest.mark.parametrize("kind", BODIES)
def test_what_moves_in_a_stage_is_blurred(kind):
    scene = scene_of(stage_text(BODIES[kind]), time=0)
    assert_blurred(lambda seed: seen(scene, seed=seed), ramp())


def test_points_that_part_are_blurred():
    # From 1 wide to 3 wide.
    body = f"""def Mesh "quad" {{ {QUAD} point3f[] points.timeSamples = {{
        2: [(-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0)],
        3: [(-1.5, -0.5, 0), (1.5, -0.5, 0), (1.5, 0.5, 0), (-1.5, 0.5, 0)] }} }}"""
    scene = scene_of(stage_text(body), time=2)
    times = (np.arange(20000) + 0.5) / 20000
    expected = np.mean([columns(-0.5 - t, 0.5 + t) for t in times], axis=0)
    assert_blurred(lambda seed: seen(scene, seed=seed), expected)


def test_what_vanishes_is_seen_for_its_time():
    body = f"""def Mesh "quad" {{ {QUAD}{CORNERS}
        token visibility.timeSamples = {{ 0: "inherited", 0.25: "invisible" }} }}
        def Mesh "late" {{ {QUAD}{CORNERS} token visibility.timeSamples = {{ 0: "invisible", 0.75: "inherited" }} }}"""
    scene = scene_of(stage_text(body), time=0)
    order = list(scene.placements)
    assert_blurred(lambda seed: seen(scene, seed=seed), 0.5 * columns(-0.5, 0.5))
    assert list(scene.placements) == order == ["/quad"]


def test_a_spoke_turns_by_its_angle():
    # A triangle from the centre turns by a quarter in the frame: rotation, not a blend of matrices.
    body = """def Mesh "spoke" { int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        rel material:binding = </glow>
        point3f[] points = [(0, 0, 0), (1.9, -0.5, 0), (1.9, 0.5, 0)]
        float xformOp:rotateZ.timeSamples = { 0: 0, 1: 90 }
        uniform token[] xformOpOrder = ["xformOp:rotateZ"] }"""
    scene = scene_of(stage_text(body), time=0)
    pictures = np.array([seen(scene, seed=seed) for seed in range(6)])
    angles = np.radians(90 * (np.arange(512) + 0.5) / 512)
    x, y = (np.arange(128) + 0.5) / 32 - 2, 2 - (np.arange(128) + 0.5) / 32
    u = x[None, None, :] * np.cos(angles)[:, None, None] + y[None, :, None] * np.sin(angles)[:, None, None]
    v = y[None, :, None] * np.cos(angles)[:, None, None] - x[None, None, :] * np.sin(angles)[:, None, None]
    inside = (u < 1.9) & (np.abs(v) < u * 0.5 / 1.9)
    expected = inside.mean(0).reshape(16, 8, 16, 8).mean((1, 3))
    mean, error = pictures.mean(0), pictures.std(0, ddof=1) / np.sqrt(len(pictures))
    # Over the pixels: their errors hang together, as they share their times.
    assert np.sqrt(((mean - expected) ** 2).mean()) < 2.0 * np.sqrt((error**2).mean())
    assert np.abs(mean - expected).max() < 0.1 and np.sqrt((error**2).mean()) < 0.02 and expected.max() > 0.3


def test_a_moving_camera_is_a_scene_that_moves_the_other_way():
    still = f'def Mesh "quad" {{ {QUAD}{CORNERS} }}'
    path = "double3 xformOp:translate.timeSamples = { 0: (0, 0, 5), 10: (10, 0, 5) }"
    text = stage_text(still).replace("double3 xformOp:translate = (0, 0, 5)", path)
    scene = scene_of(text, time=0)
    assert_blurred(lambda seed: seen(scene, seed=seed), ramp(step=-1.0))
    other, camera = slide(step=(-1.0, 0.0, 0.0))
    pictures = seen(scene, seed=3), seen(other, seed=3, camera=camera)
    # The same samples at the same times; rounding may take one of 64 to the other side of an edge.
    assert np.abs(pictures[0] - pictures[1]).max() <= 1 / 64 + 1e-6


def test_what_stands_still_keeps_its_bits():
    scene, camera = slide(step=(0.5, 0.0, 0.0))
    points, faces = scenes.quad(1.0)
    scene.add_mesh("/still", points - (1.25, 0, 0), faces, material=GLOW)
    blurred = seen(scene, camera=camera)
    camera.shutterClose = 0.0
    sharp = seen(scene, camera=camera)
    np.testing.assert_array_equal(blurred[:, :6], sharp[:, :6])
    assert sharp[:, :6].max() == 1.0 and (blurred[:, 6:] != sharp[:, 6:]).any()


def test_a_light_that_moves_blurs_its_picture_and_its_shadow():
    body = """def RectLight "lamp" { float inputs:width = 1
        float inputs:height = 1
        float inputs:intensity = 1
        double3 xformOp:translate.timeSamples = { 0: (0, 0, -1), 1: (1, 0, -1) }
        float3 xformOp:rotateXYZ = (0, 180, 0)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"] }"""
    scene = scene_of(stage_text(body), time=0)
    assert_blurred(lambda seed: seen(scene, seed=seed, lights_visible=True), ramp())


def test_a_sun_that_turns_lights_by_the_mean_of_its_cosines():
    body = """def Mesh "floor" { int[] faceVertexCounts = [4]
            int[] faceVertexIndices = [0, 1, 2, 3]
            point3f[] points = [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)]
            color3f[] primvars:displayColor = [(1, 1, 1)] }
        def DistantLight "sun" { float inputs:intensity = 1
            float inputs:angle = 0
            bool inputs:normalize = 1
            float xformOp:rotateX.timeSamples = { 0: 0, 1: 60 }
            uniform token[] xformOpOrder = ["xformOp:rotateX"] }"""
    scene = scene_of(stage_text(body), time=0)
    still = scene_of(stage_text(body, 0, 0), time=0)
    facing = wr.render(still, camera="cam", resolution=(4, 4), samples=4, transport="local").numpy("color")[0, 0, 0]
    renderer = wr.Renderer(scene, "cam", (4, 4), transport="local")
    found = [renderer.render(64, seed=seed).numpy("color")[0, 0, 0] / facing for seed in range(8)]
    expected = np.sin(np.pi / 3) / (np.pi / 3)
    assert abs(z_of(found, expected)) < 6.0
    assert np.std(found) < 0.01


def test_the_stated_error_is_the_true_one():
    scene, camera = slide()
    expected = np.broadcast_to(ramp(), (4, 16))
    renderer = prepare(scene, camera, 16, outputs=("color", SEEN), camera_light="off", sampler="sobol")
    rows = slice(6, 10)
    stated, true = [], []
    for seed in range(24):
        frame = renderer.render(samples=16, seed=seed)
        picture = frame.numpy("color")[rows, :, 0].astype(float)
        true.append(np.mean((picture - expected) ** 2))
        scale = np.mean(expected**2)
        # Of the whole picture: the other rows are dark, or half of them at the edge.
        stated.append(frame.stats["frame error"] ** 2 * scale)
    # A variance of one degree of freedom a column, shared by rows: 24 frames of four give it to a fifth or so.
    assert 0.5 < np.mean(stated) / np.mean(true) < 2.0


def test_M6_a_shutter_of_no_time_costs_nothing():
    scene, camera = slide(closes=0.0)

    def never(time):
        raise AssertionError("the scene was moved")

    scene.motion = never
    plan = wr.Renderer(scene, camera, (16, 16), transport="local").plan
    assert plan.shutter is None and "motion blur" in plan.absent
    frame = prepare(scene, camera, transport="local").render(samples=4)
    scene.motion = None
    assert wr.Renderer(scene, camera, (16, 16), transport="local").plan.path == plan.path
    plain = prepare(scene, camera, transport="local").render(samples=4)
    np.testing.assert_array_equal(plain.numpy("color"), frame.numpy("color"))


def test_nothing_is_compiled_for_motion():
    scene, camera = slide()
    blurred = wr.Renderer(scene, camera, (16, 16))
    camera.shutterClose = 0.0
    sharp = wr.Renderer(scene, camera, (16, 16))
    assert blurred.plan.path == sharp.plan.path
    assert blurred.plan.shutter == (0.0, 1.0) and sharp.plan.shutter is None
    assert blurred.plan.reasons["motion blur"].startswith("scene.motion")


@pytest.mark.parametrize("attribute", ["disableMotionBlur", "instantaneousShutter"])
def test_render_settings_turn_it_off(attribute):
    settings = f"""def RenderSettings "settings" {{ rel camera = </cam>
        uniform bool {attribute} = 1 }}"""
    scene = scene_of(stage_text(BODIES["transform"] + settings), time=0)
    renderer = wr.Renderer(scene, "cam", (8, 8))
    assert renderer.plan.shutter is None


def test_what_moves_before_or_after_is_not_blurred():
    body = BODIES["transform"].replace("0: (0, 0, 0), 10: (10, 0, 0)", "3: (0, 0, 0), 10: (10, 0, 0)")
    reader = StageReader(stage_of(stage_text(body)))
    plans = {time: wr.Renderer(reader.read(time), "cam", (8, 8)).plan for time in (1, 3, 12)}
    assert plans[1].shutter is None and plans[12].shutter is None
    assert plans[3].reasons["motion blur"].startswith("/quad.xformOp:translate")
    # Off the frame's own time, what stands still has to be fetched all the same.
    late = StageReader(stage_of(stage_text(body, 1.0, 2.0))).read(2)
    assert wr.Renderer(late, "cam", (8, 8)).plan.shutter == (1.0, 2.0)


def test_without_a_time_the_first_sample_is_the_frame():
    body = BODIES["transform"].replace("0: (0, 0, 0), 10: (10, 0, 0)", "5: (0, 0, 0), 6: (1, 0, 0)")
    scene = scene_of(stage_text(body))
    assert_blurred(lambda seed: seen(scene, seed=seed), ramp())
    assert scene_of(stage_text(body), time="default").motion is None


def test_passes_and_interruptions_change_no_bit():
    scene = scene_of(stage_text(BODIES["transform"]), time=0)
    renderer = prepare(scene, "cam", 16, outputs=("color", "cameraDepth"))
    at_rest = scene.placements["/quad"].transforms

    def stop(share, frame):
        if share > 0.2:
            raise KeyboardInterrupt

    cut = renderer.render(samples=64, progress=stop)
    assert cut.stats["interrupted"] and 4 < cut.stats["samples"] < 64
    assert scene.placements["/quad"].transforms is at_rest
    again = renderer.render(samples=cut.stats["samples"])
    np.testing.assert_array_equal(cut.numpy("color"), again.numpy("color"))
    # The other outputs are of the frame's own time.
    np.testing.assert_array_equal(again.numpy("cameraDepth"), cut.numpy("cameraDepth"))
    assert ((again.numpy("cameraDepth") > 0).any(0) == (columns(-0.5, 0.5) > 0)).all()


def test_what_was_changed_in_the_scene_stays():
    scene = scene_of(stage_text(BODIES["transform"]), time=0)
    points, faces = scenes.quad(0.5)
    scene.add_mesh("/mine", points - (1.5, 0, 0), faces, material=GLOW)
    picture = seen(scene, samples=16)
    assert (picture[7:9, 1:3] == 1.0).all()
    assert list(scene.placements) == ["/quad", "/mine"]


def test_a_shutter_that_makes_no_sense_blurs_nothing():
    scene = scene_of(stage_text(BODIES["transform"], 1.0, 0.0), time=0)
    assert any("/cam: shutter:open 1" in line for line in scene.warnings)
    assert scene.cameras["/cam"].shutterClose == 0.0
    with pytest.raises(wr.SceneError, match="shutter"):
        wr.Renderer(wr.Scene(), scenes.window(1.0, shutterClose=np.nan), (4, 4))
