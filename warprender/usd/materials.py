"""UsdShade materials that end in a UsdPreviewSurface."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from pxr import Tf, Usd, UsdShade

from ..materials import PreviewSurface
from .reading import Reading, one_line

#: Inputs of UsdPreviewSurface that change the picture and have no constant form worth keeping.
NEEDS_TEXTURES = ("normal", "displacement")


def read_material(reading: Reading, material: UsdShade.Material) -> PreviewSurface | None:
    """The material as a `PreviewSurface`; None, with a remark if it names a surface, where it is none."""
    try:
        shader, _, _ = material.ComputeSurfaceSource()
        if not shader:
            _remark_other_surface(reading, material)
            return None
        name = shader.GetShaderId() or "a shader without an id"
        if name != "UsdPreviewSurface":
            reading.remark(material.GetPrim(), f"surface {name} is not drawn yet")
            return None
        return PreviewSurface(**_inputs(reading, shader))
    except Tf.ErrorException as error:
        reading.remark(material.GetPrim(), f"cannot be read: {one_line(error)}")
        return None


def _remark_other_surface(reading: Reading, material: UsdShade.Material) -> None:
    contexts = [str(o.GetBaseName()) for o in material.GetSurfaceOutputs() if o.HasConnectedSource()]
    if contexts:
        reading.remark(material.GetPrim(), f"surface {contexts[0]} is not drawn yet")


def _inputs(reading: Reading, shader: UsdShade.Shader) -> dict[str, object]:
    """Constant values of the shader's inputs, by field of `PreviewSurface`."""
    values = {}
    for field in fields(PreviewSurface):
        value = _input_value(reading, shader, field.name)
        if value is None:
            continue
        try:
            values[field.name] = _converted(value, field.default)
        except (TypeError, ValueError):
            reading.remark(shader.GetPrim(), f"{field.name} is {value!r}; {field.default!r} is taken")
    for name in NEEDS_TEXTURES:
        if _is_connected(shader.GetInput(name)):
            reading.remark(shader.GetPrim(), f"{name} is not drawn yet")
    return values


def _input_value(reading: Reading, shader: UsdShade.Shader, name: str) -> object:
    """Value of an input through material interfaces and node graphs; None for the fallback."""
    source = shader.GetInput(name)
    producers = source.GetValueProducingAttributes() if source else []
    if not producers:
        return None
    if UsdShade.Utils.GetType(producers[0].GetName()) != UsdShade.AttributeType.Output:
        return reading.get(producers[0])
    node = UsdShade.Shader(producers[0].GetPrim())
    identifier = node.GetShaderId() or "a shader without an id"
    reading.remark(shader.GetPrim(), f"{name} comes from {identifier}, which is not read yet")
    return _node_fallback(reading, node, producers[0])


def _node_fallback(reading: Reading, node: UsdShade.Shader, output: Usd.Attribute) -> object:
    """What a texture or primvar reader would answer without its texture or primvar, if that is authored."""
    fallback = node.GetInput("fallback")
    value = reading.get(fallback.GetAttr()) if fallback and fallback.GetAttr().HasAuthoredValue() else None
    if value is None:
        return None
    channel = UsdShade.Output(output).GetBaseName()
    if channel == "rgb":
        return tuple(value)[:3]
    return value["rgba".index(channel)] if channel in ("r", "g", "b", "a") else value


def _is_connected(source: UsdShade.Input | None) -> bool:
    producers = source.GetValueProducingAttributes() if source else []
    return any(UsdShade.Utils.GetType(p.GetName()) == UsdShade.AttributeType.Output for p in producers)


def _converted(value: object, default: object) -> object:
    """The value as the type of the field's default; ValueError where it is not finite or of another type."""
    if isinstance(default, str):
        return str(value)
    numbers = np.asarray(value, np.float64).reshape(-1)
    if len(numbers) != np.size(default) or not np.isfinite(numbers).all():
        raise ValueError("not such a value")
    return tuple(map(float, numbers)) if isinstance(default, tuple) else type(default)(numbers[0])
