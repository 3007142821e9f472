"""What cameras and lidars share: following the scene, and drawing its views."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import warp as wp

from ..camera import Camera
from ..given import shown
from ..integrators import RADIANCE
from ..integrators.samples import path_request
from ..integrators.views import ViewKey, views_kernel
from ..launch import thread_count
from ..live import SharedScene
from ..plan import LIGHT_BY_LIGHT, RenderPlan, Request, analyse, check_seed
from ..records import CameraRecord
from ..renderer import use_camera_light
from ..scene import Scene, SceneError
from .batch import ViewBatch
from .poses import ViewPoses
from .worlds import SensorWorlds, check_worlds


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
        outputs: tuple[str, ...],
        request: Request,
        worlds: Sequence[str] | np.ndarray | None,
        device: str,
        threads: int | None,
        samples: int,
        seed: int,
    ) -> None:
        if not isinstance(scene, Scene):
            raise SceneError(f"scene is {shown(scene)}, not a Scene")
        check_seed(seed)
        check_worlds(worlds)
        self.scene, self.device, self.threads = scene, device, thread_count(threads)
        self._lens, self._asked, self._request, self._given_worlds = lens, outputs, request, worlds
        self._camera = Camera(projection=projection, clippingRange=(lens.near, lens.far))
        self._samples, self._seed = samples, seed
        self._with_camera_light = use_camera_light(scene, request.camera_light)
        self._table = None
        if directions is not None:
            self._table = wp.array(np.ascontiguousarray(directions, np.float32), dtype=wp.vec3, device=device)
        self._poses = ViewPoses(lens, device)
        self._batch: ViewBatch | None = None
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
        poses = self._poses.take(poses)
        self._share(poses)
        self._shared.follow(refit)
        self._follow()
        seen = self._worlds.seen(worlds, len(poses))
        if self._batch is None or self._batch.views != len(poses):
            self._batch = self._new_batch(len(poses))
            self.images = Images(**self._batch.pictures)
        live = self._shared.live
        self._worlds.follow(live.upload)
        self._shared.reflect(self._request.energy_compensation, self.plan.transport in LIGHT_BY_LIGHT)
        self._poses.place(self._batch.cameras, live.upload.origin)
        self._batch.draw(seen)
        self.images.prims, self.images.labels = self.scene.prims, self.scene.semantics
        return self.images

    def _plan(self) -> None:
        """What the scene calls for, and how first hits are found."""
        scene, lens = self.scene, self._lens
        # Each world has its own triangles, and a view of its own.
        pixels = lens.width * lens.height * SensorWorlds.count_of(self._given_worlds)
        self.plan = analyse(scene, self._camera, self._request, self._with_camera_light, pixels)
        why = "its rays come from a table" if self._table is not None else ""
        why = why or ("it is orthographic" if lens.orthographic else "")
        why = why or (f"transport {self.plan.transport!r} has many samples a pixel" if self._samples > 1 else "")
        if self._request.visibility not in ("auto", "rays") and why:
            raise SceneError(f"visibility {self._request.visibility!r}: rays alone see what this sensor sees: {why}")
        by_raster = "raster" in (self.plan.visibility, self.plan.color_visibility) and not why
        self._found_by = "table" if self._table is not None else "raster" if by_raster else "rays"

    def _share(self, poses: wp.array) -> None:
        if self._shared is None:
            # The scene may have changed since the sensor was made.
            self._plan()
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
            self._plans, before, found_by = shared.plans, self.plan, self._found_by
            self._plan()
            if self.plan.sdfs == before.sdfs:
                # All sensors share one upload, which numbers the functions that there are.
                self.plan = self.plan.kept_from(before, self._camera)
            if self._found_by != found_by:
                self._upload = None
            if _drawn_by(self.plan) != _drawn_by(before):
                self._batch = None
        if self._upload is not shared.live.upload:
            by_raster = self._found_by == "raster"
            arguments = self._lens if by_raster else None, self.device, self.threads
            self._worlds = SensorWorlds(self.scene, self._given_worlds, shared.live.upload, *arguments)
            self._upload, self._batch = shared.live.upload, None

    def _new_batch(self, views: int) -> ViewBatch:
        """So many views of the upload that there is."""
        plan, worlds = self.plan, self._worlds
        seen = self._request.lights_visible or self._request.dome_light_visible
        centred = self._samples == 1 or self._found_by != "rays"
        others = worlds.raster is not None and worlds.raster.others
        colors = tuple(name for name in ("color", "rgba8") if name in self._asked)
        found = self._found_by, worlds.count > 0, others
        key = ViewKey(plan.path, plan.outputs, plan.transport, *found, colors, seen, centred)
        with_radiance = plan.path is not None and not key.shared
        kernel = views_kernel(key, RADIANCE[plan.transport](plan.path) if with_radiance else None)
        path = path_request(self._request, plan, self._seed, self._samples > 1)
        path.samples = self._samples
        record = self._shared.live.record
        return ViewBatch(kernel, views, self._asked, self._lens, self._table, path, record, worlds, self.threads)


def _drawn_by(plan: RenderPlan) -> tuple[object, ...]:
    """What of a plan is in a batch's kernel and its request."""
    return plan.path, plan.outputs, plan.transport, plan.bounds
