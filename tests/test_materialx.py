"""MaterialX documents and networks arrive as what they say: exactly where they fold, else baked or named."""

import zipfile

import numpy as np
import OpenImageIO as oiio
import pictures
import pytest
import scenes
from usd_stage import scene_of, stage_of

import warprender as wr
from warprender.texture_lookup import sampled
from warprender.textures import PrimvarReader, Texture
from warprender.usd.materialx import spaces
from warprender.usd.materialx.noise import perlin_noise_2d

RNG = np.random.default_rng(11)
PIXELS = RNG.integers(0, 256, (6, 8, 4), np.uint8)
ST = RNG.uniform(-2, 2, (64, 2))


@pytest.fixture(scope="module")
def picture(tmp_path_factory):
    """A PNG of random texels."""
    file = tmp_path_factory.mktemp("pictures") / "a.png"
    image = oiio.ImageBuf(PIXELS)
    image.specmod().attribute("oiio:UnassociatedAlpha", 1)
    assert image.write(str(file))
    return str(file)


def node(name, identifier, inputs="", outputs="color3f outputs:out"):
    return f"""def Shader "{name}" {{ uniform token info:id = "ND_{identifier}"
        {inputs}
        {outputs} }}"""


def link(kind, name, source, output="out"):
    return f"{kind} inputs:{name}.connect = </m/{source}.outputs:{output}>\n"


def image(picture, name="image", kind="color3", space="lin_rec709", inputs="", category="image"):
    types = {"color3": "color3f", "color4": "color4f", "float": "float", "vector3": "float3"}
    file = f'asset inputs:file = @{picture}@ ( colorSpace = "{space}" )\n'
    return node(name, f"{category}_{kind}", file + inputs, f"{types[kind]} outputs:out")


def stage_text(inputs, nodes="", surface="standard_surface_surfaceshader", output="mtlx:surface"):
    return f"""def Material "m" {{ token outputs:{output}.connect = </m/s.outputs:out>
        {node("s", surface, inputs, "token outputs:out")}
        {nodes} }}
      def Mesh "q" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {{ rel material:binding = </m>
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)] }}"""


def drawn(inputs, nodes="", surface="standard_surface_surfaceshader", **options):
    """The surface and the warnings of a material on a mesh."""
    scene = scene_of(stage_text(inputs, nodes, surface, **options))
    return scene.materials[scene.placements["/q"].material], scene.warnings


def texels(place):
    """(P, 4) bilinear values of the fixture's picture, repeated, as they lie in the file."""
    return sampled(Texture(PIXELS, wrapS="repeat", wrapT="repeat", sourceColorSpace="raw"), place)


COLOR = link("color3f", "base_color", "n")


@pytest.mark.parametrize(
    ("identifier", "inputs", "expected"),
    [
        ("multiply_color3", "color3f inputs:in2 = (0.5, 0.25, 2)\n", lambda c: c * (0.5, 0.25, 2)),
        ("multiply_color3FA", "float inputs:in2 = 0.5\n", lambda c: 0.5 * c),
        ("add_color3", "color3f inputs:in2 = (0.1, 0.2, 0.3)\n", lambda c: c + (0.1, 0.2, 0.3)),
        ("subtract_color3FA", "float inputs:in2 = 0.25\n", lambda c: c - 0.25),
        ("divide_color3FA", "float inputs:in2 = 4\n", lambda c: c / 4),
        ("invert_color3", "", lambda c: 1 - c),
        ("clamp_color3", "", lambda c: c),
        ("remap_color3FA", "float inputs:outlow = 0.5\nfloat inputs:outhigh = 0.7\n", lambda c: 0.5 + 0.2 * c),
        ("contrast_color3FA", "float inputs:amount = 0.5\n", lambda c: 0.5 * c + 0.25),
        ("swizzle_color3_color3", 'string inputs:channels = "ggg"\n', lambda c: c[:, [1, 1, 1]]),
        ("extract_color3", "int inputs:index = 2\n", lambda c: c[:, [2, 2, 2]]),
    ],
)
def test_arithmetic_that_is_linear_becomes_scale_and_bias(picture, identifier, inputs, expected):
    first = "in1" if identifier.split("_")[0] in ("multiply", "add", "subtract", "divide") else "in"
    output = "float outputs:out" if identifier.startswith("extract") else "color3f outputs:out"
    nodes = image(picture) + node("n", identifier, inputs + link("color3f", first, "image"), output)
    surface, warnings = drawn(COLOR, nodes)
    assert isinstance(surface.diffuseColor, Texture) and surface.diffuseColor.file == picture and warnings == []
    channel = surface.diffuseColor.channel
    found = sampled(surface.diffuseColor, ST)
    found = found[:, :3] if channel == "rgb" else found[:, ["rgba".index(channel)] * 3]
    np.testing.assert_allclose(found, expected(texels(ST)[:, :3]), atol=1e-6)


def test_mixing_a_picture_with_a_constant_and_base_weight_fold(picture):
    mix = "color3f inputs:bg = (1, 0, 0)\nfloat inputs:mix = 0.25\n" + link("color3f", "fg", "image")
    surface, _ = drawn(COLOR + "float inputs:base = 0.5\n", image(picture) + node("n", "mix_color3", mix))
    expected = 0.5 * (0.75 * np.array([1, 0, 0]) + 0.25 * texels(ST)[:, :3])
    np.testing.assert_allclose(sampled(surface.diffuseColor, ST)[:, :3], expected, atol=1e-6)


def place2d(order, st, pivot, scale, rotate, offset):
    angle = np.radians(rotate)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    if order == 0:
        return (turn @ ((st - pivot) / scale).T).T - offset + pivot
    return (turn @ (st - pivot - offset).T).T / scale + pivot


@pytest.mark.parametrize("order", [0, 1])
def test_coordinates_fold_into_the_transform(picture, order):
    place = node(
        "p",
        "place2d_vector2",
        "float2 inputs:pivot = (0.25, 0.5)\nfloat2 inputs:scale = (2, 0.5)\nfloat inputs:rotate = 30\n"
        f"float2 inputs:offset = (0.1, 0.2)\nint inputs:operationorder = {order}\n" + link("float2", "texcoord", "u"),
        "float2 outputs:out",
    )
    uv = node("u", "geompropvalue_vector2", 'string inputs:geomprop = "uv"\n', "float2 outputs:out")
    surface, warnings = drawn(COLOR, image(picture, "n", inputs=link("float2", "texcoord", "p")) + place + uv)
    place = place2d(order, ST, (0.25, 0.5), (2, 0.5), 30, (0.1, 0.2))
    np.testing.assert_allclose(sampled(surface.diffuseColor, ST)[:, :3], texels(place)[:, :3], atol=1e-6)
    assert surface.diffuseColor.st == PrimvarReader("uv", (0.0,)) and warnings == []


def test_tiled_images_and_gltf_images_place_their_pictures(picture):
    tiled = "float2 inputs:uvtiling = (3, 2)\nfloat2 inputs:uvoffset = (0.25, 0.5)\n"
    surface, _ = drawn(COLOR, image(picture, "n", inputs=tiled, category="tiledimage"))
    expected = texels(ST * (3, 2) - (0.25, 0.5))[:, :3]
    np.testing.assert_allclose(sampled(surface.diffuseColor, ST)[:, :3], expected, atol=1e-6)
    gltf = "float2 inputs:scale = (3, 2)\nfloat2 inputs:offset = (0.25, 0.5)\ncolor3f inputs:factor = (1, 0.5, 0)\n"
    surface, _ = drawn(COLOR, image(picture, "n", inputs=gltf, category="gltf_image"))
    # KHR_texture_transform counts v from the top: v' = 2 v + 0.5 there.
    place = np.stack([3 * ST[:, 0] + 0.25, 1 - (2 * (1 - ST[:, 1]) + 0.5)], 1)
    expected = texels(place)[:, :3] * (1, 0.5, 0)
    np.testing.assert_allclose(sampled(surface.diffuseColor, ST)[:, :3], expected, atol=1e-6)


@pytest.mark.parametrize(("mode", "wrap"), [("constant", "black"), ("clamp", "clamp"), ("mirror", "mirror")])
def test_address_modes(picture, mode, wrap):
    modes = f'string inputs:uaddressmode = "{mode}"\nstring inputs:vaddressmode = "{mode}"\n'
    surface, _ = drawn(COLOR, image(picture, "n", inputs=modes))
    assert (surface.diffuseColor.wrapS, surface.diffuseColor.wrapT) == (wrap, wrap)


def test_single_channels_read_theirs(picture):
    nodes = image(picture, "f", "float") + image(picture, "c", "color4")
    nodes += node("e", "separate4_color4", link("color4f", "in", "c"), "float outputs:outg\nfloat outputs:outa")
    inputs = link("float", "specular_roughness", "f") + link("float", "coat", "e", "outg")
    surface, _ = drawn(inputs + link("float", "coat_roughness", "e", "outa"), nodes)
    assert [surface.roughness.channel, surface.clearcoat.channel, surface.clearcoatRoughness.channel] == ["r", "g", "a"]


def test_arithmetic_on_one_picture_is_done_texel_by_texel(picture):
    nodes = image(picture) + node("n", "power_color3FA", "float inputs:in2 = 3\n" + link("color3f", "in1", "image"))
    surface, warnings = drawn(COLOR, nodes)
    texture = surface.diffuseColor
    assert (texture.wrapS, texture.sourceColorSpace) == ("repeat", "raw") and warnings == []
    np.testing.assert_allclose(texture.file, (PIXELS[..., :3] / 255.0) ** 3, atol=1e-6)


def test_procedurals_are_baked_and_say_so():
    checker = "float2 inputs:uvtiling = (4, 4)\ncolor3f inputs:color2 = (0, 0, 0.5)\n"
    surface, warnings = drawn(COLOR, node("n", "checkerboard_color3", checker))
    st = (RNG.integers(0, 4, (64, 2)) + RNG.uniform(0.1, 0.9, (64, 2))) / 4
    odd = (np.floor(4 * st).sum(1) % 2)[:, None]
    expected = odd * np.ones(3) + (1 - odd) * (0, 0, 0.5)
    np.testing.assert_allclose(sampled(surface.diffuseColor, st)[:, :3], expected, atol=1e-6)
    assert warnings == ["/m/s: a network is baked into 512 × 512 texels over st in [0, 1], repeated outside"]


def test_two_pictures_are_baked_at_the_larger_ones_resolution(picture):
    nodes = image(picture) + image(picture, "other", inputs=link("float2", "texcoord", "p"))
    nodes += node("p", "place2d_vector2", "float2 inputs:offset = (0.5, 0)\n", "float2 outputs:out")
    nodes += node("n", "multiply_color3", link("color3f", "in1", "image") + link("color3f", "in2", "other"))
    surface, _ = drawn(COLOR, nodes)
    st = (RNG.integers(0, 512, (64, 2)) + 0.5) / 512
    expected = texels(st)[:, :3] * texels(st - (0.5, 0))[:, :3]
    np.testing.assert_allclose(sampled(surface.diffuseColor, st)[:, :3], expected, atol=1e-6)


def test_ramps_and_splits():
    ramp = "color3f inputs:valuel = (1, 0, 0)\ncolor3f inputs:valuer = (0, 0, 1)\n"
    surface, _ = drawn(COLOR, node("n", "ramplr_color3", ramp))
    st = RNG.uniform(0.01, 0.99, (64, 2))
    expected = np.stack([1 - st[:, 0], 0 * st[:, 0], st[:, 0]], 1)
    np.testing.assert_allclose(sampled(surface.diffuseColor, st)[:, :3], expected, atol=1e-6)
    ramp = "color3f inputs:valuet = (1, 0, 0)\ncolor3f inputs:valueb = (0, 0, 1)\n"
    surface, _ = drawn(COLOR, node("n", "ramptb_color3", ramp))
    expected = np.stack([st[:, 1], 0 * st[:, 1], 1 - st[:, 1]], 1)
    np.testing.assert_allclose(sampled(surface.diffuseColor, st)[:, :3], expected, atol=1e-6)


def hash_twin(x, y):
    """Bob Jenkins' final mix in Python's integers."""

    def turn(v, k):
        return ((v << k) | (v >> (32 - k))) & 0xFFFFFFFF

    c = (0xDEADBEEF + 8 + 13) & 0xFFFFFFFF
    a, b = (c + x) & 0xFFFFFFFF, (c + y) & 0xFFFFFFFF
    state = {"a": a, "b": b, "c": c}
    for first, second, k in (
        ("c", "b", 14), ("a", "c", 11), ("b", "a", 25), ("c", "b", 16), ("a", "c", 4), ("b", "a", 14), ("c", "b", 24),
    ):  # fmt: skip
        state[first] = ((state[first] ^ state[second]) - turn(state[second], k)) & 0xFFFFFFFF
    return state["c"]


def test_noise_has_the_gradients_that_the_hash_picks():
    cells = RNG.integers(-50, 50, (40, 2))
    step = 1e-6
    at = perlin_noise_2d(cells.astype(float))
    slope = np.stack([perlin_noise_2d(cells + np.eye(2)[k] * step)[:, 0] / step for k in (0, 1)], 1)
    assert not at.any()
    for (x, y), found in zip(cells, slope, strict=True):
        h = hash_twin(int(x), int(y)) & 7
        gradient = np.array([1.0, 2.0] if h < 4 else [2.0, 1.0])
        signs = (-1 if h & 1 else 1, -1 if h & 2 else 1)
        gradient *= signs if h < 4 else signs[::-1]
        np.testing.assert_allclose(found, 0.6616 * gradient, atol=1e-4)


def test_primvars_are_read():
    reader = node("n", "geompropvalue_color3", 'string inputs:geomprop = "paint"\n')
    surface, warnings = drawn(COLOR, reader)
    assert surface.diffuseColor == PrimvarReader("paint", (0.0,)) and warnings == []


PAINT = np.array([(0.2, 0.4, 0.6), (0.9, 0.1, 0.3), (0.5, 0.8, 0.05)], np.float32)


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize(
    ("identifier", "inputs", "expected"),
    [
        ("multiply_color3", "color3f inputs:in2 = (0.5, 0.25, 1)\n", lambda c: c * (0.5, 0.25, 1)),
        ("subtract_color3FA", "float inputs:in2 = 0.05\n", lambda c: c - 0.05),
        ("luminance_color3", "", lambda c: np.repeat(c @ [[0.2722287], [0.6740818], [0.0536895]], 3, -1)),
    ],
)
def test_linear_arithmetic_on_primvars_is_exact(identifier, inputs, expected, named):
    reader = node(
        "c", "geompropvalue_color3", 'string inputs:geomprop = "paint"\ncolor3f inputs:default = (1, 0.5, 0.25)\n'
    )
    first = "in" if "luminance" in identifier else "in1"
    nodes = reader + node("n", identifier, link("color3f", first, "c") + inputs)
    text = stage_text(COLOR + "float inputs:base = 1\nfloat inputs:specular = 0\n", nodes)
    if named:
        values = [tuple(map(float, c)) for c in PAINT]
        paint = f'color3f[] primvars:paint = {values} ( interpolation = "vertex" )\n'
        text = text.replace("int[] faceVertexCounts", paint + "int[] faceVertexCounts")
    scene = scene_of(text)
    assert scene.warnings == []
    x, y = (np.arange(8) + 0.5) / 8, 1 - (np.arange(8) + 0.5) / 8
    seen = pictures.outputs(scene, scenes.window(1.0, (0.5, 0.5, 5), (0.5, 0.5, 0)), ("albedo",), 8)["albedo"]
    b, c = np.meshgrid(x, y)
    inside = b + c < 0.95
    value = expected((1 - b - c)[..., None] * PAINT[0] + b[..., None] * PAINT[1] + c[..., None] * PAINT[2])
    if not named:
        value = np.broadcast_to(expected(np.array([1, 0.5, 0.25])), value.shape)
    np.testing.assert_allclose(seen[inside], np.clip(value, 0, 1)[inside], atol=1e-5)


def test_colour_spaces():
    # ACEScg's primaries and white in linear Rec.709, by the matrix of the ACES project (Bradford).
    aces = np.array([[1.70505, -0.62179, -0.08326], [-0.13026, 1.14080, -0.01055], [-0.02400, -0.12897, 1.15297]])
    color = np.array([[0.5, 0.3, 0.2, 0.7]])
    np.testing.assert_allclose(spaces.to_linear(color, "acescg")[0, :3], aces @ color[0, :3], atol=2e-4)
    assert spaces.to_linear(color, "acescg")[0, 3] == 0.7
    np.testing.assert_allclose(spaces.to_linear(color, "g22_rec709")[0, :3], color[0, :3] ** 2.2, atol=1e-6)
    surface, _ = drawn('color3f inputs:base_color = (0.5, 0.3, 0.2) ( colorSpace = "acescg" )')
    np.testing.assert_allclose(surface.diffuseColor, aces @ (0.5, 0.3, 0.2), atol=2e-4)


@pytest.mark.parametrize(("space", "source"), [("srgb_texture", "sRGB"), ("lin_rec709", "raw"), ("raw", "raw")])
def test_pictures_keep_their_colour_space(picture, space, source):
    surface, _ = drawn(COLOR, image(picture, "n", space=space))
    assert surface.diffuseColor.file == picture and surface.diffuseColor.sourceColorSpace == source


def test_pictures_of_wider_spaces_are_converted(picture):
    surface, _ = drawn(COLOR, image(picture, "n", space="acescg"))
    expected = spaces.to_linear(PIXELS.reshape(-1, 4) / 255.0, "acescg")[:, :3].reshape(6, 8, 3)
    np.testing.assert_allclose(surface.diffuseColor.file, expected, atol=1e-5)


def test_normal_maps(picture):
    nodes = image(picture, "image", "vector3") + node(
        "n", "normalmap_float", "float inputs:scale = 0.5\n" + link("float3", "in", "image"), "float3 outputs:out"
    )
    surface, warnings = drawn(link("float3", "normal", "n"), nodes)
    assert surface.normal.scale[:3] == (1, 1, 2) and surface.normal.bias[:3] == (-0.5, -0.5, -1) and warnings == []
    surface, warnings = drawn(link("float3", "normal", "image"), image(picture, "image", "vector3"))
    assert surface.normal == (0, 0, 1) and warnings == ["/m/image: a normal that is not of a normal map is not drawn"]


def test_standard_surface_as_numbers():
    surface, warnings = drawn(
        "float inputs:base = 0.5\ncolor3f inputs:base_color = (0.8, 0.4, 0.2)\nfloat inputs:specular = 0.5\n"
        "color3f inputs:specular_color = (1, 0.5, 0)\nfloat inputs:specular_IOR = 2\nfloat inputs:metalness = 0.25\n"
        "float inputs:coat = 0.3\nfloat inputs:coat_IOR = 1.7\nfloat inputs:emission = 2\n"
        "color3f inputs:opacity = (0.2, 0.4, 0.6)"
    )
    base = 0.5 * np.array([0.8, 0.4, 0.2])
    np.testing.assert_allclose(surface.diffuseColor, 0.75 * base, rtol=1e-6)
    weight = 0.5 * np.array([1, 0.5, 0])
    np.testing.assert_allclose(surface.specularColor, 0.75 * weight / 9 + 0.25 * base, rtol=1e-6)
    np.testing.assert_allclose(surface.specularEdgeColor, 0.75 * weight + 0.25, rtol=1e-6)
    assert surface.useSpecularWorkflow == 1 and surface.opacityMode == "presence"
    found = (surface.roughness, surface.clearcoat, surface.clearcoatRoughness, surface.ior, surface.opacity)
    np.testing.assert_allclose(found, (0.2, 0.3, 0.1, 1.7, 0.4), rtol=1e-6)
    assert surface.emissiveColor == (2, 2, 2) and warnings == []


def test_open_pbr_and_gltf_as_numbers():
    surface, warnings = drawn(
        "float inputs:base_weight = 0.5\ncolor3f inputs:base_color = (1, 0.5, 0)\nfloat inputs:specular_weight = 0\n"
        "float inputs:emission_luminance = 3\nfloat inputs:geometry_opacity = 0.5",
        surface="open_pbr_surface_surfaceshader",
    )
    assert surface.diffuseColor == (0.5, 0.25, 0) and surface.specularEdgeColor == surface.specularColor == (0, 0, 0)
    assert surface.emissiveColor == (3, 3, 3) and surface.opacity == 0.5 and surface.roughness == 0.3
    surface, more = drawn(
        "color3f inputs:base_color = (1, 0.5, 0)\nfloat inputs:alpha = 0.3\nint inputs:alpha_mode = 1",
        surface="gltf_pbr_surfaceshader",
    )
    assert surface.specularColor == (1, 0.5, 0) and surface.diffuseColor == (0, 0, 0)
    np.testing.assert_allclose((surface.opacity, surface.opacityThreshold), (0.3, 0.5), rtol=1e-6)
    assert warnings == more == []


def test_varying_metalness_mixes_in_the_metallic_workflow(picture):
    inputs = COLOR + link("float", "metalness", "k") + "float inputs:specular = 0.5"
    surface, _ = drawn(inputs, image(picture, "n") + image(picture, "k", "float"))
    assert surface.useSpecularWorkflow == 0 and surface.metallic.channel == "r" and surface.diffuseColor.file == picture
    np.testing.assert_allclose(((1 - surface.ior) / (1 + surface.ior)) ** 2, 0.02, rtol=1e-6)


def test_preview_surface_under_its_name_in_materialx(picture):
    nodes = image(picture, "n") + node("k", "constant_float", "float inputs:value = 0.25\n", "float outputs:out")
    inputs = link("color3f", "diffuseColor", "n") + link("float", "roughness", "k") + "float inputs:metallic = 1"
    surface, warnings = drawn(inputs, nodes, "UsdPreviewSurface_surfaceshader")
    assert surface.diffuseColor.file == picture and (surface.roughness, surface.metallic) == (0.25, 1) and not warnings


@pytest.mark.parametrize("context", ["mtlx:surface", "surface"])
def test_a_surface_is_found_in_either_context(context):
    surface, _ = drawn("float inputs:base = 0", output=context)
    assert surface.diffuseColor == (0, 0, 0)


@pytest.mark.parametrize(
    ("surface", "name", "value"),
    [
        *(("standard_surface", name, "0.5") for name in ("diffuse_roughness", "specular_anisotropy")),
        *(("standard_surface", name, "0.5") for name in ("subsurface", "sheen", "thin_film_thickness")),
        *(("open_pbr_surface", name, "0.5") for name in ("base_diffuse_roughness",)),
        *(("open_pbr_surface", name, "0.5") for name in ("subsurface_weight", "fuzz_weight", "thin_film_weight")),
        *(("gltf_pbr", name, "0.5") for name in ("iridescence", "anisotropy_strength", "dispersion")),
    ],
)
def test_what_is_not_drawn_is_named(surface, name, value):
    _, warnings = drawn(f"float inputs:{name} = {value}", surface=f"{surface}_surfaceshader")
    assert warnings == [f"/m/s: {name} is not drawn"]
    assert drawn(f"float inputs:{name} = 0", surface=f"{surface}_surfaceshader")[1] == []


def test_what_refracts_is_glass():
    glass, warnings = drawn(
        "float inputs:transmission = 1\nfloat inputs:specular_IOR = 1.33\nfloat inputs:specular_roughness = 0.1\n"
        "color3f inputs:transmission_color = (0.5, 0.75, 1)\nfloat inputs:coat = 1"
    )
    assert isinstance(glass, wr.Dielectric) and warnings == ["/m/s: coat is not drawn where light is refracted"]
    np.testing.assert_allclose((glass.ior, glass.roughness), (1.33, 0.1), rtol=1e-6)
    assert glass.transmissionColor == (0.5, 0.75, 1) and glass.attenuationDistance == np.inf and not glass.thinWalled
    glass, _ = drawn(
        "float inputs:transmission_weight = 1\ncolor3f inputs:transmission_color = (0.5, 0.75, 1)\n"
        "float inputs:transmission_depth = 2\nbool inputs:geometry_thin_walled = 1",
        surface="open_pbr_surface_surfaceshader",
    )
    assert glass.attenuationColor == (0.5, 0.75, 1) and glass.attenuationDistance == 2 and glass.thinWalled == 1
    assert glass.transmissionColor == (1, 1, 1)
    glass, _ = drawn("float inputs:transmission = 1", surface="gltf_pbr_surfaceshader")
    assert glass.thinWalled == 1 and glass.roughness == 1


@pytest.mark.parametrize(("weight", "kind"), [(0.75, wr.Dielectric), (0.25, wr.PreviewSurface)])
def test_what_refracts_in_part_is_one_or_the_other_and_says_so(weight, kind):
    surface, warnings = drawn(f"float inputs:transmission = {weight}")
    assert isinstance(surface, kind) and len(warnings) == 1 and warnings[0].startswith("/m/s: transmission is 0.")


def test_a_coat_that_is_off_names_nothing():
    assert drawn("color3f inputs:coat_color = (1, 0, 0)")[1] == []
    assert drawn("color3f inputs:coat_color = (1, 0, 0)\nfloat inputs:coat = 1")[1] == ["/m/s: coat_color is not drawn"]


@pytest.mark.parametrize(
    ("nodes", "message"),
    [
        (node("n", "worleynoise3d_vector3"), "/m/n: ND_worleynoise3d_vector3 is not read"),
        (node("n", "position_vector3"), "/m/n: ND_position_vector3 is not read"),
        (node("n", "add_color3", link("color3f", "in1", "n")), "/m/n: it is connected to itself"),
        (node("n", "image_color3", ""), "/m/n: it names no file; its default is taken"),
        (node("n", "geompropvalue_color3", ""), "/m/n: it names no primvar"),
        (node("n", "constant_color3", "color3f inputs:value = (nan, 0, 0)\n"), "/m/n: value is not finite"),
        (
            node("n", "add_color3", "color3f inputs:in1 = (1, 1, 1)\nfloat2 inputs:in2 = (1, 1)\n"),
            "/m/n: its inputs do not fit together: operands could not be broadcast together with shapes (1,3) (1,2)",
        ),
    ],
)
def test_nodes_that_cannot_be_drawn_are_named(nodes, message):
    surface, warnings = drawn(COLOR, nodes)
    assert warnings == [message] and not isinstance(surface.diffuseColor, Texture)


def test_a_picture_that_is_missing_leaves_its_default(tmp_path):
    default = "color3f inputs:default = (0.25, 0.5, 0.75)\n"
    surface, _ = drawn(COLOR, image(f"{tmp_path}/none.png", "n", inputs=default))
    assert surface.diffuseColor.fallback[:3] == (0.25, 0.5, 0.75)
    power = node("n", "power_color3FA", "float inputs:in2 = 2\n" + link("color3f", "in1", "image"))
    surface, warnings = drawn(COLOR, image(f"{tmp_path}/none.png", inputs=default) + power)
    assert surface.diffuseColor == (0.0625, 0.25, 0.5625) and len(warnings) == 1 and "none.png" in warnings[0]


def test_displacement_shaders():
    nodes = node(
        "d", "displacement_float", "float inputs:displacement = 0.25\nfloat inputs:scale = 3", "token outputs:out"
    )
    text = stage_text("", nodes).replace(
        "token outputs:mtlx:surface",
        "token outputs:mtlx:displacement.connect = </m/d.outputs:out>\ntoken outputs:mtlx:surface",
    )
    text = text.replace("int[] faceVertexCounts", 'uniform token subdivisionScheme = "none"\nint[] faceVertexCounts')
    np.testing.assert_allclose(scene_of(text).meshes["/q"].points[:, 2], 0.75)


DOCUMENT = """<?xml version="1.0"?>
<materialx version="1.38" colorspace="lin_rec709">
  <nodedef name="ND_half" node="half">
    <input name="in" type="color3" value="1,1,1"/><output name="out" type="color3"/>
  </nodedef>
  <nodegraph name="NG_half" nodedef="ND_half">
    <multiply name="m" type="color3"><input name="in1" type="color3" interfacename="in"/>
      <input name="in2" type="color3" value="0.5,0.5,0.5"/></multiply>
    <output name="out" type="color3" nodename="m"/>
  </nodegraph>
  <nodegraph name="graph">
    <input name="strength" type="float" value="0.5"/>
    <image name="picture" type="color3">
      <input name="file" type="filename" value="a.png" colorspace="srgb_texture"/>
    </image>
    <multiply name="times" type="color3"><input name="in1" type="color3" nodename="picture"/>
      <input name="in2" type="float" interfacename="strength"/></multiply>
    <half name="less" type="color3"><input name="in" type="color3" nodename="times"/></half>
    <output name="color" type="color3" nodename="less"/>
  </nodegraph>
  <standard_surface name="SR" type="surfaceshader">
    <input name="base_color" type="color3" nodegraph="graph" output="color"/>
    <input name="metalness" type="float" value="0"/>
  </standard_surface>
  <surfacematerial name="Paint" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="SR"/>
  </surfacematerial>
</materialx>"""

MESH = """ ( prepend apiSchemas = ["MaterialBindingAPI"] ) { rel material:binding = <%s>
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)] }"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory, picture):
    """A folder with a document, its picture, and an asset that refers to the document."""
    folder = tmp_path_factory.mktemp("documents")
    (folder / "paint.mtlx").write_text(DOCUMENT)
    (folder / "a.png").write_bytes(open(picture, "rb").read())
    (folder / "asset.usda").write_text(
        '#usda 1.0\n( defaultPrim = "Asset" )\ndef Xform "Asset"\n{\n'
        'def Scope "Looks" ( references = @./paint.mtlx@</MaterialX/Materials> )\n{\n}\n'
        + 'def Mesh "mesh"' + (MESH % "/Asset/Looks/Paint").replace("{", "{\n").replace("}", "\n}") + "\n}\n"
    )  # fmt: skip
    return folder


def check_paint(scene, path):
    surface = scene.materials[scene.placements[path].material]
    assert surface.diffuseColor.file.endswith("a.png") or "a.png" in surface.diffuseColor.file
    assert surface.diffuseColor.scale[:3] == (0.25, 0.25, 0.25) and surface.diffuseColor.sourceColorSpace == "sRGB"
    assert sampled(surface.diffuseColor, ST)[:, :3].max() > 0.05
    assert scene.warnings == []


def test_documents_are_referred_to(folder):
    check_paint(wr.load(folder / "asset.usda"), "/Asset/mesh")
    direct = f'def Material "P" ( references = @{folder}/paint.mtlx@</MaterialX/Materials/Paint> ) {{ }}'
    check_paint(scene_of(direct + 'def Mesh "q"' + MESH % "/P"), "/q")


def test_documents_inside_of_instances(folder):
    text = "".join(
        f'def Xform "i{k}" ( instanceable = true\nreferences = @{folder}/asset.usda@ ) {{ }}' for k in range(3)
    )
    scene = scene_of(text)
    for k in range(3):
        check_paint(scene, f"/i{k}/mesh")
    assert len({id(placement.shape) for placement in scene.placements.values()}) == 1


@pytest.mark.parametrize("levels", [2, 3])
def test_documents_inside_of_instances_of_instances(folder, levels):
    inner = folder / "asset.usda"
    for level in range(1, levels):
        outer = folder / f"level{level}.usda"
        copies = "".join(f'def "c{k}" (\ninstanceable = true\nreferences = @{inner}@\n)\n{{\n}}\n' for k in range(2))
        outer.write_text(f'#usda 1.0\n(\ndefaultPrim = "Set"\n)\ndef Xform "Set"\n{{\n{copies}}}\n')
        inner = outer
    scene = scene_of(
        f'def Xform "i" ( instanceable = true\nreferences = @{inner}@ ) {{ }}'
        f'def Xform "j" ( instanceable = true\nreferences = @{inner}@ ) {{ }}'
        f'def Xform "k" ( instanceable = true\nreferences = @{folder}/asset.usda@ ) {{ }}'
    )
    assert len(scene.placements) == 2 * 2 ** (levels - 1) + 1
    for path in scene.placements:
        check_paint(scene, path)


def test_documents_inside_of_packages(folder):
    package = folder / "asset.usdz"
    with zipfile.ZipFile(package, "w") as archive:
        for name in ("asset.usda", "paint.mtlx", "a.png"):
            # USDZ wants the bytes of each file to begin at multiples of 64.
            info = zipfile.ZipInfo(name)
            start = archive.fp.tell() + 30 + len(name)
            info.extra = b"\x86\x19" + (n := (-start - 4) % 64).to_bytes(2, "little") + bytes(n)
            archive.writestr(info, (folder / name).read_bytes())
    check_paint(wr.load(package), "/Asset/mesh")


def test_the_callers_stage_and_its_layers_stay_as_they_are(folder):
    stage = stage_of(f'def "P" ( references = @{folder}/paint.mtlx@</MaterialX/Materials/Paint> ) {{ }}')
    root, session = stage.GetRootLayer().ExportToString(), stage.GetSessionLayer().ExportToString()
    wr.load(stage)
    assert (root, session) == (stage.GetRootLayer().ExportToString(), stage.GetSessionLayer().ExportToString())


@pytest.mark.parametrize("content", [None, "", "<materialx", "<?xml version='1.0'?><other/>"])
def test_documents_that_cannot_be_read_are_named_in_one_line(tmp_path, content):
    file = tmp_path / "bad.mtlx"
    if content is not None:
        file.write_text(content)
    scene = scene_of(f'def Material "P" ( references = @{file}@</MaterialX/Materials/P> ) {{ }}def Sphere "s" {{ }}')
    assert len(scene.warnings) == 1 and "bad.mtlx" in scene.warnings[0] and "\n" not in scene.warnings[0]
    assert "/s" in scene.placements


@pytest.mark.parametrize(
    ("inputs", "surface", "share"),
    [
        ("float inputs:specular = 0\nfloat inputs:base = 0.5\ncolor3f inputs:base_color = (1, 0.5, 0.25)",
         "standard_surface", (0.5, 0.25, 0.125)),
        ("float inputs:specular_weight = 0\ncolor3f inputs:base_color = (1, 0.5, 0.25)", "open_pbr_surface",
         (1, 0.5, 0.25)),
        ("float inputs:specular = 0\nfloat inputs:metallic = 0\ncolor3f inputs:base_color = (1, 0.5, 0.25)", "gltf_pbr",
         (1, 0.5, 0.25)),
    ],
)  # fmt: skip
def test_without_a_specular_lobe_they_are_lambert_surfaces(inputs, surface, share):
    scene = scene_of(
        stage_text(inputs, surface=f"{surface}_surfaceshader").replace(
            "[(0, 0, 0), (1, 0, 0), (0, 1, 0)]", "[(-9, -9, 0), (9, -9, 0), (0, 9, 0)]"
        )
    )
    scene.add_light(wr.DistantLight(angle=0.0, intensity=np.pi), pose=scenes.look_at((1, 0, 1)))
    color, _ = pictures.picture(scene, scenes.camera((0, 0, 3), fov=20), 4, 16)
    np.testing.assert_allclose(color[..., :3], np.broadcast_to(np.sqrt(0.5) * np.array(share), (4, 4, 3)), rtol=3e-6)
