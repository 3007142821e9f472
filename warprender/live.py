"""A scene on a device that follows what changes in it: the least work for each kind of change."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
import warp as wp

from .attaching import posed_transforms
from .emitters import lit
from .lights import CameraLight, Light, MeshLight
from .plan import distance_functions
from .records import DeviceScene
from .scene import Scene
from .shapes.mesh import POINTS
from .texels import TEXTURE_BYTES
from .upload import Upload, rounded_origin
from .upload_placed import scene_radius
from .watched import Watched, contents, same


@dataclass
class Look:
    """What a scene was like, by the objects that it was made of; see `watched.same`.

    Attributes:
        prims: what is drawn, but for where and whether.
        places: where, and whether it is visible.
        materials: all of them.
        lights: all of them.
    """

    prims: list[object]
    places: list[object]
    materials: list[object]
    lights: list[object]

    @classmethod
    def at(cls, scene: Scene) -> Look:
        """The scene as it is now."""
        prims: list[object] = []
        places: list[object] = []
        for path, placement in scene.placements.items():
            prims += [path, placement.shape, placement.material, placement.instance_ids, len(placement.transforms)]
            prims.append(placement.semantic)
            prims += contents(placement.shape, POINTS)
            places += [placement.transforms, placement.visible]
        return cls(prims, places, _entries(scene.materials), _entries(scene.lights))


class LiveScene:
    """A scene on a device, kept in step.

    Attributes:
        upload: owns what is on the device; another one after prims came or went.
        lights: the lights that emit, hidden ones among them.
    """

    def __init__(
        self,
        scene: Scene,
        device: str,
        eye: np.ndarray,
        camera_light: bool,
        sdfs: tuple[wp.Function, ...] = (),
        texture_bytes: int = TEXTURE_BYTES,
        keep_meshes: bool = False,
    ) -> None:
        """Upload the scene for a camera with the transform `eye` (4, 4); `camera_light` adds a light there.

        `sdfs` are the plan's signed distance functions; `keep_meshes` as of `Upload`.
        """
        self._scene, self._device, self._camera_light = scene, device, camera_light
        self._texture_bytes, self._keep_meshes = texture_bytes, keep_meshes
        self.lights = lit(scene, camera_light)
        self._seen = self._glance()
        self._look = Look.at(scene)
        self._before = self._look
        self.upload = Upload(
            scene, self._standing(eye), eye[3, :3], device, texture_bytes, sdfs, keep_meshes=keep_meshes
        )
        self._remember()

    @property
    def record(self) -> DeviceScene:
        """What kernels read. Another object after prims came or went."""
        return self.upload.record

    @property
    def replaced(self) -> bool:
        """Whether something was assigned that `update` has still to see."""
        return self._look is not self._before

    def look_again(self) -> bool:
        """See what of the description has changed; whether effects may have come or gone, which calls for a plan."""
        seen = self._glance()
        if not same(seen, self._seen):
            self._seen, self._look = seen, Look.at(self._scene)
        before, look = self._before, self._look
        self._remade = not (same(before.prims, look.prims) and same(before.materials, look.materials))
        self._relit = not same(before.lights, look.lights)
        return self._remade or self._relit

    def update(self, eye: np.ndarray, sdfs: tuple[wp.Function, ...] = ()) -> None:
        """Follow all that `look_again` has seen, and what was written on the device.

        Args:
            eye: (4, 4) transform of the camera now.
            sdfs: the plan's signed distance functions.

        Raises:
            SceneError: a mesh's points were replaced by another array.
        """
        placed = not same(self._before.places, self._look.places)
        relit = self._relit
        if self._remade or relit:
            self.lights = lit(self._scene, self._camera_light)
        if self._remade:
            self.upload = Upload(
                self._scene,
                self._standing(eye),
                eye[3, :3],
                self._device,
                self._texture_bytes,
                sdfs,
                self.upload,
                self._keep_meshes,
            )
        else:
            if placed:
                self.upload.place_at_rest()
            moved = (self.upload.origin != rounded_origin(eye[3, :3])).any()
            changed = self.upload.refit_shapes()
            if placed or moved or changed or self._steps != self._scene.bodies.steps:
                self.upload.place(eye[3, :3], changed)
            if changed & self.upload.lights.glowing:
                self.lights = lit(self._scene, self._camera_light)
                relit = True
            if relit or placed or (moved and self.lights) or self._lights_moved(bool(changed)):
                self.upload.light(self._standing(eye))
        self._before = self._look
        self._remember()

    def _glance(self) -> list[object]:
        """What tells at little cost that nothing was assigned."""
        scene = self._scene
        things = (scene.placements.values(), scene.materials.values(), scene.lights.values())
        transforms = (light.transform.tobytes() for light in scene.lights.values())
        return [Watched.assignments, *chain(*things), *transforms]

    def _remember(self) -> None:
        """Keep what the next update compares with."""
        # What the update itself assigned is no change of the scene.
        self._seen[0] = Watched.assignments
        self._steps = self._scene.bodies.steps
        self._hung = posed_transforms(self._scene, self._light_transforms())
        for warning in self.upload.warnings:
            self._scene.warn(warning)
        self.upload.warnings.clear()

    def _light_transforms(self) -> dict[str, np.ndarray]:
        return {path: light.transform for path, light in self.lights.items() if not isinstance(light, MeshLight)}

    def _lights_moved(self, deformed: bool) -> bool:
        """Whether poses moved a light or what glows, or the scene's size by which lights are weighed has changed."""
        lights, world = self.upload.lights, self.upload.world
        stepped = self._steps != self._scene.bodies.steps
        if stepped and lights.glowing:
            glows = np.isin(self.upload.rows["geometry"], list(lights.glowing))
            if (glows & self.upload.rig.moved).any():
                return True
        if stepped:
            hung = posed_transforms(self._scene, self._light_transforms())
            if hung.keys() != self._hung.keys() or any((hung[path] != self._hung[path]).any() for path in hung):
                return True
        # On CUDA the size stays that of the upload: to ask for it is to wait for the device.
        weighs = lights.weighs_by_radius and world.device.is_cpu
        return weighs and (stepped or deformed) and scene_radius(world.boxes()) != lights.radius

    def _standing(self, eye: np.ndarray) -> dict[str, Light]:
        """The lights that emit where poses have put them, and the camera's light at the camera."""
        lights = dict(self.lights)
        for path, transform in posed_transforms(self._scene, self._light_transforms()).items():
            lights[path] = replace(lights[path], transform=transform)
        for light in lights.values():
            if isinstance(light, CameraLight):
                light.transform = np.eye(4)
                light.transform[3] = eye[3]
        return lights


def _entries(things: dict[str, object]) -> list[object]:
    """Keys, values and what is in the values, in a row."""
    found: list[object] = []
    for key, thing in things.items():
        found += [key, thing, *contents(thing)]
    return found


class SharedScene:
    """One live scene for all sensors of a scene on a device.

    Attributes:
        live: the scene on the device, relative to where the first view was.
        plans: counts the changes that call for another plan.
    """

    def __init__(
        self,
        scene: Scene,
        device: str,
        eye: np.ndarray,
        camera_light: bool,
        sdfs: tuple[wp.Function, ...],
        texture_bytes: int,
    ) -> None:
        """Upload the scene; arguments as of `LiveScene`."""
        self._scene, self._eye = scene, eye
        self.live = LiveScene(scene, device, eye, camera_light, sdfs, texture_bytes)
        self.plans = 0
        self._placed = scene.bodies.steps
        self._reflecting: tuple[DeviceScene | None, bool, bool] = None, False, False

    @classmethod
    def of(cls, scene: Scene, device: str, eye: np.ndarray, camera_light: bool, *arguments: object) -> SharedScene:
        """The one that there is, or a new one at `eye` (4, 4)."""
        key = device, camera_light
        if key not in scene.live:
            scene.live[key] = cls(scene, device, eye, camera_light, *arguments)
        return scene.live[key]

    def reflect(self, compensated: bool, light_by_light: bool) -> None:
        """Set how surfaces reflect in what is drawn next: `DeviceScene.energy_compensation`, `local_reflection`."""
        record = self.live.record
        if (record, compensated, light_by_light) != self._reflecting:
            self._reflecting = record, compensated, light_by_light
            record.energy_compensation, record.local_reflection = int(compensated), int(light_by_light)

    def follow(self, refit: bool) -> None:
        """See what has changed; meshes that a simulation writes only with `refit`.

        Raises:
            SceneError: a mesh's points were replaced by another array.
        """
        if self.live.look_again():
            self.plans += 1
        elif not refit and self._placed == self._scene.bodies.steps and not self.live.replaced:
            return
        self.live.update(self._eye, distance_functions(self._scene))
        self._placed = self._scene.bodies.steps
