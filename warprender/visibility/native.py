"""The native functions: the only file that touches Warp's internals.

The headers beside this file read the layout of Warp's ``BVH`` and ``Mesh``, which is not public.
``SUPPORTED`` says whether the installed Warp is the version that they were checked with.

Each function's source is the headers' text and a few lines of its own. Warp hashes that text, so a changed
header is a changed module (an ``#include`` would not be).
"""

from pathlib import Path

import warp as wp

from ..records import Geometry, Instance, World

SUPPORTED = wp.__version__.split(".")[:2] == ["1", "19"]

RAYS_PER_ITEM = 64  # rays that one item of a batch kernel traces: enough to keep eight walks in flight

NODE_BYTES, BLOCK_BYTES, PLAN_BYTES = 224, 160, 40  # of the wide trees' structs
FEW_BYTES = 64 + 8 * 416  # of the struct that holds all triangles of a small scene
FEW_FACES = 64  # that fit into it
MAX_DEPTH = 36  # of a wide tree: the length of the walks' stacks

_TRAVERSAL = Path(__file__).with_name("traversal.h").read_text()
_INSTANCES = _TRAVERSAL + Path(__file__).with_name("instances.h").read_text()
_COLLAPSE = (
    _TRAVERSAL
    + Path(__file__).with_name("collapse.h").read_text()
    + f"""
    static_assert(sizeof(Wide::Node) == {NODE_BYTES}, "NODE_BYTES");
    static_assert(sizeof(Wide::Block) == {BLOCK_BYTES}, "BLOCK_BYTES");
    static_assert(sizeof(Collapse::Plan) == {PLAN_BYTES}, "PLAN_BYTES");
    static_assert((int)(Wide::depth) == {MAX_DEPTH}, "MAX_DEPTH");
"""
)

_WORLD_TREES = _COLLAPSE + Path(__file__).with_name("world_trees.h").read_text()

bits5 = wp.types.vector(length=5, dtype=wp.int32)

_WORLD = """
    static_assert(sizeof(*world.instances.data) == sizeof(Instance), "Instance");
    static_assert(sizeof(*world.geometries.data) == sizeof(Geometry), "Geometry");
    World w = { (const Geometry*)(world.geometries.data), (const Instance*)(world.instances.data),
        world.count, world.tree, world.nodes, world.items, world.few, world.pad, world.listed, world.first_member,
        world.last_member, world.members.data, world.lowers.data, world.uppers.data };
    Lane ray;
    Answer best;
"""


def scene_functions(prefix: str = ""):
    """The native closest-hit and any-hit queries over a ``World``.

    Args:
        prefix: C++ text before the header. ``#define WR_SCALAR`` takes the CUDA form on the CPU, for tests;
            ``#define WR_FAST`` asks Warp's own query for each mesh, which leaks.
    """

    @wp.func_native(
        prefix
        + _INSTANCES
        + _WORLD
        + """
    World::solve(w, origin, direction, t_max, t_after, instance_after, face_after, false, ray, best);
    return World::result(ray, best);
    """
    )
    def closest(
        world: World,
        origin: wp.vec3,
        direction: wp.vec3,
        t_max: wp.float32,
        t_after: wp.float32,
        instance_after: wp.int32,
        face_after: wp.int32,
    ) -> bits5: ...

    @wp.func_native(
        prefix
        + _INSTANCES
        + _WORLD
        + """
    return World::solve(w, origin, direction, t_max, -1.0f, -1, -1, true, ray, best);
    """
    )
    def occluded(world: World, origin: wp.vec3, direction: wp.vec3, t_max: wp.float32) -> wp.bool: ...

    return closest, occluded


@wp.struct
class WideTree:
    """One mesh's tree: addresses of its nodes and blocks, whether it stays in a core's own cache, and its scale."""

    nodes: wp.uint64
    blocks: wp.uint64
    cached: wp.bool
    scale: wp.float32


@wp.struct
class RayBatch:
    """Rays in arrays (N,). `t_max`, and `t_after` with `face_after`, have one entry for all rays or one for each."""

    origins: wp.array(dtype=wp.vec3)
    directions: wp.array(dtype=wp.vec3)
    t_max: wp.array(dtype=wp.float32)
    t_after: wp.array(dtype=wp.float32)
    face_after: wp.array(dtype=wp.int32)


@wp.struct
class HitBatch:
    """Where the closest hits of a `RayBatch` go, arrays (N,)."""

    t: wp.array(dtype=wp.float32)
    face: wp.array(dtype=wp.int32)
    u: wp.array(dtype=wp.float32)
    v: wp.array(dtype=wp.float32)


_BATCH = (
    _TRAVERSAL
    + """
    Batch batch = { (const Wide::Node*)(tree.nodes), (const Wide::Block*)(tree.blocks), tree.cached, tree.scale,
        rays.origins.data, rays.directions.data, rays.t_max, rays.t_after, rays.face_after, nullptr, nullptr, nullptr,
        nullptr, nullptr };
"""
)


@wp.func_native(
    _BATCH
    + """
    batch.t = hits.t.data;
    batch.face = hits.face.data;
    batch.u = hits.u.data;
    batch.v = hits.v.data;
    Group::run(batch, first, end);
"""
)
def closest_batch(tree: WideTree, rays: RayBatch, first: wp.int32, end: wp.int32, hits: HitBatch):
    """Closest hits of rays [first, end) with one tree (CPU)."""
    ...


@wp.func_native(_BATCH + "batch.occluded = occluded.data; Group::run(batch, first, end);")
def occluded_batch(tree: WideTree, rays: RayBatch, first: wp.int32, end: wp.int32, occluded: wp.array(dtype=wp.bool)):
    """Whether rays [first, end) hit anything in one tree (CPU)."""
    ...


@wp.func_native(
    _COLLAPSE
    + """
    const wp::BVH tree = kind == 0 ? wp::mesh_get(id).bvh : wp::bvh_get(id);
    Collapse::layout(tree, (Collapse::Plan*)(plans), (Wide::Node*)(nodes), (Wide::Block*)(blocks),
        (int*)(items), slots.data, counts.data);
"""
)
def collapse(
    kind: wp.int32,  # 0: id is a wp.Mesh, 1: a wp.Bvh
    id: wp.uint64,
    plans: wp.uint64,
    nodes: wp.uint64,
    blocks: wp.uint64,
    items: wp.uint64,
    slots: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
):
    """Lay out the wide nodes of a tree; their boxes are left to the refit (CPU)."""
    ...


@wp.func_native(
    _COLLAPSE
    + """
    return Refit::leaves((Wide::Node*)(nodes), (Wide::Block*)(blocks), slots.data, points.data,
        indices.data, scale, first, end, count);
"""
)
def refit_leaves(
    nodes: wp.uint64,
    blocks: wp.uint64,
    slots: wp.array(dtype=wp.int32),
    points: wp.array(dtype=wp.vec3),
    indices: wp.array(dtype=wp.int32),
    scale: wp.float32,
    first: wp.int32,
    end: wp.int32,
    count: wp.int32,
) -> wp.int32:
    """Copy the points of the leaves that begin in blocks [first, end), box them, count bad faces (CPU)."""
    ...


@wp.func_native(_COLLAPSE + "Refit::items((Wide::Node*)(nodes), (const int*)(items), lowers.data, uppers.data, count);")
def refit_items(
    nodes: wp.uint64,
    items: wp.uint64,
    lowers: wp.array(dtype=wp.vec3),
    uppers: wp.array(dtype=wp.vec3),
    count: wp.int32,
):
    """Box the leaves of a tree of instances (CPU)."""
    ...


@wp.func_native(_COLLAPSE + "Refit::inner((Wide::Node*)(nodes), count, summary.data);")
def refit_inner(nodes: wp.uint64, count: wp.int32, summary: wp.array(dtype=wp.float32)):
    """Box all inner nodes from their children (CPU)."""
    ...


@wp.func_native(
    _INSTANCES
    + f"""
    static_assert(sizeof(Few) == {FEW_BYTES}, "FEW_BYTES");
"""
    + """
    Few::gather(*(Few*)(few), (const Geometry*)(geometries.data), (const Instance*)(instances.data), count);
"""
)
def gather_few(
    few: wp.uint64, geometries: wp.array(dtype=Geometry), instances: wp.array(dtype=Instance), count: wp.int32
):
    """Collect the triangles of all instances, if they are few and only moved (CPU)."""
    ...


@wp.func_native(
    _WORLD_TREES
    + """
    WorldTree::build(lowers.data, uppers.data, (int*)(items), count, (Wide::Node*)(nodes));
"""
)
def build_world_tree(
    lowers: wp.array(dtype=wp.vec3),
    uppers: wp.array(dtype=wp.vec3),
    items: wp.uint64,
    count: wp.int32,
    nodes: wp.uint64,
):
    """Make a tree over the instances that `items` names, with boxes (CPU); room for `count` + 1 nodes."""
    ...


@wp.func_native(
    """
    const wp::BVH& tree = wp::mesh_get(id).bvh;
    wp::BVHPackedNodeHalf corner = wp::bvh_load_node(upper ? tree.node_uppers : tree.node_lowers, *tree.root);
    return wp::vec3(corner.x, corner.y, corner.z);
"""
)
def mesh_corner(id: wp.uint64, upper: wp.int32) -> wp.vec3:
    """Lower or upper corner of the box of a wp.Mesh's tree, as of its last refit."""
    ...
