"""Only what the scene calls for: each effect alone is all that its plan names beyond the base scene's."""

import dataclasses

import numpy as np
import pytest
import scenes
import warp as wp
from effects import EFFECTS, ball, base
from pictures import prepare
from warp._src.context import ModuleBuilder

import warprender as wr
from warprender.integrators import RADIANCE
from warprender.integrators.samples import samples_kernel
from warprender.lights.dispatch import FUNCTIONS
from warprender.materials import MATERIALS
from warprender.materials.material import LOBES
from warprender.outputs import FILM_OUTPUTS, OUTPUTS
from warprender.plan import LIGHT_EFFECTS, Request, analyse, everything
from warprender.shapes import SHAPES
from warprender.shapes.sdf import _adapted

#: Effect to the names that it adds to the key, and the entries of the plan with the prim that called for them.
ADDED = {
    "base": ({}, {}),
    "UsdPreviewSurface": (
        {"materials": {"PreviewSurface"}},
        {"material PreviewSurface": "/sheet", "lobe glossy": "/sheet"},
    ),
    "clearcoat": ({"materials": {"PreviewSurface"}}, {"lobe clearcoat": "/sheet", "lobe glossy": "/sheet"}),
    "mirror": ({"materials": {"PreviewSurface"}}, {"lobe mirror": "/sheet"}),
    "texture": ({"materials": {"PreviewSurface"}, "features": {"texture"}}, {"texture diffuseColor": "/sheet"}),
    "primvar": ({"materials": {"PreviewSurface"}, "features": {"primvar"}}, {"primvar diffuseColor": "/sheet"}),
    "normal map": (
        {"materials": {"PreviewSurface"}, "features": {"normal map", "texture"}},
        {"normal map": "/sheet", "texture normal": "/sheet"},
    ),
    "cut-out": (
        {"materials": {"PreviewSurface"}, "features": {"texture"}, "straight_through": True},
        {"cut-out": "/sheet", "straight through": "/sheet", "texture opacity": "/sheet"},
    ),
    "opacity 0.5": ({"materials": {"PreviewSurface"}, "straight_through": True}, {"straight through": "/sheet"}),
    "energy compensation": (
        {"materials": {"PreviewSurface"}, "features": {"energy compensation"}},
        {"energy compensation": "asked for"},
    ),
    "transmission": (
        {"materials": {"Dielectric"}, "features": {"transmission"}},
        {"transmission": "/ball", "lobe mirror": "/ball", "lobe refraction": "/ball"},
    ),
    "rough transmission": (
        {"materials": {"Dielectric"}, "features": {"transmission"}},
        {"transmission": "/ball", "lobe glossy": "/ball", "lobe rough refraction": "/ball"},
    ),
    "Phong": ({"materials": {"Phong"}}, {"material Phong": "/ball", "lobe glossy": "/ball"}),
    "measured BRDF": ({"materials": {"MeasuredBRDF"}}, {"material MeasuredBRDF": "/ball", "lobe measured": "/ball"}),
    "sphere": ({}, {"shape Sphere": "/ball"}),
    "signed distance function": ({"shapes": {"Sdf"}, "sdfs": {_adapted(ball)}}, {"shape Sdf": "/ball"}),
    "sphere light": ({"lights": {"SphereLight"}}, {"light SphereLight": "/second"}),
    "disk light": ({"lights": {"DiskLight"}}, {"light DiskLight": "/second"}),
    "cylinder light": ({"lights": {"CylinderLight"}}, {"light CylinderLight": "/second"}),
    "distant light": ({"lights": {"DistantLight"}}, {"light DistantLight": "/second"}),
    "dome": ({"lights": {"DomeLight"}}, {"light DomeLight": "/second"}),
    "dome with a picture": ({"lights": {"DomeLight.texture"}}, {"light DomeLight.texture": "/second"}),
    "dome with a portal": ({"lights": {"DomeLight.portals"}}, {"light DomeLight.portals": "/second"}),
    "lamp with a picture": ({"lights": {"RectLight.texture"}}, {"light RectLight.texture": "/lamp"}),
    "glowing mesh": (
        {"materials": {"PreviewSurface"}, "lights": {"MeshLight"}},
        {"light MeshLight": "/ball (glows)"},
    ),
    "glowing sphere": (
        {"materials": {"PreviewSurface"}, "lights": {"GlowingSphere"}},
        {"light GlowingSphere": "/ball (glows)"},
    ),
    "shaping": ({"light_effects": {"shaping"}}, {"light shaping": "/lamp"}),
    "photometric profile": ({"light_effects": {"ies"}}, {"light ies": "/lamp"}),
    "changed shadows": ({"light_effects": {"shadows"}}, {"light shadows": "/lamp"}),
    "light linking": ({"light_effects": {"linking"}}, {"light linking": "/lamp"}),
    "depth of field": ({"camera": {"lens"}}, {"depth of field": "fStop and focusDistance of the camera"}),
    "clipping planes": ({"camera": {"clippingPlanes"}}, {"clipping planes": "clippingPlanes of the camera"}),
    "motion blur": ({}, {"motion blur": "scene.motion, while the shutter is open"}),
    "outputs normal and cameraDepth": ({}, {"output normal": "asked for", "output cameraDepth": "asked for"}),
    "outputs color:0 and color:1": ({"terms": True}, {"single terms": "color:0, color:1 asked for"}),
}
#: What an effect takes away, for it stands in the place of it.
REMOVED = {"lamp with a picture": {"lights": {"RectLight"}}}


def plan_of(effect, **options):
    add, asked = EFFECTS[effect]
    scene = base()
    add(scene)
    request = Request(**{**asked, **options})
    return analyse(scene, scene.cameras["/camera"], request)


def names_of(key):
    return {f.name: set(v) if isinstance(v := getattr(key, f.name), tuple) else v for f in dataclasses.fields(key)}


@pytest.mark.parametrize("effect", EFFECTS)
def test_an_effect_adds_its_own_names_and_no_others(effect):
    added, entries = ADDED[effect]
    plan, plain = plan_of(effect), plan_of("base")
    expected = names_of(plain.path)
    for part, names in added.items():
        expected[part] = names if names is True else expected[part] | names
    for part, names in REMOVED.get(effect, {}).items():
        expected[part] = expected[part] - names
    assert names_of(plan.path) == expected
    for entry, caller in entries.items():
        assert plan.reasons[entry] == caller
        assert entry not in plain.reasons and (entry in plain.absent or entry.startswith(("texture ", "primvar ")))


@pytest.mark.parametrize("effect", EFFECTS)
def test_every_effect_is_there_with_its_caller_or_left_out_with_what_would_call_for_it(effect):
    plan = plan_of(effect)
    assert not set(plan.reasons) & set(plan.absent)
    assert all((plan.reasons | plan.absent).values())
    families = [("shape", (s.__name__ for s in SHAPES)), ("material", (m.__name__ for m in MATERIALS)), ("lobe", LOBES)]
    families += [("light", (*FUNCTIONS, *LIGHT_EFFECTS)), ("output", ("color", *OUTPUTS, *FILM_OUTPUTS))]
    named = {f"{family} {name}" for family, names in families for name in names}
    named |= {"normal map", "transmission", "cut-out", "straight through", "energy compensation", "depth of field"}
    named |= {
        "clipping planes",
        "motion blur",
        "fast rays",
        "denoising",
        "single terms",
        "secondary rays",
        "shadow rays",
    }
    assert named <= {*plan.reasons, *plan.absent}
    others = {entry for entry in {*plan.reasons, *plan.absent} - named if not entry.startswith("output color:")}
    assert {entry.split()[0] for entry in others} <= {"transport", "visibility", "color", "texture", "primvar"}


@pytest.mark.parametrize("effect", EFFECTS)
def test_depth_names_no_effect_of_light_or_material(effect):
    """Only what may hide a surface or move it: opacity, clipping planes, shapes."""
    plan, passing = plan_of(effect, outputs=("cameraDepth",)), plan_of(effect).path.straight_through
    key = plan.outputs
    assert plan.path is None and plan.transport == "none" and plan.shutter is None and plan.bounds == {}
    assert set(key.features) <= ({"texture"} if passing else set())
    assert bool(key.materials) == passing == key.straight_through
    assert set(key.camera) <= {"perspective", "clippingPlanes"}
    lit = [entry for entry in plan.reasons if entry.split()[0] in ("light", "lobe", "secondary", "shadow", "depth")]
    assert not lit


def test_a_normal_needs_its_map_alone():
    assert plan_of("normal map", outputs=("normal",)).outputs.features == ("normal map", "texture")
    assert plan_of("texture", outputs=("normal",)).outputs.features == ()
    assert plan_of("texture", outputs=("albedo",)).outputs.features == ("texture",)


@pytest.mark.parametrize("fields", [{"fStop": 0.0, "focusDistance": 4.5}, {"fStop": 4.0, "focusDistance": 0.0}])
def test_a_lens_without_an_opening_or_a_focus_costs_nothing(fields):
    scene = base()
    for name, value in fields.items():
        setattr(scene.cameras["/camera"], name, value)
    assert analyse(scene, scene.cameras["/camera"], Request()) == plan_of("base")


def test_a_shutter_that_does_not_open_costs_nothing():
    scene = base()
    EFFECTS["motion blur"][0](scene)
    scene.cameras["/camera"].shutterClose = 0.0
    plan = analyse(scene, scene.cameras["/camera"], Request())
    assert plan == plan_of("base") and plan.shutter is None


#: Functions that only kernels with an effect have.
MARKS = {
    "clip": "clipping planes", "texture_at": "texture", "mapped_normal": "normal map",
    "input_at": "primvar", "medium_towards": "transmission", "fresnel_dielectric": "transmission",
    "brdf_at": "measured BRDF", "lobe_probabilities": "UsdPreviewSurface", "coat_fresnel": "clearcoat",
    "diffuse_probability": "Phong", "multiple_scattering": "energy compensation", "shadow_strength": "shadows",
    "is_linked": "linking", "focus_and_cone": "shaping", "photometric": "ies", "keep_term": "single terms",
    "choose_light": "shadow rays", "infinite_sample": "domes", "density_of": "pictures of lights",
    "emitted": "glowing mesh", "density_along": "glowing sphere", "scattered_cone": "",
}  # fmt: skip


def functions_of(key):
    """Names of the functions in the generated source of the path tracer, without those that they are closures of."""
    module = samples_kernel(key.camera, key.sdfs, RADIANCE["path"](key), False, key.terms).module
    builder = ModuleBuilder(module, {**module.resolve_options(wp.config), "output_arch": None}, target="cpu")
    return {function.key.rpartition("__")[2].lstrip("_") for function in builder.functions}


def test_code_of_effects_is_compiled_where_they_occur_alone():
    """`scattered_cone` is in every path tracer, and shows that the list of functions is one."""
    scene = base()
    scene.lights.clear()
    plain = functions_of(analyse(scene, scene.cameras["/camera"], Request()).path)
    whole = functions_of(everything())
    assert set(MARKS) <= whole
    assert set(MARKS) & plain == {"scattered_cone"}


def rays_of(scene, view, size=8, samples=16, **options):
    """Rays of each kind a sample, and the transport, which the plan chooses unless it is asked for."""
    renderer = prepare(scene, view, size, **{"transport": "auto", **options})
    rays = renderer.render(samples=samples).stats["rays"]
    return {kind: count / (samples * size**2) for kind, count in rays.items()}, renderer.plan.transport


BLACK = wr.PreviewSurface(diffuseColor=(0,) * 3, metallic=1.0)
GLOWING = wr.PreviewSurface(diffuseColor=(0,) * 3, metallic=1.0, emissiveColor=(1, 2, 3))


def filled(material=None, **options):
    """A sheet that fills the picture."""
    scene = wr.Scene()
    scene.add_mesh("/sheet", *scenes.quad(9.0), material=material, **options)
    return scene, scenes.window(2.0)


def test_what_emits_or_is_black_traces_no_further_ray():
    for material in (GLOWING, BLACK):
        rays, transport = rays_of(*filled(material), camera_light="on")
        assert transport == "local" and rays["bounce"] == rays["shadow"] == 0
    rays, transport = rays_of(*filled(color=(0,) * 3), camera_light="on")
    assert transport == "local" and rays["bounce"] == rays["shadow"] == 0


def test_without_lights_no_further_ray_is_traced():
    rays, transport = rays_of(*filled(), camera_light="off")
    assert transport == "local" and rays["bounce"] == rays["shadow"] == 0


def test_black_beside_white_traces_nothing_by_paths():
    """The white sheet lies behind the black one: the scene calls for paths, what is seen of it for nothing."""
    scene, view = filled(BLACK)
    scene.add_mesh("/white", *scenes.quad(9.0, -1.0), color=scenes.WHITE)
    scene.add_light(wr.RectLight(), pose=scenes.look_at((0, 0, 2)))
    rays, transport = rays_of(scene, view)
    assert transport == "path" and rays["bounce"] == rays["shadow"] == 0


def test_a_flat_sheet_under_a_point_takes_one_shadow_ray_and_no_other():
    """No bounces: by paths or light by light, and nothing could be met in the direction of a last ray."""
    for transport, chosen in (("auto", "direct"), ("path", "path")):
        rays, used = rays_of(*filled(), bounces=0, camera_light="on", transport=transport)
        assert used == chosen and rays["bounce"] == 0 and rays["shadow"] == 1


def test_one_bounce_is_one_ray():
    rays, _ = rays_of(*filled(), bounces=1, camera_light="on")
    assert rays["bounce"] == 1 and rays["shadow"] == 1


def test_lights_with_a_size_are_met_by_the_last_ray():
    scene, view = filled()
    scene.add_light(wr.DomeLight())
    rays, transport = rays_of(scene, view, bounces=0, transport="path")
    assert transport == "path" and rays["bounce"] == 1 and rays["shadow"] == 0
    scene.add_light(wr.RectLight(), pose=scenes.look_at((0, 0, 2)))
    rays, _ = rays_of(scene, view, bounces=0)
    assert rays["bounce"] == 1 and rays["shadow"] == 1


def test_a_last_ray_that_could_meet_nothing_changes_no_bit():
    scene = base()
    scene.lights.clear()
    pictures = {}
    for hit in (False, True):
        renderer = prepare(scene, "/camera", 16, bounces=2, camera_light="on")
        assert renderer.plan.bounds["lights can be hit"] is False
        renderer.plan.bounds["lights can be hit"] = hit
        frame = renderer.render(samples=16)
        pictures[hit] = frame.numpy("color"), frame.stats["rays"]["bounce"]
    np.testing.assert_array_equal(pictures[False][0], pictures[True][0])
    assert pictures[False][1] < pictures[True][1]


def test_aovs_trace_the_camera_s_rays_alone():
    frame = wr.Renderer(base(), "/camera", (8, 8), outputs=("cameraDepth",)).render()
    assert "rays" not in frame.stats


@pytest.mark.parametrize(
    ("change", "transport"),
    [
        (lambda scene: None, "direct"),
        (lambda scene: scene.add_light(wr.DistantLight(angle=0.0)), "direct"),
        (lambda scene: scene.add_light(wr.DomeLight()), "direct"),
        (lambda scene: scene.add_light(wr.DistantLight(angle=1.0)), "path"),
        (lambda scene: scene.add_light(wr.RectLight()), "path"),
        (lambda scene: scene.add_sphere("/lamp", material=GLOWING), "path"),
        (lambda scene: scene.add_sphere("/chrome", material=wr.PreviewSurface(metallic=1, roughness=0)), "path"),
        (lambda scene: scene.add_sphere("/plastic", material=wr.Phong()), "path"),
        (lambda scene: [scene.add_light(wr.DistantLight(angle=0.0)) for _ in range(33)], "path"),
    ],
)
def test_direct_stands_in_for_paths_of_no_bounce_where_it_finds_all_light(change, transport):
    scene, view = filled()
    change(scene)
    plan = analyse(scene, view, Request(bounces=0), camera_light=not scene.lights)
    assert plan.transport == transport
    assert analyse(scene, view, Request(), camera_light=not scene.lights).transport == "path"
    assert analyse(scene, view, Request(outputs=("color:1",)), camera_light=not scene.lights).transport == transport


@pytest.mark.parametrize(
    ("other", "transport"),
    [
        (wr.PreviewSurface(metallic=1.0, roughness=0.005), "whitted"),
        (BLACK, "whitted"),
        (wr.PreviewSurface(), "path"),
        (wr.Dielectric(), "path"),
        (wr.PreviewSurface(metallic=1.0, roughness=0.02), "path"),
        (wr.PreviewSurface(metallic=1.0, roughness=0.0, clearcoat=1.0, clearcoatRoughness=0.3), "path"),
    ],
)
def test_whitted_stands_in_for_paths_among_perfect_mirrors(other, transport):
    scene, view = filled(wr.PreviewSurface(metallic=1.0, roughness=0.0, diffuseColor=(0.5, 0.9, 0.3)))
    scene.add_light(wr.DomeLight())
    scene.add_sphere("/ball", material=other)
    plan = analyse(scene, view, Request())
    assert plan.transport == transport
    if transport == "whitted":
        assert plan.bounds["unfollowed"] <= 1e-4 or plan.bounds["bounces"] == 256
