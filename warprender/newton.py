"""A Newton model as a scene, kept in step with its state on the device. Newton is imported by whoever has a model."""

from __future__ import annotations

import numpy as np
import warp as wp

from .color import srgb_decode
from .launch import launch
from .newton_shapes import look_of, shape_of
from .scene import Placement, Scene
from .shapes import Mesh, Primvar, Sphere

#: Which bit of `shape_flags` says that a shape is shown.
_VISIBLE = 1


class NewtonScene:
    """What `from_newton` returns.

    Attributes:
        scene: the `Scene`; the prim of shape i is `paths[i]`, "" where it is not drawn.
        paths: one for each shape of the model.
        worlds: (I,) the world of each instance in drawing order, -1 for all: `worlds` of a sensor.
    """

    def __init__(self, model: object) -> None:
        """Read the shapes and particles of a `newton.Model`."""
        self.scene = Scene(up_axis="XYZ"[int(model.up_axis)], meters_per_unit=1.0)
        self.paths: list[str] = []
        self._model, self._device = model, str(model.device)
        self._no_bodies = wp.empty(0, dtype=wp.transformf, device=self._device)
        worlds = self._add_shapes() if model.shape_count else []
        self._sheets: list[tuple[wp.array, int]] = []
        self._beads = None
        if model.particle_count:
            worlds += self._add_particles()
        if getattr(model, "deformable_visual_mesh_count", 0):
            self.scene.warn("deformable visual meshes are not drawn: the surface that is simulated is")
        self.worlds = np.array(worlds, np.int32)
        self.sync(model.state())

    def sync(self, state: object) -> None:
        """Take over the bodies' poses and the particles' positions of a `newton.State`, device to device."""
        if self.paths and self._ids is not None:
            bodies = state.body_q if state.body_q is not None else self._no_bodies
            arguments = [self._shapes, self._model.shape_body, self._model.shape_transform, bodies, self._poses]
            launch(_compose, len(self._shapes), arguments, self._device)
            self.scene.set_poses(self._ids, self._poses)
        for points, first in self._sheets:
            wp.copy(points, state.particle_q, src_offset=first, count=len(points))
        if self._beads is not None:
            arguments = [self._bead_numbers, state.particle_q, self._beads]
            launch(_bead_poses, len(self._bead_numbers), arguments, self._device)
            self.scene.set_poses(self._bead_ids, self._beads)

    def _add_shapes(self) -> list[int]:
        """Add the shapes that are shown; answers their worlds."""
        model, count = self._model, self._model.shape_count
        kinds, scales, flags = (a.numpy() for a in (model.shape_type, model.shape_scale, model.shape_flags))
        owners, colors = model.shape_world.numpy(), _host(model, "shape_color", [None] * count)
        opacities = _host(model, "shape_opacity", np.ones(count))
        shapes: dict[tuple, Mesh | Sphere] = {}
        looks: dict[tuple, str] = {}
        drawn = []
        for i in range(count):
            self.paths.append("")
            if not flags[i] & _VISIBLE or not opacities[i] > 0:
                continue
            source = model.shape_source[i]
            label = str(model.shape_label[i]) if i < len(model.shape_label) else ""
            found = shape_of(int(kinds[i]), scales[i], source)
            if found is None:
                extent = ", ".join(f"{size:g}" for size in scales[i])
                self.scene.warn(f"/shape{i} ({label}): Newton's kind {int(kinds[i])} of size {extent} is not drawn")
                continue
            key, scale, make = found
            if key not in shapes:
                shapes[key] = make()
            look, material = look_of(colors[i], float(opacities[i]), source)
            if look not in looks:
                looks[look] = f"/looks/{len(looks)}"
                self.scene.materials[looks[look]] = material
            path = self.paths[i] = f"/shape{i}"
            matrix = np.diag([*scale, 1.0])
            self.scene.placements[path] = Placement(path, shapes[key], matrix, looks[look], semantic=label)
            drawn.append(i)
        self._shapes = wp.array(np.array(drawn, np.int32), dtype=wp.int32, device=self._device)
        self._poses = wp.empty(len(drawn), dtype=wp.transformf, device=self._device)
        self._ids = self.scene.ids([self.paths[i] for i in drawn], self._device) if drawn else None
        return owners[drawn].tolist()

    def _add_particles(self) -> list[int]:
        """Triangles between particles as meshes, all particles that belong to no body of them as spheres."""
        model, free = self._model, np.ones(self._model.particle_count, bool)
        owners, worlds = model.particle_world.numpy(), []
        if model.tri_count:
            triangles = model.tri_indices.numpy().reshape(-1, 3)
            free[triangles] = False
            if model.tet_count:
                free[model.tet_indices.numpy()] = False
            for world in np.unique(owners[triangles[:, 0]]):
                self._add_sheet(int(world), triangles, np.flatnonzero(owners[triangles[:, 0]] == world))
                worlds.append(int(world))
        numbers = np.flatnonzero(free)
        if len(numbers):
            copies = np.tile(np.eye(4), (len(numbers), 1, 1))
            copies[:, [0, 1, 2], [0, 1, 2]] = model.particle_radius.numpy()[numbers][:, None]
            ids = np.arange(len(numbers), dtype=np.int32)
            self.scene.placements["/particles"] = Placement("/particles", Sphere(1.0), copies, "", ids)
            self._bead_numbers = wp.array(numbers.astype(np.int32), dtype=wp.int32, device=self._device)
            self._beads = wp.empty(len(numbers), dtype=wp.transformf, device=self._device)
            self._bead_ids = self.scene.ids([("/particles", int(k)) for k in ids], self._device)
            worlds += owners[numbers].tolist()
        return worlds

    def _add_sheet(self, world: int, triangles: np.ndarray, mine: np.ndarray) -> None:
        """The triangles `mine` of a world as a mesh over its stretch of the particles."""
        first, last = int(triangles[mine].min()), int(triangles[mine].max())
        points = wp.clone(self._model.particle_q[first : last + 1])
        path = "/cloth" if world < 0 or self._model.world_count <= 1 else f"/world{world}/cloth"
        mesh = self.scene.add_mesh(path, points, triangles[mine] - first)
        colors = _host(self._model, "tri_color", None)
        if colors is not None and len(colors) == len(triangles):
            mesh.primvars["displayColor"] = Primvar(srgb_decode(np.clip(colors[mine], 0.0, 1.0)), "uniform")
        self._sheets.append((points, first))


def from_newton(model: object) -> NewtonScene:
    """A scene of a `newton.Model`: all shapes but Gaussians, and its particles.

    Planes (those without an end reach 1,000 units), heightfields, spheres, ellipsoids, capsules, cylinders, barrels,
    cones, boxes, meshes with their normals and textures, convex hulls; cloth and soft bodies as meshes, other particles
    as spheres. Shapes that Newton hides or has clear through are left out, what cannot be drawn is named in
    `scene.warnings`. Colours are on the sRGB curve, as Newton's cameras take them. Lights and cameras are the caller's
    to add. After each step of the simulation call `sync(state)`, then update renderers and sensors.

    Args:
        model: a finalized `newton.Model`. Newton is not imported here: whoever has a model has it.

    Returns:
        The `NewtonScene`: `scene`, and `worlds` for sensors of replicated worlds.
    """
    return NewtonScene(model)


def _host(model: object, name: str, fallback: object) -> object:
    """An array of the model on the host, `fallback` where it has none."""
    array = getattr(model, name, None)
    return fallback if array is None or not len(array) else array.numpy()


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
