"""UsdShade materials that end in a shader with an id of `SURFACES`."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from pxr import Tf, UsdShade

from ..materials import Dielectric, Material, Phong, PreviewSurface
from ..materials.inputs import Varying
from .reading import Reading, one_line
from .textures import is_output, producer, read_node

#: Surface shaders by id. Their inputs have the names of the fields.
SURFACES = {"UsdPreviewSurface": PreviewSurface, "warprender:Dielectric": Dielectric, "warprender:Phong": Phong}


def read_material(reading: Reading, material: UsdShade.Material) -> Material | None:
    """The material as what its surface shader is; None, with a remark if it names one, where it is none of ours."""
    try:
        shader, _, _ = material.ComputeSurfaceSource()
        if not shader:
            _remark_other_surface(reading, material)
            return None
        name = shader.GetShaderId() or "a shader without an id"
        if name not in SURFACES:
            reading.remark(material.GetPrim(), f"surface {name} is not drawn yet")
            return None
        return SURFACES[name](**_inputs(reading, shader, SURFACES[name]))
    except Tf.ErrorException as error:
        reading.remark(material.GetPrim(), f"cannot be read: {one_line(error)}")
        return None


def _remark_other_surface(reading: Reading, material: UsdShade.Material) -> None:
    contexts = [str(o.GetBaseName()) for o in material.GetSurfaceOutputs() if o.HasConnectedSource()]
    if contexts:
        reading.remark(material.GetPrim(), f"surface {contexts[0]} is not drawn yet")


def _inputs(reading: Reading, shader: UsdShade.Shader, kind: type[Material]) -> dict[str, object]:
    """Constants, textures and primvars of the shader's inputs, by field of the kind of material."""
    values = {}
    for field in fields(kind):
        source = producer(reading, shader, field.name)
        if source is None:
            continue
        value = read_node(reading, source) if is_output(source) else reading.get(source)
        if value is None:
            continue
        if isinstance(value, Varying):
            if field.name == "opacityMode":
                reading.remark(shader.GetPrim(), "opacityMode cannot vary; transparent is taken")
                continue
            values[field.name] = value
            continue
        try:
            values[field.name] = _converted(value, field.default)
        except (TypeError, ValueError):
            reading.remark(shader.GetPrim(), f"{field.name} is {value!r}; {field.default!r} is taken")
    if "normal" in values:
        reading.primvars.setdefault("st", None)
    _remark_displacement(reading, shader)
    return values


def _remark_displacement(reading: Reading, shader: UsdShade.Shader) -> None:
    source = producer(reading, shader, "displacement")
    if source is not None and (is_output(source) or reading.get(source)):
        reading.remark(shader.GetPrim(), "displacement is not drawn yet")


def _converted(value: object, default: object) -> object:
    """The value as the type of the field's default; ValueError where it is not finite or of another type."""
    if isinstance(default, str):
        return str(value)
    numbers = np.asarray(value, np.float64).reshape(-1)
    if len(numbers) != np.size(default) or not (np.isfinite(numbers) | (numbers == default)).all():
        raise ValueError("not such a value")
    return tuple(map(float, numbers)) if isinstance(default, tuple) else type(default)(numbers[0])
