"""The rasterizer for views whose places lie on the device: one view at a time, of a scene that may move."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from ..launch import launch
from ..numerics import linear_of, translation_of
from ..records import NOT_DRAWN, CameraRecord, GeometryRecord, World
from .first_hits import clip_matrix, triangles_of
from .raster import DrawList, Raster


class ViewRaster:
    """Triangles of a scene as a perspective view sees them.

    Attributes:
        first_face: (I,) int32, the first face of each instance in a picture.
    """

    def __init__(
        self,
        geometries: Sequence[GeometryRecord],
        instances: np.ndarray,
        owners: np.ndarray,
        lens: CameraRecord,
        device: str,
    ) -> None:
        """For instances (I,) of geometries, each in the world `owners` (I,), or in all (-1); `lens` has no place.

        Raises:
            ValueError: more triangles than int32 can number.
        """
        self._draws = DrawList([triangles_of(g, device) for g in geometries], instances, device)
        self.first_face = self._draws.first_face
        self._owners = wp.array(owners, dtype=wp.int32, device=device)
        at_origin = CameraRecord()
        at_origin.rotation = wp.mat33(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
        at_origin.window, at_origin.near = lens.window, lens.near
        self._lens = wp.mat44d(*clip_matrix(at_origin, np.zeros((0, 2, 3))).reshape(-1))
        self._size, self._device, self._seen = (lens.width, lens.height), device, None

    def draw(self, world: World, cameras: wp.array, worlds: wp.array, view: int, threads: int | None) -> Raster:
        """What view number `view` of the cameras (V,) sees; overwritten by the next call.

        `worlds` (V,) are the worlds that views see, empty where there is one alone.
        """
        arguments = [self._lens, cameras, worlds, view, world, self._owners, self._draws.matrices]
        launch(_view_matrices, len(self._owners), arguments, self._device, threads)
        self._seen = self._draws.rasterize(*self._size, threads, into=self._seen)
        return self._seen


@wp.kernel(module="unique", enable_backward=False)
def _view_matrices(
    first: wp.int32,
    lens: wp.mat44d,
    cameras: wp.array(dtype=CameraRecord),
    worlds: wp.array(dtype=wp.int32),
    view: wp.int32,
    world: World,
    owners: wp.array(dtype=wp.int32),
    matrices: wp.array(dtype=wp.mat44d),
):
    i = first + wp.tid()
    camera = cameras[view]
    place = world.instances[i]
    seen = place.placed != wp.static(NOT_DRAWN)
    if worlds.shape[0] > 0 and owners[i] >= 0 and owners[i] != worlds[view]:
        seen = False
    # Positions that are not finite are not drawn.
    turned = wp.mat33d(wp.float64(wp.nan))
    moved = wp.vec3d()
    if seen:
        back = wp.mat33d(wp.transpose(camera.rotation))
        turned = back * wp.mat33d(linear_of(place.to_world))
        moved = back * (wp.vec3d(translation_of(place.to_world)) - wp.vec3d(camera.position))
    to_view = wp.mat44d()
    for a in range(3):
        for b in range(3):
            to_view[a, b] = turned[a, b]
        to_view[a, 3] = moved[a]
    to_view[3, 3] = wp.float64(1.0)
    matrices[i] = lens * to_view
