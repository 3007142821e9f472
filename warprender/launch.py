"""One launch for every kernel: spread over CPU threads in chunks, plain on CUDA.

Every kernel takes `first: wp.int32` as its first argument and works on item `first + wp.tid()`. A Warp launch on the
CPU is one thread that releases the GIL, so chunks run side by side. No two items may write one address: the CPU's
atomics are plain reads and writes. Which thread takes a chunk changes no bit of the result.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from pathlib import Path

import numpy as np
import warp as wp

# A chunk must be long against a launch (about 20 µs) and short against the whole, so that threads end together.
_CHUNKS_PER_THREAD = 12
_SMALLEST_CHUNK = 256
_SMALLEST_ROWS = 8

#: Who is told, once, that a kernel has to be compiled; at most one.
_to_be_told: list[Callable[[], None]] = []


def tell_of_compiling(tell: Callable[[], None] | None) -> None:
    """Call `tell` once, before a kernel is compiled that Warp's cache does not have; None tells nobody."""
    _to_be_told[:] = [tell] if tell else []


def is_compiled(kernel: wp.Kernel, device: wp.Device) -> bool:
    """Whether Warp's cache has a kernel for the device. A CPU launch has block size 1."""
    name = kernel.module.get_module_identifier(1 if device.is_cpu else 256)
    return any(Path(wp.config.kernel_cache_dir, name).glob("*.o" if device.is_cpu else "*.[cp]*[nx]"))


def launch(
    kernel: wp.Kernel,
    count: int,
    arguments: Sequence,
    device: str | wp.Device,
    threads: int | None = None,
    smallest_chunk: int = _SMALLEST_CHUNK,
) -> None:
    """Run `kernel` on items 0 … count - 1 and return when they are done (CPU) or queued (CUDA).

    Args:
        kernel: takes `first: wp.int32` before `arguments`.
        count: number of items; 0 does nothing.
        arguments: the kernel's other arguments.
        device: where to run.
        threads: CPU threads, None for all cores; without meaning on CUDA.
        smallest_chunk: items that are worth a launch; 1 for items of many microseconds.
    """
    device = wp.get_device(device)
    if count <= 0:
        return
    if _to_be_told and not is_compiled(kernel, device):
        _to_be_told.pop()()
    threads = thread_count(threads) if device.is_cpu else 1
    chunk = _chunk(count, threads, smallest_chunk)
    if chunk >= count:
        wp.launch(kernel, count, [0, *arguments], device=device)
        return

    def run(first: int) -> None:
        wp.launch(kernel, min(chunk, count - first), [first, *arguments], device=device)

    # The module loads here and once: Warp's loader is not made for several threads. CPU launches have block size 1.
    kernel.module.load(device, 1)
    _spread([partial(run, first) for first in range(0, count, chunk)], threads)


def launch_pixels(
    kernel: wp.Kernel,
    width: int,
    height: int,
    arguments: Sequence,
    device: str | wp.Device,
    threads: int | None = None,
) -> None:
    """Run a kernel over the pixels of a picture: item i is the `columns` pixels from number i · columns on.

    They lie in one row. On the CPU they are a whole row, for an item costs as much as drawing a pixel, and finding
    (x, y) from a pixel's number costs a division. On CUDA there is one pixel an item.

    Args:
        kernel: takes `first: wp.int32` and `columns: wp.int32` before `arguments`.
        width: of the picture in pixels.
        height: likewise.
        arguments: the kernel's other arguments.
        device: where to run.
        threads: CPU threads, None for all cores; without meaning on CUDA.
    """
    columns, smallest = _columns(width, device)
    launch(kernel, width * height // columns, [columns, *arguments], device, threads, smallest)


class RecordedLaunch:
    """A launch as `launch` makes it, prepared once.

    Structs among its arguments are read when it runs: what their fields hold by then counts. They must outlive it.
    """

    def __init__(
        self,
        kernel: wp.Kernel,
        count: int,
        arguments: Sequence,
        device: str | wp.Device,
        threads: int | None = None,
        smallest_chunk: int = _SMALLEST_CHUNK,
    ) -> None:
        """Load the kernel and record; arguments as of `launch`."""
        device = wp.get_device(device)
        self._threads = thread_count(threads) if device.is_cpu else 1
        chunk = max(_chunk(count, self._threads, smallest_chunk), 1)
        self._launches = [
            wp.launch(kernel, min(chunk, count - first), [first, *arguments], device=device, record_cmd=True)
            for first in range(0, count, chunk)
        ]
        self._runs = [launch.launch for launch in self._launches]

    @classmethod
    def of_pixels(
        cls,
        kernel: wp.Kernel,
        width: int,
        height: int,
        arguments: Sequence,
        device: str | wp.Device,
        threads: int | None = None,
    ) -> RecordedLaunch:
        """A launch as `launch_pixels` makes it."""
        columns, smallest = _columns(width, device)
        return cls(kernel, width * height // columns, [columns, *arguments], device, threads, smallest)

    def replace(self, number: int, argument: wp.array) -> None:
        """Take another array of the same type for `arguments[number]` of the constructor from now on."""
        for launch in self._launches:
            launch.set_param_at_index(number + 1, argument)

    def run(self) -> None:
        """Run, and return when it is done (CPU) or queued (CUDA)."""
        if len(self._runs) == 1:
            self._runs[0]()
        else:
            _spread(self._runs, self._threads)


def _spread(runs: list[Callable[[], None]], threads: int) -> None:
    """Run all, each on the thread that is free first. This thread works too: to wake another costs as much as a chunk.

    The threads take turns at one iterator, which the GIL makes safe.
    """
    waiting = iter(runs)

    def work() -> None:
        for run in waiting:
            run()

    others = [_pool(threads).submit(work) for _ in range(min(threads, len(runs)) - 1)]
    try:
        work()
    finally:
        # After an error or an interruption nothing more is begun.
        for _ in waiting:
            pass
        for other in others:
            other.result()


def _columns(width: int, device: str | wp.Device) -> tuple[int, int]:
    """Pixels an item, and items that are worth a launch."""
    return (width, _SMALLEST_ROWS) if wp.get_device(device).is_cpu else (1, _SMALLEST_CHUNK)


def _chunk(count: int, threads: int, smallest: int) -> int:
    """Items of one launch."""
    return count if threads == 1 else max(smallest, -(-count // (threads * _CHUNKS_PER_THREAD)))


def thread_count(threads: int | None) -> int:
    """`threads`, or the number of cores that this process may use.

    Raises:
        ValueError: it is no whole number from 1 on.
    """
    if threads is not None:
        if not isinstance(threads, (int, np.integer)) or threads < 1:
            raise ValueError(f"threads must be a whole number, 1 or more, not {threads!r}")
        return int(threads)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="warprender")
