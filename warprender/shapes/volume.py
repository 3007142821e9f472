"""Sampled volumes (NanoVDB, `wp.Volume`) as distances on a dense grid, which `Sdf` interpolates."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..launch import launch

#: More points than this are not made dense: 1 GiB of float32.
MOST_POINTS = 2**28

#: Numbers of `GridData::mGridClass` in NanoVDB.
LEVEL_SET, FOG = 1, 2
#: Where NanoVDB's GridData holds that number, in bytes.
_CLASS_AT = 632


def grid_class(volume: wp.Volume) -> int:
    """What a grid says that its values are: `LEVEL_SET`, `FOG`, or another number of NanoVDB's GridClass."""
    return int(volume.array().numpy()[_CLASS_AT : _CLASS_AT + 4].view(np.uint32)[0])


def dense(volume: wp.Volume) -> tuple[np.ndarray, np.ndarray]:
    """The values around all voxels that a volume stores, and where they are.

    Args:
        volume: a grid of float32 on the CPU, whose axes are those of its world.

    Returns:
        (X, Y, Z) float32 values at the stored voxels' box and one voxel around it, and (2, 3) float64 places of the
        first and the last of them in the volume's world.

    Raises:
        ValueError: it has another type, is empty, turned, mirrored, or too large.
    """
    info = volume.get_grid_info()
    if volume.dtype != wp.float32:
        raise ValueError(f"its grid holds {info.type_str}, not float")
    matrix = np.array(info.transform_matrix, np.float64).reshape(3, 3)
    scale = np.diag(matrix)
    if not (np.isfinite(matrix).all() and (matrix == np.diag(scale)).all() and (scale > 0).all()):
        raise ValueError("its grid is turned, sheared or mirrored: only a scale along its axes is drawn")
    voxels = volume.get_voxels().numpy()
    if not len(voxels):
        raise ValueError("its grid is empty")
    lower, upper = voxels.min(0).astype(np.int64) - 1, voxels.max(0).astype(np.int64) + 1
    size = upper - lower + 1
    if np.prod(size, dtype=float) > MOST_POINTS:
        raise ValueError(f"its {size[0]} x {size[1]} x {size[2]} points are more than {MOST_POINTS} together")
    values = wp.empty(int(np.prod(size)), dtype=wp.float32, device="cpu")
    first, shape = wp.vec3i(*map(int, lower)), wp.vec3i(*map(int, size))
    launch(_look_up, len(values), [volume.id, first, shape, values], "cpu")
    translation = np.array(info.translation, np.float64)
    return values.numpy().reshape(tuple(size)), np.stack([lower, upper]) * scale + translation


@wp.kernel(module="unique", enable_backward=False)
def _look_up(first: wp.int32, volume: wp.uint64, lower: wp.vec3i, size: wp.vec3i, values: wp.array(dtype=wp.float32)):
    number = first + wp.tid()
    k = number % size[2]
    j = number / size[2] % size[1]
    i = number / size[2] / size[1]
    values[number] = wp.volume_lookup_f(volume, lower[0] + i, lower[1] + j, lower[2] + k)
