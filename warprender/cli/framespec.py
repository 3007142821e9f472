"""usdrecord's frame ranges, and the file names they are written to.

A frame range is `a`, `a:b` or `a:bxs`, several separated by commas: from a to b inclusive in steps of s,
which may be fractional and, when b lies before a, is negative (-1 if it is not given). A file name for
several frames holds one placeholder, `###` or `###.###`: as wide as all of it, with as many decimals as
hashes after the dot.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)"
_RANGE = re.compile(rf"({_NUMBER})(?::({_NUMBER})(?:x({_NUMBER}))?)?")
_PLACEHOLDER = re.compile(r"[^#]*?(#+(?:\.#+)?)[^#]*")
_MOST_FRAMES = 1_000_000


@dataclass(frozen=True)
class FrameSpec:
    """Time codes in drawing order, and the decimals that tell them apart in a file name."""

    times: tuple[float, ...]
    decimals: int


def parse_frames(text: str) -> FrameSpec:
    """Parse comma-separated frame ranges.

    Raises:
        ValueError: the text is no range, its stride is 0 or leads away from its end, or it is absurdly long.
    """
    times: list[float] = []
    decimals = 0
    for part in text.split(","):
        start, count, stride = _parse_range(part.strip())
        if len(times) + count > _MOST_FRAMES:
            raise ValueError(f"frame range {part!r} has more than {_MOST_FRAMES:,} frames")
        times += [float(start + i * stride) for i in range(count)]
        decimals = max(decimals, _decimals(start), _decimals(stride) if count > 1 else 0)
    return FrameSpec(tuple(times), decimals)


def frame_paths(pattern: str, spec: FrameSpec | None) -> list[str]:
    """The file of each frame; `[pattern]` when there is no frame range.

    Raises:
        ValueError: a placeholder is missing, not asked for, not the only one, or too short for fractions.
    """
    match = _PLACEHOLDER.fullmatch(pattern)
    if spec is None:
        if match:
            raise ValueError(f"{pattern}: a frame placeholder ({match[1]}) needs --frames")
        return [pattern]
    if not match:
        raise ValueError(f"{pattern}: with --frames it must hold exactly one placeholder, ### or ###.###")
    whole, _, fraction = match[1].partition(".")
    if len(fraction) < spec.decimals:
        needed = f"{whole}.{'#' * spec.decimals}"
        raise ValueError(f"{pattern}: these frames need {spec.decimals} decimals, as in {needed}")
    first, last = match.span(1)
    return [f"{pattern[:first]}{time:0{len(match[1])}.{len(fraction)}f}{pattern[last:]}" for time in spec.times]


def _parse_range(text: str) -> tuple[Decimal, int, Decimal]:
    """Start, number of frames and stride, in decimals: 101:104x0.1 ends at 104, which floats may miss."""
    match = _RANGE.fullmatch(text)
    if not match:
        raise ValueError(f"frame range {text!r} is none of a, a:b, a:bxs")
    start = Decimal(match[1])
    end = Decimal(match[2]) if match[2] else start
    stride = Decimal(match[3]) if match[3] else Decimal(1 if end >= start else -1)
    if stride == 0 or (end - start) * stride < 0:
        raise ValueError(f"frame range {text!r}: a stride of {stride} does not lead from {start} to {end}")
    return start, int((end - start) // stride) + 1, stride


def _decimals(number: Decimal) -> int:
    return max(0, -number.normalize().as_tuple().exponent)
