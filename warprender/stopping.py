"""What ends a render: samples, an error, a time; and how many samples each pass takes until then."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from .errors import SceneError
from .given import is_number, shown

#: Samples a pixel when neither samples, error nor seconds is asked for.
DEFAULT_SAMPLES = 64
#: The frame's error is trusted from this many samples a pixel on.
FEWEST_FOR_ERROR = 16
#: A pass is short enough to report progress and to stop in time.
_PASS_SECONDS = 0.25
#: Samples between two looks at the error: it falls by 5 % at most meanwhile, and looking takes time too.
_CHECK_FACTOR = 1.1
#: Share of the time limit that is not worth another launch.
_SPARE_SHARE = 0.005


@dataclass(frozen=True)
class Limits:
    """Whichever of these is reached first ends a render; None is no limit.

    Attributes:
        samples: a pixel.
        error: relative RMS standard error of the frame.
        seconds: wall-clock time.

    Raises:
        SceneError: a limit is not a number above 0.
    """

    samples: float | None = None
    error: float | None = None
    seconds: float | None = None

    def __post_init__(self) -> None:
        for name in ("samples", "error", "seconds"):
            value = getattr(self, name)
            if value is not None and not (is_number(value) and value > 0):
                raise SceneError(f"{name} must be a number above 0, not {shown(value)}")

    @property
    def most_samples(self) -> float:
        """Samples a pixel at most."""
        if self.samples is not None:
            return self.samples
        return DEFAULT_SAMPLES if self.error is None and self.seconds is None else 2**30


class Passes:
    """The passes of a render, until a limit is reached: an iterator over their sizes in samples a pixel.

    A size below 1 is the share of the pixels that get one more sample; it is the last. A pass takes the time from one
    step of the iterator to the next.

    Attributes:
        taken: samples a pixel before the pass at hand.
    """

    def __init__(
        self,
        limits: Limits,
        pixels: int,
        error: Callable[[], float],
        report: Callable[[float], None] | None = None,
        pilot: int = 0,
    ) -> None:
        """For a picture of so many pixels.

        Args:
            limits: what ends the render.
            pixels: of the picture.
            error: the frame's error as it is now.
            report: called between passes with the share done.
            pilot: samples that a pilot pass takes of every pixel; sizes after it need not be whole. 0: no pilot.
        """
        self._limits, self._pixels, self._error, self._report = limits, pixels, error, report
        self._pilot = pilot
        self.taken = 0

    def __iter__(self) -> Iterator[float]:
        limits, most = self._limits, self._limits.most_samples
        batch, start, next_check = 1, time.perf_counter(), FEWEST_FOR_ERROR
        while self.taken < most:
            begin = time.perf_counter()
            # Below 1: one more sample for a part of the pixels.
            batch = self._rounded(min(batch, most - self.taken))
            yield batch
            self.taken += batch
            now = time.perf_counter()
            elapsed, per_sample = now - start, (now - begin) / batch
            left = math.inf if limits.seconds is None else limits.seconds - elapsed
            if batch < 1 or left <= _SPARE_SHARE * elapsed:
                return
            if limits.error is not None and self.taken >= next_check:
                if self._error() <= limits.error:
                    return
                next_check = math.ceil(_CHECK_FACTOR * self.taken)
            batch = max(1, min(2 * batch, int(min(_PASS_SECONDS, left) / per_sample)))
            if limits.error is not None:
                # No further than to the next look.
                batch = max(1, min(batch, next_check - self.taken))
            if left < per_sample:
                batch = max(1, round(self._pixels * left / per_sample)) / self._pixels
            if self._report is not None:
                self._report(max(self.taken / most, elapsed / limits.seconds if limits.seconds else 0.0))

    def _rounded(self, batch: float) -> float:
        """The size of the next pass where `batch` is the most that it may have."""
        if self._pilot:
            if self.taken >= self._pilot:
                return batch
            batch = min(batch, self._pilot - self.taken)
        return int(batch) if batch >= 1 else batch
