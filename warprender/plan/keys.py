"""What kernels are compiled for: frozen values of names, by which their factories are cached."""

from __future__ import annotations

from dataclasses import dataclass, fields

import warp as wp

from ..lights.dispatch import FUNCTIONS
from ..materials import MATERIALS
from ..materials.inputs import FEATURES
from ..shapes import SHAPES

#: What lights may need compiled beyond their kinds, and what would call for it.
LIGHT_EFFECTS = {
    "ies": "shaping:ies:file",
    "linking": "a lightLink collection that leaves prims out",
    "shadows": "ShadowAPI, or a shadowLink collection that leaves prims out",
    "shaping": "shaping:focus, or a shaping:cone:angle that cuts something off",
}


@dataclass(frozen=True)
class PathKey:
    """What the kernel of a transport of colour is compiled for.

    Attributes:
        shapes: names of the classes of `SHAPES` that occur, sorted as all names here; meshes and spheres always.
        materials: of `MATERIALS`.
        lights: kinds of lights that emit, as `Light.kind` answers.
        light_effects: of `LIGHT_EFFECTS`.
        camera: as `Camera.effects` answers.
        sampled_lights: whether there are lights to aim at, with shadow rays.
        straight_through: whether something lets rays go straight through; without it any hit ends a shadow ray.
        features: of `materials.inputs.FEATURES`.
        sdfs: the signed distance functions, in the order of their numbers.
        terms: whether single terms of color are kept.
        ray_accuracy: how rays meet triangles, of `RAY_ACCURACIES`.
    """

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
    """What the AOV kernel is compiled for; `outputs` are their names, the rest is as in `PathKey`.

    Materials and their features are named where an output, or what lies behind something clear, needs them.
    """

    shapes: tuple[str, ...]
    materials: tuple[str, ...]
    camera: tuple[str, ...]
    outputs: tuple[str, ...]
    straight_through: bool
    features: tuple[str, ...] = ()
    sdfs: tuple[wp.Function, ...] = ()


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
