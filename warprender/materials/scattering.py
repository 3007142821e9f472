"""What sampling of a material answers once it has chosen a direction."""

from __future__ import annotations

import warp as wp

from ..records import EVENT_SCATTER, BsdfSample, BsdfValue


@wp.func
def scattered(direction: wp.vec3, value: BsdfValue, stay: float) -> BsdfSample:
    """The sample for a direction with the value and density of all lobes there; absorbed where none gives it."""
    result = BsdfSample()
    result.stay = stay
    if value.pdf > 0.0:
        result.event = EVENT_SCATTER
        result.direction = direction
        result.diffuse = value.diffuse / value.pdf
        result.specular = value.specular / value.pdf
        result.pdf = value.pdf
    return result
