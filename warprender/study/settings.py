"""What a study varies: one knob at a time about the plan's own choice, and some together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ..plan import TRANSPORTS, RenderPlan
from ..renderer import SAMPLERS

#: Bounces that are tried, as far as they are below what the plan follows.
_BOUNCES = (0, 1, 2, 4, 8, 16)


@dataclass(frozen=True)
class Setting:
    """One way to render the picture.

    Attributes:
        knob: what is varied, and the name of its curve.
        value: its value, in words.
        samples: a pixel.
        options: arguments of `Renderer` that differ from the study's.
        denoise: whether Open Image Denoise goes over the picture.
    """

    knob: str
    value: str
    samples: int
    options: tuple[tuple[str, object], ...] = ()
    denoise: bool = False

    @property
    def name(self) -> str:
        """Unique in a study, and good in a file name."""
        return f"{self.knob} {self.value}, {self.samples} samples".replace("/", "-")


def ladder(most: int) -> list[int]:
    """Numbers of samples up to `most`, each four times the last: 4, 16, 64, …; 1 is left to `most` itself."""
    steps = []
    while most >= 4:
        steps.append(most)
        most //= 4
    return sorted(steps) or [most]


def sweep(plan: RenderPlan, most: int, denoiser: bool) -> list[Setting]:
    """All settings of a study, the most telling first: a study that is cut short has them.

    Args:
        plan: of the picture as the study's own options ask for it.
        most: samples a pixel at most.
        denoiser: whether denoising can be tried.
    """
    steps = ladder(most)
    found = [Setting("sampler", SAMPLERS[0], n, (("sampler", SAMPLERS[0]),)) for n in steps]
    found += [Setting("sampler", name, n, (("sampler", name),)) for name in SAMPLERS[1:] for n in steps]
    found += _transports(plan, steps)
    found += _bounces(plan, steps)
    if denoiser:
        found += [Setting("denoised", "yes", n, denoise=True) for n in steps]
    return found


def _transports(plan: RenderPlan, steps: Sequence[int]) -> Iterator[Setting]:
    for name in TRANSPORTS:
        if name not in ("none", plan.transport):
            yield from (Setting("transport", name, n, (("transport", name),)) for n in steps)


def _bounces(plan: RenderPlan, steps: Sequence[int]) -> Iterator[Setting]:
    followed = plan.bounds.get("bounces", 0)
    for bounces in _BOUNCES:
        if bounces < followed:
            yield from (Setting("bounces", str(bounces), n, (("bounces", bounces),)) for n in steps[-2:])
