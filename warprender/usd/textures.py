"""UsdUVTexture, UsdTransform2d and UsdPrimvarReader nodes, through interfaces and node graphs."""

from __future__ import annotations

import numpy as np
from pxr import Sdf, Usd, UsdShade

from ..textures import CHANNELS, COLOR_SPACES, WRAPS, PrimvarReader, Texture
from .reading import Reading

#: Types that UsdPrimvarReader_… reads as numbers.
READ_TYPES = ("float", "float2", "float3", "float4", "int", "normal", "point", "vector")
_READER = "UsdPrimvarReader_"


def producer(reading: Reading, shader: UsdShade.Shader, name: str) -> Usd.Attribute | None:
    """The attribute that gives an input its value, of this shader or of one that it is connected to."""
    source = shader.GetInput(name)
    if not source:
        return None
    producers = source.GetValueProducingAttributes()
    if producers:
        return producers[0]
    if source.HasConnectedSource() or source.GetAttr().HasAuthoredConnections():
        reading.remark(shader.GetPrim(), f"{name} is connected to what is not there or to itself")
    return None


def is_output(attribute: Usd.Attribute) -> bool:
    """Whether the attribute is computed by a shader, not a value."""
    return UsdShade.Utils.GetType(attribute.GetName()) == UsdShade.AttributeType.Output


def read_node(reading: Reading, output: Usd.Attribute) -> Texture | PrimvarReader | tuple | float | None:
    """What a shader's output gives: a texture, a primvar, a constant, or None, with a remark, for other nodes."""
    node = UsdShade.Shader(output.GetPrim())
    identifier = node.GetShaderId() or "a shader without an id"
    if identifier == "UsdUVTexture":
        return _read_texture(reading, node, str(output.GetName()).split(":")[-1])
    if identifier.removeprefix(_READER) in READ_TYPES and identifier.startswith(_READER):
        return _read_primvar_reader(reading, node)
    reading.remark(node.GetPrim(), f"{identifier} is not read")
    return None


def _read_texture(reading: Reading, node: UsdShade.Shader, channel: str) -> Texture | tuple | float:
    if channel not in CHANNELS:
        reading.remark(node.GetPrim(), f"UsdUVTexture has no output {channel}; rgb is taken")
        channel = "rgb"
    fallback = _numbers(reading, node, "fallback", (0.0, 0.0, 0.0, 1.0))
    file = asset_file(reading, producer(reading, node, "file"))
    if not file:
        reading.remark(node.GetPrim(), "it names no file; its fallback is taken")
        return fallback[:3] if channel == "rgb" else fallback["rgba".index(channel)]
    st, transform = _coordinates(reading, node)
    return Texture(
        file,
        channel,
        wrapS=_token(reading, node, "wrapS", (*WRAPS, "useMetadata"), "useMetadata"),
        wrapT=_token(reading, node, "wrapT", (*WRAPS, "useMetadata"), "useMetadata"),
        sourceColorSpace=_token(reading, node, "sourceColorSpace", COLOR_SPACES, "auto"),
        scale=_numbers(reading, node, "scale", (1.0, 1.0, 1.0, 1.0)),
        bias=_numbers(reading, node, "bias", (0.0, 0.0, 0.0, 0.0)),
        fallback=fallback,
        st=st,
        transform=transform[:2],
        prim=str(node.GetPath()),
    )


def asset_file(reading: Reading, attribute: Usd.Attribute | None) -> str:
    """The resolved path, with `<UDIM>` left in; the path as written where nothing is found; "" for none."""
    value = reading.get(attribute) if attribute and not is_output(attribute) else None
    if not isinstance(value, Sdf.AssetPath) or not value.path:
        return ""
    if "<UDIM>" in value.path:
        specs = attribute.GetPropertyStack(reading.time)
        found = UsdShade.UdimUtils.ResolveUdimPath(value.path, specs[0].layer) if specs else ""
        return found or value.path
    return value.resolvedPath or value.path


def _coordinates(reading: Reading, node: UsdShade.Shader) -> tuple[PrimvarReader | tuple[float, float], np.ndarray]:
    """What `st` reads, and the (3, 3) transform of the chain of UsdTransform2d nodes in between."""
    transform = np.eye(3)
    name, visited = "st", set()
    while True:
        source = producer(reading, node, name)
        if source is None or not is_output(source):
            return _numbers(reading, node, name, (0.0, 0.0)), transform
        node = UsdShade.Shader(source.GetPrim())
        if node.GetShaderId() != "UsdTransform2d":
            break
        if node.GetPath() in visited:
            reading.remark(node.GetPrim(), "it is connected to itself")
            return (0.0, 0.0), transform
        visited.add(node.GetPath())
        transform = transform @ _transform_2d(reading, node)
        name = "in"
    found = read_node(reading, source)
    if isinstance(found, PrimvarReader):
        return found, transform
    if found is not None:
        reading.remark(node.GetPrim(), "texture coordinates from a texture are not read")
    return (0.0, 0.0), transform


def _transform_2d(reading: Reading, node: UsdShade.Shader) -> np.ndarray:
    """(3, 3) for columns: scale, then rotation counter-clockwise, then translation."""
    scale = _numbers(reading, node, "scale", (1.0, 1.0))
    angle = np.radians(_numbers(reading, node, "rotation", (0.0,))[0])
    matrix = np.eye(3)
    matrix[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    matrix[:2, :2] *= scale
    matrix[:2, 2] = _numbers(reading, node, "translation", (0.0, 0.0))
    return matrix


def _read_primvar_reader(reading: Reading, node: UsdShade.Shader) -> PrimvarReader | None:
    """A primvar reader; `varname` is a string, and was a token once."""
    varname = _constant(reading, node, "varname")
    if not varname:
        reading.remark(node.GetPrim(), "it names no primvar")
        return None
    declared = node.GetInput("varname").GetTypeName()
    if declared != "string":
        reading.remark(node.GetPrim(), f"varname is a {declared}, as in old stages; it is taken")
    varname = str(varname).removeprefix("primvars:")
    reading.primvars.setdefault(varname, None)
    fallback = np.reshape(_constant(reading, node, "fallback") or 0.0, -1)[:4]
    return PrimvarReader(varname, tuple(map(float, fallback)))


def _constant(reading: Reading, node: UsdShade.Shader, name: str) -> object:
    """Value of an input that must not vary; None, with a remark, where it does."""
    source = producer(reading, node, name)
    if source is None:
        return None
    if is_output(source):
        reading.remark(node.GetPrim(), f"{name} is connected to a shader, which is not read")
        return None
    return reading.get(source)


def _numbers(reading: Reading, node: UsdShade.Shader, name: str, default: tuple[float, ...]) -> tuple[float, ...]:
    value = _constant(reading, node, name)
    if value is None:
        return default
    try:
        numbers = np.asarray(value, np.float64).reshape(-1)
    except (TypeError, ValueError):
        numbers = np.zeros(0)
    if len(default) == 4 and len(numbers) == 3:
        # Stages leave the alpha of colours out.
        numbers = np.append(numbers, default[3])
    if len(numbers) != len(default) or not np.isfinite(numbers).all():
        reading.remark(node.GetPrim(), f"{name} is {value!r}; {default!r} is taken")
        return default
    return tuple(map(float, numbers))


def _token(reading: Reading, node: UsdShade.Shader, name: str, known: tuple[str, ...], default: str) -> str:
    value = _constant(reading, node, name)
    if value is None:
        return default
    if str(value) not in known:
        reading.remark(node.GetPrim(), f"{name} {value!r} is not one of {', '.join(known)}; {default} is taken")
        return default
    return str(value)
