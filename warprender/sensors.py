"""Cameras and lidars of a simulation: many views of a scene in one launch, read where they were written.

A step writes points and poses on the device, then `update` follows what has moved and draws all views; nothing passes
through the host. Pictures are arrays (V, H, W[, C]) that the next `update` writes over.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import warp as wp

from .bodies import pose_array
from .camera import Camera
from .given import is_count, is_number, shown
from .integrators import RADIANCE
from .integrators.samples import PathRequest
from .integrators.views import ViewKey, ViewRequest, views_kernel
from .launch import RecordedLaunch, launch, thread_count
from .lenses import distorted_rays, fisheye_rays, lidar_rays, window_of_field, window_of_intrinsics
from .live import SharedScene
from .outputs import FILM_OUTPUTS, OUTPUTS, OutputBuffers, output_names
from .plan import LIGHT_BY_LIGHT, Request, analyse
from .records import CameraRecord
from .renderer import use_camera_light
from .scene import Scene, SceneError
from .texels import TEXTURE_BYTES
from .visibility.view_raster import ViewRaster

LENSES = ("pinhole", "opencv", "fisheye", "orthographic")


class Images(SimpleNamespace):
    """What a sensor sees: an array (V, H, W[, C]) for each output, by its name.

    Attributes:
        prims: the prim path of each `primId`.
        labels: the label of each `semantic` id.
    """

    def numpy(self, name: str) -> np.ndarray:
        """An output on the host; on the CPU the memory itself, which the next update writes over."""
        return getattr(self, name).numpy()


class Sensor:
    """What cameras and lidars share. Use `CameraSensor` or `LidarSensor`."""

    def __init__(
        self,
        scene: Scene,
        lens: CameraRecord,
        projection: str,
        directions: np.ndarray | None,
        request: Request,
        worlds: Sequence[str] | np.ndarray | None,
        device: str,
        threads: int | None,
        samples: int,
        seed: int,
    ) -> None:
        if not isinstance(scene, Scene):
            raise SceneError(f"scene is {shown(scene)}, not a Scene")
        if not is_number(seed) or seed != seed // 1:
            raise SceneError(f"seed must be a whole number, not {shown(seed)}")
        self.scene, self.device, self.threads = scene, device, thread_count(threads)
        self._lens, self._request, self._given_worlds = lens, request, worlds
        self._camera = Camera(projection=projection, clippingRange=(lens.near, lens.far))
        self._samples, self._seed = samples, seed
        self._with_camera_light = use_camera_light(scene, request.camera_light)
        self._table = None
        if directions is not None:
            self._table = wp.array(np.ascontiguousarray(directions, np.float32), dtype=wp.vec3, device=device)
        self._views = 0
        self._shared: SharedScene | None = None
        self._plan()

    @property
    def live(self) -> SharedScene | None:
        """The scene on the device, shared by all sensors there; None before the first update."""
        return self._shared

    def update(
        self, poses: wp.array | np.ndarray, worlds: wp.array | Sequence[int] | None = None, refit: bool = True
    ) -> Images:
        """Follow what has changed in the scene, and draw it from each pose. Call it after each step of the simulation.

        Args:
            poses: (V,) `wp.array(dtype=wp.transformf)` on the sensor's device, or numbers (V, 7): position and
                quaternion xyzw, sensor to world. The sensor looks down its -Z, +Y is up.
            worlds: (V,) the world that each view sees; None where there is one, or as many as views.
            refit: whether points of meshes may have been written since the last update of any sensor of the scene.
                False spares the second sensor of a step that work. What was assigned and what was posed is followed
                in any case.

        Returns:
            The pictures, in arrays that the next call writes over.

        Raises:
            SceneError: poses or worlds are none, or a mesh's points were replaced by another array.
        """
        poses = self._poses(poses)
        self._share(poses)
        self._shared.follow(refit)
        self._follow()
        self._make_room(len(poses))
        self._see_worlds(worlds, len(poses))
        origin = wp.vec3d(*self._upload.origin)
        place = _place_single if poses.dtype == wp.transformf else _place_double
        launch(place, len(poses), [poses, self._lens, origin, self._cameras], self.device, 1)
        for name, array in self._buffers.items():
            if name in OUTPUTS:
                array.fill_(OUTPUTS[name].dtype(OUTPUTS[name].clear))
        self._draw(len(poses))
        self.images.prims, self.images.labels = self.scene.prims, self.scene.semantics
        return self.images

    def _poses(self, poses: wp.array | np.ndarray) -> wp.array:
        try:
            poses = pose_array(poses, self.device)
        except ValueError as error:
            raise SceneError(f"sensor: {error}") from None
        if poses.device != wp.get_device(self.device):
            raise SceneError(f"sensor: poses are on {poses.device}, the sensor is on {self.device}")
        if not len(poses):
            raise SceneError("sensor: there are no poses")
        return poses

    def _plan(self) -> None:
        """What the scene calls for, and how first hits are found."""
        scene, lens = self.scene, self._lens
        pixels = lens.width * lens.height
        self.plan = analyse(scene, self._camera, self._request, self._with_camera_light, pixels)
        if self.plan.transport in ("none", *LIGHT_BY_LIGHT):
            self.plan.bounds.setdefault("bounces", 0)
        by_raster = "raster" in (self.plan.visibility, self.plan.color_visibility)
        if self._request.visibility == "auto" and self._given_worlds is not None:
            by_raster = False  # a picture of few bodies is little but the cost of beginning
        why = "its rays come from a table" if self._table is not None else ""
        why = why or ("it is orthographic" if lens.orthographic else "")
        why = why or (f"transport {self.plan.transport!r} has many samples a pixel" if self._samples > 1 else "")
        if self._request.visibility != "auto" and self._request.visibility != "rays" and why:
            raise SceneError(f"visibility {self._request.visibility!r}: rays alone see what this sensor sees: {why}")
        self._found_by = "table" if self._table is not None else "raster" if by_raster and not why else "rays"

    def _share(self, poses: wp.array) -> None:
        if self._shared is None:
            eye = np.eye(4)
            first = poses[:1].numpy()[0, :3]
            eye[3, :3] = first if np.isfinite(first).all() else 0.0
            arguments = self._with_camera_light, self.plan.sdfs, self._request.texture_bytes
            self._shared = SharedScene.of(self.scene, self.device, eye, *arguments)
            self._plans, self._upload = self._shared.plans, None

    def _follow(self) -> None:
        """Another plan or another upload, where the scene calls for one."""
        shared = self._shared
        if self._plans != shared.plans:
            self._plans, before = shared.plans, self.plan
            self._plan()
            self.plan = self.plan.kept_from(before, self._camera)
        if self._upload is not shared.live.upload:
            self._upload = shared.live.upload
            self._look()
        record = shared.live.record
        record.energy_compensation = int(self._request.energy_compensation)
        record.local_reflection = int(self.plan.transport in LIGHT_BY_LIGHT)

    def _look(self) -> None:
        """Prepare for an upload: worlds, the rasterizer, the kernel."""
        upload, plan = self._upload, self.plan
        owners, count = self._owners(upload.rows)
        self._world_count = count
        others = np.zeros(len(owners), bool)
        self._raster = None
        if self._found_by == "raster":
            boxed = upload.boxes_for_rays()[upload.rows["geometry"]]
            others = boxed[:, 0, 0] < boxed[:, 1, 0]
            geometries = [part.record for part in upload.parts]
            self._raster = ViewRaster(geometries, upload.rows["geometry"], owners, self._lens, self.device)
        self._list_members(owners, others, count)
        seen = self._request.lights_visible or self._request.dome_light_visible
        centred = self._samples == 1 or self._found_by != "rays"
        found = self._found_by, count > 0, bool(others.any())
        names = self._request.outputs
        key = ViewKey(plan.path, plan.outputs, plan.transport, *found, "rgba8" in self._asked, seen, centred)
        with_radiance = plan.path is not None and not key.shared
        radiance = RADIANCE[plan.transport](plan.path) if with_radiance else None
        self._kernel, self._recorded, self._names = views_kernel(key, radiance), None, names

    def _owners(self, rows: np.ndarray) -> tuple[np.ndarray, int]:
        """(I,) the world of each instance, -1 for what all worlds share, and how many worlds there are."""
        worlds = self._given_worlds
        if worlds is None:
            return np.full(len(rows), -1, np.int32), 0
        paths = list(self.scene.placements)
        if len(worlds) and isinstance(worlds[0], str):
            of_prim = np.full(len(paths), -1, np.int32)
            for number, prefix in enumerate(worlds):
                below = prefix.rstrip("/") + "/"
                mine = [path == prefix or path.startswith(below) for path in paths]
                if not any(mine):
                    self.scene.warn(f"{prefix}: world {number} of the sensor has no prim of its own")
                of_prim[mine] = number
            return of_prim[rows["prim"]], len(worlds)
        owners = np.asarray(worlds, np.int32)
        if owners.shape != (len(rows),):
            raise SceneError(f"worlds has the shape {owners.shape}, but the scene has {len(rows)} instances")
        return owners, int(owners.max(initial=-1)) + 1

    def _list_members(self, owners: np.ndarray, others: np.ndarray, count: int) -> None:
        """Lists of instances: of each world, then those of them that only rays find."""
        lists = []
        for keep in (np.ones(len(owners), bool), others):
            shared = np.flatnonzero((owners < 0) & keep)
            lists += [np.union1d(shared, np.flatnonzero((owners == w) & keep)) for w in range(max(count, 1))]
        starts = np.cumsum([0, *map(len, lists)])
        self._members = wp.array(np.concatenate(lists).astype(np.int32), dtype=wp.int32, device=self.device)
        self._starts = wp.array(starts.astype(np.int32), dtype=wp.int32, device=self.device)
        self._lists = max(count, 1)

    def _see_worlds(self, worlds: wp.array | Sequence[int] | None, views: int) -> None:
        count = self._world_count
        if worlds is None:
            if count > 1 and count != views:
                raise SceneError(f"sensor: {views} views of {count} worlds: say which view sees which world")
            if self._default_worlds is None or len(self._default_worlds) != views:
                numbers = np.arange(views, dtype=np.int32) % max(count, 1)
                self._default_worlds = wp.array(numbers, dtype=wp.int32, device=self.device)
            worlds = self._default_worlds
        elif not isinstance(worlds, wp.array):
            host = np.asarray(worlds)
            if host.shape != (views,) or host.dtype.kind not in "iu" or host.min() < 0 or host.max() >= max(count, 1):
                raise SceneError(f"sensor: worlds must be {views} numbers from 0 to {max(count, 1) - 1}")
            worlds = wp.array(host.astype(np.int32), dtype=wp.int32, device=self.device)
        if worlds.shape != (views,) or worlds.dtype != wp.int32:
            raise SceneError(f"sensor: worlds must be ({views},) int32")
        self._worlds = worlds

    def _make_room(self, views: int) -> None:
        """Arrays for so many views; those of the last call, where they fit."""
        if views == self._views:
            return
        lens, self._views, self._buffers = self._lens, views, {}
        shape, self._default_worlds, self._recorded = (views * lens.height, lens.width), None, None
        self._cameras = wp.empty(views, dtype=CameraRecord, device=self.device)
        self._record, pictures = OutputBuffers(), {}
        self._color = wp.empty(shape if self.plan.path else (0, 0), dtype=wp.vec4, device=self.device)
        self._bytes = wp.empty(shape if "rgba8" in self._asked else (0, 0), dtype=wp.uint32, device=self.device)
        for name in self._asked:
            if name in OUTPUTS:
                self._buffers[name] = wp.empty(shape, dtype=OUTPUTS[name].dtype, device=self.device)
                setattr(self._record, name, self._buffers[name])
        sources = {**self._buffers, "color": self._color, "rgba8": self._bytes}
        for name in self._asked:
            pictures[name] = _pictures(sources[name], views, lens.height, lens.width)
        self.images = Images(**pictures, prims=self.scene.prims, labels=self.scene.semantics)

    def _draw(self, views: int) -> None:
        """All views at once by rays, one after the other by the rasterizer."""
        if self._recorded is None:
            self._request_views()
            rows = self._lens.height * (1 if self._raster else views)
            arguments = self._shared.live.record, self._views_record, self._record
            size = self._lens.width, rows
            self._recorded = RecordedLaunch(self._kernel, *size, arguments, self.device, self.threads)
        request = self._views_record
        request.worlds = self._worlds
        if self._raster is None:
            self._recorded.run()
            return
        worlds = self._worlds if self._world_count else self._no_worlds
        for view in range(views):
            world = self._shared.live.record.world
            seen = self._raster.draw(world, self._cameras, worlds, view, self.threads)
            if seen is not self._seen:
                self._seen = seen
                request.face, request.u, request.v = seen.face, seen.u, seen.v
            request.first_row = view * self._lens.height
            self._recorded.run()

    def _request_views(self) -> None:
        """What the kernel reads of the views; recorded launches see what its fields hold."""
        request, path = ViewRequest(), PathRequest()
        path.seed, path.samples = int(self._seed) & 0xFFFFFFFF, self._samples
        path.sobol, path.bounces = int(self._samples > 1), int(self.plan.bounds.get("bounces", 0))
        path.met = int(self.plan.bounds.get("lights can be hit", True))
        path.visible.lights = int(self._request.lights_visible)
        path.visible.domes = int(self._request.lights_visible or self._request.dome_light_visible)
        request.path = path
        request.cameras, request.width, request.height = self._cameras, self._lens.width, self._lens.height
        request.directions = self._table
        request.members, request.starts, request.lists = self._members, self._starts, self._lists
        request.color, request.rgba8 = self._color, self._bytes
        if self._raster is not None:
            request.first_face = self._raster.first_face
        self._seen, self._no_worlds = None, wp.empty(0, dtype=wp.int32, device=self.device)
        self._views_record = request


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
        visibility: "rays", "raster" or "auto". By raster views are drawn one by one; rays alone see what lenses
            but the pinhole do, and what takes more than one sample.
        transport: as of `Renderer`. "local" is for speed: one sample at the pixel's centre, lights without shadows,
            and a light at the camera where the scene has none. "direct" adds shadows, "path" is all light.
        samples: of colour a pixel.
        seed: of what is drawn at random.
        worlds: what belongs to which of many replicated worlds: a prim path for each world, which owns all that is
            at or under it, or (I,) ints, the world of each instance in drawing order, -1 for what all share. A view
            sees its world and what is shared. Rays go through a world's instances one by one, without a tree: that
            is for worlds of a few dozen.
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
        self._asked = tuple(dict.fromkeys(output_names(outputs)))
        record = CameraRecord()
        record.width, record.height, record.near, record.far = width, height, near, far
        record.window, record.orthographic = wp.vec4(*window), int(lens == "orthographic")
        request = Request(
            _planned(self._asked),
            visibility,
            transport if {"color", "rgba8"} & set(self._asked) else "none",
            None,
            dome_light_visible,
            lights_visible,
            camera_light=camera_light,
            texture_bytes=TEXTURE_BYTES,
        )
        projection = "orthographic" if lens == "orthographic" else "perspective"
        super().__init__(scene, record, projection, directions, request, worlds, device, threads, samples, seed)


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
        self._asked = tuple(dict.fromkeys(output_names(outputs)))
        if colors := [name for name in self._asked if name not in OUTPUTS]:
            raise SceneError(f"lidar: there is no output {colors[0]!r}")
        record = CameraRecord()
        record.height, record.width = directions.shape[:2]
        record.near, record.far = near, far
        record.window = wp.vec4(*_mean_window(directions))
        request = Request(self._asked, "rays", "none", texture_bytes=TEXTURE_BYTES)
        super().__init__(scene, record, "perspective", directions, request, worlds, device, threads, 1, 0)


@wp.func
def placed_view(place: wp.vec3d, q: wp.vec4, lens: CameraRecord, origin: wp.vec3d) -> CameraRecord:
    """A camera about an origin; a quaternion of any length counts as its direction, and one of none sees nothing."""
    camera = lens
    camera.position = wp.vec3(place - origin)
    camera.origin = wp.vec3(origin)
    camera.rotation = wp.mat33(wp.nan)
    if wp.length(q) > 0.0:
        n = q / wp.length(q)
        camera.rotation = wp.quat_to_matrix(wp.quat(n[0], n[1], n[2], n[3]))
    return camera


@wp.kernel(module="unique", enable_backward=False)
def _place_single(
    first: wp.int32,
    poses: wp.array(dtype=wp.transformf),
    lens: CameraRecord,
    origin: wp.vec3d,
    cameras: wp.array(dtype=CameraRecord),
):
    i = first + wp.tid()
    p = poses[i]
    cameras[i] = placed_view(wp.vec3d(wp.vec3(p[0], p[1], p[2])), wp.vec4(p[3], p[4], p[5], p[6]), lens, origin)


@wp.kernel(module="unique", enable_backward=False)
def _place_double(
    first: wp.int32,
    poses: wp.array(dtype=wp.transformd),
    lens: CameraRecord,
    origin: wp.vec3d,
    cameras: wp.array(dtype=CameraRecord),
):
    i = first + wp.tid()
    p = poses[i]
    q = wp.vec4(wp.vec4d(p[3], p[4], p[5], p[6]))
    cameras[i] = placed_view(wp.vec3d(p[0], p[1], p[2]), q, lens, origin)


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


def _mean_window(directions: np.ndarray) -> tuple[float, float, float, float]:
    """A window whose pixels are as wide as neighbouring rays (E, A, 3) of a table lie apart on average."""
    height, width = directions.shape[:2]
    steps = [np.linalg.norm(np.diff(directions, axis=k), axis=-1) for k in range(2)]
    down, across = (float(step.mean()) if step.size else 0.0 for step in steps)
    half = 0.5 * width * (across or down), 0.5 * height * (down or across)
    return (-half[0], -half[1], half[0], half[1])


def _check_sizes(**sizes: int) -> None:
    for name, size in sizes.items():
        if not is_count(size, least=1):
            raise SceneError(f"{name} must be a whole number from 1 on, not {shown(size)}")


def _pictures(array: wp.array, views: int, height: int, width: int) -> wp.array:
    """The rows of all views (V H, W) as pictures (V, H, W), or of packed bytes (V, H, W, 4)."""
    if array.dtype == wp.uint32:
        size = views * height * width
        return wp.array(
            ptr=array.ptr, dtype=wp.uint8, shape=(views, height, width, 4), capacity=4 * size, device=array.device
        )
    return array.reshape((views, height, width))
