"""Displacement moves points along the normal, keeps joined what is joined, and turns normals with the surface."""

import numpy as np
import OpenImageIO as oiio
import pytest
from usd_stage import scene_of

import warprender as wr
from warprender.materials.displacement import displaced
from warprender.shapes import Mesh, Primvar, Sphere
from warprender.texture_lookup import sampled
from warprender.textures import PrimvarReader, Texture

RNG = np.random.default_rng(4)


def grid(n, split=False):
    """A unit square of n × n quads facing +Z, with st; `split` gives each quad points of its own."""
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    points = np.stack([x, y, 0 * x], -1).reshape(-1, 3).astype(np.float32)
    i = np.add.outer(np.arange(n) * (n + 1), np.arange(n)).reshape(-1, 1)
    faces = i + [0, 1, n + 2, n + 1]
    if split:
        points, faces = points[faces.reshape(-1)], np.arange(4 * n * n).reshape(-1, 4)
    mesh = Mesh.from_polygons(points, np.full(n * n, 4), faces.reshape(-1))
    mesh.primvars["st"] = Primvar(points[:, :2].copy(), "vertex")
    mesh.normals = Primvar(np.tile(np.float32([0, 0, 1]), (len(points), 1)), "vertex")
    return mesh


def ramp(scale=1.0, bias=0.0):
    """A picture whose bilinear value is s between the centres of its first and last texel."""
    row = ((np.arange(16) + 0.5) / 16).astype(np.float32)
    return Texture(np.tile(row, (2, 1)), "r", wrapS="clamp", wrapT="clamp", scale=(scale,) * 4, bias=(bias,) * 4)


@pytest.mark.parametrize("wrap", ["black", "clamp", "repeat", "mirror"])
def test_host_look_up_interpolates_and_wraps(wrap):
    pixels = RNG.random((3, 5, 4)).astype(np.float32)
    texture = Texture(pixels, wrapS=wrap, wrapT=wrap, transform=[[1, 0, 0.1], [0, -2, 0.3]], scale=(2,) * 4)
    st = RNG.uniform(-3, 3, (200, 2))
    place = st * (1, -2) + (0.1, 0.3)
    expected = np.zeros((200, 4))
    texels = pixels[::-1].astype(np.float64)
    for k, (x, y) in enumerate(place * (5, 3) - 0.5):
        for i in (int(np.floor(x)), int(np.floor(x)) + 1):
            for j in (int(np.floor(y)), int(np.floor(y)) + 1):
                weight = (1 - abs(x - i)) * (1 - abs(y - j))
                indices = []
                for index, size in ((i, 5), (j, 3)):
                    if wrap == "black":
                        weight *= 0 <= index < size
                    if wrap == "mirror" and (index // size) % 2:
                        index = -1 - index
                    indices.append(index % size if wrap in ("repeat", "mirror") else min(max(index, 0), size - 1))
                expected[k] += 2 * weight * texels[indices[1], indices[0]]
    np.testing.assert_allclose(sampled(texture, st), expected, atol=2e-6)


@pytest.mark.parametrize("split", [False, True])
def test_a_plane_becomes_its_height_field(split):
    mesh = grid(32, split)
    moved = displaced(mesh, ramp(0.5, 0.25))
    s = mesh.points[:, 0].astype(np.float64)
    height = 0.25 + 0.5 * np.clip(s, 1 / 32, 31 / 32)
    np.testing.assert_allclose(moved.points[:, 2], height, atol=1e-6)
    np.testing.assert_array_equal(moved.points[:, :2], mesh.points[:, :2])
    inner = (s > 0.1) & (s < 0.9)
    normals = moved.normals.expanded()[moved.corners].reshape(-1, 3)[inner[moved.triangles.reshape(-1)]]
    np.testing.assert_allclose(normals, np.tile([-0.5, 0, 1] / np.sqrt(1.25), (len(normals), 1)), atol=2e-6)


def uv_sphere(rings, segments):
    """A unit sphere with a seam: the points at longitude 0 and 2π are split, and their s are 0 and 1."""
    theta, phi = np.meshgrid(np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, segments + 1), indexing="ij")
    phi[:, -1] = 0.0
    points = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    s, t = np.meshgrid(np.linspace(0, 1, segments + 1), np.linspace(0, 1, rings + 1))
    i = np.add.outer(np.arange(rings) * (segments + 1), np.arange(segments)).reshape(-1, 1)
    faces = (i + [0, segments + 1, segments + 2, 1]).reshape(-1)
    points = points.reshape(-1, 3).astype(np.float32)
    mesh = Mesh.from_polygons(points, np.full(rings * segments, 4), faces)
    mesh.normals = Primvar(points, "vertex")
    mesh.primvars["st"] = Primvar(np.stack([s, t], -1).reshape(-1, 2), "vertex")
    return mesh


def test_a_constant_makes_a_sphere_larger_and_leaves_its_normals():
    mesh = uv_sphere(12, 24)
    moved = displaced(mesh, 0.25)
    # The mean of the normals of a quad sphere's triangles is radial but for the triangulation: authored normals count.
    np.testing.assert_allclose(np.linalg.norm(moved.points, axis=1), 1.25, atol=2e-6)
    corners = moved.points[moved.triangles]
    normals = moved.normals.expanded()[moved.corners]
    np.testing.assert_allclose(normals, corners / 1.25, atol=1e-6)
    assert displaced(Sphere(2.0), 0.5).radius == 2.5 and displaced(Sphere(1.0), -3.0).radius == 0.0


def test_no_crack_opens_at_a_seam_of_the_texture_coordinates():
    mesh = uv_sphere(8, 12)
    moved = displaced(mesh, ramp())
    columns = moved.points.reshape(9, 13, 3)
    np.testing.assert_array_equal(columns[:, 0], columns[:, -1])
    # The seam is where s is 0 on one side and 1 on the other: it takes their mean.
    seam = 1.0 + (1 / 32 + 31 / 32) / 2
    np.testing.assert_allclose(np.linalg.norm(columns[1:-1, 0], axis=1), seam, atol=1e-6)


def test_hard_edges_stay_joined_and_hard():
    points = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    split = points[np.reshape(faces, -1)]
    for cube in (
        Mesh.from_polygons(points, np.full(6, 4), np.reshape(faces, -1)),
        Mesh.from_polygons(split, np.full(6, 4), np.arange(24)),
    ):
        moved = displaced(cube, np.sqrt(3.0))
        np.testing.assert_allclose(moved.points, 2 * cube.points, atol=1e-6)
        assert moved.normals is None


def test_two_sheets_back_to_back_part():
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)] * 2, np.float32)
    mesh = Mesh.from_polygons(points, [3, 3], [0, 1, 2, 3, 5, 4])
    moved = displaced(mesh, 0.5)
    np.testing.assert_allclose(moved.points[:, 2], [0.5] * 3 + [-0.5] * 3)


def test_faces_of_other_materials_move_by_their_own_and_meet_half_way():
    mesh = grid(2)
    mesh.face_materials = {"/b": np.array([1, 3], np.int32)}
    moved = displaced(mesh, 0.0, {"/b": 0.5})
    np.testing.assert_allclose(moved.points.reshape(3, 3, 3)[:, :, 2], [[0, 0.25, 0.5]] * 3)


def test_primvars_displace():
    mesh = grid(3)
    mesh.primvars["h"] = Primvar(RNG.random((16, 1)), "vertex")
    np.testing.assert_allclose(displaced(mesh, PrimvarReader("h")).points[:, 2], mesh.primvars["h"].values[:, 0])
    np.testing.assert_allclose(displaced(mesh, PrimvarReader("none", (0.5,))).points[:, 2], 0.5)


def material(displacement, connected=True, extra=""):
    output = "token outputs:displacement.connect = </m/s.outputs:displacement>" if connected else ""
    return f"""def Material "m" {{ token outputs:surface.connect = </m/s.outputs:surface>
        {output}
        def Shader "s" {{ uniform token info:id = "UsdPreviewSurface"
            float inputs:displacement{displacement}
            token outputs:surface
            token outputs:displacement }}
        {extra} }}"""


BOUND = '( prepend apiSchemas = ["MaterialBindingAPI"] )'
QUAD = f"""def Mesh "q" {BOUND} {{ rel material:binding = </m>
    uniform token subdivisionScheme = "%s"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "vertex" ) }}"""


@pytest.mark.parametrize(("complexity", "points"), [(1.0, 4), (1.2, 25)])
def test_a_stage_displaces_the_cage_or_its_subdivision(complexity, points):
    scene = scene_of(QUAD % "bilinear" + material(" = 0.75"), complexity=complexity)
    moved = scene.meshes["/q"].points
    assert len(moved) == points and scene.warnings == []
    np.testing.assert_allclose(moved[:, 2], 0.75)


def test_a_texture_displaces_at_the_subdivided_vertices(tmp_path):
    file = tmp_path / "h.tif"
    pixels = np.zeros((1, 2, 1), np.float32)
    pixels[0, 1] = 1.0
    output = oiio.ImageOutput.create(str(file))
    output.open(str(file), oiio.ImageSpec(2, 1, 1, "float"))
    output.write_image(pixels)
    output.close()
    texture = f"""def Shader "t" {{ uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{file}@
        token inputs:wrapS = "clamp"
        token inputs:wrapT = "clamp"
        float2 inputs:st.connect = </m/p.outputs:result>
        float outputs:r }}
      def Shader "p" {{ uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result }}"""
    scene = scene_of(QUAD % "bilinear" + material(".connect = </m/t.outputs:r>", extra=texture), complexity=1.3)
    points = scene.meshes["/q"].points
    assert len(points) == 81
    np.testing.assert_allclose(points[:, 2], np.clip(2 * points[:, 0] - 0.5, 0, 1), atol=1e-6)


def test_what_cannot_be_displaced_says_so():
    scene = scene_of(QUAD % "none" + material(" = 0.5", connected=False))
    assert not scene.meshes["/q"].points[:, 2].any()
    assert scene.warnings == ["/m: its displacement is not drawn: outputs:displacement is not connected"]
    reader = """def Shader "p" { uniform token info:id = "UsdPrimvarReader_float"
        string inputs:varname = "h"
        float outputs:result }"""
    ball = f'def Sphere "b" {BOUND} {{ rel material:binding = </m> }}'
    scene = scene_of(ball + material(".connect = </m/p.outputs:result>", extra=reader))
    assert len(scene.warnings) == 1 and scene.warnings[0].startswith("/b: it is drawn without its displacement")
    assert scene_of(ball + material(" = 0.5")).placements["/b"].shape.radius == 1.5


def test_instances_with_other_materials_move_by_their_own():
    other = material(" = 0.25").replace('"m"', '"n"').replace("</m/", "</n/")
    second = QUAD.replace('"q"', '"r"').replace("</m>", "</n>")
    scene = scene_of(QUAD % "none" + second % "none" + material(" = 0.5") + other)
    heights = [scene.meshes[path].points[0, 2] for path in ("/q", "/r")]
    assert heights == [0.5, 0.25]


def test_meshes_made_in_python_are_displaced_unless_used_in_place():
    import warp as wp

    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], np.float32)
    scene = wr.Scene()
    mesh = scene.add_mesh("/a", points, [[0, 1, 2]], wr.PreviewSurface(displacement=0.5))
    np.testing.assert_allclose(mesh.points[:, 2], 0.5)
    assert scene.meshes["/a"] is mesh and not points.any(0)[2]
    scene.add_mesh("/b", wp.array(points, dtype=wp.vec3), [[0, 1, 2]], wr.PreviewSurface(displacement=0.5))
    assert scene.warnings == ["/b: it is not displaced: its points are used in place"]
