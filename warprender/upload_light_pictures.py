"""Light pictures and photometric profiles on a device, each once."""

from __future__ import annotations

from .lights import IesProfile, LightTexture
from .records import ImageRecord, ProfileRecord


class Pictures:
    """Light pictures and profiles on a device, each once. Owns their arrays."""

    def __init__(self) -> None:
        """None yet."""
        self.images: list[ImageRecord] = []
        self.profiles: list[ProfileRecord] = []
        self._numbers: dict[int, int] = {}
        self._kept: list[object] = []

    def image(self, picture: LightTexture, device: str, of_dome: bool) -> tuple[int, bool]:
        """The number of a picture, and whether it was uploaded just now."""
        if id(picture) in self._numbers:
            return self._numbers[id(picture)], False
        record, kept = picture.upload(device, of_dome)
        return self._add(picture, self.images, record, kept), True

    def profile(self, profile: IesProfile, device: str) -> int:
        """The number of a profile."""
        if id(profile) in self._numbers:
            return self._numbers[id(profile)]
        return self._add(profile, self.profiles, *profile.upload(device))

    def _add(self, source: object, records: list, record: object, kept: list[object]) -> int:
        records.append(record)
        # The source, too: its id must not become another's.
        self._kept += [source, *kept]
        self._numbers[id(source)] = len(records) - 1
        return len(records) - 1
