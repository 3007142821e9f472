"""What a prim looks like that no material is bound to: Lambert reflection of its displayColor."""

from __future__ import annotations
from dataclasses import dataclass


@dataclass
class DisplayColor:
    """Lambert reflection of `primvars:displayColor`, present to the degree `primvars:displayOpacity`.

    Attributes:
        color: linear Rec.709 where the prim has no displayColor.
        opacity: where the prim has no displayOpacity.
    """

    color: tuple[float, float, float] = (0.18, 0.18, 0.18)
    opacity: float = 1.0
