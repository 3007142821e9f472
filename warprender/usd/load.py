"""A USD stage as a `Scene`."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

import numpy as np
from pxr import Tf, Usd, UsdGeom

from ..scene import Placement, Scene, SceneError
from ..shapes import Mesh, Sphere
from .binding import Bindings
from .cameras import read_cameras
from .geometry import read_mesh, read_sphere
from .lights import read_light
from .primvars import inherited_from
from .reading import Diagnostics, Reading, one_line, shared_prim
from .settings import read_settings
from .stage import open_stage, read_metadata
from .walk import Visit, is_light, walk

#: Prim type to the reader of its shape; what is not here is not drawn yet, and says so.
SHAPES: dict[str, Callable[[Reading, Usd.Prim], Mesh | Sphere | None]] = {
    "Mesh": read_mesh,
    "Sphere": read_sphere,
}

#: What usdrecord draws besides `default`.
PURPOSES = ("proxy",)

#: usdrecord's complexities and their subdivision levels.
LEVELS = {"low": 0, "medium": 1, "high": 2, "veryhigh": 3}

#: A diagnostic of USD's that changes nothing in the picture: the binding is used all the same.
HARMLESS = "MaterialBindingAPI is not applied"


def load(
    path: str | os.PathLike | Usd.Stage,
    time: float | Usd.TimeCode | None = None,
    purposes: Iterable[str] | None = None,
    variants: Mapping[str, Mapping[str, str]] | None = None,
    mask: Iterable[str] | None = None,
    *,
    session_layer: str | os.PathLike | None = None,
    complexity: float | str = 1.0,
    render_settings: str | None = None,
) -> Scene:
    """Read a USD stage.

    Args:
        path: a .usda, .usdc, .usd or .usdz file, or a `Usd.Stage`.
        time: time code; None is the stage's startTimeCode if it is authored, else the default time.
        purposes: purposes to draw besides "default", of "render", "proxy" and "guide"; None is usdrecord's,
            ("proxy",).
        variants: prim path to variant set to selection, as {"/Car": {"paint": "red"}}.
        mask: prim paths; only they, what they contain and their ancestors are read.
        session_layer: a layer whose opinions win over the stage's.
        complexity: usdrecord's, 1.0 to 1.3 or low, medium, high, veryhigh: 0 to 3 levels of subdivision.
        render_settings: path of the RenderSettings prim; None is the stage's own choice.

    Returns:
        The scene, in the stage's own units and axes. What cannot be drawn is named in `scene.warnings`.

    Raises:
        SceneError: the file is missing or is no USD stage, or an argument names what is not there.
    """
    level = _level(complexity)
    with Diagnostics() as diagnostics:
        try:
            stage = open_stage(path, mask=mask, variants=variants, session_layer=session_layer)
            reading = Reading(stage, _time_code(stage, time), _purposes(purposes), level)
            _read(reading, render_settings)
        except Tf.ErrorException as error:
            raise SceneError(f"{path}: {one_line(error)}") from None
    for line in diagnostics.lines:
        if HARMLESS not in line:
            reading.scene.warn(line)
    return reading.scene


def _read(reading: Reading, render_settings: str | None) -> None:
    scene = reading.scene
    layer = reading.stage.GetRootLayer()
    scene.source = layer.realPath or layer.identifier
    read_metadata(reading.stage, scene)
    read_cameras(reading)
    read_settings(reading, render_settings)
    visits = list(walk(reading))
    shapes = [v for v in visits if v.prim.IsA(UsdGeom.Gprim)]
    bindings = Bindings(reading)
    bindings.resolve([v.prim for v in shapes])
    for visit in shapes:
        reading.attempt(visit.prim, _place_shape, visit, bindings)
    for visit in visits:
        if is_light(visit.prim):
            reading.attempt(visit.prim, _place_lights, visit)
    scene.bounds = _world_bounds(reading)
    reading.report()


def _place_shape(reading: Reading, visit: Visit, bindings: Bindings) -> None:
    prim = visit.prim
    read = SHAPES.get(prim.GetTypeName())
    if read is None:
        reading.remark(prim, f"{prim.GetTypeName() or 'a prim without a type'} is not drawn yet")
        return
    transforms, ids = _drawable_copies(reading, visit)
    shape = _shared_shape(reading, prim, bindings, read) if len(transforms) else None
    if shape is None:
        return
    path = _unique(reading.scene.placements, visit)
    reading.scene.placements[path] = Placement(path, shape, transforms, bindings.key(prim), ids)


def _shared_shape(reading: Reading, prim: Usd.Prim, bindings: Bindings, read: Callable) -> Mesh | Sphere | None:
    """The shape of a prim, read once for all instances that look alike."""
    subsets = bindings.subset_keys(prim)
    key = (shared_prim(prim).GetPath(), inherited_from(prim), subsets)
    if key not in reading.shapes:
        shape = read(reading, prim)
        if isinstance(shape, Mesh) and subsets:
            faces = len(reading.get(UsdGeom.Mesh(prim).GetFaceVertexCountsAttr()))
            shape.face_materials = bindings.face_materials(prim, faces)
        reading.shapes[key] = shape
    return reading.shapes[key]


def _place_lights(reading: Reading, visit: Visit) -> None:
    transforms, ids = _drawable_copies(reading, visit)
    light = read_light(reading, visit.prim) if len(transforms) else None
    if light is None:
        return
    path = _unique(reading.scene.lights, visit)
    for number, transform in zip(ids, transforms, strict=True):
        name = path if number < 0 else f"{path}[{number}]"
        reading.scene.lights[name] = replace(light, transform=transform)


def _drawable_copies(reading: Reading, visit: Visit) -> tuple[np.ndarray, np.ndarray]:
    """Transforms (K, 4, 4) and instance ids (K,) without those that are not finite or flatten space."""
    transforms = visit.transforms()
    scales = np.linalg.norm(transforms[:, :3, :3], axis=2)
    with np.errstate(all="ignore"):
        volume = np.abs(np.linalg.det(transforms[:, :3, :3])) / scales.prod(1)
    good = np.isfinite(transforms).all((1, 2)) & (scales > 0).all(1) & (volume > 1e-15)
    if good.all():
        return transforms, visit.frame.ids
    reading.remark(visit.prim, f"{np.sum(~good)} of {len(good)} transforms are singular or not finite")
    return transforms[good], visit.frame.ids[good]


def _unique(taken: Mapping[str, object], visit: Visit) -> str:
    """The prim's path; with the instancer before it where another instancer draws the same prototype."""
    path = str(visit.prim.GetPath())
    if path not in taken and not any(f"{path}[{n}]" in taken for n in visit.frame.ids[:1]):
        return path
    return f"{visit.frame.instancers[-1]}[{path}]"


def _world_bounds(reading: Reading) -> np.ndarray | None:
    """World box (2, 3) float64 of the drawn purposes, None where the stage has none or a senseless one.

    usdrecord frames what `BBoxCache` answers, authored extents included. It follows protoIndices wherever
    they point, and recurses without end into an instancer that is its own prototype: not asked then.
    """
    if not reading.sound_instancers:
        return None
    cache = UsdGeom.BBoxCache(reading.time, sorted(reading.purposes), useExtentsHint=True)
    try:
        box = cache.ComputeWorldBound(reading.stage.GetPseudoRoot()).ComputeAlignedRange()
    except Tf.ErrorException:
        return None
    bounds = np.array([box.GetMin(), box.GetMax()], np.float64)
    sane = np.isfinite(bounds).all() and (np.abs(bounds) < 1e37).all() and not box.IsEmpty()
    return bounds if sane else None


def _time_code(stage: Usd.Stage, time: float | Usd.TimeCode | None) -> Usd.TimeCode:
    if isinstance(time, Usd.TimeCode):
        return time
    if time is not None:
        return Usd.TimeCode(float(time))
    if stage.HasAuthoredMetadata("startTimeCode"):
        return Usd.TimeCode(stage.GetStartTimeCode())
    return Usd.TimeCode.Default()


def _purposes(purposes: Iterable[str] | None) -> frozenset[str]:
    chosen = frozenset(PURPOSES if purposes is None else purposes) | {"default"}
    unknown = chosen - {"default", "render", "proxy", "guide"}
    if unknown:
        raise SceneError(f"purposes: {', '.join(sorted(unknown))}: there is no such purpose")
    return chosen


def _level(complexity: float | str) -> int:
    if complexity in LEVELS:
        return LEVELS[complexity]
    try:
        return int(np.clip(round((float(complexity) - 1.0) * 10), 0, 8))
    except ValueError:
        raise SceneError(f"complexity: {complexity} is not one of {', '.join(LEVELS)}") from None
