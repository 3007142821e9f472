"""Device structs of the ray caster, laid out as the plain structs at the end of ``traversal.h``."""

import warp as wp

from ..numerics import mat34

MESH, SPHERE = 0, 1


@wp.struct
class Ray:
    """A half line; only hits with ``0 <= t < t_max`` count, in units of the direction's length."""

    origin: wp.vec3
    direction: wp.vec3
    t_max: wp.float32


@wp.struct
class Hit:
    """What a ray met first. A miss has ``t`` infinite, ``instance`` and ``face`` -1, ``u`` and ``v`` 0."""

    t: wp.float32
    instance: wp.int32
    face: wp.int32
    u: wp.float32  # weight of vertex 1
    v: wp.float32  # weight of vertex 2


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
    """One geometry, placed in the world."""

    to_object: mat34
    to_world: mat34
    geometry: wp.int32
    placed: wp.int32  # 0 where to_object is the identity


@wp.struct
class World:
    """All instances and the tree over their boxes: what ``scene_closest`` and ``scene_occluded`` walk."""

    geometries: wp.array(dtype=Geometry)
    instances: wp.array(dtype=Instance)
    count: wp.int32
    tree: wp.uint64  # wp.Bvh over the instances' boxes, walked on CUDA
    nodes: wp.uint64  # the same made wide, and its leaves' items, walked on the CPU
    items: wp.uint64
    pad: wp.float32  # growth of those boxes per unit of the ray origin's largest component
