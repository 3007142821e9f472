"""From a light's kind to its functions, for the kinds that a plan names. Closure chains, as for materials."""

from __future__ import annotations

from functools import cache

import warp as wp

from ..records import LightRecord, LightSample
from . import LIGHTS, camera, disk, distant, dome, rect, sphere

#: Module of each kind in `LIGHTS`, with its `sample` and `meet`.
MODULES = (sphere, rect, disk, distant, dome, camera)


def kind_of(name: str) -> int:
    """Id of the light kind with this class name."""
    return [kind.__name__ for kind in LIGHTS].index(name)


@cache
def light_functions(names: tuple[str, ...]) -> tuple[wp.Function, wp.Function]:
    """`sample(light, p, u)` and `meet(light, origin, direction)` over these kinds."""
    first, *others = [kind_of(name) for name in names] or [kind_of("DomeLight")]
    sample, meet = MODULES[first].sample, MODULES[first].meet
    for kind in others:
        sample, meet = _link(kind, sample, meet)
    return sample, meet


def _link(kind: int, rest_sample: wp.Function, rest_meet: wp.Function) -> tuple[wp.Function, wp.Function]:
    this_sample, this_meet = MODULES[kind].sample, MODULES[kind].meet

    @wp.func
    def sample(light: LightRecord, p: wp.vec3, u: wp.vec2) -> LightSample:
        if light.kind == wp.static(kind):
            return this_sample(light, p, u)
        return rest_sample(light, p, u)

    @wp.func
    def meet(light: LightRecord, origin: wp.vec3, direction: wp.vec3) -> LightSample:
        if light.kind == wp.static(kind):
            return this_meet(light, origin, direction)
        return rest_meet(light, origin, direction)

    return sample, meet
