"""What finds the first hits of a renderer's pictures: rays or the rasterizer, for outputs and for colour."""

from __future__ import annotations

from .plan import OutputsKey, PathKey
from .records import CameraRecord
from .upload import Upload
from .visibility.first_hits import FirstHits, RasterHits, RayHits


class HitFinders:
    """One for each use of first hits, kept for as long as it can follow what changes."""

    def __init__(self, device: str) -> None:
        """None yet."""
        self._device = device
        self._known: dict[str, tuple[tuple, FirstHits]] = {}

    def get(
        self, use: str, visibility: str, key: PathKey | OutputsKey, upload: Upload, camera: CameraRecord
    ) -> FirstHits:
        """The one for a use, by "rays", "raster" or "painter", which sees the scene and the camera as they are now."""
        kind = upload, visibility, key.camera, key.sdfs
        known = self._known.get(use)
        if known is not None and known[0] == kind:
            known[1].follow(upload.record, camera)
            return known[1]
        self._known[use] = kind, self._new(visibility, key, upload, camera)
        return self._known[use][1]

    def _new(self, visibility: str, key: PathKey | OutputsKey, upload: Upload, camera: CameraRecord) -> FirstHits:
        if visibility == "rays":
            return RayHits(upload.record, camera, key.camera, self._device, key.sdfs)
        painter, boxes = visibility == "painter", upload.world.boxes
        instances, rayed = upload.rows["geometry"], upload.boxes_for_rays()
        triangles = [part.record for part in upload.parts]
        return RasterHits(
            upload.record, triangles, instances, rayed, boxes, camera, key.camera, self._device, painter, key.sdfs
        )
