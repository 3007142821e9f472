"""`analyse`: from a scene and a request to the plan."""

from __future__ import annotations

from collections.abc import Iterable

from ..camera import Camera
from ..denoise import GUIDES
from ..emitters import lit
from ..lights import Light
from ..lights.dispatch import FUNCTIONS
from ..materials import MATERIALS
from ..materials.material import LOBES
from ..outputs import FILM_OUTPUTS, OUTPUTS, of_first_hits, terms_of
from ..scene import Scene
from ..shapes import SHAPES
from .bounds import bounds_of
from .choices import choose_color_visibility, choose_transport, choose_visibility
from .keys import LIGHT_EFFECTS, OutputsKey, PathKey
from .occurring import Occurring, occurring
from .render_plan import RenderPlan
from .request import ONE_SURFACE, Request, check_request

#: What would call for features of materials.
_FEATURES = {
    "normal map": "a material's normal that is connected to a texture or a primvar",
    "primvar": "a material input that is connected to a primvar",
    "texture": "a material input that is connected to a texture",
    "transmission": "a warprender:Dielectric",
}
#: Shapes that every kernel has: leaving one out was measured, and saves neither time nor compiling.
_EVERY_SHAPE = ("Mesh", "Sphere")
#: Why no effect of light occurs in AOVs.
_NO_COLOR = "color among the outputs"


def analyse(
    scene: Scene, camera: Camera, request: Request, camera_light: bool = False, pixels: int = 960 * 540
) -> RenderPlan:
    """Scan the scene once for what the request needs of it.

    Args:
        scene: what to draw.
        camera: from where.
        request: what is asked for.
        camera_light: whether a light at the camera is added.
        pixels: of the picture, for the choice of visibility.

    Raises:
        SceneError: an output, transport or visibility that does not exist, or a light or material that is none.
    """
    check_request(request)
    scene.check()
    found = occurring(scene, request.energy_compensation)
    lights = lit(scene, camera_light) if request.colored else {}
    transport, called_for = choose_transport(found, request, lights)
    visibility, why = choose_visibility(scene, found, camera, request, pixels)
    color_visibility, why_color = choose_color_visibility(found, camera, request, pixels, transport)
    plan = RenderPlan(transport, visibility, color_visibility, None, None, {f"transport {transport}": called_for})
    plan.bounds = bounds_of(transport, found, request, lights)
    aovs = of_first_hits((*request.outputs, *(GUIDES if request.denoise else ())))
    if aovs:
        plan.reasons[f"visibility {visibility}"] = why
        plan.outputs = _outputs_key(found, camera, aovs)
    if request.colored:
        plan.reasons[f"color by {color_visibility}"] = why_color
        plan.path = _path_key(found, camera, request, transport, lights)
    plan.note_kinds("shape", dict.fromkeys((s.__name__ for s in SHAPES), "a prim of this kind"), found.shapes)
    _note_materials(plan, found, request)
    _note_camera(plan, scene, camera, request)
    _note_outputs(plan, request)
    _note_lights(plan, lights, request)
    _note_rays(plan, found)
    plan.note("fast rays", "asked for" if request.ray_accuracy == "fast" else "", "ray_accuracy='fast', for studies")
    return plan


def _outputs_key(found: Occurring, camera: Camera, aovs: tuple[str, ...]) -> OutputsKey:
    """With those materials and features alone that the outputs, or what lies behind something clear, depend on."""
    of_material = bool(found.passing) or any(OUTPUTS[name].of_material for name in aovs)
    mapped = "normal map" in found.features and (of_material or any(OUTPUTS[name].of_normal for name in aovs))
    reads = {name for name in ("primvar", "texture") if name in found.features} if of_material else set()
    if mapped:
        reads |= {"normal map", *found.mapped_by}
    pinhole = tuple(effect for effect in camera.effects() if effect != "lens")
    materials = tuple(sorted(found.materials)) if of_material else ()
    features = tuple(sorted(reads))
    return OutputsKey(_shapes(found), materials, pinhole, aovs, bool(found.passing), features, found.sdfs)


def _shapes(found: Occurring) -> tuple[str, ...]:
    return tuple(sorted({*_EVERY_SHAPE, *found.shapes}))


def _path_key(found: Occurring, camera: Camera, request: Request, transport: str, lights: dict[str, Light]) -> PathKey:
    aimed_at = any(light.power(1.0) > 0 for light in lights.values())
    features = {*found.features, *(("energy compensation",) if request.energy_compensation else ())}
    return PathKey(
        shapes=_shapes(found),
        materials=tuple(sorted(found.materials)),
        lights=tuple(sorted({light.kind() for light in lights.values()})),
        light_effects=tuple(sorted({effect for light in lights.values() for effect in light.effects()})),
        camera=camera.effects(),
        sampled_lights=aimed_at and transport != "local" and request.last_term != 0,
        straight_through=bool(found.passing),
        features=tuple(sorted(features)),
        sdfs=found.sdfs,
        terms=bool(terms_of(request.outputs)),
        ray_accuracy=request.ray_accuracy,
    )


def _note_materials(plan: RenderPlan, found: Occurring, request: Request) -> None:
    """Materials, how they scatter, what their inputs read, and what lets rays through."""
    kept = {name for key in (plan.path, plan.outputs) if key for name in (*key.materials, *key.features)}
    unread = "" if request.colored or plan.outputs.materials else "color or albedo among the outputs"
    kinds = dict.fromkeys((m.__name__ for m in MATERIALS), "a prim bound to one")
    plan.note_kinds("material", kinds, found.materials, unread)
    plan.note_kinds("lobe", LOBES, found.lobes, "" if request.colored else _NO_COLOR)
    plan.reasons |= {use: path for use, path in sorted(found.reads.items()) if use.partition(" ")[0] in kept}
    for feature, caller in _FEATURES.items():
        called = found.features.get(feature, "")
        if feature not in kept:
            plan.absent[feature] = (unread or _NO_COLOR) if called else caller
        elif feature not in ("primvar", "texture"):
            # Those two are named with each input that is read.
            plan.reasons[feature] = called
    plan.note("cut-out", found.cut_out, "an opacityThreshold above 0")
    asked = "asked for" if request.energy_compensation and request.colored else ""
    plan.note("energy compensation", asked, "--energyCompensation")
    plan.note("straight through", found.passing, "an opacity below 1")


def _note_camera(plan: RenderPlan, scene: Scene, camera: Camera, request: Request) -> None:
    effects = camera.effects()
    lens = "fStop and focusDistance of the camera" if "lens" in effects and request.colored else ""
    plan.note("depth of field", lens, _NO_COLOR if "lens" in effects else "fStop and focusDistance above 0")
    planes = "clippingPlanes of the camera" if "clippingPlanes" in effects else ""
    plan.note("clipping planes", planes, "clippingPlanes of the camera")
    plan.shutter, moves = _shutter(scene, camera, request)
    plan.note("motion blur", moves, "something that moves from shutter:open to shutter:close of the camera")


def _shutter(scene: Scene, camera: Camera, request: Request) -> tuple[tuple[float, float] | None, str]:
    """From when to when the shutter is open, and what moves meanwhile; None and "" where nothing is blurred."""
    shutter = camera.shutterOpen, camera.shutterClose
    off = scene.settings.disableMotionBlur or not request.colored
    if scene.motion is None or off or not shutter[0] < shutter[1]:
        return None, ""
    moving = getattr(scene.motion, "moving", None)
    moves = "scene.motion" if moving is None else moving(*shutter)
    return (shutter, f"{moves}, while the shutter is open") if moves else (None, "")


def _note_outputs(plan: RenderPlan, request: Request) -> None:
    plan.note("denoising", "asked for" if request.denoise else "", "--denoise")
    guides = {f"output {name}": "guides the denoiser" for name in GUIDES if request.denoise}
    asked = {f"output {name}": "asked for" for name in request.outputs}
    plan.reasons |= guides | asked
    known = (f"output {name}" for name in ("color", *OUTPUTS, *FILM_OUTPUTS))
    plan.absent |= {name: f"--aov {name.partition(' ')[2]}" for name in known if name not in plan.reasons}
    named = ", ".join(f"color:{number}" for number in terms_of(request.outputs))
    plan.note("single terms", f"{named} asked for" if named else "", "--aov color:0, color:1, …")


def _note_lights(plan: RenderPlan, lights: dict[str, Light], request: Request) -> None:
    unlit = "" if request.colored else _NO_COLOR
    kinds = dict.fromkeys(FUNCTIONS, "a light of this kind")
    plan.note_kinds("light", kinds, _first((light.kind(), path) for path, light in lights.items()), unlit)
    effects = _first((effect, path) for path, light in lights.items() for effect in light.effects())
    plan.note_kinds("light", LIGHT_EFFECTS, effects, unlit)


def _note_rays(plan: RenderPlan, found: Occurring) -> None:
    """What is traced besides the camera's rays."""
    follows = plan.path is not None and plan.transport not in ONE_SURFACE and plan.bounds["bounces"] >= 0
    scattering = found.brightest
    if plan.transport == "whitted":
        scattering = found.lobes.get("mirror", found.lobes.get("refraction", ""))
    why = f"{scattering} reflects light, {100 * found.albedo:.3g} % at most" if follows and scattering else ""
    plan.note("secondary rays", why, "light, surfaces that reflect it, and the transport whitted or path")
    if plan.transport in ("none", "local"):
        plan.absent["shadow rays"] = "the transport direct, whitted or path"
        return
    shadows = plan.path.sampled_lights or plan.transport == "direct"
    plan.note("shadow rays", "lights that can be aimed at" if shadows else "", "a light other than a dome")


def _first(pairs: Iterable[tuple[str, str]]) -> dict[str, str]:
    """The first value of each name."""
    found: dict[str, str] = {}
    for name, value in pairs:
        found.setdefault(name, value)
    return found
