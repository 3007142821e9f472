"""Lidars: rays by azimuth and elevation."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import warp as wp

from ..lenses import lidar_rays
from ..outputs import OUTPUTS, output_names
from ..plan import Request
from ..records import CameraRecord
from ..scene import Scene, SceneError
from ..texels import TEXTURE_BYTES
from .sensor import Sensor


class LidarSensor(Sensor):
    """A lidar: one ray for each pair of an elevation and an azimuth, from any number of poses.

    `update` returns `distance` along the ray in scene units, 0 where nothing is in range, `normal` in the world,
    `primId` and `instanceId`, arrays (V, E, A).

    Args:
        scene: as of `CameraSensor`, as are `worlds`, `device` and `threads`.
        azimuths: (A,) degrees; 0 looks down the sensor's -Z, and they grow to the left, about its +Y.
        elevations: (E,) degrees from the sensor's XZ plane towards +Y.
        range: least and largest distance, in scene units.
        outputs: any outputs of `CameraSensor` but colour.

    Raises:
        SceneError: an argument is not as described.
    """

    def __init__(
        self,
        scene: Scene,
        azimuths: np.ndarray | Sequence[float],
        elevations: np.ndarray | Sequence[float],
        range: tuple[float, float] = (0.1, 100.0),
        outputs: str | Sequence[str] = ("distance", "normal", "primId", "instanceId"),
        device: str = "cpu",
        threads: int | None = None,
        *,
        worlds: Sequence[str] | np.ndarray | None = None,
    ) -> None:
        try:
            directions = lidar_rays(azimuths, elevations)
            near, far = (float(end) for end in range)
        except (TypeError, ValueError) as error:
            raise SceneError(f"lidar: {error}") from None
        if not 0 <= near < far < math.inf:
            raise SceneError(f"lidar: range must be finite, from 0 on and in this order, not ({near}, {far})")
        asked = tuple(dict.fromkeys(output_names(outputs)))
        if colors := [name for name in asked if name not in OUTPUTS]:
            raise SceneError(f"lidar: there is no output {colors[0]!r}")
        record = CameraRecord()
        record.height, record.width = directions.shape[:2]
        record.near, record.far = near, far
        record.window = wp.vec4(*_mean_window(directions))
        request = Request(asked, "rays", "none", texture_bytes=TEXTURE_BYTES)
        super().__init__(scene, record, "perspective", directions, asked, request, worlds, device, threads, 1, 0)


def _mean_window(directions: np.ndarray) -> tuple[float, float, float, float]:
    """A window whose pixels are as wide as neighbouring rays (E, A, 3) of a table lie apart on average."""
    height, width = directions.shape[:2]
    steps = [np.linalg.norm(np.diff(directions, axis=k), axis=-1) for k in range(2)]
    down, across = (float(step.mean()) if step.size else 0.0 for step in steps)
    half = 0.5 * width * (across or down), 0.5 * height * (down or across)
    return (-half[0], -half[1], half[0], half[1])
