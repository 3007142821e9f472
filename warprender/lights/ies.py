"""Photometric profiles: files after IES LM-63 (1986 to 2019), and their look-up.

Types C, B and A differ in what their angles mean; only type C, by far the most common, is read.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..records import ProfileRecord


@dataclass
class IesProfile:
    """Luminous intensity by direction.

    Attributes:
        horizontal: (H,) degrees, increasing from 0 to 360.
        vertical: (V,) degrees from the light's axis, increasing; nothing is emitted outside of them.
        values: (H, V) candela, ballast and multiplier included.
    """

    horizontal: np.ndarray
    vertical: np.ndarray
    values: np.ndarray

    @classmethod
    def parse(cls, text: str) -> IesProfile:
        """A profile from the text of a file.

        Raises:
            ValueError: the text is no LM-63 file, or its photometry is not of type C.
        """
        numbers = _numbers(text)
        if len(numbers) < 13:
            raise ValueError("the photometric data is cut short")
        multiplier, kind = numbers[2], int(numbers[5])
        vertical_count, horizontal_count = int(numbers[3]), int(numbers[4])
        if kind != 1:
            raise ValueError(f"photometry of type {kind} is not read, only type 1 (C)")
        ballast = numbers[10] * numbers[11]
        data = np.array(numbers[13:])
        angles = vertical_count + horizontal_count
        if min(vertical_count, horizontal_count) < 1 or len(data) < angles + vertical_count * horizontal_count:
            raise ValueError("the photometric data is cut short")
        vertical, horizontal = data[:vertical_count], data[vertical_count:angles]
        values = data[angles : angles + vertical_count * horizontal_count].reshape(horizontal_count, vertical_count)
        if (np.diff(vertical) < 0).any() or (np.diff(horizontal) < 0).any():
            raise ValueError("its angles do not increase")
        return cls(*_all_round(horizontal, values * (multiplier * ballast), vertical))

    def power(self) -> float:
        """The intensity integrated over the sphere."""
        azimuth, polar = np.radians(self.horizontal), np.radians(self.vertical)
        if len(polar) < 2:
            return 0.0
        around = np.sum((self.values[1:] + self.values[:-1]) / 2 * np.diff(azimuth)[:, None], axis=0)
        # Linear between angles, so its product with sin θ has a closed integral on each interval.
        a, b, low, high = around[:-1], around[1:], polar[:-1], polar[1:]
        width = np.where(high > low, high - low, 1.0)
        slope = (b - a) / width
        parts = a * np.cos(low) - b * np.cos(high) + slope * (np.sin(high) - np.sin(low))
        return float(np.sum(np.where(high > low, parts, 0.0)))

    def upload(self, device: str) -> tuple[ProfileRecord, list[wp.array]]:
        """The record, and the arrays that must outlive it."""
        record = ProfileRecord()
        record.horizontal = wp.array(np.radians(self.horizontal), dtype=wp.float32, device=device)
        record.vertical = wp.array(np.radians(self.vertical), dtype=wp.float32, device=device)
        record.values = wp.array(np.ascontiguousarray(self.values), dtype=wp.float32, device=device)
        return record, [record.horizontal, record.vertical, record.values]


def _numbers(text: str) -> list[float]:
    """All numbers after the TILT line, the tilt table left out."""
    lines = text.splitlines()
    tilt = next((i for i, line in enumerate(lines) if line.strip().upper().startswith("TILT=")), None)
    if tilt is None:
        raise ValueError("it has no TILT line")
    words = " ".join(lines[tilt + 1 :]).replace(",", " ").split()
    try:
        numbers = [float(word) for word in words]
    except ValueError as error:
        raise ValueError(f"the photometric data holds {error.args[0].rpartition(' ')[2]}") from None
    if lines[tilt].split("=", 1)[1].strip().upper() == "INCLUDE":
        # Lamp-to-luminaire geometry, the number of pairs, angles, factors.
        numbers = numbers[2 + 2 * int(numbers[1]) :]
    return numbers


def _all_round(
    horizontal: np.ndarray, values: np.ndarray, vertical: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Horizontal angles from 0 to 360 and values for them, by the symmetry that the last angle stands for."""
    if len(horizontal) == 1:
        return np.array([0.0, 360.0]), vertical, np.repeat(values, 2, 0)
    first, last = horizontal[0], horizontal[-1]
    if first == 90.0 and last == 270.0:
        # Laterally symmetric about the plane through 90 and 270: mirrored, then counted from 0.
        horizontal, values = np.concatenate([horizontal, 540.0 - horizontal[-2::-1]]), _mirrored(values)
        inside = np.unique(np.concatenate([[0.0, 360.0], horizontal % 360.0]))
        wrapped = np.where(inside < 90.0, inside + 360.0, inside)
        values = np.stack([np.interp(wrapped, horizontal, column) for column in values.T], 1)
        return inside, vertical, values
    while last < 360.0 and last in (90.0, 180.0):
        horizontal, values = np.concatenate([horizontal, 2 * last - horizontal[-2::-1]]), _mirrored(values)
        last = horizontal[-1]
    if last < 360.0:
        horizontal, values = np.append(horizontal, 360.0), np.concatenate([values, values[:1]])
    return horizontal, vertical, values


def _mirrored(values: np.ndarray) -> np.ndarray:
    return np.concatenate([values, values[-2::-1]])


@wp.func
def interval_of(angles: wp.array(dtype=wp.float32), angle: float) -> int:
    """Index i with angles[i] ≤ angle < angles[i + 1], held inside the array."""
    low = wp.int32(0)
    high = angles.shape[0] - 1
    while low + 1 < high:
        middle = (low + high) // 2
        if angles[middle] <= angle:
            low = middle
        else:
            high = middle
    return low


@wp.func
def profile_value(profile: ProfileRecord, theta: float, phi: float) -> float:
    """Bilinear in the angles; 0 outside of the vertical ones."""
    last = profile.vertical.shape[0] - 1
    # Rounded angles at either end are still inside.
    if last < 1 or theta < profile.vertical[0] - 1.0e-6 or theta > profile.vertical[last] + 1.0e-6:
        return 0.0
    i = interval_of(profile.horizontal, phi)
    j = interval_of(profile.vertical, theta)
    s = share(profile.horizontal[i], profile.horizontal[i + 1], phi)
    t = share(profile.vertical[j], profile.vertical[j + 1], theta)
    low = profile.values[i, j] * (1.0 - t) + profile.values[i, j + 1] * t
    high = profile.values[i + 1, j] * (1.0 - t) + profile.values[i + 1, j + 1] * t
    return low * (1.0 - s) + high * s


@wp.func
def share(low: float, high: float, x: float) -> float:
    """Where x lies between two neighbours: 0 to 1."""
    if high <= low:
        return 0.0
    return wp.clamp((x - low) / (high - low), 0.0, 1.0)
