"""A USD stage as a `Scene`."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager

import numpy as np
from pxr import Tf, Usd, UsdGeom

from ..scene import RenderSettings, Scene, SceneError
from .binding import Bindings
from .cameras import read_cameras
from .lights import remark_on_portals
from .materialx.references import is_about_documents, resolved_stage
from .motion import StageMotion
from .passes import read_pass
from .placing import mark_sound, place_lights, place_mesh_light, place_shape
from .reading import Diagnostics, Reading, one_line
from .settings import read_settings
from .skeletons import find_skins
from .stage import open_stage, read_metadata
from .stillness import still_shapes
from .walk import is_light, is_mesh_light, is_portal, walk

#: What usdrecord draws besides `default`.
PURPOSES = ("proxy",)

#: usdrecord's complexities and their subdivision levels.
LEVELS = {"low": 0, "medium": 1, "high": 2, "veryhigh": 3}

#: A diagnostic of USD's that changes nothing in the picture: the binding is used all the same.
HARMLESS = "MaterialBindingAPI is not applied"


def load(
    path: str | os.PathLike | Usd.Stage,
    time: float | str | Usd.TimeCode | None = None,
    purposes: Iterable[str] | None = None,
    variants: Mapping[str, Mapping[str, str]] | None = None,
    mask: Iterable[str] | None = None,
    *,
    session_layer: str | os.PathLike | None = None,
    complexity: float | str = 1.0,
    render_settings: str | None = None,
    render_pass: str | None = None,
    draw_modes: bool = True,
) -> Scene:
    """Read a USD stage.

    Args:
        path: a .usda, .usdc, .usd or .usdz file, or a `Usd.Stage`.
        time: time code, "default" or "earliest"; None is the stage's startTimeCode if it is authored, else "earliest".
        purposes: purposes to draw besides "default", of "render", "proxy" and "guide"; None is what the render
            settings include, else usdrecord's, ("proxy",).
        variants: prim path to variant set to selection, as {"/Car": {"paint": "red"}}.
        mask: prim paths; only they, what they contain and their ancestors are read.
        session_layer: a layer whose opinions win over the stage's.
        complexity: usdrecord's, 1.0 to 1.3 or low, medium, high, veryhigh: 0 to 3 levels of subdivision.
        draw_modes: whether models may be drawn as boxes, axes or cards where the stage says so.
        render_settings: path of the RenderSettings prim; None is the stage's own choice.
        render_pass: path of a RenderPass prim, which has settings of its own and may leave prims out.

    Returns:
        The scene, in the stage's own units and axes. What cannot be drawn is named in `scene.warnings`.

    Raises:
        SceneError: the file is missing or is no USD stage, or an argument names what is not there.
    """
    reader = StageReader(
        path,
        purposes,
        variants,
        mask,
        session_layer=session_layer,
        complexity=complexity,
        render_settings=render_settings,
        render_pass=render_pass,
        draw_modes=draw_modes,
    )
    return reader.read(time)


class StageReader:
    """A stage kept open to be read at several times. Arguments as in `load`.

    The scenes share the shapes that do not change in time, as the same objects, and subdivision surfaces whose
    points alone move keep their connectivity. What is remarked on about a shared shape, its first scene says.
    """

    def __init__(
        self,
        path: str | os.PathLike | Usd.Stage,
        purposes: Iterable[str] | None = None,
        variants: Mapping[str, Mapping[str, str]] | None = None,
        mask: Iterable[str] | None = None,
        *,
        session_layer: str | os.PathLike | None = None,
        complexity: float | str = 1.0,
        render_settings: str | None = None,
        render_pass: str | None = None,
        draw_modes: bool = True,
    ) -> None:
        """Open the stage; raises SceneError as `load` does."""
        if render_settings and render_pass:
            raise SceneError(
                f"render pass {render_pass}: it has settings of its own; {render_settings} is one too many"
            )
        self._path, self._render_settings, self._render_pass = path, render_settings, render_pass
        self._purposes, self._level, self._draw_modes = _purposes(purposes), _level(complexity), draw_modes
        self._last: Reading | None = None
        self._loading = {
            "purposes": None if purposes is None else sorted(self._purposes - {"default"}),
            "variants": {prim: dict(chosen) for prim, chosen in (variants or {}).items()},
            "mask": list(mask) if mask else None,
            "session_layer": os.path.abspath(session_layer) if session_layer else None,
            "complexity": 1.0 + self._level / 10,
            "render_settings": render_settings,
            "render_pass": render_pass,
            "draw_modes": draw_modes,
        }
        with Diagnostics() as self._opening, _as_scene_errors(path):
            stage = open_stage(path, mask=mask, variants=variants, session_layer=session_layer)
            self._stage, self._unread = resolved_stage(stage)

    def read(self, time: float | str | Usd.TimeCode | None = None) -> Scene:
        """The scene at a time code.

        Args:
            time: as in `load`.

        Returns:
            A scene of its own, whose shapes may be those of scenes read before. Where a camera's shutter is open for
            a time, `scene.motion` reads the stage at other times.

        Raises:
            SceneError: as `load`.
        """
        with Diagnostics() as diagnostics, _as_scene_errors(self._path):
            reading = self._reading(time)
            if self._last:
                reading.shapes, reading.surfaces = still_shapes(self._last), self._last.surfaces
            self._read_settings(reading)
            _read(reading)
        for line in self._opening.lines + diagnostics.lines:
            if HARMLESS not in line and not is_about_documents(line):
                reading.scene.warn(line)
        for line in self._unread:
            reading.scene.warn(line)
        reading.scene.loading = {**self._loading, "time": _plain_time(reading.time)}
        self._last = reading
        if not reading.time.IsDefault() and any(c.shutterOpen < c.shutterClose for c in reading.scene.cameras.values()):
            reading.scene.motion = StageMotion(reading.scene, self.read, self._stage, reading.time)
        return reading.scene

    def settings(self, time: float | str | Usd.TimeCode | None = None) -> RenderSettings:
        """The render settings at a time code, without the rest of the scene.

        Args:
            time: as in `load`.

        Raises:
            SceneError: as `load`.
        """
        with Diagnostics(), _as_scene_errors(self._path):
            reading = self._reading(time)
            self._read_settings(reading)
        return reading.scene.settings

    def _reading(self, time: float | str | Usd.TimeCode | None) -> Reading:
        time_code = _time_code(self._stage, time)
        return Reading(self._stage, time_code, self._purposes or frozenset(), self._level, draw_modes=self._draw_modes)

    def _read_settings(self, reading: Reading) -> None:
        """What comes before all else: it says which prims are drawn, and with which of their materials."""
        scene, layer = reading.scene, reading.stage.GetRootLayer()
        scene.source = layer.realPath or layer.identifier
        scene.layers = [used.realPath for used in reading.stage.GetUsedLayers() if used != layer and used.realPath]
        read_cameras(reading)
        path = self._render_settings
        if self._render_pass:
            reading.render_pass = read_pass(reading, self._render_pass)
            path = reading.render_pass.settings
        scene.settings = read_settings(reading, path)
        if self._purposes is None:
            included = scene.settings.includedPurposes
            reading.purposes = _purposes(PURPOSES if included is None else included)


@contextmanager
def _as_scene_errors(path: object) -> Iterator[None]:
    """USD's errors as SceneErrors that name the stage."""
    try:
        yield
    except Tf.ErrorException as error:
        raise SceneError(f"{path}: {one_line(error)}") from None


def _read(reading: Reading) -> None:
    scene = reading.scene
    read_metadata(reading.stage, scene)
    reading.skins = find_skins(reading)
    visits = list(walk(reading))
    mark_sound(visits)
    shapes = [v for v in visits if v.prim.IsA(UsdGeom.Gprim) or v.draw_mode != "default"]
    bindings = Bindings(reading)
    bindings.resolve([v.prim for v in shapes])
    for visit in shapes:
        reading.attempt(visit.prim, place_shape, visit, bindings)
    for visit in visits:
        if is_light(visit.prim) and not is_portal(visit.prim) and visit.draw_mode == "default":
            reading.attempt(visit.prim, place_lights, visit)
    remark_on_portals(reading, [v.prim for v in visits if is_portal(v.prim)])
    for prim in {v.prim.GetPath(): v.prim for v in shapes if is_mesh_light(v.prim)}.values():
        reading.attempt(prim, place_mesh_light, prim)
    scene.bounds = _world_bounds(reading)
    reading.report()


def _world_bounds(reading: Reading) -> np.ndarray | None:
    """World box (2, 3) float64 of the drawn purposes, None where it has none, a senseless one, or a point.

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
    sane = np.isfinite(bounds).all() and (np.abs(bounds) < 1e37).all() and (bounds[1] >= bounds[0]).all()
    return bounds if sane and (bounds[1] > bounds[0]).any() else None


def _time_code(stage: Usd.Stage, time: float | str | Usd.TimeCode | None) -> Usd.TimeCode:
    if isinstance(time, Usd.TimeCode):
        return time
    if time == "default":
        return Usd.TimeCode.Default()
    if time == "earliest":
        return Usd.TimeCode.EarliestTime()
    if time is not None:
        return Usd.TimeCode(float(time))
    if stage.HasAuthoredMetadata("startTimeCode"):
        return Usd.TimeCode(stage.GetStartTimeCode())
    # As usdrecord: the first sample of what is animated, the default of what is not.
    return Usd.TimeCode.EarliestTime()


def _plain_time(code: Usd.TimeCode) -> float | str:
    """As `load` takes it."""
    if code.IsDefault():
        return "default"
    return "earliest" if code.IsEarliestTime() else code.GetValue()


def _purposes(purposes: Iterable[str] | None) -> frozenset[str] | None:
    if purposes is None:
        return None
    chosen = frozenset(purposes) | {"default"}
    unknown = chosen - {"default", "render", "proxy", "guide"}
    if unknown:
        raise SceneError(f"purposes: {', '.join(sorted(unknown))}: there is no such purpose")
    return chosen


def _level(complexity: float | str) -> int:
    if complexity in LEVELS:
        return LEVELS[complexity]
    try:
        return int(np.clip(round((float(complexity) - 1.0) * 10), 0, 8))
    except (ValueError, OverflowError):
        raise SceneError(f"complexity: {complexity} is not one of {', '.join(LEVELS)}") from None
