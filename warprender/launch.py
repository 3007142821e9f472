"""One launch that spreads a kernel over CPU threads, and is a plain launch on CUDA.

Every kernel launched here takes ``first: wp.int32`` as its first argument; its item is ``first + wp.tid()``.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import warp as wp

CHUNKS_PER_THREAD = 8  # enough to even out items of unequal cost; a launch costs about 20 us


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="warprender")


def launch(kernel, count, inputs, outputs=(), device=None, threads=None):
    """Run ``kernel`` for items 0 … count - 1 and wait for it on the CPU.

    Args:
        kernel: A ``wp.kernel`` whose first argument is ``first: wp.int32``.
        count: Number of items.
        inputs: The kernel's arguments after ``first``.
        outputs: The arguments it writes, after the inputs.
        device: Warp device, default the current one.
        threads: CPU threads, default all cores. Ignored on CUDA.
    """
    device = wp.get_device(device)
    threads = threads or os.cpu_count() or 1
    arguments = [*inputs, *outputs]
    if not device.is_cpu or threads == 1 or count <= threads:
        if count > 0:
            wp.launch(kernel, dim=count, inputs=[0, *arguments], device=device)
        return
    kernel.module.load(device, block_dim=1)  # modules load in one thread; 1 is what a CPU launch asks for
    size = -(-count // (threads * CHUNKS_PER_THREAD))

    def run(first):
        wp.launch(kernel, dim=min(size, count - first), inputs=[first, *arguments], device=device)

    list(_pool(threads).map(run, range(0, count, size)))
