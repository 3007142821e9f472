"""What a material tells the host: its numbers, what varies, and bounds for the plan."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ..given import fault_of_fields
from ..watched import Watched
from .inputs import NORMAL, Varying, constant

_PLAIN_NORMAL = (0.0, 0.0, 1.0)

#: Ways in which surfaces scatter light, and what calls for them. "mirror" and "refraction" are perfect.
LOBES = {
    "clearcoat": "a clearcoat above 0",
    "diffuse": "a diffuseColor or displayColor that is not black",
    "glossy": "a specular lobe of a roughness above 0",
    "measured": "a warprender:MeasuredBRDF",
    "mirror": "a specular lobe of roughness 0",
    "refraction": "a warprender:Dielectric of roughness 0",
    "rough refraction": "a warprender:Dielectric of a roughness above 0",
}


class BaseMaterial(Watched):
    """What every kind of material answers; by default as an opaque one that emits nothing.

    Attributes:
        inputs: names of the fields that kernels read, in the order of their numbers. `normal` has the number of all
            kinds that have one.
    """

    inputs: ClassVar[tuple[str, ...]] = ()

    def pack(self) -> np.ndarray:
        """Values by input number: (n, 3) float32, zeros where the input varies."""
        return np.array([constant(getattr(self, name)) for name in self.inputs], np.float32)

    def varying(self) -> dict[int, tuple[str, Varying | tuple]]:
        """Input number to name and source of what varies over the surface, a normal that is not the plain one too."""
        numbered = {number: (name, getattr(self, name)) for number, name in enumerate(self.inputs)}
        found = {number: named for number, named in numbered.items() if isinstance(named[1], Varying)}
        normal = getattr(self, "normal", _PLAIN_NORMAL)
        if isinstance(normal, Varying) or tuple(normal) != _PLAIN_NORMAL:
            found[NORMAL] = "normal", normal
        return found

    def fault(self) -> str:
        """What is wrong with its fields, in a few words; "" for a good material."""
        return fault_of_fields(self, varying=Varying)

    def passes_light(self) -> bool:
        """Whether rays may go straight through; what does not stops shadow rays."""
        return False

    def is_cut_out(self) -> bool:
        """Whether it is either there or not, by a threshold."""
        return False

    def lobes(self) -> tuple[str, ...]:
        """Those of `LOBES` by which it may scatter light; both of two where a texture decides. By default all."""
        return tuple(LOBES)

    def largest_emission(self) -> float:
        """Upper bound on the luminance that is emitted; 1 where it varies."""
        return 0.0

    def largest_albedo(self) -> float:
        """Upper bound on the share of light that is reflected or refracted, any direction and channel."""
        return 1.0
