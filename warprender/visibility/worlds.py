"""Worlds: which instances belong to each of many replicated scenes, and a tree over those of each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from ..launch import RecordedLaunch
from ..records import World
from . import native
from .trees import Memory

#: Members of worlds that are worth another thread.
_CHUNK = 8


@wp.struct
class Worlds:
    """World w has the instances `members[starts[w]]` up to `members[starts[w + 1]]`, of which there are `count` worlds.

    `listed` is `World.listed` of a ray that sees one of them. Each has room in `nodes` and `items` for its tree.
    """

    count: wp.int32
    listed: wp.int32
    members: wp.array(dtype=wp.int32)
    starts: wp.array(dtype=wp.int32)
    nodes: wp.uint64
    items: wp.uint64


@wp.func
def one_world(world: World, worlds: Worlds, number: wp.int32) -> World:
    """All that is there, as rays see it that know one world alone."""
    one = world
    first = worlds.starts[number]
    one.listed = worlds.listed
    one.members = worlds.members
    one.first_member = first
    one.last_member = worlds.starts[number + 1]
    one.nodes = worlds.nodes + wp.uint64(first + number) * wp.uint64(wp.static(native.NODE_BYTES))
    one.items = worlds.items + wp.uint64(first) * wp.uint64(4)
    return one


class WorldTrees:
    """Lists of instances on a device, and on the CPU a tree over each. On CUDA rays go through a list one by one.

    Attributes:
        record: what kernels read; this object must outlive it.
    """

    def __init__(self, lists: Sequence[np.ndarray], device: str, threads: int | None = None) -> None:
        """For W >= 1 lists of instance numbers."""
        members = np.concatenate(lists).astype(np.int32)
        starts = np.cumsum([0, *map(len, lists)]).astype(np.int32)
        self.record = record = Worlds()
        record.count = len(lists)
        record.members = wp.array(members, dtype=wp.int32, device=device)
        record.starts = wp.array(starts, dtype=wp.int32, device=device)
        self._device, self._threads, self._build = wp.get_device(device), threads, None
        if self._device.is_cpu:
            record.listed = 2
            self._nodes = Memory((len(members) + len(lists)) * native.NODE_BYTES)
            self._items = np.where(members < 0, 0, members)
            record.nodes, record.items = self._nodes.address, self._items.ctypes.data
        else:
            record.listed = 1

    def build(self, world: World) -> None:
        """Make the trees for instances where they are now. `world` is the same object at each call."""
        if not self._device.is_cpu:
            return
        if self._build is None:
            arguments = [world, self.record]
            self._build = RecordedLaunch(
                _build_trees, self.record.count, arguments, self._device, self._threads, smallest_chunk=_CHUNK
            )
        self._build.run()


@wp.kernel(enable_backward=False, module="unique")
def _build_trees(first: wp.int32, world: World, worlds: Worlds):
    number = first + wp.tid()
    one = one_world(world, worlds, number)
    native.build_world_tree(world.lowers, world.uppers, one.items, one.last_member - one.first_member, one.nodes)
