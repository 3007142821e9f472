"""What has been uploaded of a scene's geometry, for the lights that come after it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .upload_shapes import Part
from .visibility.world_tree import WorldTree


@dataclass
class Placed:
    """What has been uploaded of the scene's geometry.

    Attributes:
        instances: the instance records; `light` is filled in here.
        parts: the shapes by geometry number.
        world: where the instances are.
        origin: (3,) world position that positions on the device are relative to.
    """

    instances: np.ndarray
    parts: list[Part]
    world: WorldTree
    origin: np.ndarray

    @cached_property
    def boxes(self) -> np.ndarray:
        """(instances, 2, 3) float64 boxes relative to the origin; NaN for what is not drawn."""
        return self.world.boxes()

    @cached_property
    def places(self) -> np.ndarray:
        """(instances,) rows of `Instance`."""
        return self.world.instances.numpy()

    def radius(self) -> float:
        """Half the diagonal of all that is drawn."""
        return scene_radius(self.boxes)


def scene_radius(boxes: np.ndarray) -> float:
    """Half the diagonal of what boxes (I, 2, 3) hold together, NaN ones left out; not below 1e-6."""
    if not np.isfinite(boxes).any():
        return 1e-6
    return max(float(np.linalg.norm(np.nanmax(boxes[:, 1], 0) - np.nanmin(boxes[:, 0], 0))) / 2, 1e-6)
