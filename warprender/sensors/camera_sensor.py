"""Cameras: pinholes, distorted lenses, orthographic views."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import warp as wp

from ..given import is_count, is_number, shown
from ..lenses import distorted_rays, fisheye_rays, window_of_field, window_of_intrinsics
from ..outputs import FILM_OUTPUTS, output_names
from ..plan import Request
from ..records import CameraRecord
from ..scene import Scene, SceneError
from ..texels import TEXTURE_BYTES
from .sensor import Sensor

LENSES = ("pinhole", "opencv", "fisheye", "orthographic")


class CameraSensor(Sensor):
    """Cameras that look at a scene from any number of poses.

    Args:
        scene: what to look at. What is assigned to it, posed, or written into its points is seen by `update`.
        width: of a picture in pixels.
        height: likewise.
        fov: vertical field of view in degrees; of an orthographic camera the height of its window in scene units.
        intrinsics: (3, 3) matrix of fx, fy, cx and cy in pixels, in place of `fov`; see `warprender.lenses` for where
            pixel centres are.
        distortion: coefficients in OpenCV's order: k1, k2, p1, p2, k3 of the lens "opencv", k1 to k4 of "fisheye".
        lens: "pinhole", "opencv", "fisheye" or "orthographic".
        outputs: names as of `Renderer`, and "rgba8": color on the sRGB curve, (V, H, W, 4) uint8, alpha last.
        near: distance along -Z from which things are seen, along the ray where rays come from a table; scene units.
        far: likewise, to which.
        visibility: "rays", "raster" or "auto". Rays alone see what lenses but the pinhole do, and what takes more
            than one sample.
        transport: as of `Renderer`. "local" is for speed: one sample at the pixel's centre, lights without shadows,
            and a light at the camera where the scene has none. "direct" adds shadows, "path" is all light.
        samples: of colour a pixel.
        seed: of what is drawn at random.
        worlds: what belongs to which of many replicated worlds: a prim path for each world, which owns all that is
            at or under it, or (I,) ints, the world of each instance in drawing order, -1 for what all share. A view
            sees its world and what is shared.
        device: Warp device.
        threads: CPU threads, None for all cores.
        camera_light: as of `Renderer`.
        dome_light_visible: as of `Renderer`.
        lights_visible: as of `Renderer`.

    Attributes:
        plan: the `RenderPlan`.
        images: what `update` returned last.

    Raises:
        SceneError: an argument is not as described.
    """

    def __init__(
        self,
        scene: Scene,
        width: int,
        height: int,
        fov: float | None = None,
        intrinsics: np.ndarray | None = None,
        outputs: str | Sequence[str] = ("color",),
        visibility: str = "auto",
        transport: str = "local",
        device: str = "cpu",
        threads: int | None = None,
        *,
        distortion: Sequence[float] = (),
        lens: str = "pinhole",
        near: float = 0.01,
        far: float = 1.0e6,
        samples: int = 1,
        seed: int = 0,
        worlds: Sequence[str] | np.ndarray | None = None,
        camera_light: str = "auto",
        dome_light_visible: bool = False,
        lights_visible: bool = False,
    ) -> None:
        _check_sizes(width=width, height=height, samples=samples)
        if not (is_number(near) and is_number(far) and 0 < near < far < math.inf):
            given = f"{shown(near)} and {shown(far)}"
            raise SceneError(f"near and far must be positive, finite and in this order, not {given}")
        try:
            window, directions = _lens(lens, fov, intrinsics, distortion, width, height)
        except (TypeError, ValueError) as error:
            raise SceneError(f"sensor: {error}") from None
        asked = tuple(dict.fromkeys(output_names(outputs)))
        record = CameraRecord()
        record.width, record.height, record.near, record.far = width, height, near, far
        record.window, record.orthographic = wp.vec4(*window), int(lens == "orthographic")
        request = Request(
            _planned(asked),
            visibility,
            transport if {"color", "rgba8"} & set(asked) else "none",
            None,
            dome_light_visible,
            lights_visible,
            camera_light=camera_light,
            texture_bytes=TEXTURE_BYTES,
        )
        projection = "orthographic" if lens == "orthographic" else "perspective"
        super().__init__(scene, record, projection, directions, asked, request, worlds, device, threads, samples, seed)


def _planned(outputs: tuple[str, ...]) -> tuple[str, ...]:
    """The outputs as the plan knows them."""
    if unknown := [name for name in outputs if name in FILM_OUTPUTS]:
        raise SceneError(f"sensor: {unknown[0]} is an output of Renderer alone")
    return tuple(dict.fromkeys("color" if name == "rgba8" else name for name in outputs))


def _lens(
    lens: str, fov: float | None, intrinsics: np.ndarray | None, distortion: Sequence[float], width: int, height: int
) -> tuple[tuple[float, float, float, float], np.ndarray | None]:
    """Window and, where no window describes the lens, directions (H, W, 3)."""
    if lens not in LENSES:
        raise ValueError(f"lens {lens!r} is not one of {', '.join(LENSES)}")
    if (fov is None) == (intrinsics is None):
        raise ValueError("give fov or intrinsics, one of them")
    if len(distortion) and lens in ("pinhole", "orthographic"):
        raise ValueError(f"distortion: the lens is {lens!r}; say lens='opencv' or 'fisheye'")
    if lens == "orthographic":
        if fov is None or not 0 < fov < math.inf:
            raise ValueError("an orthographic camera has the height of its window in fov")
        return (-fov * width / height / 2, -fov / 2, fov * width / height / 2, fov / 2), None
    if lens == "pinhole":
        window = window_of_intrinsics(intrinsics, width, height) if fov is None else None
        return window or window_of_field(fov, width, height), None
    if intrinsics is None:
        raise ValueError(f"the lens {lens!r} has intrinsics")
    rays = distorted_rays if lens == "opencv" else fisheye_rays
    return window_of_intrinsics(intrinsics, width, height), rays(intrinsics, distortion, width, height)


def _check_sizes(**sizes: int) -> None:
    for name, size in sizes.items():
        if not is_count(size, least=1):
            raise SceneError(f"{name} must be a whole number from 1 on, not {shown(size)}")
