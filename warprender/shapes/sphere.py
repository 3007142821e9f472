"""UsdGeomSphere: an exact quadric about the origin of its object space."""

from __future__ import annotations

from dataclasses import dataclass, field

from .primvar import Primvar


@dataclass
class Sphere:
    """A sphere about the origin of object space.

    Attributes:
        radius: in scene units; 0 and below draw nothing.
        primvars: name to `Primvar`; only the first value is used, a quadric has no faces or points.
    """

    radius: float = 1.0
    primvars: dict[str, Primvar] = field(default_factory=dict)
