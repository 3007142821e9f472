"""Hard cases C1 to C9 of the catalogue: far, mirrored, flattened, nested and turning transforms, senseless cameras."""

import numpy as np
import pytest
import warp as wp
from pictures import outputs, prepare
from pictures import picture as lit_picture
from usd_stage import scene_of

from warprender.camera import Camera, camera_ray_function
from warprender.records import CameraRecord
from warprender.renderer import Renderer
from warprender.scene import SceneError

#: From z = 9 down to the origin.
EYE = """def Camera "eye" { double3 xformOp:translate = (0, 0, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"] }
"""


def scaled(text: str, scale: tuple) -> str:
    """A prim's text with a scale."""
    return text.replace(
        "{", f'{{ double3 xformOp:scale = {scale}\n uniform token[] xformOpOrder = ["xformOp:scale"]\n', 1
    )


def picture(scene, output: str, camera: object = "/eye", size: int = 16) -> np.ndarray:
    return Renderer(scene, camera, (size, size), outputs=(output,)).render().numpy(output)


#: A quad whose authored normals lean to +X.
LEANING = """def Mesh "m" { int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    point3f[] points = [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)]
    normal3f[] normals = [(3, 0, 4)] ( interpolation = "constant" ) }
"""


@pytest.mark.parametrize(
    "scale, normal",
    [
        pytest.param((-1, 1, 1), (-0.6, 0, 0.8), id="C2-one-axis"),
        # All three turn the quad's face away: the normal that the viewer sees is the opposite of the authored.
        pytest.param((-1, -1, -1), (0.6, 0, 0.8), id="C2-three-axes"),
        pytest.param((-2, 1, 1), (-3 / 73**0.5, 0, 8 / 73**0.5), id="C2-uneven"),
    ],
)
def test_normals_of_mirrored_shapes(scale, normal):
    seen = picture(scene_of(scaled(LEANING, scale) + EYE), "normal")
    np.testing.assert_allclose(seen[8, 8], normal, atol=1e-6)


@pytest.mark.parametrize(
    "scale, lit",
    [
        pytest.param((1, 1, 1), True, id="C2-authored"),
        pytest.param((-1, 1, 1), True, id="C2-light-one-axis"),
        pytest.param((-1, -1, -1), False, id="C2-light-three-axes"),
    ],
)
def test_mirrored_lights_emit_from_the_authored_side(scale, lit):
    """A rect light at the origin shines down -Z onto the quad, unless its Z is turned."""
    floor = LEANING.replace(", 0)", ", -2)").replace("(3, 0, 4)", "(0, 0, 1)")
    scene = scene_of(scaled('def RectLight "l" { float inputs:intensity = 5 }', scale) + floor + EYE)
    color = prepare(scene, "/eye", 8).render(samples=16).numpy("color")
    assert (color[..., 0].mean() > 0.01) == lit


@pytest.mark.parametrize("s", [1e-6, 1e-20, 1e-39, 0.0], ids=lambda s: f"C3-{s:g}")
def test_flattened_shapes_give_numbers(s):
    """Thin is drawn; a scale of 0 is legal and draws nothing; neither gives NaN."""
    scene = scene_of(scaled('def Sphere "s" { }', (1, 1, s)) + 'def Sphere "good" { double radius = 0.5 }' + EYE)
    frame = Renderer(scene, "/eye", (64, 64), outputs=("normal", "primId")).render()
    assert np.isfinite(frame.numpy("normal")).all()
    paths = list(scene.placements)
    seen = {paths[i] for i in np.unique(frame.numpy("primId")) if i >= 0}
    assert "/good" in seen
    assert "/s" in seen or any("/s" in warning for warning in scene.warnings)
    assert ("/s" in seen) == (s > 0) or s not in (1e-6, 0.0)


def directions(camera: Camera, width: int) -> np.ndarray:
    """(width, 3) directions of the rays through the middle row of a picture of one row."""
    camera_ray = camera_ray_function(("perspective",))

    @wp.kernel(module="unique", enable_backward=False)
    def rays(record: CameraRecord, out: wp.array(dtype=wp.vec3)):
        i = wp.tid()
        out[i] = camera_ray(record, wp.float32(i) + 0.5, 0.5, wp.vec2(0.5, 0.5)).direction

    out = wp.zeros(width, dtype=wp.vec3, device="cpu")
    wp.launch(rays, width, [camera.record(width, 1, np.zeros(3), policy="adjustApertureHeight"), out], device="cpu")
    return out.numpy()


@pytest.mark.parametrize("degrees", [1e-6, 1e-2, 179.9], ids=lambda d: f"C6-{d:g}-degrees")
def test_every_column_has_its_direction(degrees):
    aperture = 2 * 50 * np.tan(np.radians(degrees) / 2)
    seen = directions(Camera(horizontalAperture=aperture, verticalAperture=aperture), 16384)
    assert np.isfinite(seen).all()
    # At 179.9 degrees the outer columns lie closer together than float32 can tell from 1.
    assert degrees > 1 or (np.diff(seen[:, 0]) > 0).all()


@pytest.mark.parametrize(
    "fields",
    [
        pytest.param("float focalLength = 0", id="C6-180-degrees"),
        pytest.param("float horizontalAperture = 0", id="C6-0-degrees"),
        pytest.param("float verticalAperture = -1", id="C6-negative"),
        pytest.param("float2 clippingRange = (5, 5)", id="C7-near-is-far"),
        pytest.param("float2 clippingRange = (9, 5)", id="C7-near-behind-far"),
        pytest.param("float2 clippingRange = (0, 5)", id="C7-near-0"),
        pytest.param("float2 clippingRange = (-1, 5)", id="C7-near-negative"),
        pytest.param("double3 xformOp:scale = (1, 0, 1)\n uniform token[] xformOpOrder = [\"xformOp:scale\"]",
                     id="C7-no-up"),
        pytest.param("double3 xformOp:scale = (1, 1, 0)\n uniform token[] xformOpOrder = [\"xformOp:scale\"]",
                     id="C7-no-direction"),
        pytest.param("double3 xformOp:translate = (nan, 0, 0)\n uniform token[] xformOpOrder = [\"xformOp:translate\"]",
                     id="C7-nan"),
    ],
)  # fmt: skip
def test_a_camera_that_sees_nothing_is_named(fields):
    scene = scene_of(f'def Camera "bad" {{ {fields} }} def Sphere "s" {{ }}')
    with pytest.raises(SceneError, match="/bad"):
        Renderer(scene, "/bad", (8, 8))


@pytest.mark.parametrize("focus", ["inf", "1e30", "1e-30"])
def test_a_lens_focused_anywhere_gives_numbers(focus):
    camera = f'def Camera "eye" {{ float fStop = 1 \n float focusDistance = {focus} }}'
    scene = scene_of('def Sphere "s" { double radius = 3 }' + camera)
    color = prepare(scene, "/eye", 8).render(samples=2)
    assert np.isfinite(color.numpy("color")).all() and color.stats["dropped samples"] == 0


#: A closed box of two units about the origin.
BOX = """def Mesh "box" { int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]
    uniform token subdivisionScheme = "none"
    point3f[] points = [(-1, -1, -1), (-1, -1, 1), (-1, 1, -1), (-1, 1, 1),
        (1, -1, -1), (1, -1, 1), (1, 1, -1), (1, 1, 1)] }
"""
INSIDE = 'def Camera "eye" { float2 clippingRange = (0.001, 100)\n float horizontalAperture = 60 }\n'


def test_C8_inside_a_closed_mesh():
    """C8: back faces are seen, and lit by the camera's light."""
    color = prepare(scene_of(BOX + INSIDE), "/eye").render(samples=4).numpy("color")
    assert (color[..., 3] == 1).all() and (color[..., :3] > 0).all()


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_C8_a_face_on_the_near_plane_is_seen_by_all_pixels_or_none(projection):
    """C8: t = 0 may count or not, but for the whole picture alike."""
    camera = f"""def Camera "eye" {{ token projection = "{projection}"
        float2 clippingRange = (1, 10)
        double3 xformOp:translate = (0, 0, 1)
        uniform token[] xformOpOrder = ["xformOp:translate"] }}"""
    assert len(np.unique(picture(scene_of(LEANING + camera), "primId", size=64))) == 1


def test_C8_inside_a_light():
    """C8: a light is no obstacle, emits outwards only, and leaves no NaN where the camera stands in it."""
    light = 'def SphereLight "l" { float inputs:radius = 0.2\n float inputs:intensity = 5 }'
    frame = prepare(scene_of(BOX + INSIDE + light), "/eye").render(samples=4)
    color = frame.numpy("color")
    assert np.isfinite(color).all() and frame.stats["dropped samples"] == 0
    assert (color[..., 3] == 1).all() and color[..., 0].mean() > 0


def test_C8_inside_glass():
    """C8: the camera starts in the glass of a sphere and sees the dome through its surface."""
    glass = """def Sphere "s" ( apiSchemas = ["MaterialBindingAPI"] ) { rel material:binding = </m> }
        def Material "m" { token outputs:surface.connect = </m/p.outputs:surface>
        def Shader "p" { uniform token info:id = "UsdPreviewSurface"
            float inputs:opacity = 0
            float inputs:roughness = 0
            token outputs:surface } }
        def DomeLight "d" { }"""
    frame = prepare(scene_of(glass + INSIDE), "/eye", dome_light_visible=True).render(samples=8)
    color = frame.numpy("color")
    assert np.isfinite(color).all() and frame.stats["dropped samples"] == 0
    assert 0.5 < color[..., 0].mean() <= 1 + 1e-4, "no light is made"


#: A unit cube and a camera of its own, five units away, both moved together; the light is at the camera.
CUBE = """def Xform "x" {{ double3 xformOp:translate = {place}
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Cube "cube" {{ double size = 1 }}
    def Camera "eye" {{ double3 xformOp:translate = (1.3, 2.2, 4.3)
        float3 xformOp:rotateXYZ = (-26, 16, 0)
        float2 clippingRange = (0.1, 100)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"] }} }}
"""


@pytest.mark.parametrize("distance", [1e5, 1e6, 1e7], ids=lambda d: f"C1-{d:g}")
def test_far_from_the_origin_the_picture_is_the_same(distance):
    """1e7 units are the catalogue's 10,000 km; moved by numbers that float32 cannot hold."""
    pictures = []
    for place in ((0, 0, 0), (distance + 0.1, -2 * distance, distance / 3)):
        scene = scene_of(CUBE.format(place=place))
        names = ("primId", "normal", "cameraDepth", "albedo")
        pictures.append(outputs(scene, scene.cameras["/x/eye"], names, 32))
        pictures[-1]["color"] = lit_picture(scene, scene.cameras["/x/eye"], 32, 4, bounces=0)[0]
    here, there = pictures
    np.testing.assert_array_equal(here["primId"], there["primId"])
    assert (here["primId"] == 0).mean() > 0.03
    for name in ("normal", "cameraDepth", "albedo"):
        np.testing.assert_allclose(here[name], there[name], atol=1e-5)
    np.testing.assert_allclose(here["color"], there["color"], atol=1 / 255)


def test_C4_a_chain_of_twenty_turns_and_steps_composes_in_float64():
    """C4: the catalogue has 2.5e-5 for a chain in float32."""
    text, expected = 'def Sphere "s" { }', np.eye(4)
    for i in range(20):
        angle = 17.0 + i
        text = f"""def Xform "x{i}" {{ double3 xformOp:translate = (10, {i}, -3)
            double xformOp:rotateZ = {angle}
            double xformOp:rotateX = {2 * angle}
            uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateZ", "xformOp:rotateX"] {text} }}"""
        c, s = np.cos(np.radians([angle, 2 * angle])), np.sin(np.radians([angle, 2 * angle]))
        about_z = np.array([(c[0], s[0], 0, 0), (-s[0], c[0], 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)])
        about_x = np.array([(1, 0, 0, 0), (0, c[1], s[1], 0), (0, -s[1], c[1], 0), (0, 0, 0, 1)])
        step = np.eye(4)
        step[3, :3] = 10, i, -3
        expected = expected @ about_x @ about_z @ step
    (placement,) = scene_of(text).placements.values()
    np.testing.assert_allclose(placement.transforms[0], expected, atol=1e-11)
    linear = placement.transforms[0, :3, :3]
    np.testing.assert_allclose(linear @ linear.T, np.eye(3), atol=1e-14)


def test_C9_a_turn_that_drifted_is_made_one_again():
    """C9: 1e5 products in float32; the camera's axes are of unit length and at right angles all the same."""
    angle = np.float32(1e-3)
    step = np.array([(1, angle, 0), (-angle, 1, angle), (0, -angle, 1)], np.float32)
    turn = np.eye(3, dtype=np.float32)
    for _ in range(3000):
        turn = turn @ step
    assert abs(np.linalg.det(turn) - 1) > 4e-3, "the catalogue's drift, reached in fewer steps"
    transform = np.eye(4)
    transform[:3, :3] = turn
    axes = Camera(transform=transform).frame_of_reference()
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-15)
    record = Camera(transform=transform).record(8, 8, np.zeros(3))
    rotation = np.array(record.rotation, np.float64).reshape(3, 3)
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=3e-7)


@pytest.mark.parametrize("op, zero, half_turn", [
    pytest.param("quatf xformOp:orient", "(1, 0, 0, 0)", "(0, 0, 0, 1)", id="C5-quaternions"),
    pytest.param("float xformOp:rotateZ", "0", "180", id="C5-angles"),
])  # fmt: skip
@pytest.mark.parametrize("share", [0.25, 0.5, 0.75])
def test_turns_between_samples_are_turns(op, zero, half_turn, share):
    name = op.split()[1]
    scene = scene_of(
        f"""def Sphere "s" {{ {op}.timeSamples = {{ 0: {zero}, 1: {half_turn}, }}
            uniform token[] xformOpOrder = ["{name}"] }}""",
        time=share,
    )
    matrix = scene.placements["/s"].transforms[0, :3, :3]
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-6)
    # At exactly half a turn either way round is right.
    x, y = np.cos(np.pi * share), np.sin(np.pi * share)
    np.testing.assert_allclose(np.abs(matrix[0]), [abs(x), y, 0], atol=1e-6)
    assert matrix[0, 0] == pytest.approx(x, abs=1e-6)


def test_matrices_between_samples_are_mixed_element_by_element():
    """C5: as USD has it; half way between opposite matrices nothing is left, and that is said and not drawn."""
    text = """def Sphere "s" { matrix4d xformOp:transform.timeSamples = {
            0: ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)),
            1: ((-1, 0, 0, 0), (0, -1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)), }
        uniform token[] xformOpOrder = ["xformOp:transform"] }"""
    np.testing.assert_allclose(np.diag(scene_of(text, time=0.25).placements["/s"].transforms[0]), [0.5, 0.5, 1, 1])
    halfway = scene_of(text, time=0.5)
    assert not halfway.placements and [w for w in halfway.warnings if w.startswith("/s:")]
