"""Starting Warp without its remarks."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager

_NO_DRIVER = b"Could not find or load the NVIDIA CUDA driver"


def start_warp(device: str) -> None:
    """Initialise Warp and check that `device` exists.

    Raises:
        ValueError: there is no such device.
    """
    import warp as wp

    wp.config.log_level = wp.LOG_WARNING
    with without_lines(_NO_DRIVER):
        wp.init()
    try:
        wp.get_device(device)
    except ValueError:
        found = ", ".join(d.alias for d in wp.get_devices())
        raise ValueError(f"--device {device}: there is no such device; there is {found}") from None


@contextmanager
def without_lines(unwanted: bytes) -> Iterator[None]:
    """Drop lines that C code prints past Python's `sys.stderr`, and pass on all others."""
    sys.stderr.flush()
    stderr = os.dup(2)
    with tempfile.TemporaryFile() as caught:
        os.dup2(caught.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
            caught.seek(0)
            os.write(2, b"".join(line for line in caught if unwanted not in line))
