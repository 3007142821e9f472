"""The scene on the host: what to draw, where, of what, and under which lights.

A `Scene` is a plain description. Transforms are float64 and keep prim paths; of what is here, only points and poses
that a simulation gives are on a device. `Renderer` uploads it, `warprender.usd` reads it from a stage, and the `add_*`
methods build one in Python.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
import warp as wp

from .bodies import Bodies, Name, ancestors, as_names, pose_array
from .camera import Camera
from .errors import SceneError
from .given import plain_array, shown
from .lights import Light
from .materials import DisplayColor, Material
from .materials.material import BaseMaterial
from .picture_settings import PictureSettings, RenderProduct, RenderSettings
from .placement import Placement, copies_of, materials_of
from .scene_arguments import check_described, pose_matrix
from .scene_shapes import displaced_as, mesh_of, sdf_of, sphere_of
from .shapes import Mesh, Sdf, Sphere

Shape = TypeVar("Shape", Mesh, Sphere, Sdf)


@dataclass
class Scene:
    """Everything that a picture depends on, except the request for it.

    Attributes:
        placements: prim path to `Placement`, in drawing order; ids are positions in this order.
        materials: path to material; the key "" is the material of prims that are bound to none.
        lights: path to light.
        cameras: path to camera.
        settings: the stage's render settings, or one of their products: see `for_product`.
        up_axis: "Y" or "Z".
        meters_per_unit: scene units in metres; lights are not scaled by it.
        source: file that the scene was read from, "" for one built in Python.
        loading: how it was read: arguments of `load` as plain values, for the receipt; empty when built in Python.
        layers: the other layers that the stage is composed of, as paths.
        bounds: (2, 3) float64 world box of what is drawn, as the stage states it, or None.
        warnings: one line for each thing that the stage asks for and that is not drawn as asked.
        frames: path to the (4, 4) float64 local-to-world matrix, for row vectors, of prims that are not drawn
            themselves but have drawn ones below them.
        bodies: what `set_poses` has moved.
        live: what sensors have uploaded of the scene, by device.
        motion: brings the scene to a time in frames from its own, with 0 back to where it was: moves prims by
            `set_poses`, writes points, assigns transforms, lights, cameras. Called between samples of a camera whose
            shutter is open for a time. `load` provides it; for a scene built in Python any function of a float will
            do, so long as the time alone decides what it does. Its method `moving(opens, closes)`, if it has one,
            names what moves between two times, "" where nothing does.
    """

    placements: dict[str, Placement] = field(default_factory=dict)
    materials: dict[str, Material] = field(default_factory=lambda: {"": DisplayColor()})
    lights: dict[str, Light] = field(default_factory=dict)
    cameras: dict[str, Camera] = field(default_factory=dict)
    settings: PictureSettings = field(default_factory=RenderSettings)
    up_axis: str = "Y"
    meters_per_unit: float = 0.01
    source: str = ""
    loading: dict[str, object] = field(default_factory=dict)
    layers: list[str] = field(default_factory=list)
    bounds: np.ndarray | None = None
    warnings: list[str] = field(default_factory=list)
    frames: dict[str, np.ndarray] = field(default_factory=dict)
    bodies: Bodies = field(default_factory=Bodies)
    live: dict[object, object] = field(default_factory=dict, init=False, repr=False, compare=False)
    motion: Callable[[float], None] | None = None

    def warn(self, message: str) -> None:
        """Keep a one-line warning, once."""
        if message not in self.warnings:
            self.warnings.append(message)

    def for_product(self, product: RenderProduct) -> Scene:
        """This scene as `product` pictures it; everything but `settings` is shared."""
        return replace(self, settings=product)

    @property
    def semantics(self) -> dict[int, str]:
        """What the ids of the output `semantic` stand for: labels in the order in which prims first have them."""
        labels = dict.fromkeys(p.semantic for p in self.placements.values() if p.semantic)
        return dict(enumerate(labels))

    @property
    def prims(self) -> list[str]:
        """The prim paths that the ids of the output `primId` stand for."""
        return list(self.placements)

    @property
    def meshes(self) -> dict[str, Mesh]:
        """The meshes by the path of the prim that places them; instances of one prim share a mesh."""
        return {path: p.shape for path, p in self.placements.items() if isinstance(p.shape, Mesh)}

    def add_mesh(
        self,
        path: str,
        points: np.ndarray | wp.array,
        faces: np.ndarray | Sequence,
        material: Material | str | None = None,
        pose: object = None,
        normals: np.ndarray | wp.array | str | None = None,
        color: np.ndarray | Sequence | None = None,
        st: np.ndarray | None = None,
    ) -> Mesh:
        """Add a mesh prim.

        Args:
            path: prim path, unique in the scene.
            points: (N, 3) float32 in object space and scene units. A `wp.array(dtype=wp.vec3)` of length N, and an
                array (N, 3) float32 of PyTorch or JAX, is used in place, not copied.
            faces: (F, k) int indices into `points`, or a sequence of F faces of any sizes; three corners or more,
                counter-clockwise seen from the front.
            material: None draws `color` as a Lambert surface; a path takes
                the material of the scene that other prims are bound to. One with a
                displacement moves a copy of the points.
            pose: object to world: `wp.transformf`, seven numbers (position, quaternion xyzw), a (4, 4) matrix for
                row vectors (p' = p M, translation in the last row), or None for the identity.
            normals: (N, 3) shading normals in object space, of any length, which go along with points that are
                written in place; a `wp.array(dtype=wp.vec3)` of length N that the caller keeps in step; "smooth" for
                those of the points as they are; or None for flat shading.
            color: linear Rec.709 reflectance, one (3,) or one for each point (N, 3); None is 0.18 grey. Read only
                where `material` is None.
            st: (N, 2) texture coordinates, (0, 0) at the lower left corner of a picture.

        Returns:
            The mesh, as `scene.meshes[path]` has it.

        Raises:
            SceneError: the path is taken, an array has the wrong shape or type, an index is out of range, or a field
                of the material is not as described.
        """
        self._claim(path)
        mesh = mesh_of(path, points, faces, normals, color, st, self.warn)
        return self._place(path, mesh, material, pose)

    def add_sphere(
        self,
        path: str,
        radius: float = 1.0,
        material: Material | str | None = None,
        pose: object = None,
        color: Sequence | None = None,
    ) -> Sphere:
        """Add a sphere prim about the origin of its object space: an exact quadric, not a mesh.

        Args:
            path: prim path, unique in the scene.
            radius: in scene units; 0 and below draw nothing, with a warning.
            material: as in `add_mesh`.
            pose: as in `add_mesh`; a matrix with a scale makes an ellipsoid.
            color: one (3,) colour, as in `add_mesh`.

        Returns:
            The sphere.

        Raises:
            SceneError: the path is taken, or an array has the wrong shape.
        """
        self._claim(path)
        return self._place(path, sphere_of(path, radius, color, self.warn), material, pose)

    def add_sdf(
        self,
        path: str,
        distance: wp.Function | np.ndarray | wp.Volume,
        bounds: np.ndarray | Sequence | None = None,
        material: Material | str | None = None,
        pose: object = None,
        color: Sequence | None = None,
        lipschitz: float = 1.0,
        precision: float | None = None,
        parameters: Sequence[float] = (),
    ) -> Sdf:
        """Add a solid given by a signed distance: negative inside, positive outside.

        Args:
            path: prim path, unique in the scene.
            distance: a `wp.func` of a `wp.vec3` in object space, or of that and `parameters` as a `wp.vec4`, that
                returns a float; or its samples (X, Y, Z) on a grid from corner to corner of the bounds; or a
                `wp.Volume` of float32 on the CPU, whose world is object space.
            bounds: (2, 3) lower and upper corner in object space of where it is asked; inf has no end. A `wp.Volume`
                has its own.
            material: as in `add_mesh`.
            pose: as in `add_mesh`.
            color: one (3,) colour, as in `add_mesh`.
            lipschitz: the function changes by no more than this times the way; 1 for true distances. Samples
                have their own.
            precision: thinner parts than this may be missed, in object space; None takes 2^-16 of the diagonal.
            parameters: up to four numbers for `distance`; `Sdf.parameters` may change.

        Returns:
            The solid.

        Raises:
            SceneError: the path is taken, or an argument is not as described; no material has this path.
        """
        self._claim(path)
        shape = {"bounds": bounds, "lipschitz": lipschitz, "precision": precision, "parameters": parameters}
        sdf = sdf_of(path, distance, color, **shape)
        return self._place(path, sdf, material, pose)

    def add_instances(self, path: str, prototype: str, poses: Sequence | np.ndarray) -> Placement:
        """Draw the shape of the prim `prototype` once more for each pose; it is stored once.

        Args:
            path: prim path of the instancer.
            prototype: path of a placed prim, which stays where it is; its own pose is not applied to the copies.
            poses: (K, 7) positions and quaternions xyzw, or (K, 4, 4) matrices for row vectors, object to world.

        Returns:
            The placement; copy k has the output `instanceId` k.

        Raises:
            SceneError: the path is taken, there is no prim `prototype`, or a pose has the wrong shape.
        """
        self._claim(path)
        if prototype not in self.placements:
            raise SceneError(f"{path}: there is no prim {prototype} to draw instances of")
        source = self.placements[prototype]
        poses = plain_array(poses)
        if poses.ndim == 0:
            raise SceneError(f"{path}: poses are {shown(poses[()])}, not (K, 7) or (K, 4, 4) numbers")
        transforms = [pose_matrix(pose, f"{path}[{k}]") for k, pose in enumerate(poses)]
        transforms = np.stack(transforms) if transforms else np.zeros((0, 4, 4))
        ids = np.arange(len(transforms), dtype=np.int32)
        placement = Placement(path, source.shape, transforms, source.material, ids)
        self.placements[path] = placement
        return placement

    def add_light(self, light: Light, path: str | None = None, pose: object = None) -> str:
        """Add a light.

        Args:
            light: kept, not copied.
            path: prim path, unique in the scene; None takes /Lights/, the kind and a number.
            pose: light to world, as in `add_mesh`; replaces `light.transform`. Lights emit towards local -Z.

        Returns:
            The light's path.

        Raises:
            SceneError: the path is taken, it is no light, or a field of it or the pose is not as described.
        """
        path = path or f"/Lights/{type(light).__name__}{len(self.lights)}"
        self._claim(path)
        if pose is not None and isinstance(light, Light):
            light.transform = pose_matrix(pose, path)
        check_described(path, light, Light)
        self.lights[path] = light
        return path

    def add_camera(self, path: str, camera: Camera, pose: object = None) -> Camera:
        """Add a camera.

        Args:
            path: prim path, unique in the scene.
            camera: kept, not copied.
            pose: camera to world, as in `add_mesh`; replaces `camera.transform`. The camera looks down local -Z,
                +Y is up.

        Returns:
            The camera.

        Raises:
            SceneError: the path is taken, it is no camera, or a field of it or the pose is not as described.
        """
        self._claim(path)
        if pose is not None and isinstance(camera, Camera):
            camera.transform = pose_matrix(pose, path)
        if not isinstance(camera, Camera):
            raise SceneError(f"{path}: {shown(camera)} is not a Camera")
        if fault := camera.wrong_field():
            raise SceneError(f"{path}: {fault}")
        self.cameras[path] = camera
        return camera

    def remove(self, path: str) -> None:
        """Take a prim, light or camera out of the scene; heeded by the next `Renderer.update`.

        Raises:
            SceneError: there is nothing of this path.
        """
        for things in (self.placements, self.lights, self.cameras):
            if things.pop(path, None) is not None:
                return
        raise SceneError(f"{path}: there is no such prim, light or camera to remove")

    def ids(self, paths: Name | Sequence[Name], device: str | None = None) -> wp.array:
        """Numbers by which `set_poses` knows prims; they stay the same for as long as the scene lives.

        Args:
            paths: prim paths of meshes, spheres, instancers, lights, cameras, or of anything above them, which then
                moves with all that is below it; or pairs (path, k) for copy k of an instancer.
            device: of the poses to come; None is Warp's current one.

        Returns:
            (N,) int32 on that device, made once for the same paths.

        Raises:
            SceneError: a path is not in the scene, or occurs twice.
        """
        if not isinstance(paths, (str, tuple, list, np.ndarray)):
            raise SceneError(f"{shown(paths)} is no prim path, nor a row of them")
        names, device = as_names(paths), str(wp.get_device(device))
        if (known := self.bodies.known(names, device)) is not None:
            return known
        for name in names:
            self._check_body(name)
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise SceneError(f"{twice}: the path occurs twice among those to move")
        return self.bodies.ids(names, device)

    def set_poses(self, paths: Name | Sequence[Name] | wp.array, poses: wp.array | np.ndarray) -> None:
        """Move prims; seen from the next `Renderer.update` on. Poses on a device stay there: it is one launch.

        A pose is prim to world, position and quaternion xyzw (of any length). It replaces the prim's transform but
        for its scale and shear, which are kept: the factor that stays when the rotation nearest to the transform is
        taken out, mirrored through the origin where the transform mirrors. What is below the prim moves with it,
        unless it has been posed itself.

        Args:
            paths: what to move, as for `ids`, or what `ids` returned, which spares looking the paths up.
            poses: (N,) `wp.array(dtype=wp.transformf)`. float32 counts positions far from the world's origin
                coarsely: `wp.transformd`, or numbers (N, 7) from the host, keep float64.

        Raises:
            SceneError: as `ids` does; or the arrays are not alike in length, types or device.
        """
        try:
            poses = pose_array(poses, str(paths.device) if isinstance(paths, wp.array) else None)
        except ValueError as error:
            raise SceneError(f"set_poses: {error}") from None
        ids = paths if isinstance(paths, wp.array) else self.ids(paths, str(poses.device))
        if ids.dtype != wp.int32 or ids.ndim != 1 or ids.device != poses.device:
            raise SceneError(f"set_poses: ids are not a wp.array of int32 on {poses.device}, as Scene.ids returns them")
        if len(ids) != len(poses):
            raise SceneError(f"set_poses: {len(poses)} poses for {len(ids)} prims")
        self.bodies.store(ids, poses)

    def set_visible(self, paths: str | Sequence[str], visible: bool) -> None:
        """Show or hide prims and lights, and all that is below them, from the next `Renderer.update` on.

        Raises:
            SceneError: a path is not in the scene.
        """
        if not isinstance(paths, (str, Iterable)):
            raise SceneError(f"set_visible: {shown(paths)} is no prim path, nor a row of them")
        for path in (paths,) if isinstance(paths, str) else paths:
            if not isinstance(path, str):
                raise SceneError(f"set_visible: {shown(path)} is no prim path")
            self._check_body(path)
            for things in (self.placements, self.lights):
                for name in things:
                    if path in ancestors(name):
                        things[name].visible = visible

    def _check_body(self, name: Name) -> None:
        """Raise a SceneError unless there is something to move by this name."""
        if isinstance(name, str):
            things = (self.frames, self.placements, self.lights, self.cameras)
            if any(name in t for t in things) or any(name in ancestors(p) for t in things for p in t):
                return
            raise SceneError(f"{name}: there is no such prim in the scene")
        if not (isinstance(name, tuple) and len(name) == 2):
            raise SceneError(f"{shown(name)} is no prim path, nor a pair of one and the number of a copy")
        path, copy = name
        if path not in self.placements or copy not in copies_of(self.placements[path]):
            raise SceneError(f"{path}: there is no such prim, or it has no copy {copy}")

    def check(self) -> None:
        """Look at what may have been assigned to materials and lights, and whether prims have their materials.

        Raises:
            SceneError: one cannot be drawn; the message names it and the field.
        """
        for key, material in self.materials.items():
            check_described(key or "the scene's own material", material, BaseMaterial)
        for path, light in self.lights.items():
            check_described(path, light, Light)
        for path, placement in self.placements.items():
            for key in materials_of(placement):
                if key not in self.materials:
                    raise SceneError(f"{path}: there is no material {key} that a prim is bound to")

    def _claim(self, path: str) -> None:
        if not isinstance(path, str) or not path:
            raise SceneError(f"a path is a text such as '/World/box', not {shown(path)}")
        if path in self.placements or path in self.lights or path in self.cameras:
            raise SceneError(f"{path}: the path is already in the scene")

    def _place(self, path: str, shape: Shape, material: Material | str | None, pose: object) -> Shape:
        """Draw a shape; returns it, displaced as its material says."""
        key = material if isinstance(material, str) else f"{path}/material" if material is not None else ""
        if isinstance(material, str):
            if key not in self.materials:
                raise SceneError(f"{path}: there is no material {key} that a prim is bound to")
            material = self.materials[key]
        elif material is not None:
            check_described(key, material, BaseMaterial)
        shape = displaced_as(path, shape, material, self.warn)
        placement = Placement(path, shape, pose_matrix(pose, path)[None], key)
        if material is not None:
            self.materials[key] = material
        self.placements[path] = placement
        return shape
