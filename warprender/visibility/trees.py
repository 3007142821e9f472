"""Trees on a device: over one mesh's triangles, and Warp's binary trees made wide."""

import numpy as np
import warp as wp

from ..launch import launch
from ..records import MESH, SPHERE, Geometry
from . import native

BLOCKS_PER_ITEM = 512  # blocks of triangles that one item of the refit fills
CACHE_LINE = 64
OWN_CACHE = 512 * 1024  # bytes: half of a common second-level cache
REBUILD_AT = 2.0  # refit trees lose quality: rebuild when a ray is expected to visit this many times more

CLEAN_RANGE = 1e-9, 1e9  # coordinates outside are rescaled: products of lengths would leave float32's range


class Memory:
    """Uninitialised bytes that begin on a cache line; numpy asks for huge pages, which spares TLB misses."""

    def __init__(self, size):
        self.data = np.empty(size + CACHE_LINE, np.uint8)
        self.address = self.data.ctypes.data + -self.data.ctypes.data % CACHE_LINE


class WideTree:
    """Wide nodes made from one of Warp's binary trees, and the blocks or items of its leaves (CPU)."""

    def __init__(self, kind, tree_id, leaves):
        inner = max(leaves, 1)
        plans = Memory(2 * leaves * native.PLAN_BYTES)
        counts = wp.zeros(3, dtype=wp.int32, device="cpu")
        self.nodes = Memory(inner * native.NODE_BYTES)
        leaf_bytes = native.BLOCK_BYTES if kind == 0 else 4
        self.leaves = Memory(leaves * leaf_bytes)
        blocks, items = (self.leaves.address, 0) if kind == 0 else (0, self.leaves.address)
        self.slots = wp.empty(leaves if kind == 0 else 0, dtype=wp.int32, device="cpu")
        arguments = [kind, tree_id, plans.address, self.nodes.address, blocks, items, self.slots, counts]
        wp.launch(_collapse, dim=1, inputs=arguments, device="cpu")
        self.count, self.blocks, depth = (int(n) for n in counts.numpy())
        if not 0 < depth <= native.MAX_DEPTH:
            raise RuntimeError("Warp built a tree that the watertight walk cannot read")
        self.bytes = self.count * native.NODE_BYTES + self.blocks * leaf_bytes
        self.summary = wp.zeros(14, dtype=wp.float32, device="cpu")

    def box_inner(self):
        """Box the inner nodes; the leaves' boxes must stand."""
        inputs = [self.nodes.address, self.count, self.summary]
        wp.launch(_refit_inner, dim=1, inputs=inputs, device="cpu")

    def box_items(self, lowers, uppers):
        """Box a tree of instances anew: wp.arrays (I,) of their corners."""
        inputs = [self.nodes.address, self.leaves.address, lowers, uppers, self.count]
        wp.launch(_refit_items, dim=1, inputs=inputs, device="cpu")
        self.box_inner()

    @property
    def visits(self):
        """Nodes and leaves that a ray through the tree is expected to visit (surface area heuristic)."""
        return float(self.summary.numpy()[6])

    def is_built(self):
        """Compare from now on with the boxes as they are."""
        self.visits_built = self.visits
        self.summary.numpy()[8:] = self.summary.numpy()[:6]

    @property
    def has_degraded(self):
        """Whether building anew should pay: refitted trees lose quality.

        Rays are taken through the whole box as it is, and as it was at the build.
        """
        return bool((self.summary.numpy()[6:8] > REBUILD_AT * self.visits_built).any())

    @property
    def box(self):
        """Lower and upper corner."""
        box = self.summary.numpy()
        return box[:3].copy(), box[3:6].copy()


class MeshTree:
    """The triangles of one mesh, ready for rays.

    Args:
        points: wp.array (N,) of wp.vec3, read at the build and at each refit, never written.
        indices: wp.array (3F,) of wp.int32, in range.
        wide: Make wide nodes, for the watertight walk on the CPU; otherwise keep the wp.Mesh.
        threads: CPU threads, default all.
        keep_mesh: Keep the wp.Mesh beside wide nodes.

    Attributes:
        mesh: The wp.Mesh over ``scale * points``, or None.
        scale: A power of two: the tree holds ``scale * points``. 1 unless coordinates leave 1e-9 … 1e9.
    """

    def __init__(self, points, indices, wide=None, threads=None, keep_mesh=False):
        self.points, self.indices, self.threads = points, indices, threads
        self.device = points.device
        self.wide = self.device.is_cpu if wide is None else wide
        self._own, self._keep_mesh = False, keep_mesh
        self.build()

    def build(self):
        """Build the tree from the points as they are."""
        self.scale = _scale(self.points)
        self.mesh = self._wide = self._bad = None
        self._dropped = 0
        if len(self.indices) == 0:
            return
        self._tree_points, self._tree_indices = self.points, self.indices
        if self._own or self.scale != 1.0 or not _all_sound(self.points, self.indices, self.wide):
            self._tree_points, self._tree_indices = wp.empty_like(self.points), wp.empty_like(self.indices)
            self._bad = wp.zeros(len(self.indices) // 3, dtype=wp.int32, device=self.device)
            self._copy_finite()
        if self._bad is not None and self._bad.numpy().all():
            return
        self.mesh = wp.Mesh(self._tree_points, self._tree_indices)
        if self.wide:
            self._wide = WideTree(0, self.mesh.id, len(self.indices) // 3)
            if not self._keep_mesh:
                self.mesh = self._tree_points = self._tree_indices = self._bad = None
            self._fill()
            self._wide.is_built()

    def refit(self):
        """Follow moved points; build again when that pays or the scale calls for it."""
        if self._keep_mesh or (self._wide is None and self.mesh is None):
            self.build()
        elif self.wide:
            self._fill()
            largest = np.abs(self._wide.box).max() / self.scale
            if self._wide.has_degraded or _scale_for(largest) != self.scale:
                self.build()
        else:
            self._refit_mesh()

    def _refit_mesh(self):
        """Follow moved points without asking the host; arrays of our own take what is not finite out of the tree."""
        if self._tree_points is self.points or self._tree_indices is self.indices:
            self._own = True
            self.build()
            return
        self._copy_finite()
        self.mesh.refit()

    def _copy_finite(self):
        """Points that are not finite go to the origin, and their faces shrink to a point: ids stay, nothing hits."""
        inputs = [self.points, self.scale, self._tree_points]
        launch(_finite_points, len(self.points), inputs, self.device, self.threads)
        inputs = [self.points, self.indices, self._tree_indices, self._bad]
        launch(_collapse_bad, len(self._bad), inputs, self.device, self.threads)

    def _fill(self):
        wide = self._wide
        items = -(-wide.blocks // BLOCKS_PER_ITEM)
        dropped = wp.zeros(items, dtype=wp.int32, device="cpu")
        tree = [wide.nodes.address, wide.leaves.address, wide.slots]
        arguments = [*tree, self.points, self.indices, self.scale, wide.blocks, dropped]
        launch(_refit_leaves, items, arguments, "cpu", self.threads, smallest_chunk=1)
        wide.box_inner()
        self._dropped = int(dropped.numpy().sum())

    @property
    def dropped(self):
        """Faces left out since a vertex is repeated or not finite, as of the last build or refit."""
        return self._dropped if self._bad is None else int(self._bad.numpy().sum())

    def store_box(self, lowers, uppers, number):
        """Write the corners of the box in object space to entry `number` of two arrays; inverted around nothing."""
        if self.mesh is not None:
            inputs = [self.mesh.id, 1.0 / self.scale, number]
            wp.launch(_mesh_box, 1, inputs, [lowers, uppers], device=self.device)
            return
        box = (np.inf, -np.inf) if self._wide is None else self._wide.box
        for array, corner in zip((lowers, uppers), box, strict=True):
            array[number : number + 1].assign(np.full((1, 3), corner / np.float32(self.scale), np.float32))

    @property
    def faces(self):
        """Number of triangles."""
        return len(self.indices) // 3

    @property
    def cached(self):
        """Whether the wide tree is small enough to stay in a core's own cache."""
        return self._wide.bytes <= OWN_CACHE

    def geometry(self):
        """The device record; this object must outlive it."""
        record = Geometry()
        record.kind = MESH
        record.mesh = self.mesh.id if self.mesh else 0
        if self._wide:
            record.nodes, record.blocks = self._wide.nodes.address, self._wide.leaves.address
        return record


class SphereShape:
    """A sphere of the given radius about the origin: exact, no triangles."""

    scale = 1.0

    def __init__(self, radius):
        self.radius = float(radius)

    def store_box(self, lowers, uppers, number):
        """As `MeshTree.store_box`."""
        for array, corner in ((lowers, -self.radius), (uppers, self.radius)):
            array[number : number + 1].assign(np.full((1, 3), corner, np.float32))

    def geometry(self):
        """The device record."""
        record = Geometry()
        record.kind = SPHERE
        record.radius = self.radius
        return record


class SdfShape:
    """A signed distance function: it has a place among the instances, and nothing that these trees could hit.

    `bounds` (2, 3) is its box, left out where it has no end.
    """

    scale = 1.0

    def __init__(self, bounds):
        self.bounds = np.asarray(bounds, np.float32)
        if not np.isfinite(self.bounds).all():
            self.bounds = np.array([[np.inf] * 3, [-np.inf] * 3], np.float32)

    def geometry(self):
        """The device record of a mesh without faces."""
        return Geometry()

    def store_box(self, lowers, uppers, number):
        """As `MeshTree.store_box`."""
        for array, corner in zip((lowers, uppers), self.bounds, strict=True):
            array[number : number + 1].assign(corner[None])


# ---------------------------------------------------------------- points and faces


def _scale_for(largest):
    if largest == 0.0 or not np.isfinite(largest) or CLEAN_RANGE[0] <= largest <= CLEAN_RANGE[1]:
        return 1.0
    return float(2.0 ** -np.frexp(np.float64(largest))[1])


def _scale(points):
    values = points.numpy()
    if values.size == 0:
        return 1.0
    largest = max(float(values.max()), -float(values.min()))
    if not np.isfinite(largest):
        largest = float(np.abs(values, where=np.isfinite(values), out=np.zeros_like(values)).max())
    return _scale_for(largest)


def _all_sound(points, indices, wide):
    """Whether faces can go to Warp's tree as they are.

    A wide tree looks for repeated vertices itself: for it only what is not finite matters.
    """
    if not np.isfinite(points.numpy()).all():
        return False
    a, b, c = indices.numpy().reshape(-1, 3).T
    return wide or not ((a == b) | (b == c) | (c == a)).any()


@wp.func
def _finite(p: wp.vec3) -> bool:
    return wp.isfinite(p[0]) and wp.isfinite(p[1]) and wp.isfinite(p[2])


@wp.kernel(enable_backward=False, module="unique")
def _finite_points(first: wp.int32, points: wp.array(dtype=wp.vec3), scale: wp.float32, out: wp.array(dtype=wp.vec3)):
    i = first + wp.tid()
    p = points[i] * scale
    out[i] = wp.where(_finite(p), p, wp.vec3())


@wp.kernel(enable_backward=False, module="unique")
def _collapse_bad(
    first: wp.int32,
    points: wp.array(dtype=wp.vec3),
    indices: wp.array(dtype=wp.int32),
    clean: wp.array(dtype=wp.int32),
    bad: wp.array(dtype=wp.int32),
):
    f = first + wp.tid()
    a = indices[3 * f]
    b = indices[3 * f + 1]
    c = indices[3 * f + 2]
    bad[f] = wp.where(a == b or b == c or c == a, 1, 0)
    if not (_finite(points[a]) and _finite(points[b]) and _finite(points[c])):
        bad[f] = 1
        # A finite corner if there is one: the box need not reach to the origin.
        k = a
        if _finite(points[b]):
            k = b
        if _finite(points[c]):
            k = c
        if _finite(points[a]):
            k = a
        a = k
        b = k
        c = k
    clean[3 * f] = a
    clean[3 * f + 1] = b
    clean[3 * f + 2] = c


# ---------------------------------------------------------------- kernels over trees


@wp.kernel(enable_backward=False, module="unique")
def _collapse(
    kind: wp.int32,
    tree: wp.uint64,
    plans: wp.uint64,
    nodes: wp.uint64,
    blocks: wp.uint64,
    items: wp.uint64,
    slots: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
):
    native.collapse(kind, tree, plans, nodes, blocks, items, slots, counts)


@wp.kernel(enable_backward=False, module="unique")
def _refit_leaves(
    first: wp.int32,
    nodes: wp.uint64,
    blocks: wp.uint64,
    slots: wp.array(dtype=wp.int32),
    points: wp.array(dtype=wp.vec3),
    indices: wp.array(dtype=wp.int32),
    scale: wp.float32,
    count: wp.int32,
    dropped: wp.array(dtype=wp.int32),
):
    i = first + wp.tid()
    begin = i * wp.static(BLOCKS_PER_ITEM)
    end = wp.min(begin + wp.static(BLOCKS_PER_ITEM), count)
    dropped[i] = native.refit_leaves(nodes, blocks, slots, points, indices, scale, begin, end, count)


@wp.kernel(enable_backward=False, module="unique")
def _refit_items(
    nodes: wp.uint64,
    items: wp.uint64,
    lowers: wp.array(dtype=wp.vec3),
    uppers: wp.array(dtype=wp.vec3),
    count: wp.int32,
):
    native.refit_items(nodes, items, lowers, uppers, count)


@wp.kernel(enable_backward=False, module="unique")
def _refit_inner(nodes: wp.uint64, count: wp.int32, summary: wp.array(dtype=wp.float32)):
    native.refit_inner(nodes, count, summary)


@wp.kernel(enable_backward=False, module="unique")
def _mesh_box(
    mesh: wp.uint64,
    scale: wp.float32,
    number: wp.int32,
    lowers: wp.array(dtype=wp.vec3),
    uppers: wp.array(dtype=wp.vec3),
):
    lowers[number] = native.mesh_corner(mesh, 0) * scale
    uppers[number] = native.mesh_corner(mesh, 1) * scale
