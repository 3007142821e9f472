"""What hangs on which body: from names and rest transforms to what places instances, lights and the camera."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from .bodies import Name, ancestors
from .numerics import mat34d
from .scene import Scene, copies_of, pose_matrix
from .visibility.placing import Attachments

#: Decimal digits of rest transforms that count: what lies below is the rounding of their factors.
_DIGITS = 13


class Rig:
    """The bodies that instances hang on, on a device.

    Attributes:
        attachments: for `WorldTree`.
        moved: instances that hang on a body.
    """

    def __init__(self, scene: Scene, instances: Sequence[tuple[str, int]], rest: np.ndarray, device: str) -> None:
        """For instances by placement path and copy, with rest transforms (I, 4, 4) for row vectors."""
        self._bodies, self._device = scene.bodies, device
        self.attachments = Attachments()
        self.moved = np.zeros(len(instances), bool)
        if not scene.bodies.numbers:
            return
        first, bodies, offsets = [0], [], []
        frames: dict[Name, np.ndarray] = {}
        hung: dict[str, list[Name]] = {}
        for number, (path, copy) in enumerate(instances):
            if path not in hung:
                hung[path] = [name for name in ancestors(path) if name in scene.bodies.numbers]
            names = [name for name in ((path, copy),) if name in scene.bodies.numbers] + hung[path]
            for name in names:
                if name not in frames:
                    frames[name] = body_frame(scene, name)
                bodies.append(scene.bodies.numbers[name])
                offsets.append(offset_from(rest[number], frames[name]))
            first.append(len(bodies))
            self.moved[number] = bool(names)
        if not bodies:
            return
        self.attachments.first = wp.array(np.array(first, np.int32), dtype=wp.int32, device=device)
        self.attachments.bodies = wp.array(np.array(bodies, np.int32), dtype=wp.int32, device=device)
        columns = np.array(offsets).swapaxes(1, 2)[:, :3, :]
        self.attachments.offsets = wp.array(np.ascontiguousarray(columns), dtype=mat34d, device=device)
        self.follow()

    def follow(self) -> None:
        """See the poses as they are now."""
        if self.attachments.first is not None:
            self.attachments.poses, self.attachments.posed = self._bodies.on(self._device)


def posed_transforms(scene: Scene, things: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Paths of lights or cameras and their (4, 4) transforms at rest to those of them that poses have moved.

    Asks the device for the poses, where anything that is named hangs on a body.
    """
    bodies = scene.bodies
    hung = {path: [n for n in ancestors(path) if n in bodies.numbers] for path in things} if bodies.numbers else {}
    hung = {path: names for path, names in hung.items() if names}
    if not hung or bodies.poses is None:
        return {}
    poses, posed = bodies.poses.numpy(), bodies.posed.numpy()
    moved = {}
    for path, names in hung.items():
        name = next((n for n in names if posed[bodies.numbers[n]]), None)
        if name is not None:
            offset = offset_from(things[path], body_frame(scene, name))
            moved[path] = offset @ _matrix(poses[bodies.numbers[name]])
    return moved


def body_frame(scene: Scene, name: Name) -> np.ndarray:
    """(4, 4) transform at rest of what a body is named after; the identity for a path that has none of its own."""
    path, copy = (name, 0) if isinstance(name, str) else name
    placement = scene.placements.get(path)
    if placement is not None and (not isinstance(name, str) or len(placement.transforms) == 1):
        at = np.flatnonzero(copies_of(placement) == copy) if not isinstance(name, str) else [0]
        return placement.transforms[at[0]]
    for things in (scene.lights, scene.cameras):
        if path in things:
            return np.asarray(things[path].transform, np.float64)
    return scene.frames.get(path, np.eye(4))


def offset_from(rest: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """(4, 4) from an object to the frame of a body with its scale taken out, both given at rest, for row vectors.

    For the body's own prim it is the scale and shear that poses keep. Rounding is taken out of it: a scale of 1 is 1.
    """
    with np.errstate(all="ignore"):
        offset = np.asarray(rest, np.float64) @ np.linalg.inv(rigid_part(frame))
    largest = max(np.abs(rest[3, :3]).max(), np.abs(frame[3, :3]).max())
    offset[:3, :3] = _rounded(offset[:3, :3], np.abs(offset[:3, :3]).max())
    offset[3, :3] = _rounded(offset[3, :3], largest)
    return offset


def rigid_part(matrix: np.ndarray) -> np.ndarray:
    """Rotation and translation (4, 4) of a matrix for row vectors: the rotation nearest to ± its linear part.

    The factor that remains is symmetric, and negative where the matrix mirrors, as `GfMatrix4d.Factor` has it.
    """
    rigid = np.eye(4)
    rigid[3, :3] = matrix[3, :3]
    linear = np.asarray(matrix, np.float64)[:3, :3]
    if np.isfinite(linear).all():
        u, _, v = np.linalg.svd(linear)
        rigid[:3, :3] = u @ v * np.sign(np.linalg.det(u @ v))
    return rigid


def _rounded(values: np.ndarray, largest: float) -> np.ndarray:
    """Values to so many digits of the largest."""
    if not 0 < largest < np.inf:
        return values
    return np.round(values, _DIGITS - int(np.ceil(np.log10(largest)))) + 0.0


def _matrix(pose: np.ndarray) -> np.ndarray:
    """(4, 4) for row vectors; NaN where the pose is no number or has no direction."""
    if not np.isfinite(pose).all() or not pose[3:].any():
        return np.full((4, 4), np.nan)
    return pose_matrix(pose, "")
