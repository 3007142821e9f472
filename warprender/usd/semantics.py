"""Semantic labels: UsdSemantics' SemanticsLabelsAPI, and the SemanticsAPI that simulators wrote before it."""

from __future__ import annotations

from pxr import Sdf, Usd, UsdSemantics

from .reading import Reading

#: The taxonomy that the output `semantic` tells; without it a prim's first one does.
TAXONOMY = "class"


def read_semantic(reading: Reading, prim: Usd.Prim) -> str:
    """What a prim is: its own labels, or those of the nearest prim above that has any; "" where none has.

    Several labels are put in alphabetical order, with commas between them.
    """
    path = prim.GetPath()
    if path not in reading.semantics:
        label = _own(prim, reading.time)
        if not label and path != Sdf.Path.absoluteRootPath:
            label = read_semantic(reading, prim.GetParent())
        reading.semantics[path] = label
    return reading.semantics[path]


def _own(prim: Usd.Prim, time: Usd.TimeCode) -> str:
    found: dict[str, list[str]] = {}
    # As authored: USD does not know the older schema, and leaves it out of those that are applied.
    authored = prim.GetMetadata("apiSchemas")
    for schema in authored.GetAppliedItems() if authored else ():
        kind, _, instance = schema.partition(":")
        if kind == "SemanticsLabelsAPI":
            labels = UsdSemantics.LabelsAPI(prim, instance).GetLabelsAttr().Get(time)
            found.setdefault(instance, []).extend(labels or ())
        elif kind == "SemanticsAPI":
            values = [prim.GetAttribute(f"semantic:{instance}:params:semantic{part}") for part in ("Type", "Data")]
            taxonomy, label = (value.Get(time) if value else None for value in values)
            if label:
                found.setdefault(taxonomy or TAXONOMY, []).append(label)
    found = {taxonomy: labels for taxonomy, labels in found.items() if labels}
    return ",".join(sorted(set(found.get(TAXONOMY) or next(iter(found.values()), []))))
