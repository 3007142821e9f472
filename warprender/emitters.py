"""What gives light in a scene: its lights, and the geometry whose material emits enough to be worth aiming at."""

from __future__ import annotations

import numpy as np

from .errors import SceneError
from .lights import CameraLight, DomeLight, GlowingSphere, Light, MeshLight
from .placement import Placement, materials_of
from .scene import Scene
from .shapes import Mesh, Sdf, Sphere

#: Geometry that emits a smaller share of all light than this is left to be met by chance: aiming at it would call for
#: shadow rays, and take them from the lights that matter.
_WORTH_AIMING_AT = 1e-3


def lit(scene: Scene, camera_light: bool) -> dict[str, Light]:
    """The lights that emit, by path: the stage's, then glowing geometry, the camera light last when it is on."""
    powers = {path: light.power(1.0) for path, light in scene.lights.items()}
    lights = {path: light for path, light in scene.lights.items() if powers[path] != 0 or _is_lit_dome(light)}
    total = sum(powers.values())
    taken = {light.prim for light in lights.values() if isinstance(light, MeshLight)}
    glowing = {path: glow_power(scene, p) for path, p in scene.placements.items() if path not in taken}
    total += sum(glowing.values())
    for path, power in glowing.items():
        if power > _WORTH_AIMING_AT * total:
            kind = GlowingSphere if isinstance(scene.placements[path].shape, Sphere) else MeshLight
            lights[f"{path} (glows)"] = kind(prim=path, bothSides=True)
    if camera_light:
        lights["camera light"] = CameraLight()
    return lights


def use_camera_light(scene: Scene, mode: str) -> bool:
    """Whether a light is added at the camera; "auto" adds one to a scene without lights.

    Raises:
        SceneError: `mode` is not one of auto, on, off.
    """
    if mode not in ("auto", "on", "off"):
        raise SceneError(f"camera light {mode!r} is not one of auto, on, off")
    return mode == "on" or (mode == "auto" and not scene.lights)


def _is_lit_dome(light: Light) -> bool:
    """Whether it is a dome of one colour that emits: it is not aimed at, and answers a power of 0."""
    return isinstance(light, DomeLight) and light.texture is None and bool(light.radiance().any())


def emits(scene: Scene, placement: Placement) -> bool:
    """Whether any material of the placement emits."""
    return any(scene.materials[key].largest_emission() > 0 for key in materials_of(placement))


def glow_power(scene: Scene, placement: Placement) -> float:
    """Emitted power of all copies, at most; scale is taken as the same along all axes."""
    emission = max(scene.materials[key].largest_emission() for key in materials_of(placement))
    if emission <= 0:
        return 0.0
    with np.errstate(all="ignore"):
        scale = np.abs(np.linalg.det(placement.transforms[:, :3, :3])) ** (2 / 3)
    return float(emission * np.pi * 2 * object_area(placement.shape) * np.sum(scale[np.isfinite(scale)]))


def object_area(shape: Mesh | Sphere | Sdf) -> float:
    """Area in object space; 0 for signed distance functions, whose light is left to be met by chance."""
    if isinstance(shape, Sdf):
        return 0.0
    if isinstance(shape, Sphere):
        return 4 * np.pi * shape.radius**2
    area = triangle_areas(shape.host_points().astype(np.float64), shape.triangles)
    return float(area[np.isfinite(area)].sum())


def triangle_areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(T,) areas of triangles (T, 3) of points (N, 3)."""
    corners = points[triangles]
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
