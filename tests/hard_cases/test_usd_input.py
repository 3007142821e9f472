"""Hard cases U1 to U8 of the catalogue: bad and extreme input costs one warning, and the rest is drawn."""

import numpy as np
import pytest
from usd_stage import scene_of

from warprender import images
from warprender.renderer import Renderer
from warprender.scene import Placement, Scene
from warprender.shapes import Mesh

#: A mesh that must be drawn whatever stands beside it, and the camera that sees it.
GOOD = """def Mesh "good" { int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    uniform token subdivisionScheme = "none"
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (0, 1, 0)] }
def Camera "eye" { double3 xformOp:translate = (0, 0, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"] }
"""


def mesh_text(counts, indices, points, extra="", name="bad"):
    return f"""def Mesh "{name}" {{ int[] faceVertexCounts = {list(counts)}
        int[] faceVertexIndices = {list(indices)}
        uniform token subdivisionScheme = "none"
        point3f[] points = {[tuple(p) for p in points]}
        {extra} }}
    """


def seen_prims(scene: Scene, camera: str = "/eye") -> set[str]:
    """Paths of the prims that the camera sees; -1 is no prim."""
    ids = Renderer(scene, camera, (32, 32), outputs=("primId",)).render().numpy("primId")
    paths = list(scene.placements)
    return {paths[i] for i in np.unique(ids) if i >= 0}


def warnings_of(scene: Scene, path: str) -> list[str]:
    return [warning for warning in scene.warnings if warning.startswith(f"{path}:")]


SQUARE = [(2, -1, 0), (3, -1, 0), (3, 1, 0), (2, 1, 0)]


@pytest.mark.parametrize(
    "counts, indices, warnings",
    [
        pytest.param([4], [0, 1, 2], 1, id="U1-too-few-indices"),
        pytest.param([3], [0, 1, 2, 3, 0], 1, id="U1-too-many-indices"),
        pytest.param([0, 1, 2], [0, 1, 2], 0, id="U1-counts-0-1-2"),
        pytest.param([-3, 3], [0, 1, 2], 1, id="U1-negative-count"),
        pytest.param([3], [0, 1, 9], 1, id="U1-index-past-the-end"),
        pytest.param([3], [0, -1, 2], 1, id="U1-negative-index"),
        pytest.param([3], [0, 1, 2147483647], 1, id="U1-huge-index"),
    ],
)
def test_counts(counts, indices, warnings):
    scene = scene_of(mesh_text(counts, indices, SQUARE) + GOOD)
    assert len(warnings_of(scene, "/bad")) == warnings
    assert "/good" in seen_prims(scene)


def triangles_of(points, count=1) -> np.ndarray:
    """(T, 3, 2) float64 corners in the plane of the triangles of one polygon."""
    scene = scene_of(mesh_text([len(points)], range(len(points)), points))
    mesh = scene.meshes["/bad"]
    return np.asarray(mesh.points, np.float64)[mesh.triangles][..., :2]


def signed_areas(corners: np.ndarray) -> np.ndarray:
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2


L_SHAPE = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0)]


@pytest.mark.parametrize("first", range(6), ids="U2-concave-{}".format)
def test_concave_polygon_is_filled_once(first):
    """U2: no hole and no overlap, whichever corner comes first."""
    areas = signed_areas(triangles_of(L_SHAPE[first:] + L_SHAPE[:first]))
    assert areas.sum() == pytest.approx(3.0, abs=1e-5)
    assert np.abs(areas).sum() == pytest.approx(3.0, abs=1e-5), "nothing is covered twice"


def test_polygon_of_10000_corners():
    """U2: a star, so that every second corner is concave."""
    angle = np.linspace(0, 2 * np.pi, 10_000, endpoint=False)
    radius = np.where(np.arange(10_000) % 2, 1.0, 0.9)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], 1).round(6)
    x, y = points[:, 0], points[:, 1]
    expected = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    areas = signed_areas(triangles_of(points.tolist()))
    assert np.abs(areas).sum() == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(
    "points, area",
    [
        pytest.param([(0, 0, 0), (1, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], 1.0, id="U2-repeated-point"),
        pytest.param([(0, 0, 0), (1, 0, 0), (1, 1, 0.3), (0, 1, 0)], 1.0, id="U2-non-planar"),
    ],
)
def test_polygons_that_are_nearly_simple(points, area):
    assert np.abs(signed_areas(triangles_of(points))).sum() == pytest.approx(area, abs=1e-5)


def test_bow_tie_does_no_harm():
    """U2: what a polygon that crosses itself covers is nobody's to say; the others are drawn."""
    tie = mesh_text([4], range(4), [(2, 0, 0), (3, 1, 0), (3, 0, 0), (2, 1, 0)])
    assert "/good" in seen_prims(scene_of(tie + GOOD))


@pytest.mark.parametrize(
    "bad, warnings",
    [
        pytest.param('def Mesh "bad" { int[] faceVertexCounts = [3]\n int[] faceVertexIndices = [0, 1, 2] }', 1,
                     id="U3-no-points"),
        pytest.param('def Mesh "bad" { }', 0, id="U3-nothing"),
        pytest.param(mesh_text([3], range(3), SQUARE, "float3[] extent = []"), 0, id="U3-empty-extent"),
        pytest.param(
            mesh_text([3], range(3), SQUARE, "float3[] extent = [(nan, 0, 0), (1, 1, 1)]"), 0, id="U3-nan-extent"
        ),
        pytest.param(
            mesh_text([3], range(3), SQUARE, 'float[] primvars:displayOpacity = [1] (interpolation = "vertex")'),
            1,
            id="U3-short-primvar",
        ),
        pytest.param(
            mesh_text([3], range(3), SQUARE, "normal3f[] normals = [(0, 0, 1), (0, 0, 1)]"), 1, id="U3-short-normals"
        ),
    ],
)  # fmt: skip
def test_missing_parts(bad, warnings):
    scene = scene_of(bad + GOOD)
    assert len(warnings_of(scene, "/bad")) == warnings
    assert "/good" in seen_prims(scene)


def test_points_of_changing_number_are_held():
    """U3: between two numbers of points there is nothing to interpolate."""
    text = """def Mesh "m" { uniform token subdivisionScheme = "none"
        int[] faceVertexCounts.timeSamples = { 1: [3], 2: [4] }
        int[] faceVertexIndices.timeSamples = { 1: [0, 1, 2], 2: [0, 1, 2, 3] }
        point3f[] points.timeSamples = { 1: [(0, 0, 0), (1, 0, 0), (0, 1, 0)],
            2: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)] } }"""
    assert len(scene_of(text, time=1.5).meshes["/m"].triangles) == 1
    assert len(scene_of(text, time=2).meshes["/m"].triangles) == 2


TRANSLATED = 'double3 xformOp:translate = ({}) \n uniform token[] xformOpOrder = ["xformOp:translate"]'


@pytest.mark.parametrize(
    "bad",
    [
        pytest.param(mesh_text([3], range(3), [(2, 0, 0), (3, 0, 0)]).replace("(3, 0, 0)", "(nan, inf, 0), (0, 0, 0)"),
                     id="U4-points"),
        pytest.param(mesh_text([3], range(3), SQUARE, TRANSLATED.format("nan, 0, 0")), id="U4-transform-nan"),
        pytest.param(mesh_text([3], range(3), SQUARE, TRANSLATED.format("0, inf, 0")), id="U4-transform-inf"),
        pytest.param('def SphereLight "bad" { float inputs:intensity = nan }', id="U4-light"),
        pytest.param('def RectLight "bad" { float inputs:width = inf }', id="U4-light-size"),
        pytest.param('def Sphere "bad" { double radius = nan }', id="U4-radius"),
    ],
)  # fmt: skip
def test_numbers_that_are_not_finite(bad):
    scene = scene_of(bad + GOOD)
    assert len(warnings_of(scene, "/bad")) == 1
    assert "/good" in seen_prims(scene)


@pytest.mark.parametrize("field", ["focalLength = nan", "horizontalAperture = inf", "verticalApertureOffset = nan"])
def test_a_camera_that_is_not_finite_leaves_the_others(field):
    """U4: it is refused when it is asked for, and disturbs nothing otherwise."""
    scene = scene_of(f'def Camera "bad" {{ float {field} }}' + GOOD)
    assert "/good" in seen_prims(scene)
    with pytest.raises(ValueError, match="/bad"):
        Renderer(scene, "/bad", (8, 8), outputs=("primId",))


INSTANCER = """def PointInstancer "p" {{ rel prototypes = </p/s>
    int[] protoIndices = {indices}
    point3f[] positions = {positions}
    {extra}
    def Mesh "s" {{ int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        uniform token subdivisionScheme = "none"
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)] }} }}
"""


@pytest.mark.parametrize(
    "indices, extra, drawn, warned",
    [
        pytest.param([0, 7, -1], "", 1, True, id="U5-proto-index-out-of-range"),
        pytest.param([0, 0, 0], "quath[] orientations = [(0, 0, 0, 0), (1, 0, 0, 0), (1, 0, 0, 0)]", None, False,
                     id="U5-orientation-of-length-0"),
        pytest.param([0, 0, 0], "float3[] scales = [(0, 0, 0), (1, 1, 1), (1, 1, 0)]", 1, True, id="U5-scale-0"),
        pytest.param([0, 0, 0], "float3[] scales = [(nan, 1, 1), (1, 1, 1), (1, 1, 1)]", 2, True, id="U5-scale-nan"),
        pytest.param([0, 0, 0], "int64[] ids = [4294967296, 9000000000, 3]\n int64[] invisibleIds = [9000000000]",
                     2, False, id="U5-ids-above-2-31"),
    ],
)  # fmt: skip
def test_instances(indices, extra, drawn, warned):
    positions = [(2, 0, 0), (2, 2, 0), (2, 4, 0)]
    scene = scene_of(INSTANCER.format(indices=indices, positions=positions, extra=extra) + GOOD)
    copies = len(scene.placements["/p/s"].transforms)
    assert copies == drawn if drawn is not None else copies >= 2
    assert bool([w for w in scene.warnings if w.startswith("/p")]) == warned
    assert {"/good", "/p/s"} - seen_prims(scene) <= {"/p/s"}


def test_instances_nested_8_deep():
    """U5: two copies at each of eight levels are 256 triangles of one shape."""
    inner = """def Mesh "s" { int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)] }"""
    name = "s"
    for level in range(8):
        inner = f"""def PointInstancer "p{level}" {{ int[] protoIndices = [0, 0]
            rel prototypes = <{name}>
            point3f[] positions = [(0, 0, 0), ({2**level}, 0, 0)]
            {inner} }}"""
        name = f"p{level}"
    (placement,) = scene_of(inner).placements.values()
    x = np.sort(placement.transforms[:, 3, 0])
    np.testing.assert_array_equal(x, np.arange(256))
    assert len(np.unique(placement.instance_ids)) == 256


def test_a_million_instances():
    """U5: every copy is there, and what the camera looks at has the right id."""
    count = 1000
    grid = np.stack([*np.meshgrid(np.arange(count), np.arange(count)), np.zeros((count, count))], -1).reshape(-1, 3)
    scene = Scene()
    mesh = scene.add_mesh("/m", [(-0.4, -0.4, 0), (0.4, -0.4, 0), (0.4, 0.4, 0), (-0.4, 0.4, 0)], [(0, 1, 2, 3)])
    transforms = np.tile(np.eye(4), (len(grid), 1, 1))
    transforms[:, 3, :3] = grid
    scene.placements = {"/many": Placement("/many", mesh, transforms, "", np.arange(len(grid), dtype=np.int32))}
    seen = Renderer(scene, _above(500, 500), (4, 4), outputs=("instanceId",)).render().numpy("instanceId")
    assert set(np.unique(seen)) - {-1} == {y * count + x for x in (499, 500) for y in (499, 500)}


def _above(x: float, y: float):
    """An orthographic camera of two units, whose pixels' centres lie on the shapes at half-integer distances."""
    from warprender.camera import Camera

    transform = np.eye(4)
    transform[3, :3] = x - 0.5, y - 0.5, 10
    return Camera("orthographic", horizontalAperture=20, verticalAperture=20, transform=transform)


@pytest.mark.parametrize(
    "unit, warned", [(0.01, False), (0.001, False), (1, False), (0, True), (-1, True)], ids="U6-{}".format
)
def test_units_leave_the_picture_alone(unit, warned):
    """U6: metersPerUnit says what a unit is, not how large the picture is."""
    scene = scene_of(GOOD, f"metersPerUnit = {unit}")
    assert seen_prims(scene) == {"/good"}
    assert bool(scene.warnings) == warned
    assert scene.meters_per_unit == (0.01 if warned else unit)


def test_the_up_axis_turns_the_automatic_camera():
    """U6: the same model, lying, in a stage whose up axis is Z."""
    upright = mesh_text([3], range(3), [(0, 0, 0), (2, 0, 0), (0, 3, 0)])
    lying = mesh_text([3], range(3), [(0, 0, 0), (2, 0, 0), (0, 0, 3)])
    pictures = [
        Renderer(scene_of(text, f'upAxis = "{axis}"'), None, (32, 32), outputs=("primId",)).render().numpy("primId")
        for text, axis in ((upright, "Y"), (lying, "Z"))
    ]
    np.testing.assert_array_equal(*pictures)
    assert (pictures[0] == 0).any()


@pytest.mark.parametrize("number", [2**24 + 1, 2**31 - 1], ids="U7-{}".format)
def test_ids_survive(number):
    """U7: float32 cannot hold 16 777 217."""
    mesh = Mesh.from_polygons(np.array([(-9, -9, 0), (9, -9, 0), (0, 9, 0)], np.float32), [3], [0, 1, 2])
    scene = Scene(placements={"/m": Placement("/m", mesh, np.eye(4), "", np.array([number], np.int32))})
    seen = Renderer(scene, _above(0, 0), (4, 4), outputs=("instanceId",)).render().numpy("instanceId")
    assert (seen == number).all()


def test_a_texture_that_is_not_there():
    """U8: one warning, and the fallback colour."""
    albedo, scene = textured("not_there.png")
    np.testing.assert_allclose(albedo, (0.25, 0.5, 0.75), rtol=1e-5)
    assert len([w for w in scene.warnings if w.startswith("/m/")]) == 1


@pytest.mark.parametrize("content", [b"", b"\x89PNG\r\n\x1a\n", b"no picture"], ids="U8-{}".format)
def test_a_texture_without_pixels(tmp_path, content):
    (tmp_path / "broken.png").write_bytes(content)
    albedo, scene = textured(tmp_path / "broken.png")
    np.testing.assert_allclose(albedo, (0.25, 0.5, 0.75), rtol=1e-5)
    assert len([w for w in scene.warnings if w.startswith("/m/")]) == 1


@pytest.mark.parametrize("size", [(1, 1), (1, 16384), (16384, 1), (16384, 16)], ids=lambda s: f"U8-{s[1]}x{s[0]}")
def test_a_texture_of_extreme_size(tmp_path, size):
    images.write_png(tmp_path / "big.png", np.full((*size, 4), (0.5, 0.25, 0.125, 1)), color_correction="disabled")
    albedo, scene = textured(tmp_path / "big.png")
    np.testing.assert_allclose(albedo, np.array([128, 64, 32]) / 255, rtol=1e-5)
    assert not scene.warnings


def textured(file):
    """Albedo (3,) of a surface with a texture in the middle of the picture, and the scene."""
    scene = scene_of(
        GOOD.replace('"good"', '"good" ( apiSchemas = ["MaterialBindingAPI"] )').replace(
            "point3f[]", "rel material:binding = </m>\n point3f[]"
        )
        + f"""def Material "m" {{ token outputs:surface.connect = </m/s.outputs:surface>
        def Shader "s" {{ uniform token info:id = "UsdPreviewSurface"
            int inputs:useSpecularWorkflow = 1
            color3f inputs:diffuseColor.connect = </m/t.outputs:rgb>
            token outputs:surface }}
        def Shader "t" {{ uniform token info:id = "UsdUVTexture"
            asset inputs:file = @{file}@
            float2 inputs:st = (0.5, 0.5)
            token inputs:sourceColorSpace = "raw"
            float4 inputs:fallback = (0.25, 0.5, 0.75, 1)
            float3 outputs:rgb }} }}"""
    )
    albedo = Renderer(scene, "/eye", (32, 32), outputs=("albedo",)).render().numpy("albedo")
    return albedo[16, 16], scene
