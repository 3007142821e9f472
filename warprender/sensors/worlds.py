"""Which instances belong to which of many replicated worlds, and which world each view sees."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from ..bodies import ancestors
from ..given import plain_array, shown
from ..records import CameraRecord
from ..scene import Scene, SceneError
from ..upload import Upload
from ..visibility.view_raster import ViewRaster
from ..visibility.worlds import WorldTrees


class SensorWorlds:
    """The worlds of a sensor over an upload.

    Attributes:
        count: of the worlds; 0 where there is one scene for all.
        lists: the instances of each world, and what all share; of one scene, all instances.
        others: those of them that the rasterizer does not see, None by rays.
        raster: draws triangles of views, None by rays.
    """

    def __init__(
        self,
        scene: Scene,
        given: Sequence[str] | np.ndarray | None,
        upload: Upload,
        lens: CameraRecord | None,
        device: str,
        threads: int,
    ) -> None:
        """Worlds as `CameraSensor` has them; `lens` is of views that are rasterized, None of others.

        Raises:
            SceneError: there are not as many numbers of worlds as instances.
        """
        self._scene, self._given, self._device, self._places = scene, given, device, -1
        owners, self.count = self._owners(upload.rows)
        self.lists = WorldTrees(_lists(owners, self.count), device, threads)
        self.others = self.raster = None
        if lens is not None:
            geometry, boxes = upload.rows["geometry"], upload.boxes_for_rays()
            bare = (boxes[:, 0, 0] < boxes[:, 1, 0])[geometry]
            self.others = WorldTrees([part[bare[part]] for part in _lists(owners, self.count)], device, threads)
            records = [part.record for part in upload.parts]
            self.raster = ViewRaster(records, geometry, boxes, self.lists.record, lens, device, threads)
        self.world = upload.world.world
        self._default = self._own = None

    @staticmethod
    def count_of(given: Sequence[str] | np.ndarray | None) -> int:
        """How many worlds are given, at least 1."""
        if given is None or not len(given):
            return 1
        return len(given) if isinstance(given[0], str) else max(int(np.max(given)) + 1, 1)

    def follow(self, upload: Upload) -> None:
        """See where instances are now."""
        if self._places != upload.places:
            self._places = upload.places
            if self.count:
                self.lists.build(self.world)
            if self.raster is not None and self.raster.others:
                self.others.build(self.world)

    def seen(self, worlds: wp.array | Sequence[int] | None, views: int) -> wp.array:
        """(V,) int32, the world of each view, as given to `update`.

        Raises:
            SceneError: they are none, or not as many as views.
        """
        last = max(self.count, 1) - 1
        if worlds is None:
            if self.count > 1 and self.count != views:
                raise SceneError(f"sensor: {views} views of {self.count} worlds: say which view sees which world")
            if self._default is None or len(self._default) != views:
                numbers = np.arange(views, dtype=np.int32) % (last + 1)
                self._default = wp.array(numbers, dtype=wp.int32, device=self._device)
            return self._default
        if isinstance(worlds, wp.array):
            if worlds.shape != (views,) or worlds.dtype != wp.int32:
                raise SceneError(f"sensor: worlds must be ({views},) int32")
            if worlds.device != wp.get_device(self._device):
                raise SceneError(f"sensor: worlds are on {worlds.device}, the sensor is on {self._device}")
            return worlds
        host = plain_array(worlds)
        if host.shape != (views,) or host.dtype.kind not in "iu" or host.min() < 0 or host.max() > last:
            raise SceneError(f"sensor: worlds must be {views} numbers from 0 to {last}")
        if self._own is None or len(self._own) != views:
            self._own = wp.empty(views, dtype=wp.int32, device=self._device)
        self._own.assign(host.astype(np.int32))
        return self._own

    def _owners(self, rows: np.ndarray) -> tuple[np.ndarray, int]:
        """(I,) the world of each instance, -1 for what all worlds share, and how many worlds there are."""
        worlds = self._given
        if worlds is None:
            return np.full(len(rows), -1, np.int32), 0
        if len(worlds) and isinstance(worlds[0], str):
            return self._owners_by_path(worlds)[rows["prim"]], len(worlds)
        owners = np.asarray(worlds, np.int32)
        if owners.shape != (len(rows),):
            raise SceneError(f"worlds has the shape {owners.shape}, but the scene has {len(rows)} instances")
        return owners, int(owners.max(initial=-1)) + 1

    def _owners_by_path(self, worlds: Sequence[str]) -> np.ndarray:
        """(P,) the world of each prim: the nearest prim at or above it that is one."""
        numbers, owned = {path.rstrip("/"): number for number, path in enumerate(worlds)}, set()
        owners = np.full(len(self._scene.placements), -1, np.int32)
        for prim, path in enumerate(self._scene.placements):
            name = next((name for name in (*ancestors(path), "") if name in numbers), None)
            if name is not None:
                owners[prim] = numbers[name]
                owned.add(name)
        for number, path in enumerate(worlds):
            if path.rstrip("/") not in owned:
                self._scene.warn(f"{path}: world {number} of the sensor has no prim of its own")
        return owners


def check_worlds(given: object) -> None:
    """Raise a SceneError unless it is None, prim paths, or whole numbers."""
    array = plain_array(given)
    numbers = array.dtype.kind in "iu" or not array.size
    paths = array.dtype.kind == "U" and all(isinstance(path, str) for path in given)
    if given is not None and not (array.ndim == 1 and (numbers or paths)):
        raise SceneError(f"sensor: worlds are {shown(given)}, neither prim paths nor a whole number for each instance")


def _lists(owners: np.ndarray, count: int) -> list[np.ndarray]:
    """Numbers of the instances of each of `count` worlds, and of what all share; at least one list."""
    shared = np.flatnonzero(owners < 0)
    order = np.argsort(owners, kind="stable")
    ends = np.searchsorted(owners[order], np.arange(max(count, 1) + 1))
    return [np.union1d(shared, order[ends[w] : ends[w + 1]]) for w in range(max(count, 1))]
