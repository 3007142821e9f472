"""Where to look from: usdrecord's rule for the camera, and its automatic framing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .camera import Camera, DataWindow
from .given import is_count, plain_array, shown
from .scene import Placement, Scene, SceneError
from .shapes import Mesh, Sdf

#: usdrecord's width of pictures.
DEFAULT_WIDTH = 960

#: Pixels are numbered by int32.
MOST_PIXELS = 2**31 - 1

#: Name of the camera that usdrecord takes when none is asked for.
MAIN_CAMERA = "main_cam"


def choose_camera(scene: Scene, name: str | None = None) -> Camera:
    """The camera to render with: `name`, else the render settings', else `main_cam`, else automatic framing.

    Args:
        scene: the scene.
        name: path or name of a camera prim.

    Raises:
        SceneError: there is no camera `name`, or the chosen one has no window to look through.
    """
    path = choose_camera_path(scene, name)
    if not path:
        return auto_camera(scene)
    camera = camera_at(scene, path)
    if fault := camera.fault():
        raise SceneError(f"{path}: {fault}")
    return camera


def choose_camera_path(scene: Scene, name: str | None = None) -> str:
    """Path of the camera that `choose_camera` takes, "" for automatic framing.

    Raises:
        SceneError: there is no camera `name`.
    """
    if not name:
        return scene.settings.camera or _find(scene, MAIN_CAMERA) or ""
    path = _find(scene, name)
    if path is None:
        known = ", ".join(scene.cameras) or "none"
        raise SceneError(f"camera {name}: there is no such camera; the scene has {known}")
    return path


def camera_at(scene: Scene, path: str) -> Camera:
    """The camera of this path, as the render settings have it."""
    camera = scene.cameras[path]
    return replace(camera, fStop=0.0) if scene.settings.disableDepthOfField else camera


def choose_resolution(scene: Scene, camera: Camera, width: int | None = None) -> tuple[int, int]:
    """(width, height) in pixels: `width` by the camera's aspect, else the settings', else 960 wide."""
    if width is None and scene.settings.resolution is not None:
        return scene.settings.resolution
    width = width or DEFAULT_WIDTH
    # As usdrecord: the quotient in 32 bits (960 by 16:9 is 540, not 539), cut to whole pixels.
    aspect = np.float32(camera.horizontalAperture / camera.verticalAperture)
    return width, max(1, int(np.float32(width) / aspect))


def checked_resolution(resolution: object) -> tuple[int, int]:
    """(width, height) as it was given.

    Raises:
        SceneError: it is no pair of whole numbers from 1 on.
    """
    pair = plain_array(resolution)
    if pair.shape != (2,) or not all(map(is_count, pair)):
        raise SceneError(f"resolution is {shown(resolution)}, not (width, height) in whole pixels")
    if min(pair) < 1:
        raise SceneError(f"resolution {pair[0]}x{pair[1]} has no pixels")
    return int(pair[0]), int(pair[1])


def choose_data_window(scene: Scene, resolution: tuple[int, int]) -> DataWindow:
    """The pixels to draw of a picture of (width, height): all, or what the settings' dataWindowNDC leaves.

    Raises:
        SceneError: the data window holds no pixel's centre, or more pixels than can be counted.
    """
    ndc = scene.settings.dataWindowNDC
    window = DataWindow.of(resolution, ndc)
    if min(window.width, window.height) < 1:
        size = f"{resolution[0]}x{resolution[1]}"
        raise SceneError(f"{scene.settings.path or 'dataWindowNDC'}: {ndc} of {size} pixels holds no pixel's centre")
    if window.width * window.height > MOST_PIXELS:
        raise SceneError(f"{scene.settings.path or 'dataWindowNDC'}: {ndc} is {window.width}x{window.height} pixels")
    return window


def auto_camera(scene: Scene) -> Camera:
    """A 50 mm camera that frames everything drawn: from +Z when Y is up, from -Y when Z is up."""
    bounds = scene.bounds if scene.bounds is not None else placement_bounds(scene)
    low, high = (np.zeros(3), np.zeros(3)) if bounds is None else np.asarray(bounds, np.float64)
    centre, size = (low + high) / 2, high - low
    camera = Camera()
    across, deep = (1, 2) if scene.up_axis == "Y" else (2, 1)
    radius = np.hypot(size[0], size[across]) / 2
    distance = radius / (camera.horizontalAperture / (2 * camera.focalLength)) + size[deep] / 2
    near, far = camera.clippingRange
    if distance < near:
        distance += near
    transform = np.eye(4)
    if scene.up_axis == "Y":
        transform[3, :3] = centre + np.array([0, 0, distance])
    else:
        transform[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
        transform[3, :3] = centre - np.array([0, distance, 0])
    # usdrecord keeps the far plane at 1e6 and loses what lies behind it; a picture of everything needs more.
    far = max(far, 2 * (distance + size[deep]))
    return replace(camera, clippingRange=(near, far), transform=transform)


def placement_bounds(scene: Scene) -> np.ndarray | None:
    """World box (2, 3) float64 of all placements, None of an empty scene."""
    boxes = [_bounds(p) for p in scene.placements.values() if len(p.transforms)]
    boxes = [box for box in boxes if box is not None]
    if not boxes:
        return None
    return np.stack([np.min([b[0] for b in boxes], 0), np.max([b[1] for b in boxes], 0)])


def _bounds(placement: Placement) -> np.ndarray | None:
    """World box of one placement: its object box, transformed by each copy's matrix (Arvo 1990)."""
    shape = placement.shape
    if isinstance(shape, Mesh):
        points = shape.host_points()
        used = points[np.unique(shape.triangles)]
        used = used[np.isfinite(used).all(1)]
        if not len(used):
            return None
        low, high = used.min(0).astype(np.float64), used.max(0).astype(np.float64)
    elif isinstance(shape, Sdf):
        low, high = shape.bounds
        if not np.isfinite(shape.bounds).all():
            return None
    else:
        if not 0 < shape.radius < np.inf:
            return None
        low, high = np.full(3, -shape.radius), np.full(3, shape.radius)
    matrices = placement.transforms[np.isfinite(placement.transforms).all((1, 2))]
    if not len(matrices):
        return None
    centre = (low + high) / 2 @ matrices[:, :3, :3] + matrices[:, 3, :3]
    reach = (high - low) / 2 @ np.abs(matrices[:, :3, :3])
    return np.stack([(centre - reach).min(0), (centre + reach).max(0)])


def _find(scene: Scene, name: str) -> str | None:
    """Path of the camera with this path or, first in namespace order, this name."""
    if name in scene.cameras:
        return name
    return next((path for path in scene.cameras if path.rsplit("/", 1)[-1] == name), None)
