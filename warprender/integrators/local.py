"""Transport "local": the local reflection model, I = Σ_L ρ(v, l) L over all lights, with nothing in their way.

What a graphics pipeline without shadow maps draws: the first surface by its emission and its reflection of each light.
"""

from __future__ import annotations

from functools import cache

import warp as wp

from ..plan import PathKey
from .direct import first_surfaces_function


@cache
def radiance_function(key: PathKey) -> wp.Function:
    """`radiance(…)` of `samples`, without secondary rays."""
    return first_surfaces_function(key, False)
