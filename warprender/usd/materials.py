"""UsdShade materials that end in a surface of ours, a UsdPreviewSurface, or one of MaterialX drawn as one."""

from __future__ import annotations

from dataclasses import Field, fields, replace

import numpy as np
from pxr import Tf, UsdShade

from ..materials import Dielectric, Material, MeasuredBRDF, Phong, PreviewSurface
from ..materials.inputs import Varying
from ..materials.preview_surface import OPACITY_MODES
from .materialx.inputs import resolve
from .materialx.surfaces import displacement_input, is_node, is_surface, read_surface
from .reading import Reading, one_line
from .textures import asset_file, is_output, producer, read_node

#: The one input of a surface that moves it, which counts by an output of its own.
DISPLACEMENT = "displacement"
#: Kinds of material by shader id, whose inputs have the names of the fields.
KINDS = {
    "UsdPreviewSurface": PreviewSurface,
    "ND_UsdPreviewSurface_surfaceshader": PreviewSurface,
    "warprender:Dielectric": Dielectric,
    "warprender:Phong": Phong,
}
#: Inputs that mean nothing at 0 and below.
ABOVE_ZERO = {Dielectric: ("ior", "attenuationDistance")}


def read_material(reading: Reading, material: UsdShade.Material) -> Material | None:
    """The material; None, with a remark if it names a surface, where it is none of those that are drawn.

    A UsdPreviewSurface is what this renderer draws exactly, so it wins over MaterialX where a material has both.
    """
    try:
        for context in ("", "mtlx"):
            shader, _, _ = material.ComputeSurfaceSource(context)
            name = shader.GetShaderId() if shader else ""
            if name == "warprender:MeasuredBRDF":
                return _read_measured_brdf(reading, material, shader)
            if name in KINDS:
                inputs = _inputs(reading, shader, KINDS[name])
                _remark_unknown(reading, material, shader, KINDS[name])
                if KINDS[name] is PreviewSurface:
                    _remark_straight_through(reading, shader, inputs)
                    inputs |= _displacement(reading, material, shader)
                return KINDS[name](**inputs)
            if shader and name and is_surface(shader):
                return _displaced(reading, material, shader, read_surface(reading, shader))
        _remark_other_surface(reading, material)
    except Tf.ErrorException as error:
        reading.remark(material.GetPrim(), f"cannot be read: {one_line(error)}")
    return None


def _displaced(
    reading: Reading, material: UsdShade.Material, shader: UsdShade.Shader, drawn: PreviewSurface | Dielectric
) -> PreviewSurface | Dielectric:
    """A surface of MaterialX's with the material's displacement; a remark where it cannot have one."""
    displacement = _displacement(reading, material, shader)
    if displacement and isinstance(drawn, Dielectric):
        reading.remark(material.GetPrim(), "its displacement is not drawn where light is refracted")
        return drawn
    return replace(drawn, **displacement)


def _remark_unknown(
    reading: Reading, material: UsdShade.Material, shader: UsdShade.Shader, kind: type[Material]
) -> None:
    """Name what a material asks for beside its surface, and inputs that the surface does not have."""
    if material.ComputeVolumeSource()[0]:
        reading.remark(material.GetPrim(), "its volume is not drawn")
    known = {field.name for field in fields(kind)} | {"occlusion"}
    for source in shader.GetInputs():
        if source.GetBaseName() not in known and source.GetAttr().HasAuthoredValue():
            reading.remark(shader.GetPrim(), f"{kind.__name__} has no input {source.GetBaseName()}")


def _remark_other_surface(reading: Reading, material: UsdShade.Material) -> None:
    shader, _, _ = material.ComputeSurfaceSource("mtlx")
    if shader:
        name = shader.GetShaderId() or "a shader without an id"
        reading.remark(material.GetPrim(), f"surface {name} is not drawn yet")
        return
    contexts = [str(o.GetBaseName()) for o in material.GetSurfaceOutputs() if o.HasConnectedSource()]
    if contexts:
        reading.remark(material.GetPrim(), f"surface {contexts[0]} is not drawn yet")
    elif material.ComputeVolumeSource()[0]:
        reading.remark(material.GetPrim(), "its volume is not drawn")


def _read_measured_brdf(reading: Reading, material: UsdShade.Material, shader: UsdShade.Shader) -> MeasuredBRDF | None:
    """The measured material, with remarks about its data; None, with a remark, where its file cannot be read."""
    file = asset_file(reading, producer(reading, shader, "file"))
    if not file:
        reading.remark(shader.GetPrim(), "warprender:MeasuredBRDF names no file; it is drawn as if unbound")
        return None
    try:
        measured = MeasuredBRDF(file)
    except ValueError as error:
        reading.remark(shader.GetPrim(), f"{error}; it is drawn as if unbound")
        return None
    for warning in measured.table.warnings:
        reading.remark(material.GetPrim(), warning)
    return measured


def _inputs(reading: Reading, shader: UsdShade.Shader, kind: type[Material]) -> dict[str, object]:
    """Constants, textures and primvars of the shader's inputs, by field of the kind of material."""
    found = {field.name: _input(reading, shader, field) for field in fields(kind) if field.name != DISPLACEMENT}
    values = {name: value for name, value in found.items() if value is not None}
    if isinstance(values.get("opacityMode"), Varying):
        reading.remark(shader.GetPrim(), "opacityMode cannot vary; transparent is taken")
        del values["opacityMode"]
    if (mode := values.get("opacityMode", OPACITY_MODES[0])) not in OPACITY_MODES:
        reading.remark(shader.GetPrim(), f"opacityMode is {mode!r}; {OPACITY_MODES[0]!r} is taken")
        del values["opacityMode"]
    for name in ABOVE_ZERO.get(kind, ()):
        if not isinstance(values.get(name), Varying) and values.get(name, 1.0) <= 0:
            default = getattr(kind, name)
            reading.remark(shader.GetPrim(), f"{name} is {values.pop(name)!r}; {default!r} is taken")
    if "normal" in values:
        reading.primvars.setdefault("st", None)
    return values


def _remark_straight_through(reading: Reading, shader: UsdShade.Shader, values: dict[str, object]) -> None:
    """Say that clear surfaces do not bend light, where the stage asks for an index of refraction."""
    opacity, threshold = values.get("opacity", 1.0), values.get("opacityThreshold", 0.0)
    clear = isinstance(opacity, Varying) or opacity < 1.0
    cut_out = isinstance(threshold, Varying) or threshold > 0.0
    presence = values.get("opacityMode") == "presence"
    if clear and not cut_out and not presence and values.get("ior", 1.0) != 1.0:
        reading.remark(
            shader.GetPrim(),
            "light goes straight through it, its ior is for reflections alone; a warprender:Dielectric refracts",
        )


def _input(reading: Reading, shader: UsdShade.Shader, field: Field) -> object:
    """What an input is, None where nothing is authored that can be taken."""
    source = producer(reading, shader, field.name)
    if source is None:
        return None
    if is_output(source) and is_node(source):
        value = resolve(reading, shader.GetPrim(), lambda passing: passing.output(source), np.size(field.default))
    else:
        value = read_node(reading, source) if is_output(source) else reading.get(source)
    if value is None or isinstance(value, Varying):
        return value
    try:
        return _converted(value, field.default)
    except (TypeError, ValueError):
        reading.remark(shader.GetPrim(), f"{field.name} is {value!r}; {field.default!r} is taken")
        return None


def _displacement(reading: Reading, material: UsdShade.Material, surface: UsdShade.Shader) -> dict[str, object]:
    """The displacement of the shader that the material's own output names; a remark where no output is connected."""
    field = next(field for field in fields(PreviewSurface) if field.name == DISPLACEMENT)
    shader, _, _ = material.ComputeDisplacementSource("mtlx")
    if shader and (shader.GetShaderId() or "").startswith("ND_displacement"):
        value = displacement_input(reading, shader)
    else:
        value = _input(reading, shader or surface, field)
    if value is None:
        return {}
    if not shader and value != 0.0:
        reading.remark(material.GetPrim(), "its displacement is not drawn: outputs:displacement is not connected")
        return {}
    return {DISPLACEMENT: value}


def _converted(value: object, default: object) -> object:
    """The value as the type of the field's default; ValueError where it is not finite or of another type."""
    if isinstance(default, str):
        return str(value)
    numbers = np.asarray(value, np.float64).reshape(-1)
    if len(numbers) != np.size(default) or not (np.isfinite(numbers) | (numbers == default)).all():
        raise ValueError("not such a value")
    return tuple(map(float, numbers)) if isinstance(default, tuple) else type(default)(numbers[0])
