"""Starting Warp without its remarks."""

from __future__ import annotations

import os
import sys
import tempfile

_NO_DRIVER = b"Could not find or load the NVIDIA CUDA driver"


def start_warp(device: str) -> None:
    """Initialise Warp; on the CPU, drop the native library's remark that there is no CUDA driver.

    Raises:
        ValueError: there is no such device.
    """
    import warp as wp

    wp.config.log_level = wp.LOG_WARNING
    if device != "cpu":
        wp.get_device(device)
        return
    # The remark is printed by C code, past Python's sys.stderr. Everything else that it prints is passed on.
    sys.stderr.flush()
    stderr = os.dup(2)
    with tempfile.TemporaryFile() as caught:
        os.dup2(caught.fileno(), 2)
        try:
            wp.init()
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
            caught.seek(0)
            os.write(2, b"".join(line for line in caught if _NO_DRIVER not in line))
