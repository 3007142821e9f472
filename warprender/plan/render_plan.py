"""`RenderPlan`: the answer of `analyse`."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace

import warp as wp

from ..camera import Camera
from .keys import OutputsKey, PathKey, covers

_OUTPUT = "output "


@dataclass
class RenderPlan:
    """Which effects a picture involves, and what follows.

    Attributes:
        transport: one of `TRANSPORTS`.
        visibility: "rays", "raster" or "painter": how the AOVs' first hits are found.
        color_visibility: the same of colour.
        path: key of the transport's kernel, None when no colour is asked for.
        outputs: key of the AOV kernel, None when no AOV is asked for.
        shutter: from when to when samples of colour are taken, in frames from the scene's time; None for motionless
            ones.
        reasons: effect to the prim or flag that called for it.
        absent: effect to what would call for it.
        bounds: what follows: `bounces` followed, `albedo` and `unfollowed` that they come from, whether "lights can be
            hit" by rays that are not aimed at them, and whether "shadow rays can pass" what is in their way.
    """

    transport: str
    visibility: str
    color_visibility: str
    path: PathKey | None
    outputs: OutputsKey | None
    reasons: dict[str, str] = field(default_factory=dict)
    absent: dict[str, str] = field(default_factory=dict)
    bounds: dict[str, float | bool] = field(default_factory=dict)
    shutter: tuple[float, float] | None = None

    def note(self, effect: str, reason: str, caller: str) -> None:
        """Name an effect as one that occurs, where there is a reason, or else what would call for it."""
        if reason:
            self.reasons[effect] = reason
        else:
            self.absent[effect] = caller

    def note_kinds(self, family: str, known: dict[str, str], callers: dict[str, str], why_not: str = "") -> None:
        """Note each known kind of a family with the first prim that calls for it.

        Args:
            family: the first word of the entries.
            known: kind to what would call for it.
            callers: kind to who did.
            why_not: what else would have to be asked for; then none occurs.
        """
        for kind in sorted({*known, *callers}):
            self.note(f"{family} {kind}", "" if why_not else callers.get(kind, ""), why_not or known.get(kind, ""))

    def explain(self) -> str:
        """A few lines for people: what runs, why, and what would call for the rest."""
        lines = [f"transport   {self.transport}", "", "in this picture"]
        left_out = {name: why for name, why in self.absent.items() if not name.startswith(_OUTPUT)}
        width = max((len(name) for name in (*self.reasons, *left_out)), default=0)
        lines += [f"  {name:{width}}  {reason}" for name, reason in self.reasons.items()]
        lines += ["", "left out, with what would call for it"]
        lines += [f"  {name:{width}}  {reason}" for name, reason in left_out.items()]
        outputs = [name.removeprefix(_OUTPUT) for name in self.absent if name.startswith(_OUTPUT)]
        lines += [f"  {'outputs':{width}}  --aov {' '.join(outputs)}"] if outputs else []
        numbers = {name: "no yes".split()[v] if isinstance(v, bool) else f"{v:g}" for name, v in self.bounds.items()}
        lines += ["", "bounds"] + [f"  {name:{width}}  {value}" for name, value in numbers.items()]
        return "\n".join(lines)

    def kept_from(self, before: RenderPlan, camera: Camera) -> RenderPlan:
        """This plan with the kernels of an earlier one of the same request, as far as they draw what it asks for.

        So nothing is compiled because something went, or came back.
        """
        alike = before.transport == self.transport
        path = before.path if alike and covers(before.path, self.path) else self.path
        outputs = before.outputs if covers(before.outputs, self.outputs) else self.outputs
        # Both kernels must number the distance functions alike.
        if path is None or outputs is None or path.sdfs == outputs.sdfs:
            self.path, self.outputs = path, outputs
        if "clippingPlanes" not in camera.effects() and self.visibility != before.visibility:
            self.reasons.pop(f"visibility {self.visibility}", "")
            self.visibility = before.visibility
            self.reasons[f"visibility {self.visibility}"] = "as before"
        if self.color_visibility != "rays" and before.color_visibility == "rays":
            self.reasons.pop(f"color by {self.color_visibility}", "")
            self.color_visibility, self.reasons["color by rays"] = "rays", "as before"
        return self

    @property
    def sdfs(self) -> tuple[wp.Function, ...]:
        """The signed distance functions that occur, in the order of their numbers on the device."""
        key = self.path or self.outputs
        return key.sdfs if key else ()

    def as_dict(self) -> dict:
        """The same as plain values, for JSON; functions by their names."""
        names = tuple(function.key for function in self.sdfs)
        keys = {part: replace(key, sdfs=()) if (key := getattr(self, part)) else None for part in ("path", "outputs")}
        plain = asdict(replace(self, **keys))
        for key in filter(None, (plain["path"], plain["outputs"])):
            key["sdfs"] = names
        return plain
