"""The plan: which effects a request on a scene calls for, which prim called for each, and what follows from it.

A kernel is compiled for its key, a frozen value of names; what is not named is not in the generated code. Counts,
sizes and colours are runtime values and never in a key.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, fields, replace

import numpy as np
import warp as wp

from .camera import Camera
from .denoise import GUIDES
from .emitters import emits, lit
from .lights import Light
from .lights.dispatch import FUNCTIONS
from .materials import MATERIALS, TRANSMITTING, DisplayColor
from .materials.inputs import FEATURES, NORMAL
from .outputs import FILM_OUTPUTS, OUTPUTS, of_first_hits, of_samples, term_of, terms_of
from .scene import Placement, Scene, SceneError, materials_of
from .shapes import SHAPES, Mesh, Primvar, Sdf
from .textures import Texture

#: The transports: from none to all light, and how each goes on.
TRANSPORTS = ("none", "local", "direct", "whitted", "path")
#: Those that see one surface a ray: they follow no bounce.
ONE_SURFACE = ("local", "direct")
#: Those that add up the lights at a surface, and reflect no other light in its rough parts.
LIGHT_BY_LIGHT = ("local", "direct", "whitted")
VISIBILITIES = ("rays", "raster", "painter")
#: How rays of colour meet triangles: by our walk, or by Warp's own query, which leaks.
RAY_ACCURACIES = ("watertight", "fast")

#: Nanoseconds of one CPU thread, measured at 1280×720 with 100,000 and a million triangles, a quarter of the picture
#: covered: a camera ray (116, 133); a rasterized pixel, and a triangle (120 where it covers 8 pixels, 30 where 1).
RAY_COST, PIXEL_COST, TRIANGLE_COST = 120.0, 25.0, 60.0

#: What lights may need compiled beyond their kinds, and what would call for it.
LIGHT_EFFECTS = {
    "ies": "shaping:ies:file",
    "linking": "a lightLink collection that leaves prims out",
    "shadows": "ShadowAPI, or a shadowLink collection that leaves prims out",
    "shaping": "shaping:focus, or a shaping:cone:angle that cuts something off",
}

#: Share of the emitted light that may be lost to the end of paths when no number of bounces is given.
BOUNCE_TOLERANCE = 1e-4
#: Perfect reflections and refractions that "whitted" follows when no number of bounces is given.
WHITTED_BOUNCES = 8
#: Paths never reflect more often than this.
MOST_BOUNCES = 256


@dataclass(frozen=True)
class PathKey:
    """What the path-tracing kernel is compiled for."""

    shapes: tuple[str, ...]
    materials: tuple[str, ...]
    lights: tuple[str, ...]
    light_effects: tuple[str, ...]
    camera: tuple[str, ...]
    sampled_lights: bool
    straight_through: bool
    features: tuple[str, ...] = ()
    sdfs: tuple[wp.Function, ...] = ()
    terms: bool = False
    ray_accuracy: str = "watertight"


@dataclass(frozen=True)
class OutputsKey:
    """What the AOV kernel is compiled for."""

    shapes: tuple[str, ...]
    materials: tuple[str, ...]
    camera: tuple[str, ...]
    outputs: tuple[str, ...]
    straight_through: bool
    features: tuple[str, ...] = ()
    sdfs: tuple[wp.Function, ...] = ()


@dataclass(frozen=True)
class Request:
    """What is asked of a scene; see `Renderer` for the meanings."""

    outputs: tuple[str, ...] = ("color",)
    visibility: str = "auto"
    transport: str = "auto"
    bounces: int | None = None
    dome_light_visible: bool = False
    lights_visible: bool = False
    energy_compensation: bool = False
    camera_light: str = "auto"
    filter: str = "box"
    sampler: str = "sobol"
    texture_bytes: int = 0
    denoise: bool = False
    light_sampling: str = "tree"
    filter_textures: bool = True
    adaptive: bool = False
    ray_accuracy: str = "watertight"


@dataclass
class RenderPlan:
    """The answer of `analyse`.

    Attributes:
        transport: one of `TRANSPORTS`.
        visibility: "rays", "raster" or "painter": how the AOVs' first hits are found.
        color_visibility: the same of colour.
        path: key of the transport's kernel, None when no colour is asked for.
        outputs: key of the AOV kernel, None when no AOV is asked for.
        shutter: from when to when samples of colour are taken, in frames from the scene's time; None for motionless
            ones.
        reasons: effect to the prim or flag that called for it.
        absent: effect to what would call for it.
        bounds: name to number: `bounces` followed, and `albedo` and `unfollowed` that it comes from.
    """

    transport: str
    visibility: str
    color_visibility: str
    path: PathKey | None
    outputs: OutputsKey | None
    reasons: dict[str, str] = field(default_factory=dict)
    absent: dict[str, str] = field(default_factory=dict)
    bounds: dict[str, float] = field(default_factory=dict)
    shutter: tuple[float, float] | None = None

    def explain(self) -> str:
        """A few lines for people: what runs, why, and what would call for the rest."""
        lines = [f"transport   {self.transport}", "", "in this picture"]
        width = max((len(name) for name in (*self.reasons, *self.absent)), default=0)
        lines += [f"  {name:{width}}  {reason}" for name, reason in self.reasons.items()]
        lines += ["", "left out, with what would call for it"]
        lines += [f"  {name:{width}}  {reason}" for name, reason in self.absent.items()]
        lines += ["", "bounds"] + [f"  {name:{width}}  {value:g}" for name, value in self.bounds.items()]
        return "\n".join(lines)

    def kept_from(self, before: RenderPlan, camera: Camera) -> RenderPlan:
        """This plan with the kernels of an earlier one of the same request, as far as they draw what it asks for.

        So nothing is compiled because something went, or came back.
        """
        alike = before.transport == self.transport
        path = before.path if alike and covers(before.path, self.path) else self.path
        outputs = before.outputs if covers(before.outputs, self.outputs) else self.outputs
        # Both kernels must number the distance functions alike.
        if path is None or outputs is None or path.sdfs == outputs.sdfs:
            self.path, self.outputs = path, outputs
        if "clippingPlanes" not in camera.effects() and self.visibility != before.visibility:
            self.reasons.pop(f"visibility {self.visibility}", "")
            self.visibility = before.visibility
            self.reasons[f"visibility {self.visibility}"] = "as before"
        if self.color_visibility != "rays" and before.color_visibility == "rays":
            self.reasons.pop(f"color by {self.color_visibility}", "")
            self.color_visibility, self.reasons["color by rays"] = "rays", "as before"
        return self

    @property
    def sdfs(self) -> tuple[wp.Function, ...]:
        """The signed distance functions that occur, in the order of their numbers on the device."""
        key = self.path or self.outputs
        return key.sdfs if key else ()

    def as_dict(self) -> dict:
        """The same as plain values, for JSON; functions by their names."""
        names = tuple(function.key for function in self.sdfs)
        keys = {part: replace(key, sdfs=()) if (key := getattr(self, part)) else None for part in ("path", "outputs")}
        plain = asdict(replace(self, **keys))
        for key in filter(None, (plain["path"], plain["outputs"])):
            key["sdfs"] = names
        return plain


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
        SceneError: an output, transport or visibility that does not exist.
    """
    _check(request)
    lights = lit(scene, camera_light) if of_samples(request.outputs) else {}
    transport, called_for = _transport(scene, request, lights)
    passing = _straight_through(scene)
    visibility, why = _visibility(scene, camera, request, pixels)
    color_visibility, why_color = _color_visibility(scene, camera, request, pixels, transport, passing)
    plan = RenderPlan(transport, visibility, color_visibility, None, None, {f"transport {transport}": called_for})
    if of_first_hits(request.outputs):
        plan.reasons[f"visibility {visibility}"] = why
    if of_samples(request.outputs):
        plan.reasons[f"color by {color_visibility}"] = why_color
    shapes = _effects(plan, "shape", {s.__name__ for s in SHAPES}, _shape_callers(scene), "a prim of this kind")
    materials = _effects(
        plan, "material", {m.__name__ for m in MATERIALS}, _material_callers(scene), "a prim bound to one"
    )
    features = _material_features(plan, scene, request)
    _note(plan, "straight through", passing, "an opacity below 1")
    effects = camera.effects()
    _note(plan, "lens", "fStop and focusDistance of the camera" if "lens" in effects else "", "fStop above 0")
    planes = "clippingPlanes of the camera" if "clippingPlanes" in effects else ""
    _note(plan, "clipping planes", planes, "clippingPlanes of the camera")
    plan.shutter, moves = _shutter(scene, camera, request)
    _note(plan, "motion blur", moves, "something that moves from shutter:open to shutter:close of the camera")
    sdfs = distance_functions(scene)
    guides = GUIDES if request.denoise else ()
    _note(plan, "denoising", "asked for" if guides else "", "--denoise")
    if request.ray_accuracy == "fast":
        plan.reasons["fast rays"] = "asked for"
    aovs = of_first_hits((*request.outputs, *guides))
    for name in request.outputs:
        plan.reasons[f"output {name}"] = "asked for"
    if aovs:
        pinhole = tuple(e for e in effects if e != "lens")
        plan.outputs = OutputsKey(shapes, materials, pinhole, aovs, bool(passing), features, sdfs)
    if of_samples(request.outputs):
        kinds = _effects(plan, "light", set(FUNCTIONS), _light_callers(lights), "a light of this kind")
        sampled = any(light.power(1.0) > 0 for light in lights.values()) and _last_term(request) != 0
        if transport == "local":
            plan.absent["shadow rays"] = "another transport than local"
        else:
            why = "lights that can be aimed at" if sampled else ""
            _note(plan, "shadow rays", why, "a light other than a dome")
        light_effects = _light_effects(plan, lights)
        terms = terms_of(request.outputs)
        named = ", ".join(f"color:{number}" for number in terms)
        _note(plan, "single terms", f"{named} asked for" if named else "", "--aov color:0, color:1, …")
        plan.path = PathKey(
            shapes,
            materials,
            kinds,
            light_effects,
            effects,
            sampled,
            bool(passing),
            features,
            sdfs,
            bool(terms),
            request.ray_accuracy,
        )
        _bound_bounces(plan, scene, request)
    return plan


def _transport(scene: Scene, request: Request, lights: dict[str, Light]) -> tuple[str, str]:
    """The transport, and why: with "auto" the cheapest that leaves out nothing that the scene calls for."""
    if request.transport != "auto":
        return request.transport, "asked for"
    if not of_samples(request.outputs):
        return "none", "no color is asked for"
    if not lights and not any(emits(scene, placement) for placement in scene.placements.values()):
        return "local", "nothing gives light"
    if _largest_albedo(scene, request) <= 0.0:
        return "local", "nothing reflects light"
    return "path", "surfaces reflect light to each other"


def _shutter(scene: Scene, camera: Camera, request: Request) -> tuple[tuple[float, float] | None, str]:
    """From when to when the shutter is open, and what moves meanwhile; None and "" where nothing is blurred."""
    shutter = camera.shutterOpen, camera.shutterClose
    off = scene.settings.disableMotionBlur or not of_samples(request.outputs)
    if scene.motion is None or off or not shutter[0] < shutter[1]:
        return None, ""
    moving = getattr(scene.motion, "moving", None)
    moves = "scene.motion" if moving is None else moving(*shutter)
    return (shutter, f"{moves}, while the shutter is open") if moves else (None, "")


def _color_visibility(
    scene: Scene, camera: Camera, request: Request, pixels: int, transport: str, passing: str
) -> tuple[str, str]:
    """How the first hits of colour are found, and why. Rays where the rasterizer cannot see what they do."""
    for reason, applies in (
        ("the camera has depth of field", "lens" in camera.effects()),
        (f"{passing} lets paths straight through", passing and transport == "path"),
        ("paths are made of rays", transport == "path" and request.visibility == "auto"),
        ("the camera has clippingPlanes", "clippingPlanes" in camera.effects()),
        ("pixels get samples of their own number", request.adaptive),
        (f"{_sdf(scene)} is a signed distance function", request.visibility == "auto" and _sdf(scene)),
    ):
        if applies:
            return "rays", reason
    return _cheaper(scene, request, pixels)


def _visibility(scene: Scene, camera: Camera, request: Request, pixels: int) -> tuple[str, str]:
    """How the AOVs' first hits are found, and why.

    Raises:
        SceneError: what is asked for cannot show this scene.
    """
    only_rays = "the camera has clippingPlanes" if "clippingPlanes" in camera.effects() else ""
    other = next((path for path, p in scene.placements.items() if not isinstance(p.shape, Mesh)), "")
    if request.visibility == "painter" and other:
        kind = type(scene.placements[other].shape).__name__
        raise SceneError(f"visibility 'painter' draws triangles alone, and {other} is a {kind.lower()}")
    if request.visibility in ("raster", "painter") and only_rays:
        raise SceneError(f"visibility {request.visibility!r}: {only_rays}, which only rays can follow")
    if request.visibility == "auto" and _sdf(scene):
        only_rays = only_rays or f"{_sdf(scene)} is a signed distance function"
    return ("rays", only_rays) if only_rays else _cheaper(scene, request, pixels)


def _sdf(scene: Scene) -> str:
    """The first prim that is a signed distance function, or ""."""
    return next((path for path, p in scene.placements.items() if isinstance(p.shape, Sdf)), "")


def _cheaper(scene: Scene, request: Request, pixels: int) -> tuple[str, str]:
    """What is asked for, or what should take less time, where both show the same."""
    if request.visibility != "auto":
        return request.visibility, "asked for"
    faces = sum(
        len(p.shape.triangles) * len(p.transforms) for p in scene.placements.values() if isinstance(p.shape, Mesh)
    )
    rays, raster = pixels * RAY_COST, pixels * PIXEL_COST + faces * TRIANGLE_COST
    milliseconds = f"about {1e-6 * raster:.3g} ms of one thread by raster, {1e-6 * rays:.3g} ms by rays"
    return "raster" if raster < rays else "rays", f"{faces} triangles, {pixels} pixels: {milliseconds}"


def covers(wide: PathKey | OutputsKey | None, narrow: PathKey | OutputsKey | None) -> bool:
    """Whether the kernel of one key draws all that another key asks for, to the bit: it has more compiled in."""
    if wide is None or narrow is None:
        return wide is narrow
    for part in fields(wide):
        more, less = getattr(wide, part.name), getattr(narrow, part.name)
        if part.name == "outputs" or not isinstance(more, (tuple, bool)):
            if more != less:
                return False
        elif (less and not more) if isinstance(more, bool) else not set(less) <= set(more):
            return False
    return True


def everything() -> PathKey:
    """The key with every effect compiled in: another kernel, the same pictures."""
    return PathKey(
        shapes=tuple(sorted(shape.__name__ for shape in SHAPES)),
        materials=tuple(sorted(material.__name__ for material in MATERIALS)),
        lights=tuple(sorted(FUNCTIONS)),
        light_effects=tuple(sorted(LIGHT_EFFECTS)),
        camera=("clippingPlanes", "lens", "orthographic", "perspective"),
        sampled_lights=True,
        straight_through=True,
        features=FEATURES,
        terms=True,
    )


def check_outputs(names: tuple[str, ...]) -> None:
    """Raise a SceneError at the first name that is no output."""
    for name in names:
        if name not in OUTPUTS and name not in FILM_OUTPUTS and name != "color" and term_of(name) is None:
            known = ", ".join((*OUTPUTS, *FILM_OUTPUTS))
            raise SceneError(f"output {name!r} is not one of color, color:0, color:1, …, {known}")


def _check(request: Request) -> None:
    if not request.outputs:
        raise SceneError("outputs: none is asked for")
    check_outputs(request.outputs)
    if request.transport not in (*TRANSPORTS, "auto"):
        raise SceneError(f"transport {request.transport!r} is not one of auto, {', '.join(TRANSPORTS)}")
    if request.transport == "none" and of_samples(request.outputs):
        name = next(name for name in request.outputs if of_samples([name]))
        raise SceneError(f"transport 'none' gives no {name}: ask for other outputs alone, or for transport 'path'")
    if request.visibility not in (*VISIBILITIES, "auto"):
        raise SceneError(f"visibility {request.visibility!r} is not one of auto, {', '.join(VISIBILITIES)}")
    if request.ray_accuracy not in RAY_ACCURACIES:
        raise SceneError(f"ray accuracy {request.ray_accuracy!r} is not one of {', '.join(RAY_ACCURACIES)}")
    if request.denoise and "color" not in request.outputs:
        raise SceneError("denoising is of color, which is not among the outputs")
    if request.bounces is not None and request.bounces < 0:
        raise SceneError(f"bounces must be 0 or more, not {request.bounces}")
    if request.bounces and request.transport in ONE_SURFACE:
        raise SceneError(f"bounces {request.bounces}: transport {request.transport!r} follows none")


def _note(plan: RenderPlan, effect: str, reason: str, caller: str) -> None:
    if reason:
        plan.reasons[effect] = reason
    else:
        plan.absent[effect] = caller


def _effects(plan: RenderPlan, family: str, kinds: set[str], callers: dict[str, str], caller: str) -> tuple[str, ...]:
    """Note each kind of a family with the first prim that calls for it; the names that occur, sorted."""
    for kind in sorted(kinds):
        _note(plan, f"{family} {kind}", callers.get(kind, ""), caller)
    return tuple(sorted(callers))


def _shape_callers(scene: Scene) -> dict[str, str]:
    callers: dict[str, str] = {}
    for path, placement in scene.placements.items():
        callers.setdefault(type(placement.shape).__name__, path)
    return callers


def distance_functions(scene: Scene) -> tuple[wp.Function, ...]:
    """The functions of all `Sdf` shapes, each once, in drawing order."""
    shapes = (placement.shape for placement in scene.placements.values())
    return tuple(dict.fromkeys(shape.kernel_function() for shape in shapes if isinstance(shape, Sdf)))


def _material_callers(scene: Scene) -> dict[str, str]:
    callers: dict[str, str] = {}
    for path, placement in scene.placements.items():
        for key in materials_of(placement):
            callers.setdefault(type(scene.materials[key]).__name__, path)
    return callers


def _material_features(plan: RenderPlan, scene: Scene, request: Request) -> tuple[str, ...]:
    """What material inputs need of the kernel; notes each input that varies, and cut-outs, with the first caller."""
    features = {"energy compensation"} if request.energy_compensation else set()
    uses: dict[str, str] = {}
    cut_out = transmission = ""
    for path, placement in scene.placements.items():
        for key in materials_of(placement):
            material = scene.materials[key]
            for number, (name, source) in material.varying().items():
                reads = "texture" if isinstance(source, Texture) else "primvar"
                features.add(reads)
                uses.setdefault(f"{reads} {name}", path)
                if number == NORMAL:
                    features.add("normal map")
            if isinstance(material, TRANSMITTING):
                features.add("transmission")
                transmission = transmission or path
            if material.is_cut_out():
                cut_out = cut_out or path
    plan.reasons |= dict(sorted(uses.items()))
    for feature in ("normal map", "primvar", "texture"):
        if feature not in features:
            plan.absent[feature] = f"a material input that is connected to a {feature}"
    _note(plan, "transmission", transmission, "a warprender:Dielectric")
    _note(plan, "cut-out", cut_out, "an opacityThreshold above 0")
    _note(plan, "energy compensation", "asked for" if request.energy_compensation else "", "--energyCompensation")
    return tuple(sorted(features))


def _light_callers(lights: dict[str, Light]) -> dict[str, str]:
    callers: dict[str, str] = {}
    for path, light in lights.items():
        callers.setdefault(light.kind(), path)
    return callers


def _light_effects(plan: RenderPlan, lights: dict[str, Light]) -> tuple[str, ...]:
    callers: dict[str, str] = {}
    for path, light in lights.items():
        for effect in light.effects():
            callers.setdefault(effect, path)
    for effect, caller in LIGHT_EFFECTS.items():
        _note(plan, f"light {effect}", callers.get(effect, ""), caller)
    return tuple(sorted(callers))


def _primvar(scene: Scene, placement: Placement, key: str, name: str) -> Primvar | None:
    """A primvar of a placement's shape, if its material `key` is of the kind that reads it."""
    return placement.shape.primvars.get(name) if isinstance(scene.materials[key], DisplayColor) else None


def _straight_through(scene: Scene) -> str:
    """The first prim that lets rays straight through, or ""."""
    for path, placement in scene.placements.items():
        for key in materials_of(placement):
            if scene.materials[key].passes_light():
                return path
            opacity = _primvar(scene, placement, key, "displayOpacity")
            if opacity is not None and not (opacity.values >= 1.0).all():
                return path
    return ""


def _largest_albedo(scene: Scene, request: Request) -> float:
    """Upper bound on the reflected share of light over all surfaces; 1 where compensation may add to it."""
    albedo = 0.0
    for placement in scene.placements.values():
        for key in materials_of(placement):
            albedo = max(albedo, scene.materials[key].largest_albedo())
            colors = _primvar(scene, placement, key, "displayColor")
            if colors is not None and len(colors.values):
                albedo = max(albedo, float(np.nanmax(colors.values)))
    return 1.0 if request.energy_compensation and albedo > 0.0 else min(albedo, 1.0)


def _last_term(request: Request) -> int | None:
    """The highest term that is asked for, None where color with all of them is."""
    terms = terms_of(request.outputs)
    of_all = any(name == "color" or name in FILM_OUTPUTS for name in request.outputs)
    return terms[-1] if terms and not of_all else None


def _bound_bounces(plan: RenderPlan, scene: Scene, request: Request) -> None:
    """With largest albedo ρ, what d bounces leave out is at most ρ^(d+1) / (1 - ρ) of what is emitted.

    Single terms of color follow no bounce behind the last; -1 bounces are emission alone.
    """
    if plan.transport in ONE_SURFACE:
        plan.bounds = {"bounces": 0}
        return
    if plan.transport == "whitted":
        plan.bounds = {"bounces": WHITTED_BOUNCES if request.bounces is None else request.bounces}
        return
    albedo = _largest_albedo(scene, request)
    bounces = request.bounces
    if bounces is None:
        bounces = MOST_BOUNCES
        if albedo <= 0.0:
            bounces = 0
        elif albedo < 1.0:
            needed = math.log(BOUNCE_TOLERANCE * (1.0 - albedo)) / math.log(albedo) - 1.0
            bounces = int(min(MOST_BOUNCES, max(0, math.ceil(needed))))
    last = _last_term(request)
    if last is not None:
        # Term n is what n - 1 bounces bring; for term 0 nothing is scattered.
        bounces = min(bounces, last - 1)
    unfollowed = albedo ** (bounces + 1) / (1.0 - albedo) if albedo < 1.0 else math.inf
    plan.bounds = {"albedo": albedo, "bounces": bounces, "unfollowed": unfollowed}
