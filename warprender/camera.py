"""UsdGeomCamera: its window, and the rays through it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache

import numpy as np
import warp as wp

from .given import fault_of_fields, fault_of_matrix, plain_array, shown
from .records import CameraRecord, Ray
from .sampling import unit_disk
from .watched import Watched

#: What an image whose shape is not the aperture's does to the aperture (UsdRenderSettings).
CONFORM_POLICIES = (
    "expandAperture",
    "cropAperture",
    "adjustApertureWidth",
    "adjustApertureHeight",
    "adjustPixelAspectRatio",
)


@dataclass(frozen=True)
class DataWindow:
    """The pixels of a picture that are drawn (UsdRenderSettings `dataWindowNDC`); overscan lies outside of it.

    Attributes:
        x: column of the first drawn pixel, counted from the picture's left edge.
        y: row of it, counted from the top.
        width: drawn columns.
        height: drawn rows.
        full: (width, height) of the picture itself, its display window.
    """

    x: int
    y: int
    width: int
    height: int
    full: tuple[int, int]

    @classmethod
    def of(cls, full: tuple[int, int], ndc: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)) -> DataWindow:
        """The pixels whose centres lie in the rectangle `ndc`: left, bottom, right, top from the lower left corner."""
        left, bottom, right, top = ndc
        columns = [math.ceil(edge * full[0] - 0.5) for edge in (left, right)]
        rows = [math.ceil((1.0 - edge) * full[1] - 0.5) for edge in (top, bottom)]
        return cls(columns[0], rows[0], columns[1] - columns[0], rows[1] - rows[0], full)


@dataclass
class Camera(Watched):
    """UsdGeomCamera, names, units and defaults as in the schema; looks down local -Z, +Y up.

    Attributes:
        projection: "perspective" or "orthographic".
        focalLength: tenths of a scene unit, as are the apertures and their offsets; only their ratios matter for
            what a perspective camera sees. Horizontal angle of view: 2 atan(horizontalAperture / 2 focalLength).
        horizontalAperture: width of the window at the focal length; an orthographic window itself.
        verticalAperture: height of it. A picture of another shape widens one of the two (expandAperture).
        horizontalApertureOffset: shift of the window to the right.
        verticalApertureOffset: shift of the window upwards.
        clippingRange: (near, far) distances along -Z in scene units; what lies outside is not seen.
        clippingPlanes: (a, b, c, d) in camera space; what has a x + b y + c z + d < 0 is not seen.
        fStop: focal length over the lens's diameter, sets the depth of field; 0 is a pinhole.
        focusDistance: distance along -Z that is sharp, in scene units; 0 is a pinhole.
        exposureScale: multiplies the picture (`UsdGeomCamera.ComputeLinearExposureScale`).
        shutterOpen: when the shutter opens (`shutter:open`), in frames from the time of the scene.
        shutterClose: when it closes (`shutter:close`); what `Scene.motion` moves in between is blurred.
        transform: (4, 4) float64 camera-to-world matrix for row vectors; its scale does not matter.
    """

    projection: str = "perspective"
    focalLength: float = 50.0
    horizontalAperture: float = 20.955
    verticalAperture: float = 15.2908
    horizontalApertureOffset: float = 0.0
    verticalApertureOffset: float = 0.0
    clippingRange: tuple[float, float] = (1.0, 1.0e6)
    clippingPlanes: tuple[tuple[float, float, float, float], ...] = ()
    fStop: float = 0.0
    focusDistance: float = 0.0
    exposureScale: float = 1.0
    shutterOpen: float = 0.0
    shutterClose: float = 0.0
    transform: np.ndarray = field(default_factory=lambda: np.eye(4))

    def effects(self) -> tuple[str, ...]:
        """What the camera calls for, by name: its projection, "lens" for depth of field, "clippingPlanes"."""
        with_lens = self.projection == "perspective" and self.fStop > 0 and self.focusDistance > 0
        lens = ("lens",) if with_lens else ()
        return (self.projection, *lens, *(("clippingPlanes",) if self.clippingPlanes else ()))

    def wrong_field(self) -> str:
        """Which field is no number, or not as many as it should be, in a few words; "" where all are."""
        planes = _fault_of_planes(self.clippingPlanes)
        fault = fault_of_fields(self, unbounded=("clippingRange", "focusDistance"))
        return fault or fault_of_matrix("transform", self.transform) or planes

    def fault(self) -> str:
        """Why no picture can be taken with it, in a few words; "" for a good camera."""
        if self.projection not in ("perspective", "orthographic"):
            return f"projection {self.projection!r} is neither perspective nor orthographic"
        if fault := self.wrong_field():
            return fault
        near, far = self.clippingRange
        for name in ("focalLength", "horizontalAperture", "verticalAperture"):
            if not 0 < getattr(self, name) < np.inf:
                return f"{name} is {getattr(self, name)}; this camera sees nothing"
        if not (near < far) or (self.projection == "perspective" and near <= 0):
            return f"clippingRange ({near:g}, {far:g}) is empty or starts behind the camera"
        if not np.isfinite(self.transform).all() or np.linalg.matrix_rank(self.transform[:3, :3]) < 3:
            return "its transform is singular or not finite"
        return ""

    def window(self, aspect: float, policy: str = "expandAperture") -> tuple[float, float, float, float]:
        """Left, bottom, right, top of the image at distance 1, or in scene units when orthographic.

        Args:
            aspect: width × pixel aspect ratio / height of the image.
            policy: one of `CONFORM_POLICIES`.
        """
        width, height = self.horizontalAperture, self.verticalAperture
        wider = aspect > width / height
        adjust_width = {
            "expandAperture": wider,
            "cropAperture": not wider,
            "adjustApertureWidth": True,
            "adjustApertureHeight": False,
        }.get(policy)
        if adjust_width is True:
            width = height * aspect
        elif adjust_width is False:
            height = width / aspect
        scale = 0.1 if self.projection == "orthographic" else 1.0 / self.focalLength
        x, y = self.horizontalApertureOffset, self.verticalApertureOffset
        edges = (x - width / 2, y - height / 2, x + width / 2, y + height / 2)
        return tuple(scale * edge for edge in edges)

    def frame_of_reference(self) -> np.ndarray:
        """(3, 3) float64 with the world's unit right, up and backward vectors as columns; scale drops out."""
        right, up, backward = np.asarray(self.transform, np.float64)[:3, :3]
        backward = backward / np.linalg.norm(backward)
        right = right - backward * (right @ backward)
        right = right / np.linalg.norm(right)
        up = up - backward * (up @ backward) - right * (up @ right)
        return np.stack([right, up / np.linalg.norm(up), backward], 1)

    def record(
        self,
        width: int,
        height: int,
        origin: np.ndarray,
        pixel_aspect: float = 1.0,
        policy: str = "expandAperture",
        device: str = "cpu",
        data_window: DataWindow | None = None,
    ) -> CameraRecord:
        """The device's record, with positions relative to `origin` (3,) float64; of the data window's pixels alone."""
        record = CameraRecord()
        record.position = wp.vec3(*(np.asarray(self.transform, np.float64)[3, :3] - origin))
        record.rotation = wp.mat33(*self.frame_of_reference().reshape(-1))
        drawn = data_window or DataWindow.of((width, height))
        record.window = wp.vec4(*_part(self.window(width * pixel_aspect / height, policy), drawn))
        record.width, record.height = drawn.width, drawn.height
        record.near, record.far = self.clippingRange
        if "lens" in self.effects():
            record.lens_radius = 0.05 * self.focalLength / self.fStop
        # Focused on infinity: finite, so that the vector to the focus is, too.
        record.focus_distance = min(self.focusDistance, 1e30)
        record.orthographic = int(self.projection == "orthographic")
        record.origin = wp.vec3(*origin)
        record.planes = wp.array(self.clippingPlanes, dtype=wp.vec4, device=device) if self.clippingPlanes else None
        return record


def _fault_of_planes(planes: object) -> str:
    array = plain_array(planes)
    good = array.size == 0 or (array.dtype.kind in "fiu" and array.ndim == 2 and array.shape[1] == 4)
    return "" if good and array.dtype != object else f"clippingPlanes is {shown(planes)}, not rows of 4 numbers"


def _part(window: tuple[float, float, float, float], drawn: DataWindow) -> tuple[float, float, float, float]:
    """The part of a window (left, bottom, right, top) that the drawn pixels cover."""
    if (drawn.x, drawn.y, drawn.width, drawn.height) == (0, 0, *drawn.full):
        return window
    left, bottom, right, top = window
    across, down = (right - left) / drawn.full[0], (bottom - top) / drawn.full[1]
    columns, rows = (drawn.x, drawn.x + drawn.width), (drawn.y, drawn.y + drawn.height)
    return left + across * columns[0], top + down * rows[1], left + across * columns[1], top + down * rows[0]


@wp.func
def clip(seen: wp.vec2, plane: wp.vec4, origin: wp.vec3, towards: wp.vec3) -> wp.vec2:
    """The part of the interval of a ray that lies on the plane's visible side; empty, an end before its start."""
    normal = wp.vec3(plane[0], plane[1], plane[2])
    height = wp.dot(normal, origin) + plane[3]
    slope = wp.dot(normal, towards)
    if slope > 0.0:
        return wp.vec2(wp.max(seen[0], -height / slope), seen[1])
    if slope < 0.0:
        return wp.vec2(seen[0], wp.min(seen[1], -height / slope))
    return wp.where(height < 0.0, wp.vec2(seen[0], -1.0), seen)


@cache
def camera_ray_function(effects: tuple[str, ...]) -> wp.Function:
    """`camera_ray(camera, x, y, u) -> Ray` for raster position (x, y) in pixels and lens sample u.

    The ray starts on the near plane and ends on the far plane, or on the clipping planes where they are nearer; its
    direction has unit length.
    """
    orthographic, lens, planes = "orthographic" in effects, "lens" in effects, "clippingPlanes" in effects
    only_orthographic = int("perspective" not in effects)

    @wp.func
    def camera_ray(camera: CameraRecord, x: float, y: float, u: wp.vec2) -> Ray:
        window = camera.window
        px = window[0] + (window[2] - window[0]) * (x / wp.float32(camera.width))
        py = window[3] + (window[1] - window[3]) * (y / wp.float32(camera.height))
        origin = wp.vec3(0.0, 0.0, 0.0)
        towards = wp.vec3(px, py, -1.0)
        if wp.static(orthographic):
            if camera.orthographic + wp.static(only_orthographic) > 0:
                origin = wp.vec3(px, py, 0.0)
                towards = wp.vec3(0.0, 0.0, -1.0)
        if wp.static(lens):
            if camera.lens_radius > 0.0:
                place = unit_disk(u) * camera.lens_radius
                origin = wp.vec3(place[0], place[1], 0.0)
                towards = wp.vec3(px, py, -1.0) * camera.focus_distance - origin
        ray = Ray()
        # A unit step of the raw vector along -Z, so that the clipping planes are exact.
        towards = towards / -towards[2]
        length = wp.length(towards)
        seen = wp.vec2(camera.near, camera.far)
        if wp.static(planes):
            for i in range(camera.planes.shape[0]):
                seen = clip(seen, camera.planes[i], origin, towards)
        ray.origin = camera.position + camera.rotation * (origin + towards * seen[0])
        ray.direction = camera.rotation * (towards / length)
        ray.t_max = (seen[1] - seen[0]) * length
        return ray

    return camera_ray


@wp.func
def pixel_cone(camera: CameraRecord) -> wp.vec2:
    """Width of a pixel where its ray starts, in scene units, and its growth along the ray."""
    width = (camera.window[2] - camera.window[0]) / wp.float32(camera.width)
    height = (camera.window[3] - camera.window[1]) / wp.float32(camera.height)
    pixel = wp.sqrt(wp.abs(width * height))
    if camera.orthographic != 0:
        return wp.vec2(pixel, 0.0)
    return wp.vec2(pixel * camera.near, pixel)
