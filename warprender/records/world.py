"""Where the shapes are: what rays walk."""

from __future__ import annotations

import warp as wp

from ..numerics import mat34

#: Kinds of `Geometry`.
MESH, SPHERE = 0, 1

#: `Instance.placed` of what is hidden or has no usable transform; its `to_object` is zero, which no ray enters.
NOT_DRAWN = 2
#: `Instance.placed` where `to_object` moves points and no more.
MOVED = 3


@wp.struct
class Geometry:
    """A shape in its own space: the triangles of a tree, or a sphere about the origin."""

    kind: wp.int32  # MESH or SPHERE
    radius: wp.float32
    mesh: wp.uint64  # wp.Mesh, walked on CUDA; 0: no faces
    nodes: wp.uint64  # wide nodes and blocks of triangles, walked on the CPU; 0: no faces
    blocks: wp.uint64


@wp.struct
class Instance:
    """One geometry, placed in the world; matrices for column vectors. The tree's scale is in `to_object`."""

    to_object: mat34
    to_world: mat34
    geometry: wp.int32
    placed: wp.int32  # 0 where to_object is the identity, MOVED, NOT_DRAWN, or 1 for anything else


@wp.struct
class World:
    """All instances and the tree over their boxes: what ``scene_closest`` and ``scene_occluded`` walk.

    Where `listed` is not 0, only `members` from number `first_member` up to `last_member` are there. At 1 no tree is
    walked; at 2 (on the CPU) `nodes` and `items` are a tree over them.
    """

    geometries: wp.array(dtype=Geometry)
    instances: wp.array(dtype=Instance)
    count: wp.int32
    tree: wp.uint64  # wp.Bvh over the instances' boxes, walked on CUDA
    nodes: wp.uint64  # the same made wide, and its leaves' items, walked on the CPU
    items: wp.uint64
    few: wp.uint64  # all triangles, where they are few and only moved (CPU), or 0
    pad: wp.float32  # growth of those boxes per unit of the ray origin's largest component
    lowers: wp.array(dtype=wp.vec3)
    uppers: wp.array(dtype=wp.vec3)
    members: wp.array(dtype=wp.int32)
    listed: wp.int32
    first_member: wp.int32
    last_member: wp.int32
