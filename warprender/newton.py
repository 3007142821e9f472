"""A Newton model as a scene, kept in step with its state on the device. Newton is imported by whoever has a model."""

from __future__ import annotations

import numpy as np
import warp as wp

from .launch import launch
from .scene import Placement, Scene
from .shapes import Mesh, Primvar, Sphere
from .shapes.revolved import capsule, cone, cylinder

#: `newton.GeoType` by number, and which bit of `shape_flags` says that a shape is shown.
_PLANE, _SPHERE, _CAPSULE, _ELLIPSOID, _CYLINDER, _BOX, _MESH, _CONE, _CONVEX = 1, 3, 4, 5, 6, 7, 8, 9, 10
_VISIBLE = 1
#: Half the width of a plane that has no end, in scene units.
ENDLESS = 1000.0


class NewtonScene:
    """What `from_newton` returns.

    Attributes:
        scene: the `Scene`; the prim of shape i is `paths[i]`, "" where it is not drawn.
        paths: one for each shape of the model.
        worlds: (I,) the world of each instance in drawing order, -1 for all: `worlds` of a sensor.
    """

    def __init__(self, model: object) -> None:
        """Read the shapes and particles of a `newton.Model`."""
        self.scene = Scene()
        self.paths: list[str] = []
        self._model, worlds = model, []
        if not model.shape_count:
            self._ids = None
        else:
            worlds += self._add_shapes(model)
        self._cloth = self._beads = None
        if model.particle_count:
            worlds += self._add_particles(model)
        self.worlds = np.array(worlds, np.int32)
        self.sync(model.state())

    def sync(self, state: object) -> None:
        """Take over the bodies' poses and the particles' positions of a `newton.State`, device to device."""
        if self._ids is not None:
            bodies = state.body_q if state.body_q is not None else self._no_bodies
            arguments = [self._shapes, self._model.shape_body, self._model.shape_transform, bodies, self._poses]
            launch(_compose, len(self._shapes), arguments, self._poses.device)
            self.scene.set_poses(self._ids, self._poses)
        if self._cloth is not None:
            wp.copy(self._cloth, state.particle_q)
        if self._beads is not None:
            launch(
                _bead_poses,
                len(self._bead_numbers),
                [self._bead_numbers, state.particle_q, self._beads],
                self._beads.device,
            )
            self.scene.set_poses(self._bead_ids, self._beads)

    def _add_shapes(self, model: object) -> list[int]:
        kinds, scales, flags = (a.numpy() for a in (model.shape_type, model.shape_scale, model.shape_flags))
        owners, colors = model.shape_world.numpy(), model.shape_color
        colors = None if colors is None else colors.numpy()
        shapes: dict[object, Mesh | Sphere] = {}
        drawn, worlds = [], []
        for i, (kind, scale) in enumerate(zip(kinds, scales, strict=True)):
            shape = None
            if flags[i] & _VISIBLE:
                key = int(kind), tuple(scale), id(model.shape_source[i]), None if colors is None else tuple(colors[i])
                if key not in shapes:
                    shapes[key] = _shape(int(kind), scale, model.shape_source[i])
                    if shapes[key] is not None and colors is not None and np.isfinite(colors[i]).all():
                        shapes[key].primvars["displayColor"] = Primvar(colors[i][None], "constant")
                shape = shapes[key]
            label = model.shape_label[i] if i < len(model.shape_label) else ""
            self.paths.append(f"/shape{i}" if shape is not None else "")
            if shape is None:
                if flags[i] & _VISIBLE:
                    self.scene.warn(f"/shape{i} ({label}): shapes of Newton's kind {int(kind)} are not drawn")
                continue
            matrix = np.diag([*scale, 1.0]) if kind in (_MESH, _CONVEX, _ELLIPSOID) else np.eye(4)
            self.scene.placements[f"/shape{i}"] = Placement(f"/shape{i}", shape, matrix, semantic=str(label))
            drawn.append(i)
            worlds.append(int(owners[i]))
        device = str(model.device)
        self._no_bodies = wp.empty(0, dtype=wp.transformf, device=device)
        self._shapes = wp.array(np.array(drawn, np.int32), dtype=wp.int32, device=device)
        self._poses = wp.empty(len(drawn), dtype=wp.transformf, device=device)
        self._ids = self.scene.ids([f"/shape{i}" for i in drawn], device) if drawn else None
        return worlds

    def _add_particles(self, model: object) -> list[int]:
        """Triangles between particles as a mesh, all other particles as spheres."""
        device, free = str(model.device), np.ones(model.particle_count, bool)
        worlds = []
        if model.tri_count:
            triangles = model.tri_indices.numpy().reshape(-1, 3)
            free[triangles] = False
            self._cloth = wp.clone(model.particle_q)
            self.scene.add_mesh("/cloth", self._cloth, triangles)
            owners = np.unique(model.particle_world.numpy()[triangles])
            worlds.append(int(owners[0]) if len(owners) == 1 else -1)
        numbers = np.flatnonzero(free)
        if len(numbers):
            radii = model.particle_radius.numpy()[numbers]
            copies = np.tile(np.eye(4), (len(numbers), 1, 1))
            copies[:, [0, 1, 2], [0, 1, 2]] = radii[:, None]
            ids = np.arange(len(numbers), dtype=np.int32)
            self.scene.placements["/particles"] = Placement("/particles", Sphere(1.0), copies, "", ids)
            self._bead_numbers = wp.array(numbers.astype(np.int32), dtype=wp.int32, device=device)
            self._beads = wp.empty(len(numbers), dtype=wp.transformf, device=device)
            self._bead_ids = self.scene.ids([("/particles", int(k)) for k in ids], device)
            worlds += model.particle_world.numpy()[numbers].tolist()
        return worlds


def from_newton(model: object) -> NewtonScene:
    """A scene of a `newton.Model`: planes, spheres, ellipsoids, capsules, cylinders, cones, boxes, meshes, particles.

    Shapes that Newton hides are left out; kinds that are not drawn are named in `scene.warnings`. Lights and cameras
    are the caller's to add. After each step of the simulation call `sync(state)`, then update renderers and sensors.

    Args:
        model: a finalized `newton.Model`. Its lengths are the scene's units.

    Returns:
        The scene and what keeps it in step.
    """
    return NewtonScene(model)


def _shape(kind: int, scale: np.ndarray, source: object) -> Mesh | Sphere | None:
    """A shape as Newton has it: axes along Z, scale holds half sizes."""
    x, y, z = (float(size) for size in scale)
    if kind == _SPHERE:
        return Sphere(x)
    if kind == _ELLIPSOID:
        return Sphere(1.0)
    if kind == _PLANE:
        half = [size / 2 if size > 0 else ENDLESS for size in (x, y)]
        corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float32) * [*half, 1]
        return Mesh.from_polygons(corners.astype(np.float32), np.array([4]), np.arange(4))
    if kind == _BOX:
        corners = np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)], np.float32) * [x, y, z]
        quads = np.array([0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3])
        return Mesh.from_polygons(corners.astype(np.float32), np.full(6, 4), quads)
    if kind in (_MESH, _CONVEX):
        indices = np.asarray(source.indices).reshape(-1)
        points = np.asarray(source.vertices, np.float32)
        return Mesh.from_polygons(points, np.full(len(indices) // 3, 3), indices)
    if kind == _CAPSULE:
        return capsule(y * 2, x, x)
    if kind == _CYLINDER:
        return cylinder(y * 2, x, x)
    if kind == _CONE:
        return cone(y * 2, x)
    return None


@wp.kernel(module="unique", enable_backward=False)
def _compose(
    first: wp.int32,
    shapes: wp.array(dtype=wp.int32),
    shape_body: wp.array(dtype=wp.int32),
    shape_transform: wp.array(dtype=wp.transformf),
    body_q: wp.array(dtype=wp.transformf),
    poses: wp.array(dtype=wp.transformf),
):
    i = first + wp.tid()
    shape = shapes[i]
    pose = shape_transform[shape]
    if shape_body[shape] >= 0:
        pose = body_q[shape_body[shape]] * pose
    poses[i] = pose


@wp.kernel(module="unique", enable_backward=False)
def _bead_poses(
    first: wp.int32,
    numbers: wp.array(dtype=wp.int32),
    positions: wp.array(dtype=wp.vec3),
    poses: wp.array(dtype=wp.transformf),
):
    i = first + wp.tid()
    poses[i] = wp.transform(positions[numbers[i]], wp.quat_identity())
