"""The bodies of a scene: what poses on a device move, by number."""

# Without `from __future__ import annotations`: Warp reads the types of a kernel that a factory makes as they are.

from collections.abc import Sequence
from functools import cache

import numpy as np
import warp as wp

from .given import shared_rows
from .launch import launch

#: Poses that are worth another thread.
_CHUNK = 8192
#: What is moved: everything at or under a prim path, or one copy of a prim that is drawn many times.
Name = str | tuple[str, int]


class Bodies:
    """Numbers and poses of what is moved. Poses are kept as float64 on the device that they came from.

    Attributes:
        numbers: name to number, in the order in which they were first asked for.
        steps: how many times poses were stored.
        poses: (B,) `wp.transformd`, None before the first are stored; those from `len(numbers)` on are unused.
        posed: (B,) int32, 1 where a pose was stored.
    """

    def __init__(self) -> None:
        """No body yet."""
        self.numbers: dict[Name, int] = {}
        self.steps = 0
        self.poses: wp.array | None = None
        self.posed: wp.array | None = None
        self._ids: dict[tuple[tuple[Name, ...], str], wp.array] = {}

    def known(self, names: tuple[Name, ...], device: str) -> wp.array | None:
        """The numbers of names that were asked for before, or None."""
        return self._ids.get((names, device))

    def ids(self, names: tuple[Name, ...], device: str) -> wp.array:
        """(N,) int32 numbers of the names on a device; new names get new ones."""
        if (names, device) not in self._ids:
            numbers = [self.numbers.setdefault(name, len(self.numbers)) for name in names]
            self._ids[names, device] = wp.array(np.array(numbers, np.int32), dtype=wp.int32, device=device)
        return self._ids[names, device]

    def store(self, ids: wp.array, poses: wp.array) -> None:
        """Keep poses (N,) of `wp.transformf` or `wp.transformd` for the bodies with these numbers (N,)."""
        self._make_room(poses.device)
        arguments = [ids, poses, self.poses, self.posed]
        launch(store_kernel(poses.dtype), len(ids), arguments, poses.device, smallest_chunk=_CHUNK)
        self.steps += 1

    def on(self, device: str | wp.Device) -> tuple[wp.array, wp.array]:
        """`poses` and `posed` on a device, with an entry for each number: theirs, or copies."""
        self._make_room(wp.get_device(device) if self.poses is None else self.poses.device)
        return self.poses.to(device), self.posed.to(device)

    def _make_room(self, device: wp.Device) -> None:
        count = len(self.numbers)
        if self.poses is not None and len(self.poses) >= count and self.poses.device == device:
            return
        poses, posed = self.poses, self.posed
        room = max(2 * count, 64)
        self.poses = wp.zeros(room, dtype=wp.transformd, device=device)
        self.posed = wp.zeros(room, dtype=wp.int32, device=device)
        if poses is not None:
            wp.copy(self.poses, poses, count=len(poses))
            wp.copy(self.posed, posed, count=len(posed))


@cache
def wide_pose_function(pose_type: type) -> wp.Function:
    """`wide_pose(pose) -> wp.transformd` of a `wp.transformf` or `wp.transformd`."""
    if pose_type == wp.transformd:

        @wp.func
        def same_pose(pose: wp.transformd) -> wp.transformd:
            return pose

        return same_pose

    @wp.func
    def wide_pose(p: wp.transformf) -> wp.transformd:
        return wp.transformd(
            wp.vec3d(wp.float64(p[0]), wp.float64(p[1]), wp.float64(p[2])),
            wp.quatd(wp.float64(p[3]), wp.float64(p[4]), wp.float64(p[5]), wp.float64(p[6])),
        )

    return wide_pose


@cache
def store_kernel(pose_type: type) -> wp.Kernel:
    """Poses of `wp.transformf` or `wp.transformd` for the bodies with these numbers."""
    wide_pose = wide_pose_function(pose_type)

    @wp.kernel(enable_backward=False, module="unique")
    def store_poses(
        first: wp.int32,
        ids: wp.array(dtype=wp.int32),
        poses: wp.array(dtype=pose_type),
        stored: wp.array(dtype=wp.transformd),
        posed: wp.array(dtype=wp.int32),
    ):
        i = first + wp.tid()
        body = ids[i]
        if body >= 0 and body < stored.shape[0]:
            stored[body] = wide_pose(poses[i])
            posed[body] = 1

    return store_poses


def pose_array(poses: object, device: str | None = None) -> wp.array:
    """Poses as a `wp.array` (N,) of `wp.transformf` or `wp.transformd`; device arrays are taken as they are.

    Args:
        poses: such an array, a `wp.array` (N, 7) of float32 or float64, an array (N, 7) float32 of PyTorch or JAX, or
            numbers (N, 7) on the host, which keep double precision.
        device: where numbers from the host go.

    Raises:
        ValueError: it is nothing of the kind.
    """
    poses = shared_rows(poses, wp.transformf)
    if not isinstance(poses, wp.array):
        host = np.asarray(poses, np.float64)
        if host.ndim != 2 or host.shape[1] != 7:
            raise ValueError(f"poses have the shape {host.shape}, not (N, 7)")
        return wp.array(np.ascontiguousarray(host), dtype=wp.transformd, device=device)
    pairs = {wp.float32: wp.transformf, wp.float64: wp.transformd}
    if poses.ndim == 2 and poses.shape[1] == 7 and poses.dtype in pairs:
        return poses.contiguous().view(pairs[poses.dtype]).flatten()
    if poses.ndim != 1 or poses.dtype not in pairs.values():
        raise ValueError(f"poses are an array {poses.shape} of {poses.dtype.__name__}, not (N,) of wp.transformf")
    return poses


def as_names(paths: Name | Sequence[Name]) -> tuple[Name, ...]:
    """One name or several as a tuple."""
    single = isinstance(paths, str) or (
        isinstance(paths, tuple) and len(paths) == 2 and isinstance(paths[0], str) and not isinstance(paths[1], str)
    )
    return (paths,) if single else tuple(paths)


def ancestors(path: str) -> list[str]:
    """A path and the paths above it, itself first; "/i[/p]" is below the instancer "/i"."""
    above = [path]
    if "[" in path:
        path = path[: path.index("[")]
        above.append(path)
    while path.count("/") > 1:
        path = path[: path.rindex("/")]
        above.append(path)
    return above
