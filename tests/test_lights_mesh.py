"""Geometry that shines: by its material, by MeshLightAPI, by GeometryLight."""

import numpy as np
import pytest
from chance import SIGMAS, polygon_irradiance
from light_scenes import assert_illuminance, floor, illuminance, pose
from pictures import picture
from scenes import cube, icosphere, window
from usd_stage import scene_of

import warprender as wr
from warprender.emitters import lit
from warprender.lights import MeshLight, RectLight, Shadow, SphereLight
from warprender.plan import analyse

CORNERS = np.array([(-0.7, -0.4, 1.0), (-0.7, 0.6, 1.2), (0.5, 0.6, 1.2), (0.5, -0.4, 1.0)])


def glow(*color):
    """A material that emits and reflects nothing."""
    return wr.PreviewSurface(diffuseColor=(0, 0, 0), metallic=1.0, emissiveColor=color)


def expected(corners=CORNERS):
    """Irradiance of the floor under radiance 1."""
    return polygon_irradiance(np.zeros(3), np.array([0, 0, 1.0]), corners)


def test_a_glowing_mesh_is_aimed_at():
    scene = floor()
    scene.add_mesh("/lamp", CORNERS, [[0, 1, 2, 3]], material=glow(3.0, 2.0, 1.0))
    assert list(lit(scene, False)) == ["/lamp (glows)"]
    assert_illuminance(scene, expected() * np.array([3, 2, 1.0]), within=0.01)


@pytest.mark.parametrize(("width", "height", "z"), [(0.6, 0.4, 1.0), (2.0, 2.0, 0.5), (4.0, 4.0, 0.05)])
@pytest.mark.parametrize("cells", [1, 8])
def test_a_glowing_mesh_converges_as_a_rect_light_does(width, height, z, cells):
    by_mesh, by_light = floor(), floor(RectLight(width=width, height=height, transform=pose((0.1, 0, z))))
    x, y = np.linspace(-0.5, 0.5, cells + 1) * width + 0.1, np.linspace(-0.5, 0.5, cells + 1) * height
    points = [(a, b, z) for a in x for b in y]
    corner = np.array([(i * (cells + 1) + j) for i in range(cells) for j in range(cells)])
    faces = corner[:, None] + (0, 1, cells + 2, cells + 1)
    by_mesh.add_mesh("/lamp", points, faces, material=glow(1, 1, 1))
    options = {"sampler": "independent"}
    (mesh, mesh_error), (light, light_error) = illuminance(by_mesh, **options), illuminance(by_light, **options)
    assert abs(mesh[0] - light[0]) < SIGMAS * np.hypot(mesh_error[0], light_error[0])
    # Both uniform in solid angle; among two triangles the tree chooses by what each may send, among many better.
    assert mesh_error[0] < 1.8 * light_error[0]


@pytest.mark.parametrize("outwards", [1, -1])
@pytest.mark.parametrize("both_sides", [False, True])
def test_a_closed_mesh_is_aimed_at_from_outside(both_sides, outwards):
    points, faces = icosphere(2)
    placed = points * 0.3 * (1, 1.5, 0.7) + (0.4, 0, 1.5)
    scene = floor(MeshLight(prim="/lamp", intensity=2.0, bothSides=both_sides))
    pose_of_lamp = pose((0.4, 0, 1.5), scale=(0.3, 0.45, 0.21))
    scene.add_mesh("/lamp", points, faces[:, ::outwards], color=(0, 0, 0), pose=pose_of_lamp)
    corners = placed[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    seen = corners[np.sum(normals * corners[:, 0], 1) < 0]
    expected = 2.0 * sum(polygon_irradiance(np.zeros(3), np.array([0, 0, 1.0]), c) for c in seen)
    dark = outwards < 0 and not both_sides
    assert_illuminance(scene, 0.0 if dark else expected, within=0.03)


def test_a_cube_without_a_face_is_aimed_at_from_both_sides():
    # Open: from the floor the inside is seen through the missing bottom.
    points, faces = cube(1.0)
    scene = floor(MeshLight(prim="/lamp", intensity=2.0, bothSides=True))
    bottom = [face for face in faces if np.all(points[face][:, 2] < 0)]
    rest = [face for face in faces if face not in bottom]
    scene.add_mesh("/lamp", points, rest, color=(0, 0, 0), pose=pose((0, 0, 0.8)))
    window = [(-0.5, -0.5, 0.3), (0.5, -0.5, 0.3), (0.5, 0.5, 0.3), (-0.5, 0.5, 0.3)]
    assert_illuminance(scene, 2.0 * expected(window))


def test_many_triangles_share_leaves(monkeypatch):
    points, faces = icosphere(3)
    found = []
    for most in (2**16, 100):
        monkeypatch.setattr("warprender.upload_lights.MOST_LEAVES", most)
        scene = floor()
        scene.add_mesh("/lamp", points, faces, material=glow(1, 2, 3), pose=pose((0.4, 0, 1.5), scale=0.3))
        found.append(illuminance(scene, samples=1024))
    (each, each_error), (shared, shared_error) = found
    assert (np.abs(each - shared) < SIGMAS * np.hypot(each_error, shared_error)).all()
    assert each_error[0] < shared_error[0] < 0.02 * shared[0]


@pytest.mark.parametrize("scale", [(1, 1, 1), (2.0, 0.3, 0.7)])
def test_instances_and_scale(scale):
    points, faces = icosphere(3)
    scene = floor()
    scene.add_mesh("/a", points * 0.3, faces, material=glow(5, 5, 5), pose=pose((0.4, 0, 1.5), scale=scale))
    scene.add_instances("/b", "/a", [pose((-1, 0.5, 2.0), scale=0.5), pose((0, -1, 1.0), scale=0.2)])
    aimed, aimed_error = illuminance(scene)
    # The same by chance alone: nothing is aimed at when the lights are left out.
    renderer_light = floor()
    for path in ("/a", "/b"):
        renderer_light.placements[path] = scene.placements[path]
        renderer_light.materials.update(scene.materials)
    chance, chance_error = by_chance(renderer_light)
    assert (np.abs(aimed - chance) < 4.5 * np.hypot(aimed_error, chance_error)).all()
    # Of a quarter of the samples.
    assert aimed_error[0] < 0.5 * 2 * chance_error[0]


def by_chance(scene):
    """`illuminance` where glowing geometry is only met."""
    from unittest.mock import patch

    with patch("warprender.emitters._WORTH_AIMING_AT", 2.0):
        return illuminance(scene, samples=1024)


def test_both_sides_of_a_material_glow_and_one_of_a_mesh_light():
    upside_down = CORNERS[::-1]
    scene = floor()
    scene.add_mesh("/lamp", upside_down, [[0, 1, 2, 3]], material=glow(1, 1, 1))
    assert_illuminance(scene, expected())
    for sides, share in ((False, 0.0), (True, 1.0)):
        scene = floor(MeshLight(prim="/lamp", intensity=1.0, bothSides=sides))
        scene.add_mesh("/lamp", upside_down, [[0, 1, 2, 3]], color=(0, 0, 0))
        assert_illuminance(scene, share * expected())


def test_the_inside_of_a_glowing_cube_is_uniform():
    points, faces = cube(2.0)
    scene = floor()
    scene.add_mesh("/box", points, faces, material=glow(2, 2, 2))
    assert_illuminance(scene, 2 * np.pi, within=0.01)


def test_glowing_spheres():
    scene = floor()
    scene.add_sphere("/ball", 0.25, material=glow(3, 3, 3), pose=pose((0, 0, 1)))
    assert_illuminance(scene, 3 * np.pi * 0.25**2, within=0.002)
    scene = floor()
    scene.add_sphere("/ball", 2.0, material=glow(3, 3, 3))
    assert_illuminance(scene, 3 * np.pi, within=0.01)


def test_faint_glow_is_left_to_chance():
    scene = floor(SphereLight(intensity=1e6))
    scene.add_mesh("/screen", CORNERS, [[0, 1, 2, 3]], material=glow(0.1, 0.1, 0.1))
    assert list(lit(scene, False)) == ["/light0"]
    camera = wr.Camera()
    request = wr.plan.Request()
    assert analyse(floor(), camera, request).path.sampled_lights is False


def test_only_the_faces_that_glow():
    scene = floor()
    points = np.concatenate([CORNERS, CORNERS + (2, 0, 0)])
    mesh = scene.add_mesh("/lamp", points, [[0, 1, 2, 3], [4, 5, 6, 7]], color=(0, 0, 0))
    scene.materials["glow"] = glow(1, 1, 1)
    mesh.face_materials = {"glow": np.array([0], np.int32)}
    assert_illuminance(scene, expected(), within=0.01)


@pytest.mark.parametrize(
    ("mode", "emission", "share"),
    [
        ("materialGlowTintsLight", (0, 0, 0), 4.0),
        ("materialGlowTintsLight", (0.5, 0.25, 1.0), 4.0 * np.array([0.5, 0.25, 1.0])),
        ("independent", (0.5, 0.25, 1.0), 4.0),
        ("noMaterialResponse", (0.5, 0.25, 1.0), 4.0),
    ],
)
def test_mesh_lights_of_usd(mode, emission, share):
    text = f"""
    def Material "m" {{ token outputs:surface.connect = </m/s.outputs:surface>
        def Shader "s" {{ uniform token info:id = "UsdPreviewSurface"
            color3f inputs:emissiveColor = {emission}
            color3f inputs:diffuseColor = (0, 0, 0)
            token outputs:surface }} }}
    def Mesh "lamp" ( prepend apiSchemas = ["MeshLightAPI", "MaterialBindingAPI"] ) {{
        rel material:binding = </m>
        uniform token light:materialSyncMode = "{mode}"
        float inputs:intensity = 2
        float inputs:exposure = 1
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = {[tuple(map(float, p)) for p in CORNERS]} }}
    def Mesh "floor" {{
        uniform token subdivisionScheme = "none"
        color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-0.01, -0.01, 0), (0.01, -0.01, 0), (0.01, 0.01, 0), (-0.01, 0.01, 0)] }}"""
    scene = scene_of(text)
    assert not scene.warnings
    assert_illuminance(scene, share * expected())


@pytest.mark.parametrize("seen", ["by the camera", "in a mirror"])
@pytest.mark.parametrize(
    ("mode", "emission", "radiance"),
    [
        ("materialGlowTintsLight", (0, 0, 0), (4, 4, 4)),
        ("materialGlowTintsLight", (0.5, 0.25, 1.0), (2, 1, 4)),
        ("independent", (0.5, 0.25, 1.0), (4, 4, 4)),
        ("noMaterialResponse", (0.5, 0.25, 1.0), (4, 4, 4)),
    ],
)
def test_mesh_lights_look_as_they_shine(mode, emission, radiance, seen):
    # The lamp is white, but there is nothing else that it could reflect.
    scene = wr.Scene()
    material = wr.PreviewSurface(diffuseColor=(1, 1, 1), emissiveColor=emission)
    scene.add_mesh("/lamp", CORNERS, [[0, 1, 2, 3]], material=material)
    scene.add_light(MeshLight(prim="/lamp", intensity=2.0, exposure=1.0, materialSyncMode=mode), "/lamp light")
    view = window(0.02, (0, 0, 0.5), (0, 0, 1.1))
    if seen == "in a mirror":
        mirror = wr.PreviewSurface(diffuseColor=(1, 1, 1), metallic=1.0, roughness=0.0)
        square = [(-0.1, -0.1, 0), (0.1, -0.1, 0), (0.1, 0.1, 0), (-0.1, 0.1, 0)]
        scene.add_mesh("/mirror", square, [[0, 1, 2, 3]], material=mirror)
        view = window(0.02, (0, 0, 0.01), (0, 0, 0))
    color, _ = picture(scene, view, 4, 16, bounces=1, camera_light="off")
    np.testing.assert_allclose(color[..., :3], np.broadcast_to(radiance, (4, 4, 3)), rtol=1e-5)


def test_geometry_lights_make_their_targets_shine():
    scene = scene_of("""
        def GeometryLight "l" {
            rel geometry = </a>
            float inputs:intensity = 3 }
        def Mesh "a" {
            int[] faceVertexCounts = [3]
            int[] faceVertexIndices = [0, 1, 2]
            point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)] }""")
    (light,) = scene.lights.values()
    assert (light.prim, light.intensity) == ("/a", 3)


def test_normalised_mesh_lights_divide_by_their_world_area():
    scene = floor(MeshLight(prim="/lamp", intensity=2.0, normalize=True))
    scene.add_mesh("/lamp", CORNERS, [[0, 1, 2, 3]], color=(0, 0, 0), pose=pose(scale=2.0))
    area = 1.2 * np.hypot(1.0, 0.2) * 4
    assert_illuminance(scene, 2.0 / area * expected(CORNERS * 2))


def test_changed_shadows_of_a_mesh_light():
    scene = floor(MeshLight(prim="/lamp", intensity=2.0, shadow=Shadow(color=(0.25, 0.5, 1.0))))
    scene.add_mesh("/lamp", CORNERS, [[0, 1, 2, 3]], color=(0, 0, 0))
    assert_illuminance(scene, 2 * expected())
    scene.add_mesh("/card", CORNERS * (9, 9, 0.5), [[0, 1, 2, 3]], color=(0, 0, 0))
    assert_illuminance(scene, 2 * expected() * np.array([0.25, 0.5, 1.0]))
