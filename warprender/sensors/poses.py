"""Where views are: from poses on a device to cameras about the scene's origin."""

# Without `from __future__ import annotations`: Warp reads the types of a kernel that a factory makes as they are.

from functools import cache

import numpy as np
import warp as wp

from ..bodies import pose_array, wide_pose_function
from ..launch import RecordedLaunch
from ..records import CameraRecord
from ..scene import SceneError
from ..visibility.placing import rotation_of


class ViewPoses:
    """Poses as users give them, and the cameras there."""

    def __init__(self, lens: CameraRecord, device: str) -> None:
        """For cameras that are `lens` in another place each."""
        self._lens, self._device = lens, wp.get_device(device)
        self._own: wp.array | None = None
        self._launch: RecordedLaunch | None = None

    def take(self, poses: wp.array | np.ndarray) -> wp.array:
        """(V,) `wp.transformf` or `wp.transformd` on the device; numbers from the host go to one array for all calls.

        Raises:
            SceneError: they are none, or elsewhere.
        """
        try:
            kept = self._kept(poses)
            taken = pose_array(poses, self._device) if kept is None else kept
        except ValueError as error:
            raise SceneError(f"sensor: {error}") from None
        if taken.device != self._device:
            raise SceneError(f"sensor: poses are on {taken.device}, the sensor is on {self._device}")
        if not len(taken):
            raise SceneError("sensor: there are no poses")
        if taken.dtype == wp.transformd and not isinstance(poses, wp.array):
            # A copy: what another library lends is float32, and not ours to write into.
            self._own = taken
        self._poses = taken
        return taken

    def _kept(self, poses: wp.array | np.ndarray) -> wp.array | None:
        """Numbers from the host in the array of the last ones, where they fit."""
        lent = hasattr(poses, "__dlpack__") and not isinstance(poses, np.ndarray)
        if lent or self._own is None:
            return None
        host = np.asarray(poses, np.float64)
        if host.shape != (len(self._own), 7):
            return None
        self._own.assign(host)
        return self._own

    def place(self, cameras: wp.array, origin: np.ndarray) -> None:
        """Fill `cameras` (V,) from the poses that were taken last, relative to `origin` (3,)."""
        poses, place = self._poses, origin.tobytes()
        known = None if self._launch is None else self._placed
        if known is None or known[0] is not cameras or known[1:3] != (poses.dtype, place):
            arguments = [poses, self._lens, wp.vec3d(*origin), cameras]
            self._launch = RecordedLaunch(place_kernel(poses.dtype), len(cameras), arguments, self._device, 1)
        elif known[3] != poses.ptr:
            self._launch.replace(0, poses)
        self._placed = cameras, poses.dtype, place, poses.ptr
        self._launch.run()


@cache
def place_kernel(pose_type: type) -> wp.Kernel:
    """Cameras from poses of `wp.transformf` or `wp.transformd`; one without a direction sees nothing."""
    wide_pose = wide_pose_function(pose_type)

    @wp.kernel(module="unique", enable_backward=False)
    def place_views(
        first: wp.int32,
        poses: wp.array(dtype=pose_type),
        lens: CameraRecord,
        origin: wp.vec3d,
        cameras: wp.array(dtype=CameraRecord),
    ):
        i = first + wp.tid()
        pose = wide_pose(poses[i])
        camera = lens
        camera.position = wp.vec3(wp.transform_get_translation(pose) - origin)
        camera.origin = wp.vec3(origin)
        camera.rotation = wp.mat33(rotation_of(pose))
        cameras[i] = camera

    return place_views
