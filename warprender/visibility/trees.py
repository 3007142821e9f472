"""Trees on a device: over one mesh's triangles, and over placed shapes."""

import numpy as np
import warp as wp

from ..launch import launch
from ..records import MESH, SPHERE, Geometry, Instance, World
from . import native

BLOCKS_PER_ITEM = 512  # blocks of triangles that one item of the refit fills
CACHE_LINE = 64
OWN_CACHE = 512 * 1024  # bytes: half of a common second-level cache
REBUILD_AT = 2.0  # refit trees lose quality: rebuild when a ray is expected to visit this many times more

CLEAN_RANGE = 1e-9, 1e9  # coordinates outside are rescaled: products of lengths would leave float32's range


class _Memory:
    """Uninitialised bytes that begin on a cache line; numpy asks for huge pages, which spares TLB misses."""

    def __init__(self, size):
        self.data = np.empty(size + CACHE_LINE, np.uint8)
        self.address = self.data.ctypes.data + -self.data.ctypes.data % CACHE_LINE


class _WideTree:
    """Wide nodes made from one of Warp's binary trees, and the blocks or items of its leaves (CPU)."""

    def __init__(self, kind, tree_id, leaves):
        inner = max(leaves, 1)
        plans = _Memory(2 * leaves * native.PLAN_BYTES)
        counts = wp.zeros(3, dtype=wp.int32, device="cpu")
        self.nodes = _Memory(inner * native.NODE_BYTES)
        leaf_bytes = native.BLOCK_BYTES if kind == 0 else 4
        self.leaves = _Memory(leaves * leaf_bytes)
        blocks, items = (self.leaves.address, 0) if kind == 0 else (0, self.leaves.address)
        self.slots = wp.empty(leaves if kind == 0 else 0, dtype=wp.int32, device="cpu")
        arguments = [kind, tree_id, plans.address, self.nodes.address, blocks, items, self.slots, counts]
        wp.launch(_collapse, dim=1, inputs=arguments, device="cpu")
        self.count, self.blocks, depth = (int(n) for n in counts.numpy())
        if not 0 < depth <= native.MAX_DEPTH:
            raise RuntimeError("Warp built a tree that the watertight walk cannot read")
        self.bytes = self.count * native.NODE_BYTES + self.blocks * leaf_bytes
        self.summary = wp.zeros(7, dtype=wp.float32, device="cpu")

    def box_inner(self):
        """Box the inner nodes; the leaves' boxes must stand."""
        inputs = [self.nodes.address, self.count, self.summary]
        wp.launch(_refit_inner, dim=1, inputs=inputs, device="cpu")

    @property
    def visits(self):
        """Nodes and leaves that a ray through the tree is expected to visit (surface area heuristic)."""
        return float(self.summary.numpy()[6])

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

    Attributes:
        mesh: The wp.Mesh over ``scale * points``, or None.
        dropped: Faces left out since a vertex is repeated or not finite.
        scale: A power of two: the tree holds ``scale * points``. 1 unless coordinates leave 1e-9 … 1e9.
        box: Lower and upper corner in the tree's coordinates; inverted where there is nothing to hit.
    """

    def __init__(self, points, indices, wide=None, threads=None):
        self.points, self.indices, self.threads = points, indices, threads
        self.device = points.device
        self.wide = self.device.is_cpu if wide is None else wide
        self.build()

    def build(self):
        """Build the tree from the points as they are."""
        self.scale = _scale(self.points)
        self.mesh, self._wide, self.dropped = None, None, 0
        self.box = np.full(3, np.inf, np.float32), np.full(3, -np.inf, np.float32)
        if len(self.indices) == 0:
            return
        clean, self.dropped, anchor = _clean_faces(self.points, self.indices, self.wide)
        if anchor is None:
            return
        self._clean, self._scaled = clean, _scaled(self.points, self.scale)
        self.mesh = wp.Mesh(self._scaled, clean)
        if self.wide:
            self._wide = _WideTree(0, self.mesh.id, len(clean) // 3)
            self._fill()
            self._visits_built = self._wide.visits
            self.mesh = None
        else:
            self.box = _finite_box(self._scaled)

    def refit(self):
        """Follow moved points; build again when that pays or the scale calls for it."""
        if self._wide is None and self.mesh is None:
            self.build()
        elif self.wide:
            self._fill()
            largest = max(np.abs(self.box).max() / self.scale, 0.0)
            if self._wide.visits > REBUILD_AT * self._visits_built or _scale_for(largest) != self.scale:
                self.build()
        else:
            self._refit_mesh()

    def _refit_mesh(self):
        clean, self.dropped, anchor = _clean_faces(self.points, self.indices, self.wide)
        if anchor is None or (clean is not self._clean and self._clean is self.indices):
            self.build()  # the caller's indices are not ours to change
            return
        if clean is not self._clean:
            wp.copy(self._clean, clean)
        if self._scaled is not self.points:
            wp.launch(
                _scale_points,
                len(self.points),
                [0, self.points, self.scale],
                [self._scaled],
                device=self.device,
            )
        self.mesh.refit()
        self.box = _finite_box(self._scaled)

    def _fill(self):
        wide = self._wide
        items = -(-wide.blocks // BLOCKS_PER_ITEM)
        dropped = wp.zeros(items, dtype=wp.int32, device="cpu")
        tree = [wide.nodes.address, wide.leaves.address, wide.slots]
        arguments = [*tree, self.points, self.indices, self.scale, wide.blocks, dropped]
        launch(_refit_leaves, items, arguments, "cpu", self.threads, smallest_chunk=1)
        wide.box_inner()
        self.dropped = int(dropped.numpy().sum())
        self.box = wide.box

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
        self.box = np.full(3, -self.radius, np.float32), np.full(3, self.radius, np.float32)

    def geometry(self):
        """The device record."""
        record = Geometry()
        record.kind = SPHERE
        record.radius = self.radius
        return record


class SdfShape:
    """A signed distance function: it has a place among the instances, and nothing that these trees could hit."""

    scale = 1.0
    box = np.full(3, np.inf, np.float32), np.full(3, -np.inf, np.float32)

    def geometry(self):
        """The device record of a mesh without faces."""
        return Geometry()


class WorldTree:
    """Shapes placed in the world, without copying them.

    Args:
        shapes: ``MeshTree``, ``SphereShape`` and ``SdfShape`` objects on one device.
        geometry: (I,) ints, which shape each instance places.
        to_world: (I, 3, 4) or (I, 4, 4) float64, columns acting on points as column vectors.
        device: Warp device.

    Attributes:
        world: The ``World`` record for ``scene_closest`` and ``scene_occluded``; this object must outlive it.
    """

    def __init__(self, shapes, geometry, to_world, device=None):
        self.device = wp.get_device(device)
        self.shapes = list(shapes)
        self.geometry = np.asarray(geometry, np.int32)
        self._place(to_world)
        self._geometries = wp.array([s.geometry() for s in self.shapes], dtype=Geometry, device=self.device)
        self._build()

    def update(self, to_world=None):
        """Follow moved instances and refitted shapes.

        Args:
            to_world: As at construction; None keeps the matrices.
        """
        if to_world is not None:
            self._place(to_world)
        self._geometries.assign([s.geometry() for s in self.shapes])
        self._build()

    def _place(self, to_world):
        to_world = np.asarray(to_world, np.float64)[:, :3, :]
        to_object, sound = _inverse(to_world)
        scale = np.array([s.scale for s in self.shapes])[self.geometry][:, None, None]
        rows = np.zeros(len(to_world), Instance.numpy_dtype())
        rows["to_object"], rows["to_world"] = to_object * scale, to_world
        rows["geometry"] = self.geometry
        differs = rows["to_object"] != np.eye(3, 4, dtype=np.float32)
        rows["placed"] = np.where(differs[:, :, :3].any((1, 2)), 2, differs.any((1, 2)))
        self._instances = wp.array(rows, dtype=Instance, device=self.device)
        # |W| |M| bounds how far an error of the object-space origin reaches in the world
        reach = (np.abs(to_world[:, :, :3]) @ np.abs(to_object[:, :, :3])).sum(2).max(1)
        self._pad = float(2.0 * 8.0 * 2.0**-24 * np.where(sound & (rows["placed"] != 0), reach, 0.0).max(initial=0.0))

    def _build(self):
        count = len(self._instances)
        boxes = np.array([s.box for s in self.shapes], np.float32).reshape(-1, 2, 3)
        boxes = boxes / np.array([s.scale for s in self.shapes], np.float32)[:, None, None]
        shape_lowers, shape_uppers = (
            wp.array(np.ascontiguousarray(boxes[:, k]), dtype=wp.vec3, device=self.device) for k in (0, 1)
        )
        self.lowers, self.uppers = (wp.empty(count, dtype=wp.vec3, device=self.device) for _ in range(2))
        inputs = [self._instances, shape_lowers, shape_uppers]
        launch(_instance_boxes, count, [*inputs, self.lowers, self.uppers], self.device)
        self._bvh = self._wide = None
        if count > 1:
            self._bvh = wp.Bvh(self.lowers, self.uppers, leaf_size=1)
            if self.device.is_cpu:
                self._wide = _WideTree(1, self._bvh.id, count)
                inputs = [
                    self._wide.nodes.address,
                    self._wide.leaves.address,
                    self.lowers,
                    self.uppers,
                    self._wide.count,
                ]
                wp.launch(_refit_items, dim=1, inputs=inputs, device="cpu")
                self._wide.box_inner()
        self.world = self._record(count)

    def _record(self, count):
        world = World()
        world.geometries, world.instances, world.count = self._geometries, self._instances, count
        world.pad = self._pad
        if self._bvh:
            world.tree = self._bvh.id
        if self._wide:
            world.nodes, world.items = self._wide.nodes.address, self._wide.leaves.address
        return world


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


def _scaled(points, scale):
    if scale == 1.0:
        return points
    out = wp.empty_like(points)
    wp.launch(_scale_points, len(points), [0, points, scale], [out], device=points.device)
    return out


def _finite_box(points):
    values = points.numpy()
    values = values[np.isfinite(values).all(1)]
    return values.min(0), values.max(0)


def _clean_faces(points, indices, only_if_not_finite):
    """Indices whose faces are all finite, the number of faces left out, and a finite vertex or None.

    A face with a vertex that is not finite is collapsed to a point, so that ids stay and nothing can hit it.
    Wide trees look for repeated vertices themselves: for them only what is not finite matters.
    """
    device = points.device
    if only_if_not_finite and np.isfinite(points.numpy()).all():
        return indices, 0, 0
    anchor = wp.full(1, len(points), dtype=wp.int32, device=device)
    wp.launch(_first_finite, len(points), [0, points], [anchor], device=device)
    first = int(anchor.numpy()[0])
    if first == len(points):
        return indices, len(indices) // 3, None
    clean, dropped = wp.empty_like(indices), wp.empty(len(indices) // 3, dtype=wp.int32, device=device)
    wp.launch(_collapse_bad, len(dropped), [0, points, indices, first], [clean, dropped], device=device)
    return clean, int(dropped.numpy().sum()), first


def _inverse(to_world):
    """(I, 3, 4) inverses in float64, zero where there is none, and which are sound."""
    out = np.zeros_like(to_world)
    with np.errstate(all="ignore"):
        determinant = np.linalg.det(to_world[:, :, :3])
        sound = np.isfinite(determinant) & (determinant != 0.0) & np.isfinite(to_world).all((1, 2))
    linear = np.linalg.inv(to_world[sound, :, :3])
    out[sound, :, :3] = linear
    out[sound, :, 3] = -np.einsum("nij,nj->ni", linear, to_world[sound, :, 3])
    sound &= np.isfinite(out.astype(np.float32)).all((1, 2))
    out[~sound] = 0.0
    return out, sound


@wp.func
def _finite(p: wp.vec3) -> bool:
    return wp.isfinite(p[0]) and wp.isfinite(p[1]) and wp.isfinite(p[2])


@wp.kernel(enable_backward=False, module="unique")
def _scale_points(first: wp.int32, points: wp.array(dtype=wp.vec3), scale: wp.float32, out: wp.array(dtype=wp.vec3)):
    i = first + wp.tid()
    out[i] = points[i] * scale


@wp.kernel(enable_backward=False, module="unique")
def _first_finite(first: wp.int32, points: wp.array(dtype=wp.vec3), anchor: wp.array(dtype=wp.int32)):
    i = first + wp.tid()
    if _finite(points[i]):
        wp.atomic_min(anchor, 0, i)


@wp.kernel(enable_backward=False, module="unique")
def _collapse_bad(
    first: wp.int32,
    points: wp.array(dtype=wp.vec3),
    indices: wp.array(dtype=wp.int32),
    anchor: wp.int32,
    clean: wp.array(dtype=wp.int32),
    dropped: wp.array(dtype=wp.int32),
):
    f = first + wp.tid()
    a = indices[3 * f]
    b = indices[3 * f + 1]
    c = indices[3 * f + 2]
    dropped[f] = wp.where(a == b or b == c or c == a, 1, 0)
    if not (_finite(points[a]) and _finite(points[b]) and _finite(points[c])):
        dropped[f] = 1
        k = anchor
        if _finite(points[a]):
            k = a
        elif _finite(points[b]):
            k = b
        elif _finite(points[c]):
            k = c
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
def _instance_boxes(
    first: wp.int32,
    instances: wp.array(dtype=Instance),
    shape_lowers: wp.array(dtype=wp.vec3),
    shape_uppers: wp.array(dtype=wp.vec3),
    lowers: wp.array(dtype=wp.vec3),
    uppers: wp.array(dtype=wp.vec3),
):
    i = first + wp.tid()
    place = instances[i]
    lo = shape_lowers[place.geometry]
    hi = shape_uppers[place.geometry]
    w = place.to_world
    m = place.to_object
    lower = wp.vec3(w[0, 3], w[1, 3], w[2, 3])
    upper = lower
    if lo[0] <= hi[0]:
        # gamma(8) of all terms: how far rounding of either matrix may move points of this box
        reach = wp.vec3(0.0)
        for a in range(3):
            for b in range(3):
                x = w[a, b] * lo[b]
                y = w[a, b] * hi[b]
                lower[a] += wp.min(x, y)
                upper[a] += wp.max(x, y)
        far = wp.max(wp.abs(lower), wp.abs(upper))
        for b in range(3):
            error = wp.max(wp.abs(lo[b]), wp.abs(hi[b])) + wp.abs(m[b, 3])
            for c in range(3):
                error += wp.abs(m[b, c]) * far[c]
            for a in range(3):
                reach[a] += wp.abs(w[a, b]) * error
        grow = (reach + far) * wp.static(8.0 * 2.0**-24 / (1.0 - 8.0 * 2.0**-24))
        if place.placed != 0:
            lower -= grow
            upper += grow
    lowers[i] = lower
    uppers[i] = upper
