"""Views of one number: their pictures, and the launches that fill them, made once."""

from __future__ import annotations

import warp as wp

from ..integrators.samples import PathRequest
from ..integrators.views import ViewRequest
from ..launch import RecordedLaunch
from ..outputs import OUTPUTS, OutputBuffers
from ..records import CameraRecord, DeviceScene
from .worlds import SensorWorlds


class ViewBatch:
    """Arrays and launches for so many views of an upload.

    Attributes:
        views: how many.
        cameras: (V,) to be filled before each `draw`.
        pictures: output name to array (V, H, W[, C]).
    """

    def __init__(
        self,
        kernel: wp.Kernel,
        views: int,
        outputs: tuple[str, ...],
        lens: CameraRecord,
        directions: wp.array | None,
        path: PathRequest,
        scene: DeviceScene,
        worlds: SensorWorlds,
        threads: int,
    ) -> None:
        """For a kernel of `views_kernel` and outputs by name; `scene` is read by each `draw`."""
        self.views, self._raster = views, worlds.raster
        device = worlds.lists.record.members.device
        self.cameras = wp.zeros(views, dtype=CameraRecord, device=device)
        shape = views * lens.height, lens.width
        self._request = request = ViewRequest()
        request.path, request.cameras, request.directions = path, self.cameras, directions
        request.width, request.height = lens.width, lens.height
        request.lists = worlds.lists.record
        self._worlds = request.worlds = wp.zeros(views, dtype=wp.int32, device=device)
        self._fill(outputs, shape, device)
        self.pictures = {name: _pictures(array, views, lens.height) for name, array in self._arrays.items()}
        if self._raster is not None:
            self._raster.see(worlds.world, self.cameras, request.worlds)
            request.others, request.first_face = worlds.others.record, self._raster.first_face
            request.face, request.u, request.v = self._raster.seen[:3]
            request.marks = self._raster.marks
        arguments = scene, request, self._buffers
        self._views = RecordedLaunch.of_pixels(kernel, *shape[::-1], arguments, device, threads)

    def draw(self, worlds: wp.array) -> None:
        """Draw the views, each of its world (V,)."""
        if worlds is not self._worlds:
            self._worlds = self._request.worlds = worlds
            if self._raster is not None:
                self._raster.look_at(worlds)
        for array, nothing in self._cleared:
            array.fill_(nothing)
        if self._raster is not None:
            self._raster.draw()
        self._views.run()

    def _fill(self, outputs: tuple[str, ...], shape: tuple[int, int], device: wp.Device) -> None:
        """Make an array for each output, the rows of all views one below the other."""
        self._buffers, self._arrays = OutputBuffers(), {}
        for name in outputs:
            owner = self._buffers if name in OUTPUTS else self._request
            dtype = OUTPUTS[name].dtype if name in OUTPUTS else {"color": wp.vec4, "rgba8": wp.uint32}[name]
            self._arrays[name] = wp.empty(shape, dtype=dtype, device=device)
            setattr(owner, name, self._arrays[name])
        aovs = [(name, OUTPUTS[name]) for name in outputs if name in OUTPUTS]
        self._cleared = [(self._arrays[name], aov.dtype(aov.clear)) for name, aov in aovs]


def _pictures(array: wp.array, views: int, height: int) -> wp.array:
    """The rows of all views (V H, W) as pictures (V, H, W), or of packed bytes (V, H, W, 4)."""
    width = array.shape[1]
    if array.dtype == wp.uint32:
        shape, size = (views, height, width, 4), array.size
        return wp.array(ptr=array.ptr, dtype=wp.uint8, shape=shape, capacity=4 * size, device=array.device)
    return array.reshape((views, height, width))
