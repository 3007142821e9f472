"""References to `.mtlx` files in a stage, which usd-core alone cannot open.

Where a prim refers to one, an opinion in a session layer adds a reference to the layer that stands for the document.
Inside instances such an opinion counts only where it comes with the instance itself, so there it is written into a
layer that the instance refers to, in all its copies alike, and so on where these lie in instances.
"""

from __future__ import annotations

from collections.abc import Iterator

from pxr import Ar, Sdf, Usd

EXTENSION = ".mtlx"
#: What a reference without a path means.
ROOT = "/MaterialX"


def resolved_stage(stage: Usd.Stage) -> tuple[Usd.Stage, list[str]]:
    """The stage with its `.mtlx` references in place, and a line for each file that cannot be read.

    Returns the stage itself where USD has opened all it refers to.
    """
    if Sdf.FileFormat.FindByExtension(EXTENSION[1:]):
        return stage, []
    overlay, layers, lines = Sdf.Layer.CreateAnonymous("materialx.usda"), {}, []
    for prim, asset, target in _references(stage):
        if asset not in layers:
            layers[asset] = _layer(asset, lines)
        if layers[asset] is not None:
            _refer(overlay, layers, prim, Sdf.Reference(layers[asset].identifier, target))
    if not any(layers.values()):
        return stage, lines
    session = Sdf.Layer.CreateAnonymous("session.usda")
    session.subLayerPaths = [overlay.identifier, stage.GetSessionLayer().identifier]
    opened = Usd.Stage.OpenMasked(
        stage.GetRootLayer(), session, stage.GetPathResolverContext(), stage.GetPopulationMask()
    )
    opened.SetLoadRules(stage.GetLoadRules())
    return opened, lines


def is_about_documents(diagnostic: str) -> bool:
    """Whether a line of USD's says that it cannot open a document: what cannot be read says so by itself."""
    return "Could not open asset" in diagnostic and EXTENSION in diagnostic


def _layer(asset: str, lines: list[str]) -> Sdf.Layer | None:
    # Imported only here: stages without documents do not pay for the package.
    from .document import document_layer

    try:
        return document_layer(asset)
    except ValueError as error:
        lines.append(str(error))
        return None


def _references(stage: Usd.Stage) -> Iterator[tuple[Usd.Prim, str, Sdf.Path]]:
    """Prims that refer to a document, with the document's path and the path in it."""
    paths = {error.rootSite.path for error in stage.GetCompositionErrors()}
    for path in sorted(paths):
        prim = stage.GetPrimAtPath(path)
        for spec in prim.GetPrimStack() if prim else []:
            arcs = [*spec.referenceList.GetAddedOrExplicitItems(), *spec.payloadList.GetAddedOrExplicitItems()]
            for arc in arcs:
                if arc.assetPath.lower().endswith((EXTENSION, f"{EXTENSION}]")):
                    asset = Sdf.ComputeAssetPathRelativeToLayer(spec.layer, arc.assetPath)
                    yield prim, str(Ar.GetResolver().Resolve(asset)) or asset, arc.primPath or Sdf.Path(ROOT)


def _refer(overlay: Sdf.Layer, layers: dict, prim: Usd.Prim, reference: Sdf.Reference) -> None:
    """Add a reference to a prim, or to all instances that share it; these may lie in instances themselves."""
    if prim.IsInstanceProxy():
        prim = prim.GetPrimInPrototype()
    if not prim.IsInPrototype():
        _append(overlay, prim.GetPath(), reference)
        return
    prototype = prim
    while not prototype.IsPrototype():
        prototype = prototype.GetParent()
    key = f"instances of {prototype.GetPath()}"
    if key not in layers:
        layers[key] = Sdf.Layer.CreateAnonymous("instance.usda")
        for copy in prototype.GetInstances():
            _refer(overlay, layers, copy, Sdf.Reference(layers[key].identifier, "/Instance"))
    _append(layers[key], prim.GetPath().ReplacePrefix(prototype.GetPath(), Sdf.Path("/Instance")), reference)


def _append(layer: Sdf.Layer, path: Sdf.Path, reference: Sdf.Reference) -> None:
    references = Sdf.CreatePrimInLayer(layer, path).referenceList
    if reference not in references.appendedItems:
        references.appendedItems.append(reference)
