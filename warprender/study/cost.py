"""What each effect of a plan costs: the picture timed with it and without it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from statistics import median, quantiles

from ..camera import Camera
from ..materials import DisplayColor
from ..plan import LIGHT_EFFECTS, RenderPlan
from ..renderer import Renderer
from ..scene import Scene

#: Seconds that one timed render should take, and how often each is timed.
_RENDER_SECONDS, _ROUNDS = 0.15, 5
_MOST_SAMPLES = 256


@dataclass
class Variant:
    """The picture without one effect.

    Attributes:
        effect: as the plan names it.
        how: what was taken away, in words.
        scene: the changed scene.
        camera: the changed camera.
        options: arguments of `Renderer` that change.
        key: fields of the plan's `PathKey` that change.
    """

    effect: str
    how: str
    scene: Scene
    camera: Camera
    options: dict[str, object] = field(default_factory=dict)
    key: dict[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Cost:
    """Seconds of rendering with everything (median) and without one effect (median of the ratio, times that).

    On the CPU they are those of the processor, all threads together: other work disturbs them least. Rounds of all
    variants take turns, so that the ratio stands when the machine slows down. `spread` is half the
    distance of the ratio's quartiles.
    """

    effect: str
    how: str
    seconds: float
    without: float
    spread: float = 0.0

    @property
    def share(self) -> float:
        """Of the time, what the effect takes; below 0 where its absence costs."""
        return 1.0 - self.without / self.seconds


#: Makes a renderer of a scene, seen by a camera, with some of `Renderer`'s arguments changed.
Build = Callable[..., Renderer]


def measure_costs(scene: Scene, base: Renderer, build: Build, progress: Callable[[float, str], None]) -> list[Cost]:
    """Time the picture without each effect that can be taken away; the dearest first.

    Args:
        scene: what `base` draws.
        base: renderer with every effect of its plan.
        build: `build(scene, camera, options)`.
        progress: told of each variant.
    """
    variants = list(without_each(scene, base))
    renderers = []
    for number, variant in enumerate(variants):
        progress(number / len(variants), f"compiling without {variant.effect}")
        renderer = build(variant.scene, variant.camera, variant.options)
        if variant.key and renderer.plan.path is not None:
            renderer.plan.path = replace(renderer.plan.path, **variant.key)
        renderer.render(samples=1)
        renderers.append(renderer)
    samples = _samples(base)
    times: list[list[float]] = [[] for _ in range(len(renderers) + 1)]
    for number in range(_ROUNDS):
        progress(number / _ROUNDS, "timing")
        for taken, renderer in zip(times, (base, *renderers), strict=True):
            taken.append(_seconds(renderer, samples))
    found = [_cost(variant, times[0], taken) for variant, taken in zip(variants, times[1:], strict=True)]
    return sorted(found, key=lambda cost: cost.without)


def _cost(variant: Variant, base: Sequence[float], without: Sequence[float]) -> Cost:
    ratios = [b / a for a, b in zip(base, without, strict=True)]
    low, middle, high = quantiles(ratios, n=4)
    return Cost(variant.effect, variant.how, median(base), median(base) * middle, (high - low) / 2)


def without_each(scene: Scene, base: Renderer) -> Iterator[Variant]:
    """A variant for each effect of the plan that can be taken away; what is all that is drawn cannot."""
    plan, camera = base.plan, base.camera
    for effect in plan.reasons:
        family, _, name = effect.partition(" ")
        if family == "shape":
            yield from _without_shape(effect, name, scene, camera)
        elif family == "light" and name in LIGHT_EFFECTS:
            kept = tuple(e for e in plan.path.light_effects if e != name) if plan.path else ()
            yield Variant(effect, "lights without it", scene, camera, key={"light_effects": kept})
        elif family == "light":
            yield from _without_light(effect, name, scene, camera)
        elif family == "material" and name != "DisplayColor":
            materials = {p: DisplayColor() if type(m).__name__ == name else m for p, m in scene.materials.items()}
            yield Variant(effect, "its prims in displayColor", replace(scene, materials=materials), camera)
        elif family in ("texture", "primvar"):
            yield _without_input(effect, name, scene, camera)
        elif effect in ("straight through", "cut-out"):
            yield from _opaque(effect, scene, camera)
        else:
            yield from _without_other(effect, plan, scene, camera)
    yield from _without_outputs(plan, base, scene, camera)
    if plan.bounds.get("bounces", 0) > 0:
        yield Variant("bounces", "light straight from the lights alone", scene, camera, {"bounces": 0})


def _without_shape(effect: str, name: str, scene: Scene, camera: Camera) -> Iterator[Variant]:
    kept = {path: p for path, p in scene.placements.items() if type(p.shape).__name__ != name}
    if kept:
        yield Variant(effect, "its prims not drawn", replace(scene, placements=kept), camera)


def _without_light(effect: str, name: str, scene: Scene, camera: Camera) -> Iterator[Variant]:
    kept = {path: light for path, light in scene.lights.items() if light.kind() != name}
    if kept and len(kept) < len(scene.lights):
        yield Variant(effect, "its lights left out", replace(scene, lights=kept), camera)


def _without_input(effect: str, name: str, scene: Scene, camera: Camera) -> Variant:
    """The input as its default constant in every material in which it varies."""
    materials = dict(scene.materials)
    for path, material in scene.materials.items():
        if any(varying == name for varying, _ in material.varying().values()):
            default = next(f for f in fields(material) if f.name == name)
            constant = default.default_factory() if callable(default.default_factory) else default.default
            materials[path] = replace(material, **{name: constant})
    return Variant(effect, "the default constant instead", replace(scene, materials=materials), camera)


def _opaque(effect: str, scene: Scene, camera: Camera) -> Iterator[Variant]:
    change = {"opacity": 1.0} if effect == "straight through" else {"opacityThreshold": 0.0}
    names = {path: {f.name for f in fields(material)} for path, material in scene.materials.items()}
    materials = {p: replace(m, **change) if names[p] >= set(change) else m for p, m in scene.materials.items()}
    if effect == "cut-out":
        yield Variant(effect, "opacityThreshold 0", replace(scene, materials=materials), camera)
        return
    placements = {}
    for path, placement in scene.placements.items():
        kept = {name: v for name, v in placement.shape.primvars.items() if name != "displayOpacity"}
        placements[path] = replace(placement, shape=replace(placement.shape, primvars=kept))
    yield Variant(effect, "everything opaque", replace(scene, materials=materials, placements=placements), camera)


def _without_other(effect: str, plan: RenderPlan, scene: Scene, camera: Camera) -> Iterator[Variant]:
    if effect == "depth of field":
        yield Variant(effect, "fStop 0", scene, replace(camera, fStop=0.0))
    elif effect == "clipping planes":
        yield Variant(effect, "no clippingPlanes", scene, replace(camera, clippingPlanes=()))
    elif effect == "shadow rays" and plan.path is not None:
        yield Variant(effect, "lights met by chance alone", scene, camera, key={"sampled_lights": False})
    elif effect == "energy compensation":
        yield Variant(effect, "without", scene, camera, {"energy_compensation": False})
    elif effect == "fast rays":
        yield Variant(effect, "watertight ones", scene, camera, {"ray_accuracy": "watertight"})
    elif effect == "denoising":
        yield Variant(effect, "without", scene, camera, {"denoise": False})


def _without_outputs(plan: RenderPlan, base: Renderer, scene: Scene, camera: Camera) -> Iterator[Variant]:
    asked = base.request.outputs
    for name in asked if len(asked) > 1 else ():
        # Denoising goes with the colour that it is of.
        options = {"outputs": tuple(o for o in asked if o != name), **({"denoise": False} if name == "color" else {})}
        yield Variant(f"output {name}", "not asked for", scene, camera, options)


def _samples(renderer: Renderer) -> int:
    """Samples for which a render is long enough to be timed."""
    renderer.render(samples=1)
    return max(1, min(_MOST_SAMPLES, round(_RENDER_SECONDS / max(_seconds(renderer, 1), 1e-6))))


def _seconds(renderer: Renderer, samples: int) -> float:
    start = time.process_time()
    taken: dict[str, float] = renderer.render(samples=samples).stats["seconds"]
    if renderer.device == "cpu":
        return time.process_time() - start
    return sum(taken.get(stage, 0.0) for stage in ("outputs", "sample", "denoise"))


def table(costs: Sequence[Cost]) -> str:
    """Lines for people."""
    if not costs:
        return "no effect can be taken away"
    width = max(len(cost.effect) for cost in costs)
    lines = [
        f"cost: {costs[0].seconds:.3g} s with everything, by the processor on the CPU; without one effect",
    ]
    for cost in costs:
        change = f"{-100 * cost.share:+6.1f} ± {100 * cost.spread:.1f} %"
        lines.append(f"  {cost.effect:{width}}  {cost.without:8.3g} s  {change}  ({cost.how})")
    if len(costs) > 1:
        lines.append("  effects share work: what each takes need not add up")
    return "\n".join(lines)
