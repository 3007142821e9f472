"""The tree over placed shapes: built once, refitted when shapes or instances have moved, rebuilt when that pays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from ..numerics import mat34d
from ..records import Geometry, Instance, World
from . import native
from .placing import Attachments, Placed, Rest, Shapes, launch_placing
from .trees import Memory, MeshTree, SdfShape, SphereShape, WideTree


class WorldTree:
    """Shapes placed in the world, without copying them.

    Args:
        shapes: on one device.
        geometry: (I,) ints, which shape each instance places.
        to_world: (I, 3, 4) or (I, 4, 4) float64, columns acting on points as column vectors.
        device: Warp device.
        origin: (3,) float64 place that positions on the device are relative to.

    Attributes:
        world: The ``World`` record for ``scene_closest`` and ``scene_occluded``; this object must outlive it.
        instances: (I,) `Instance` on the device, in the order of ``geometry``.
    """

    def __init__(
        self,
        shapes: Sequence[MeshTree | SphereShape | SdfShape],
        geometry: Sequence[int] | np.ndarray,
        to_world: np.ndarray,
        device: str | wp.Device | None = None,
        origin: np.ndarray | Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Place the shapes and build the tree."""
        self.device = wp.get_device(device)
        self.shapes = list(shapes)
        count = len(geometry)
        self._few = Memory(native.FEW_BYTES) if self._has_few_faces(geometry) else None
        self._rest, self._shapes, self._placed = Rest(), Shapes(), Placed()
        self._rest.shape = wp.array(np.asarray(geometry, np.int32), dtype=wp.int32, device=self.device)
        self._rest.to_world = wp.empty(count, dtype=mat34d, device=self.device)
        self._rest.shown = wp.ones(count, dtype=wp.int32, device=self.device)
        self._shapes.lowers, self._shapes.uppers = self._vectors(len(self.shapes)), self._vectors(len(self.shapes))
        self._shapes.scales = wp.empty(len(self.shapes), dtype=wp.float32, device=self.device)
        self._placed.lowers, self._placed.uppers = self._vectors(count), self._vectors(count)
        self._placed.reach = wp.empty(count, dtype=wp.float32, device=self.device)
        self.instances = self._placed.instances = wp.empty(count, dtype=Instance, device=self.device)
        self._geometries = wp.empty(len(self.shapes), dtype=Geometry, device=self.device)
        self._placed.drawn = wp.empty(count, dtype=wp.int32, device=self.device)
        self._count = count
        self._known: dict[int, tuple[float, ...]] = {}
        self._attachments = Attachments()
        self.world = World()
        self.place_at_rest(to_world)
        self.move_origin(origin)
        for number in range(len(self.shapes)):
            self._read_shape(number)
        self._place()
        self._build()

    def place_at_rest(self, to_world: np.ndarray, shown: np.ndarray | None = None) -> None:
        """Where instances are unless a body moves them, and which are shown; heeded by the next refit."""
        to_world = np.ascontiguousarray(np.asarray(to_world, np.float64)[:, :3, :])
        self._reach = None
        if self._count:
            self._rest.to_world.assign(to_world)
            if shown is not None:
                self._rest.shown.assign(np.asarray(shown, np.int32))

    def move_origin(self, origin: np.ndarray | Sequence[float]) -> None:
        """Make positions relative to another place (3,); heeded by the next refit."""
        self._origin = wp.vec3d(*(float(x) for x in origin))

    def attach(self, attachments: Attachments) -> None:
        """Let instances hang on bodies; heeded by the next refit."""
        self._attachments, self._reach = attachments, None

    def update(self, to_world: np.ndarray | None = None) -> None:
        """Follow refitted shapes, and instances that are at `to_world` now; None keeps them where they are."""
        if to_world is not None:
            self.place_at_rest(to_world)
        self.refit(range(len(self.shapes)))

    def refit(self, changed: Sequence[int] = ()) -> None:
        """Place all instances anew and follow them; builds again when that pays.

        Args:
            changed: numbers of the shapes that were refitted since.
        """
        for number in changed:
            self._read_shape(number)
        self._place()
        if self._count < 2:
            self._record()
            return
        self._bvh.refit()
        if self._wide is not None:
            self._wide.box_items(self._placed.lowers, self._placed.uppers)
            if self._wide.has_degraded:
                self._build()
        self._record()

    def boxes(self) -> np.ndarray:
        """(I, 2, 3) float64 boxes relative to the origin; NaN for what is not drawn. Asks the device."""
        boxes = np.stack([self._placed.lowers.numpy(), self._placed.uppers.numpy()], 1).astype(np.float64)
        boxes[self._placed.drawn.numpy() == 0] = np.nan
        return boxes

    def _vectors(self, count: int) -> wp.array:
        return wp.empty(count, dtype=wp.vec3, device=self.device)

    def _read_shape(self, number: int) -> None:
        shape = self.shapes[number]
        shape.store_box(self._shapes.lowers, self._shapes.uppers, number)
        record = shape.geometry()
        known = shape.scale, record.kind, record.radius, record.mesh, record.nodes, record.blocks
        # A refitted tree lies where it lay: nothing goes to the device then.
        if self._known.get(number) != known:
            self._known[number] = known
            self._shapes.scales[number : number + 1].fill_(shape.scale)
            self._geometries[number : number + 1].assign([record])

    def _place(self) -> None:
        launch_placing(self._rest, self._attachments, self._shapes, self._origin, self._placed)

    def _build(self) -> None:
        self._bvh = self._wide = None
        if self._count > 1:
            lowers, uppers = self._placed.lowers, self._placed.uppers
            self._bvh = wp.Bvh(lowers, uppers, leaf_size=1)
            if self.device.is_cpu:
                self._wide = WideTree(1, self._bvh.id, self._count)
                self._wide.box_items(lowers, uppers)
                self._wide.is_built()
        self._record()

    def _record(self) -> None:
        world = self.world
        world.geometries, world.instances, world.count = self._geometries, self.instances, self._count
        world.lowers, world.uppers = self._placed.lowers, self._placed.uppers
        world.tree = self._bvh.id if self._bvh else 0
        world.nodes, world.items = (self._wide.nodes.address, self._wide.leaves.address) if self._wide else (0, 0)
        if self._reach is None:
            # Bodies may turn any way at no greater reach: only other places at rest ask the device again.
            self._reach = float(self._placed.reach.numpy().max(initial=0.0))
        self._gather_few()
        # What transforms may add to a box, per unit of the ray origin's largest component.
        world.pad = 2.0 * 8.0 * 2.0**-24 * self._reach

    def _has_few_faces(self, geometry: Sequence[int] | np.ndarray) -> bool:
        """Whether all triangles fit into what rays sweep without a tree (CPU)."""
        shapes = [self.shapes[number] for number in geometry[: native.FEW_FACES + 1]]
        if not self.device.is_cpu or not all(isinstance(shape, MeshTree) for shape in shapes):
            return False
        return len(shapes) <= native.FEW_FACES and 0 < sum(shape.faces for shape in shapes) <= native.FEW_FACES

    def _gather_few(self) -> None:
        """Collect the triangles beside the trees, where they are so few that rays need none."""
        if self._few:
            inputs = [self._few.address, self._geometries, self.instances, self._count]
            wp.launch(_gather_few, dim=1, inputs=inputs, device="cpu")
            self.world.few = self._few.address


@wp.kernel(enable_backward=False, module="unique")
def _gather_few(
    few: wp.uint64, geometries: wp.array(dtype=Geometry), instances: wp.array(dtype=Instance), count: wp.int32
):
    native.gather_few(few, geometries, instances, count)
