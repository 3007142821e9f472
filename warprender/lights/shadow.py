"""UsdLux ShadowAPI: how much of its shadows a light shows."""

from __future__ import annotations

from dataclasses import dataclass

import warp as wp

from ..records import LightRecord
from ..watched import Watched


@dataclass
class Shadow(Watched):
    """Controls over shadows that no real light has.

    Attributes:
        enable: False lets the light through everything.
        color: what arrives in full shadow, as a share of the light.
        distance: from the receiver, in scene units, up to which things cast shadows; below 0 is no limit.
        falloff: the last part of `distance`, over which shadows fade to none; 0 and below is none.
        falloffGamma: exponent of that fading.
    """

    enable: bool = True
    color: tuple[float, float, float] = (0.0, 0.0, 0.0)
    distance: float = -1.0
    falloff: float = -1.0
    falloffGamma: float = 1.0

    def is_plain(self) -> bool:
        """Whether shadows are as light makes them."""
        return self.enable and not any(self.color) and self.distance < 0


@wp.func
def shadow_strength(light: LightRecord, t: float) -> float:
    """How much of its shadow something at distance t from the receiver casts, 0 to 1."""
    if light.shadow_distance < 0.0:
        return 1.0
    if t >= light.shadow_distance:
        return 0.0
    falloff = wp.min(light.shadow_falloff, light.shadow_distance)
    left = light.shadow_distance - t
    if falloff <= 0.0 or left >= falloff:
        return 1.0
    return wp.pow(left / falloff, light.shadow_gamma)
