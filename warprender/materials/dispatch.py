"""From a material's kind to its functions, for the kinds that a plan names.

Chains of closures, not tables: inside a `wp.func`, `wp.static(table[i])` on a loop variable does not reach the
module's hash, and another plan's binary would run silently.
"""

from __future__ import annotations

from functools import cache

import warp as wp

from ..records import Bsdf, BsdfSample, BsdfValue, DeviceScene, Surface
from . import MATERIALS, dielectric, display_color, measured_brdf, phong, preview_surface

#: Module of each kind in `MATERIALS`, with its `prepare_function`, `evaluate` and `sample`.
MODULES = (display_color, preview_surface, measured_brdf, dielectric, phong)


def kind_of(name: str) -> int:
    """Id of the material kind with this class name."""
    return [m.__name__ for m in MATERIALS].index(name)


@cache
def material_functions(
    names: tuple[str, ...], features: tuple[str, ...] = ()
) -> tuple[wp.Function, wp.Function, wp.Function]:
    """`prepare(scene, surface)`, `evaluate(scene, bsdf, wo, wi)` and `sample(scene, bsdf, wo, u, lobe)`.

    Args:
        names: class names of the kinds that occur.
        features: what of `inputs.FEATURES` occurs, sorted.
    """
    kinds = [kind_of(name) for name in names] or [0]
    first, *others = kinds
    prepare, evaluate, sample = _last(first, features)
    for kind in others:
        prepare, evaluate, sample = _link(kind, features, prepare, evaluate, sample)
    return prepare, evaluate, sample


def _last(kind: int, features: tuple[str, ...]) -> tuple[wp.Function, wp.Function, wp.Function]:
    module = MODULES[kind]
    prepare_kind = module.prepare_function(features)

    @wp.func
    def prepare(scene: DeviceScene, surface: Surface) -> Bsdf:
        bsdf = prepare_kind(scene, surface)
        bsdf.kind = wp.static(kind)
        return bsdf

    return prepare, module.evaluate, module.sample


def _link(
    kind: int,
    features: tuple[str, ...],
    rest_prepare: wp.Function,
    rest_evaluate: wp.Function,
    rest_sample: wp.Function,
) -> tuple[wp.Function, wp.Function, wp.Function]:
    this_prepare, this_evaluate, this_sample = _last(kind, features)

    @wp.func
    def prepare(scene: DeviceScene, surface: Surface) -> Bsdf:
        if scene.materials[surface.material].kind == wp.static(kind):
            return this_prepare(scene, surface)
        return rest_prepare(scene, surface)

    @wp.func
    def evaluate(scene: DeviceScene, bsdf: Bsdf, wo: wp.vec3, wi: wp.vec3) -> BsdfValue:
        if bsdf.kind == wp.static(kind):
            return this_evaluate(scene, bsdf, wo, wi)
        return rest_evaluate(scene, bsdf, wo, wi)

    @wp.func
    def sample(scene: DeviceScene, bsdf: Bsdf, wo: wp.vec3, u: wp.vec2, lobe: float) -> BsdfSample:
        if bsdf.kind == wp.static(kind):
            return this_sample(scene, bsdf, wo, u, lobe)
        return rest_sample(scene, bsdf, wo, u, lobe)

    return prepare, evaluate, sample
