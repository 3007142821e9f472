"""Which camera a renderer looks through, and where poses and assignments have put it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .attaching import posed_transforms
from .camera import Camera
from .errors import SceneError
from .framing import camera_at, choose_camera, choose_camera_path
from .scene import Scene
from .scene_arguments import pose_matrix


class Viewpoint:
    """A camera of a scene, or one by itself.

    Attributes:
        camera: the camera as `look` has last seen it.
        path: its path in the scene, "" where it has none.
    """

    def __init__(self, scene: Scene, camera: Camera | str | None) -> None:
        """Choose as `choose` does, and look.

        Raises:
            SceneError: there is no such camera, or it can take no picture.
        """
        self._scene = scene
        self.choose(camera)
        self.look()

    def choose(self, camera: Camera | str | np.ndarray | Sequence | None) -> None:
        """Take another one from the next `look` on.

        Args:
            camera: a `Camera`; the path or name of one in the scene, which poses may move; a camera-to-world
                transform for the one at hand, as `pose_matrix` takes it; or None for usdrecord's choice.

        Raises:
            SceneError: there is no such camera, or no transform of this shape.
        """
        if camera is not None and not isinstance(camera, (str, Camera)):
            camera = replace(self.camera, transform=pose_matrix(camera, "camera"))
        if isinstance(camera, Camera):
            self._chosen = camera
            self.path = next((path for path, other in self._scene.cameras.items() if other is camera), "")
        else:
            self.path = choose_camera_path(self._scene, camera)
            self._chosen = None if self.path else choose_camera(self._scene, camera)

    def look(self) -> bool:
        """See the camera where it is now; whether effects of it may have come or gone.

        Raises:
            SceneError: it can take no picture, or is gone.
        """
        before = self._effects() if hasattr(self, "camera") else None
        path, camera = self.path, self._chosen
        if camera is None:
            if path not in self._scene.cameras:
                raise SceneError(f"{path}: the camera is no longer in the scene")
            camera = camera_at(self._scene, path)
        elif path:
            camera = self._scene.cameras.get(path, camera)
        moved = posed_transforms(self._scene, {path: camera.transform}) if path else {}
        if moved:
            camera = replace(camera, transform=moved[path])
        if fault := camera.fault():
            raise SceneError(f"{path or 'camera'}: {fault}")
        self.camera = camera
        return before != self._effects()

    def _effects(self) -> tuple[object, ...]:
        return self.camera.effects(), self.camera.shutterOpen, self.camera.shutterClose
