"""What a study varies: one knob at a time about the plan's own choice, and some together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ..plan import LIGHT_SAMPLINGS, ONE_SURFACE, SAMPLERS, TRANSPORTS, RenderPlan

#: Bounces that are tried, as far as they are below what the plan follows.
_BOUNCES = (0, 1, 2, 4, 8, 16)
#: Relative errors that are asked for.
_TARGETS = (0.2, 0.1, 0.05, 0.02)
#: The knob of settings that stop at an error, and that of settings that turn several at once.
ASKED, TOGETHER = "asked error", "together"


@dataclass(frozen=True)
class Setting:
    """One way to render the picture.

    Attributes:
        knob: what is varied, and the name of its curve.
        value: its value, in words.
        samples: a pixel; with an `error`, the most.
        options: arguments of `Renderer` that differ from the study's, and "complexity" of the stage.
        error: relative error at which to stop, or None.
    """

    knob: str
    value: str
    samples: int
    options: tuple[tuple[str, object], ...] = ()
    error: float | None = None

    @property
    def name(self) -> str:
        """Unique in a study, and good in a file name."""
        most = "" if self.error is None else "at most "
        return f"{self.knob} {self.value}, {most}{self.samples} samples".replace("/", "-")


def ladder(most: int) -> list[int]:
    """Numbers of samples up to `most`, each four times the last: 4, 16, 64, …; 1 is left to `most` itself."""
    steps = []
    while most >= 4:
        steps.append(most)
        most //= 4
    return sorted(steps) or [most]


def sweep(plan: RenderPlan, most: int, denoiser: bool, levels: Sequence[str] = ()) -> list[Setting]:
    """All settings of a study, the most telling first: a study that is cut short has them.

    Args:
        plan: of the picture as the study's own options ask for it.
        most: samples a pixel at most.
        denoiser: whether denoising can be tried.
        levels: values of --complexity that change the stage.
    """
    steps = ladder(most)
    found = [Setting("sampler", name, n, (("sampler", name),)) for name in SAMPLERS for n in steps]
    for knob, value, options in _knobs(plan, denoiser, levels):
        found += [Setting(knob, value, n, options) for n in steps]
    found += [Setting(ASKED, f"{error:g}", 4 * most, error=error) for error in _TARGETS]
    found += [Setting(TOGETHER, value, n, options) for value, options in _together(plan, denoiser) for n in steps]
    return found


def _knobs(
    plan: RenderPlan, denoiser: bool, levels: Sequence[str]
) -> Iterator[tuple[str, str, tuple[tuple[str, object], ...]]]:
    """Knob, value and options of every curve with one knob turned."""
    for name in TRANSPORTS:
        if name not in ("none", plan.transport):
            # Those that follow no bounce refuse a number of them.
            yield "transport", name, (("transport", name), *((("bounces", None),) if name in ONE_SURFACE else ()))
    for bounces in _tried_bounces(plan):
        yield "bounces", str(bounces), (("bounces", bounces),)
    if denoiser:
        yield "denoised", "yes", (("denoise", True),)
    if plan.transport == "path":
        yield "adaptive", "yes", (("adaptive", True),)
        if any(name.startswith("light ") or name == "shadow rays" for name in plan.reasons):
            for name in LIGHT_SAMPLINGS[1:]:
                yield "light sampling", name, (("light_sampling", name),)
    if any(name.startswith("texture ") for name in plan.reasons):
        yield "texture filter", "off", (("filter_textures", False),)
    if plan.color_visibility == "rays" and "shape Mesh" in plan.reasons:
        yield "rays", "fast", (("ray_accuracy", "fast"),)
    for name in ("rays", "raster", "painter"):
        if name != plan.color_visibility and plan.transport != "path":
            yield "visibility", name, (("visibility", name),)
    for level in levels:
        yield "complexity", level, (("complexity", level),)


def _together(plan: RenderPlan, denoiser: bool) -> Iterator[tuple[str, tuple[tuple[str, object], ...]]]:
    """Value and options of every curve with several knobs turned: bounces by sampler, and both denoised."""
    for bounces in _tried_bounces(plan):
        for sampler in SAMPLERS[1:]:
            yield f"bounces {bounces}, {sampler}", (("bounces", bounces), ("sampler", sampler))
        if denoiser:
            yield f"bounces {bounces}, denoised", (("bounces", bounces), ("denoise", True))


def _tried_bounces(plan: RenderPlan) -> list[int]:
    return [bounces for bounces in _BOUNCES if bounces < plan.bounds.get("bounces", 0)]
