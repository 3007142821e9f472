"""Clip positions and indices as users give them, checked and on the device."""

from __future__ import annotations

import numpy as np
import warp as wp


def device_of(positions: np.ndarray | wp.array, indices: np.ndarray | wp.array, device: object) -> wp.Device:
    """The device asked for; for None that of a `wp.array` given, else the CPU."""
    if device is None:
        device = next((a.device for a in (positions, indices) if isinstance(a, wp.array)), "cpu")
    return wp.get_device(device)


def position_array(positions: np.ndarray | wp.array, device: wp.Device) -> wp.array:
    """(N,) `wp.vec4` on the device; ValueError for another shape or type."""
    if not isinstance(positions, wp.array):
        positions = np.asarray(positions)
        if positions.ndim != 2 or positions.shape[1] != 4:
            raise ValueError(f"clip positions must have shape (N, 4), not {positions.shape}")
        return wp.array(np.ascontiguousarray(positions, np.float32), dtype=wp.vec4, device=device)
    if positions.dtype == wp.float32 and positions.ndim == 2 and positions.shape[1] == 4:
        positions = positions.contiguous().view(wp.vec4).flatten() if positions.size else wp.empty(0, wp.vec4)
    if positions.dtype != wp.vec4 or positions.ndim != 1:
        raise ValueError(f"clip positions must be (N,) vec4 or (N, 4) float32, not {positions.shape} {positions.dtype}")
    return positions.contiguous().to(device)


def index_array(indices: np.ndarray | wp.array, device: wp.Device) -> wp.array:
    """(3 F,) int32 on the device; ValueError for another shape or type."""
    shape = tuple(indices.shape if isinstance(indices, wp.array) else np.shape(indices))
    if len(shape) not in (1, 2) or (len(shape) == 2 and shape[1] != 3) or int(np.prod(shape)) % 3:
        raise ValueError(f"indices must have shape (F, 3) or (3 F,), not {shape}")
    if isinstance(indices, wp.array) and indices.dtype == wp.int32:
        return indices.contiguous().flatten().to(device)
    host = np.reshape(indices.numpy() if isinstance(indices, wp.array) else indices, -1)
    if not host.size:
        return wp.empty(0, wp.int32, device=device)
    if host.dtype.kind not in "iu":
        raise ValueError(f"indices must be integers, not {host.dtype}")
    if host.dtype != np.int32:
        # What int32 cannot hold is out of range as it is; -1 says so to the kernel.
        host = np.where((host < 0) | (host > 2**31 - 1), -1, host).astype(np.int32)
    return wp.array(host, dtype=wp.int32, device=device)
