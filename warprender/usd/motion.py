"""What a stage does while a camera's shutter is open: the scene that was read from it, brought to other times."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
import warp as wp
from pxr import Usd

from ..scene import Placement, Scene
from ..shutter import MOST_TIMES

#: What of a placement may change in time.
FIELDS = ("shape", "transforms", "material", "instance_ids", "visible")
#: Attributes of the scene that hold things by their paths.
TABLES = ("placements", "materials", "lights", "cameras")


@dataclass
class _State:
    """What is different at a time from the scene's own.

    Attributes:
        fields: a placement's path and field to its value.
        entries: table and path to what stands there, None where nothing does.
    """

    fields: dict[tuple[str, str], object] = field(default_factory=dict)
    entries: dict[str, dict[str, object]] = field(default_factory=lambda: {table: {} for table in TABLES})


class StageMotion:
    """Brings a scene to a time in frames from its own; called with 0 it puts everything back.

    Each time is read from the stage, which interpolates as USD does, and what is different there from the scene's own
    time is kept for the next frame. All else is left alone, and with it what was changed in the scene since.
    """

    def __init__(self, scene: Scene, read: Callable[[float], Scene], stage: Usd.Stage, time: Usd.TimeCode) -> None:
        """For a scene that was read at `time`; `read` reads the stage at another time code."""
        self._scene, self._read, self._stage = scene, read, stage
        self._time = _first_sample(stage) if time.IsEarliestTime() else time.GetValue()
        self._base: Scene | None = None
        self._states: dict[float, _State] = {}
        self._found: dict[tuple[float, float], str] = {}
        # What is to be put back.
        self._fields: dict[tuple[str, str], object] = {}
        self._tables: dict[str, dict[str, object]] = {}

    def moving(self, opens: float, closes: float) -> str:
        """The first attribute with values of its own between two times and the scene's own, or ""."""
        if (opens, closes) not in self._found:
            low, high = self._time + min(opens, 0.0), self._time + max(closes, 0.0)
            attributes = (a for prim in _prims(self._stage) for a in prim.GetAuthoredAttributes())
            moving = (str(a.GetPath()) for a in attributes if _varies(a, low, high))
            self._found[opens, closes] = next(moving, "")
        return self._found[opens, closes]

    def __call__(self, time: float) -> None:
        """Bring the scene to this time, in frames from its own."""
        state = self._state(time) if time != 0.0 else _State()
        for table in TABLES:
            self._fill(table, state.entries[table])
        for path, name in {**self._fields, **state.fields}:
            placement = self._scene.placements.get(path)
            if placement is None:
                continue
            rest = self._fields.setdefault((path, name), getattr(placement, name))
            value = state.fields.get((path, name), rest)
            if getattr(placement, name) is not value:
                setattr(placement, name, value)
        if time == 0.0:
            self._fields.clear()
            self._tables.clear()

    def _fill(self, table: str, entries: dict[str, object]) -> None:
        """Put other things into a table of the scene, and back what no longer is another; the order is kept."""
        if not entries and table not in self._tables:
            return
        things = getattr(self._scene, table)
        wanted = self._tables.setdefault(table, dict(things)) | entries
        wanted = {path: thing for path, thing in wanted.items() if thing is not None}
        if list(things) != list(wanted) or any(things[path] is not wanted[path] for path in wanted):
            things.clear()
            things.update(wanted)

    def _state(self, time: float) -> _State:
        if self._base is None:
            self._base = self._read(self._time)
        if time not in self._states:
            if len(self._states) >= MOST_TIMES:
                self._states.clear()
            self._states[time] = self._compare(self._read(self._time + time))
        return self._states[time]

    def _compare(self, other: Scene) -> _State:
        """What is different in a scene from the one at rest."""
        state = _State()
        for warning in other.warnings:
            self._scene.warn(warning)
        for table in TABLES:
            mine, its = getattr(self._base, table), getattr(other, table)
            for path in {**mine, **its}:
                if table == "placements" and path in mine and path in its:
                    self._compare_fields(path, mine[path], its[path], state)
                elif not alike(mine.get(path), its.get(path)):
                    state.entries[table][path] = its.get(path)
        return state

    def _compare_fields(self, path: str, mine: Placement, its: Placement, state: _State) -> None:
        for name in FIELDS:
            value = getattr(its, name)
            if not alike(getattr(mine, name), value):
                state.fields[path, name] = value


def alike(a: object, b: object) -> bool:
    """Whether two values, arrays, containers or plain objects hold the same."""
    if a is b:
        return True
    a, b = (thing.numpy() if isinstance(thing, wp.array) else thing for thing in (a, b))
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, dict):
        return list(a) == list(b) and all(alike(a[key], b[key]) for key in a)
    if isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(map(alike, a, b))
    if hasattr(a, "__dict__") and not callable(a):
        mine, its = ({k: v for k, v in vars(thing).items() if k != "handed_out"} for thing in (a, b))
        return alike(mine, its)
    return bool(a == b)


def _prims(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """All prims but those in instances, and those of the prototypes."""
    for root in (stage.GetPseudoRoot(), *stage.GetPrototypes()):
        yield from Usd.PrimRange(root, Usd.PrimIsActive & Usd.PrimIsLoaded)


def _varies(attribute: Usd.Attribute, low: float, high: float) -> bool:
    """Whether the attribute has more than one value from one time code to another."""
    if not attribute.ValueMightBeTimeVarying():
        return False
    below, above = attribute.GetBracketingTimeSamples(low), attribute.GetBracketingTimeSamples(high)
    return len({*below, *above}) > 1


def _first_sample(stage: Usd.Stage) -> float:
    """The earliest time code that anything has a value of its own at; 0 where nothing has."""
    first = (a.GetBracketingTimeSamples(-1e30) for p in _prims(stage) for a in p.GetAuthoredAttributes())
    return min((samples[0] for samples in first if samples), default=0.0)
