"""Glass in whole pictures: furnaces, slabs, windows and media whose radiance is known exactly."""

import numpy as np
import pytest
import scenes
import warp as wp
from pictures import mean_and_error, picture
from usd_stage import scene_of

import warprender as wr

SHOWN = {"dome_light_visible": True, "camera_light": "off"}


def fresnel(cosine, eta):
    """Reflected share of unpolarised light, float64; 1 where all is reflected."""
    beyond = 1 - (1 - cosine**2) / eta**2
    t = np.sqrt(np.maximum(beyond, 0))
    s, p = (cosine - eta * t) / (cosine + eta * t), (eta * cosine - t) / (eta * cosine + t)
    return np.where(beyond > 0, (s**2 + p**2) / 2, 1.0)


def in_white(**light):
    scene = wr.Scene()
    scene.add_light(wr.DomeLight(**light))
    return scene


def slab(thickness=1.0, size=50.0):
    """A closed box about the origin, thin along Z."""
    points, faces = scenes.cube(1.0)
    return points * (size, size, thickness), faces


def quadric(scene, look, scale):
    scene.add_sphere("/glass", scale, material=look)


def ball(scene, look, scale):
    points, faces = scenes.icosphere(2)
    scene.add_mesh("/glass", points * scale, faces, material=look)


def cube(scene, look, scale):
    scene.add_mesh("/glass", *scenes.cube(1.4 * scale), material=look)


SHAPES = (quadric, ball, cube)


@wp.func
def round_box(p: wp.vec3) -> float:
    q = wp.vec3(wp.abs(p[0]) - 0.5, wp.abs(p[1]) - 0.6, wp.abs(p[2]) - 0.4)
    outside = wp.length(wp.max(q, wp.vec3(0.0, 0.0, 0.0)))
    return outside + wp.min(wp.max(q[0], wp.max(q[1], q[2])), 0.0) - 0.2


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
@pytest.mark.parametrize("shape", SHAPES)
def test_clear_glass_in_a_white_dome_disappears(shape, scale):
    # Every path ends outside with a throughput of exactly 1: one that slipped through a boundary would have kept a
    # factor of 1.5² or its inverse, and one of 256 samples like that moves its pixel by 2e-3.
    # Of a million paths in a ball of flat faces some are reflected more than 300 times before they find a way out.
    scene = in_white()
    shape(scene, wr.Dielectric(), scale)
    view = scenes.camera(np.array((1.0, 1.5, 4.0)) * scale, clippingRange=(1e-3 * scale, 1e3 * scale))
    color, error = picture(scene, view, 32, 256, bounces=5000, **SHOWN)
    np.testing.assert_allclose(color, 1.0, atol=1e-4)
    assert error.max() < 1e-5


@pytest.mark.parametrize("case", ["right", "turned round", "mirrored"])
def test_orientation_says_where_the_glass_is(case):
    # A ray at half the radius turns by 2 (asin 0.5 - asin 0.5/n), towards the axis; with the faces turned round the
    # ball is a bubble in glass, 1/n takes the place of n, and it turns away. A dark spot waits there.
    points, faces = scenes.icosphere(4)
    scene = in_white()
    inside_out = case == "turned round"
    turned = faces[:, ::-1] if inside_out else faces
    # A transform that mirrors takes the authored normals along: outside stays outside.
    pose = np.diag([1.0, -1.0, 1.0, 1.0]) if case == "mirrored" else None
    scene.add_mesh("/ball", points, turned, normals=points, material=wr.Dielectric(), pose=pose)
    index = 1 / 1.5 if inside_out else 1.5
    first, second = np.arcsin(0.5), np.arcsin(0.5 / index)
    turn = 2 * (first - second)
    # It leaves the sphere where the normal is turned by π - 2 asin(0.5/n) from that of the place it entered.
    angle = np.pi / 2 - first - (np.pi - 2 * second)
    x, z = np.cos(angle), np.sin(angle)
    reach = (z + 3.0) / np.cos(turn)
    spot, faces = scenes.quad(0.4, -3.0)
    scene.add_mesh("/spot", spot + (x - reach * np.sin(turn), 0, 0), faces, color=(0, 0, 0))
    view = scenes.window(0.005, eye=(0.5, 0, 5), target=(0.5, 0, 0))
    color, error = picture(scene, view, 8, 256, **SHOWN)
    # What is left is reflected at the front, and a little that bounces inside and leaves elsewhere.
    share = fresnel(np.cos(first), index)
    mean, sigma = mean_and_error(color, error)
    assert share - 4.5 * sigma < mean < 2 * share + 4.5 * sigma, (mean, share)


def test_a_slab_reflects_and_lets_through_all_its_bounces():
    # Seen head-on, lit from behind by a glowing wall alone: (1-R)² a / (1 - R² a²) with a the absorption of one way;
    # lit from the front, R + R (1-R)² a² / (1 - R² a²).
    share, left, thickness = 0.04, np.array([0.9, 0.5, 0.1]), 2.0
    glass = wr.Dielectric(attenuationColor=tuple(left), attenuationDistance=0.5 * thickness)
    left = left**2
    through = (1 - share) ** 2 * left / (1 - share**2 * left**2)
    back = share + share * (1 - share) ** 2 * left**2 / (1 - share**2 * left**2)
    for height, expected in ((-5.0, through), (5.0, back)):
        scene = wr.Scene()
        scene.add_mesh("/slab", *slab(thickness), material=glass)
        wall, faces = scenes.quad(500.0, height)
        glow = wr.PreviewSurface(diffuseColor=(0, 0, 0), emissiveColor=(1, 1, 1), useSpecularWorkflow=1, ior=1.0)
        scene.add_mesh("/wall", wall, faces, material=glow)
        color, error = picture(scene, scenes.window(1.0, eye=(0, 0, 3)), 16, 1024, camera_light="off")
        mean, sigma = color[..., :3].mean((0, 1)), np.sqrt((error**2).sum((0, 1))) / 256
        assert (np.abs(mean - expected) < 4.5 * sigma + 1e-6).all(), (mean, expected, sigma)


def test_a_window_of_one_sheet_has_both_faces():
    scene = wr.Scene()
    scene.add_mesh("/window", *scenes.quad(50.0), material=wr.Dielectric(thinWalled=1, transmissionColor=(0.5, 0.7, 1)))
    wall, faces = scenes.quad(500.0, -5.0)
    scene.add_mesh("/wall", wall, faces, material=wr.PreviewSurface(diffuseColor=(0, 0, 0), emissiveColor=(1, 1, 1)))
    color, error = picture(scene, scenes.window(1.0), 16, 256, camera_light="off")
    expected = (1 - 2 * 0.04 / 1.04) * np.array([0.5, 0.7, 1.0])
    sigma = np.sqrt((error**2).sum((0, 1))) / 256
    # The wall reflects 4 % of what the window sends back to it.
    expected = expected * (1 + 0.04 * (2 * 0.04 / 1.04))
    assert (np.abs(color[..., :3].mean((0, 1)) - expected) < 4.5 * sigma + 2e-4).all()


def test_rough_sheets_lose_what_one_scattering_loses():
    # Reflection and transmission share the same facets: together they keep what a white metal keeps, seen from above
    # at alpha 1 all but 1 - ln 2, whatever the index.
    for ior in (1.2, 1.5, 3.0):
        scene = in_white()
        scene.add_mesh("/sheet", *scenes.quad(50.0), material=wr.Dielectric(ior=ior, roughness=1.0, thinWalled=1))
        color, error = picture(scene, scenes.window(1.0), 16, 1024, **SHOWN)
        mean, sigma = mean_and_error(color, error)
        assert abs(mean - (1 - np.log(2))) < 4.5 * sigma


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.6, 1.0])
@pytest.mark.parametrize("shape", SHAPES)
def test_rough_glass_loses_light_and_never_gains(shape, roughness):
    scene = in_white()
    shape(scene, wr.Dielectric(roughness=roughness), 1.0)
    color, error = picture(scene, scenes.camera((1.0, 1.5, 4.0)), 16, 256, **SHOWN)
    assert (color[..., :3] <= 1 + 4.5 * error + 1e-4).all()
    mean, sigma = mean_and_error(color, error)
    assert mean < 1 + 4.5 * sigma
    if roughness == 0.1:
        # Alpha 0.01: masking takes some 1e-4.
        assert mean > 1 - 2e-3


@pytest.mark.parametrize("ior", [1.33, 1.5])
def test_snells_window_from_below(ior):
    # Looking up through an open sheet, its back seen: the medium has no end below, and the dome of radiance 1 fills
    # both. What is refracted brings ior² as much radiance, beyond the critical angle all is reflected.
    scene = in_white()
    scene.add_mesh("/surface", *scenes.quad(1e4), material=wr.Dielectric(ior=ior))
    view = scenes.camera((0, 0, -1), (0, 0, 1), fov=120.0)
    size = 48
    color, _ = picture(scene, view, size, 256, **SHOWN)
    place = ((np.arange(size * 64) + 0.5) / (size * 64) * 2 - 1) * np.tan(np.radians(60))
    cosine = 1 / np.sqrt(1 + place[:, None] ** 2 + place[None, :] ** 2)
    share = fresnel(cosine, 1 / ior)
    exact = (share + (1 - share) * ior**2).reshape(size, 64, size, 64)
    expected, chance = exact.mean((1, 3)), share.reshape(exact.shape).mean((1, 3))
    # Each sample is reflected or refracted, at a place of the pixel. At the window's edge places tell too little.
    sigma = np.hypot(exact.std((1, 3)), np.sqrt(chance * (1 - chance)) * (ior**2 - 1)) / np.sqrt(256)
    even = exact.std((1, 3)) < 0.03
    assert even.mean() > 0.8 and abs(expected[even].min() - 1) < 1e-3 and expected[even].max() > 1.7
    off = np.abs(color[..., 0] - expected)
    assert (off <= 4.5 * sigma + 1e-5)[even].all()


def test_a_lamp_within_a_medium_is_dimmed_on_its_way():
    # Between equal media nothing bends. A small lamp over a Lambert floor, both inside: E = π L (r/d)², which the
    # medium dims by exp(-σ d) on the way to the floor and by exp(-σ s) on the way to the boundary above.
    radius, distance, sigma = 1e-3, 1.0, 0.7
    fog = wr.Dielectric(ior=1.0, attenuationColor=(np.exp(-sigma),) * 3, attenuationDistance=1.0)
    scene = wr.Scene()
    scene.add_mesh("/fog", *scenes.cube(4.0), material=fog)
    scene.add_mesh("/floor", *scenes.quad(0.01), color=(0.5, 0.5, 0.5))
    scene.add_light(wr.SphereLight(radius=radius, intensity=1e6), pose=(0, 0, distance, 0, 0, 0, 1))
    view = scenes.window(0.002, eye=(3.0, 0, 5.0), up=(0, 0, 1))
    color, error = picture(scene, view, 8, 256, camera_light="off")
    # The lamp's face is two thirds of its radius nearer, on average.
    inside = -2 / 3 * radius + 2.0 * np.sqrt(3.0**2 + 5.0**2) / 5.0
    expected = 0.5 * 1e6 * (radius / distance) ** 2 * np.exp(-sigma * (distance + inside))
    mean, spread = mean_and_error(color, error)
    assert abs(mean - expected) < 4.5 * spread + 3e-4 * expected


def test_the_camera_may_stand_in_the_glass():
    scene = in_white()
    fog = wr.Dielectric(1.0, attenuationColor=(0.25,) * 3, attenuationDistance=2.0)
    scene.add_mesh("/fog", *scenes.cube(4.0), material=fog)
    view = scenes.window(0.5, eye=(0, 0, 0), target=(0, 0, -1), clippingRange=(1e-7, 10))
    color, _ = picture(scene, view, 8, 4, **SHOWN)
    np.testing.assert_allclose(color[..., :3], 0.25, rtol=1e-5)


def test_glass_keeps_shadow_rays_off_and_lets_lights_be_met():
    # Rays that look for a distant light stop at glass, and none meets a light without a size; a dome is met. Between
    # a floor of reflectance ρ and a pane that keeps R of diffuse light, radiance is (1-R) ρ / (1 - R ρ).
    scene = wr.Scene()
    scene.add_mesh("/floor", *scenes.quad(500.0), color=(0.5, 0.5, 0.5))
    scene.add_mesh("/pane", *scenes.quad(500.0, 1.0), material=wr.Dielectric(thinWalled=1))
    scene.add_light(wr.DistantLight(intensity=1.0, angle=0.0))
    view = scenes.window(0.5, eye=(0, 0, 0.5))
    color, _ = picture(scene, view, 8, 16, camera_light="off")
    assert (color[..., :3] == 0).all()
    scene.add_light(wr.DomeLight())
    color, error = picture(scene, view, 8, 1024, camera_light="off")
    cosine = (np.arange(100000) + 0.5) / 100000
    share = fresnel(cosine, 1.5)
    kept = (2 * cosine * 2 * share / (1 + share)).mean()
    mean, sigma = mean_and_error(color, error)
    assert abs(mean - (1 - kept) * 0.5 / (1 - 0.5 * kept)) < 4.5 * sigma + 1e-3


def test_rough_glass_towards_smooth():
    pictures = []
    for roughness in (0.0, 0.012, 0.03):
        scene = in_white(intensity=0.2)
        scene.add_light(wr.SphereLight(radius=1.0, intensity=5.0), pose=(0, 3, -3, 0, 0, 0, 1))
        scene.add_sphere("/ball", material=wr.Dielectric(roughness=roughness))
        pictures.append(picture(scene, scenes.camera((0, 0, 4)), 24, 256, camera_light="off"))
    (smooth, error), *rough = pictures
    assert smooth[..., :3].max() > 1.0
    for color, other in rough:
        mean, sigma = mean_and_error(color - smooth, np.hypot(error, other))
        assert abs(mean) < 0.005 * smooth[..., :3].mean() + 4.5 * sigma


def test_interpolated_normals_lose_a_little_and_gain_nothing():
    # A direction that the true surface puts on the other side than the shading normal does ends there: at the outline
    # of a ball of 1280 triangles, 5e-4 of the whole picture. No path carries more than 1.
    points, faces = scenes.icosphere(3)
    scene = in_white()
    scene.add_mesh("/glass", points, faces, normals=points, material=wr.Dielectric())
    color, _ = picture(scene, scenes.camera((1.0, 1.5, 4.0)), 32, 256, **SHOWN)
    assert color[..., :3].max() <= 1 + 1e-5 and 1 - 1e-3 < color[..., :3].mean() < 1


def test_light_of_several_lamps_adds_up_in_rough_glass():
    # Lamps on all sides, chosen by the tree: what crosses the glass takes those that a normal would leave out.
    places = [(0, 0, 3), (0, 0, -3), (3, 0, 0), (-3, 1, -1), (0, -3, 1), (1, 3, -2)]
    glass = wr.Dielectric(roughness=0.6)

    def lit(chosen, samples):
        scene = wr.Scene()
        scene.add_sphere("/ball", material=glass)
        for number in chosen:
            scene.add_light(wr.SphereLight(radius=0.3, intensity=4.0 + number), pose=(*places[number], 0, 0, 0, 1))
        return picture(scene, scenes.window(2.2), 12, samples, camera_light="off")

    together, error = lit(range(6), 2048)
    single = [lit([number], 512) for number in range(6)]
    total, spread = sum(color for color, _ in single), np.sqrt(sum(e**2 for _, e in single))
    mean, sigma = mean_and_error(together - total, np.hypot(error, spread))
    assert abs(mean) < 4.5 * sigma and sigma < 0.01 * total[..., :3].mean()
    z = ((together[..., :3] - total[..., :3]) / np.maximum(np.hypot(error, spread), 1e-6))[..., 0]
    assert np.abs(z).max() < 6 and abs(z.std() - 1) < 0.3


def test_the_plan_names_what_refracts():
    scene = wr.Scene()
    scene.add_sphere("/plain", 1.0)
    scene.add_sphere("/glass", 1.0, material=wr.Dielectric())
    plan = wr.Renderer(scene, scenes.window(2.0), (4, 4)).plan
    assert "transmission" in plan.path.features and plan.reasons["transmission"] == "/glass"
    del scene.placements["/glass"]
    plan = wr.Renderer(scene, scenes.window(2.0), (4, 4)).plan
    assert "transmission" not in plan.path.features and "transmission" in plan.absent


def test_glass_in_a_stage_is_left_handed_where_it_says():
    # The camera looks through a ball of 1.5 onto a wall: turned inside out it shrinks the view, and is a bubble.
    points, faces = scenes.icosphere(1)
    rows = ", ".join(str(tuple(p)) for p in points.tolist())
    text = """def Material "M" { token outputs:surface.connect = </M/s.outputs:surface>
        def Shader "s" { uniform token info:id = "warprender:Dielectric"
            token outputs:surface } }
        def Mesh "m" ( prepend apiSchemas = ["MaterialBindingAPI"] ) { rel material:binding = </M>
            uniform token subdivisionScheme = "none"
            uniform token orientation = "%s"
            int[] faceVertexCounts = %s
            int[] faceVertexIndices = %s
            point3f[] points = [%s] }"""

    def seen(orientation, order):
        indices = faces[:, ::order].reshape(-1).tolist()
        scene = scene_of(text % (orientation, [3] * len(faces), indices, rows))
        wall, square = scenes.quad(40.0, -6.0)
        scene.add_mesh("/dark", wall - (20, 0, 0), square, color=(0, 0, 0))
        scene.add_light(wr.DomeLight())
        return picture(scene, scenes.camera((0, 0, 5), fov=20.0), 16, 16, **SHOWN)[0]

    right, left = seen("rightHanded", 1), seen("leftHanded", -1)
    np.testing.assert_array_equal(right, left)
    assert np.abs(right - seen("leftHanded", 1)).mean() > 0.1


def test_glass_by_a_distance_function_disappears_too():
    scene = in_white()
    scene.add_sdf("/glass", round_box, [(-1, -1, -1), (1, 1, 1)], material=wr.Dielectric())
    renderer = wr.Renderer(
        scene, scenes.camera((1.0, 1.5, 4.0)), (24, 24), sampler="independent", bounces=1000, **SHOWN
    )
    color = renderer.render(samples=64).numpy("color")
    np.testing.assert_allclose(color, 1.0, atol=1e-4)
