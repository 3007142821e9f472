"""Opening a stage: files, masks, variants, session layers, and metadata that may be broken."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping

from pxr import Sdf, Tf, Usd, UsdGeom

from ..scene import Scene, SceneError
from .reading import one_line


def open_stage(
    source: str | os.PathLike | Usd.Stage,
    *,
    mask: Iterable[str] | None = None,
    variants: Mapping[str, Mapping[str, str]] | None = None,
    session_layer: str | os.PathLike | None = None,
) -> Usd.Stage:
    """Open a stage; arguments as in `load`.

    Raises:
        SceneError: the file is missing or no USD, or a variant or session layer does not exist.
    """
    if isinstance(source, Usd.Stage):
        if not (mask or variants or session_layer):
            return source
        root, session_paths = source.GetRootLayer(), [source.GetSessionLayer().identifier]
    else:
        root, session_paths = _open_layer(source), []
    if session_layer:
        session_paths.insert(0, _open_layer(session_layer).identifier)
    session = Sdf.Layer.CreateAnonymous("warprender.usda")
    session.subLayerPaths = session_paths
    for prim, selections in (variants or {}).items():
        for name, value in selections.items():
            _prim_spec(session, prim).variantSelections[name] = value
    try:
        if mask:
            stage = Usd.Stage.OpenMasked(root, session, Usd.StagePopulationMask(list(mask)))
        else:
            stage = Usd.Stage.Open(root, session)
    except Tf.ErrorException as error:
        raise SceneError(f"{_name(source)}: {one_line(error)}") from None
    _check_variants(stage, variants or {})
    return stage


def read_metadata(stage: Usd.Stage, scene: Scene) -> None:
    """Up axis and unit of the stage; a warning and the fallback where they make no sense."""
    up_axis = stage.GetMetadata("upAxis")
    if up_axis not in (None, "Y", "Z"):
        scene.warn(f"{scene.source}: upAxis {up_axis!r} is neither Y nor Z; Y is taken")
    scene.up_axis = "Z" if up_axis == "Z" else "Y"
    try:
        meters = float(UsdGeom.GetStageMetersPerUnit(stage))
    except (Tf.ErrorException, RuntimeError, TypeError):
        # Crate files may hold the number as a float, which the schema's getter refuses.
        meters = float(stage.GetMetadata("metersPerUnit"))
    if not 0.0 < meters < float("inf"):
        scene.warn(f"{scene.source}: metersPerUnit {meters} is no length; 0.01 is taken")
        meters = 0.01
    scene.meters_per_unit = meters


def _open_layer(path: str | os.PathLike) -> Sdf.Layer:
    path = os.fspath(path)
    if os.path.isdir(path):
        raise SceneError(f"{path}: is a folder, not a USD stage")
    try:
        layer = Sdf.Layer.FindOrOpen(path)
    except Tf.ErrorException as error:
        raise SceneError(f"{path}: not a USD stage: {one_line(error)}") from None
    if not layer:
        reason = "not a USD stage" if os.path.exists(path) else "there is no such file"
        raise SceneError(f"{path}: {reason}")
    return layer


def _prim_spec(layer: Sdf.Layer, path: str) -> Sdf.PrimSpec:
    if not Sdf.Path.IsValidPathString(path) or not Sdf.Path(path).IsAbsoluteRootOrPrimPath():
        raise SceneError(f"{path}: not the path of a prim")
    return Sdf.CreatePrimInLayer(layer, path)


def _check_variants(stage: Usd.Stage, variants: Mapping[str, Mapping[str, str]]) -> None:
    for path, selections in variants.items():
        prim = stage.GetPrimAtPath(path)
        for name, value in selections.items():
            names = prim.GetVariantSet(name).GetVariantNames() if prim else []
            if value not in names:
                choice = f"it has {', '.join(names)}" if names else "it has no such variant set"
                raise SceneError(f"{path}: there is no variant {name}={value}; {choice}")


def _name(source: object) -> str:
    return source.GetRootLayer().identifier if isinstance(source, Usd.Stage) else os.fspath(source)
