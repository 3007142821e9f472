"""Evaluation of a shading network of MaterialX nodes, with given values at its leaves: its pictures and primvars."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from pxr import Sdf, Usd, UsdShade

from ...textures import Texture
from ..reading import Reading, one_line
from ..textures import asset_file, is_output, producer
from . import spaces
from .nodes import NODES, SWIZZLE, Values, column, converted, placed

#: Components of the types of outputs.
WIDTHS = {
    "float": 1, "int": 1, "bool": 1, "color3f": 3, "color4f": 4, "float2": 2, "float3": 3, "float4": 4,
    "vector3f": 3, "normal3f": 3, "point3f": 3, "texCoord2f": 2, "double": 1, "half": 1,
}  # fmt: skip
#: Names of single components among the outputs of nodes that have several.
_COMPONENTS = {"r": 0, "g": 1, "b": 2, "a": 3, "x": 0, "y": 1, "z": 2, "w": 3}
_WRAPS = {
    "constant": "black", "black": "black", "clamp": "clamp", "periodic": "repeat", "repeat": "repeat",
    "mirror": "mirror", "useMetadata": "useMetadata",
}  # fmt: skip
IMAGES = ("image", "tiledimage", "gltf_image", "gltf_normalmap", "gltf_colorimage", "UsdUVTexture")
READERS = ("geompropvalue", "UsdPrimvarReader")
#: Nodes whose values a surface knows only while it is being shaded.
_CATEGORIES = (*NODES, *IMAGES, *READERS, "texcoord", "geomcolor", "swizzle")


class Undrawable(Exception):
    """A node that cannot be drawn; `prim` and `message` make the remark."""

    def __init__(self, prim: Usd.Prim, message: str) -> None:
        super().__init__(message)
        self.prim, self.message = prim, message


@dataclass(frozen=True)
class PrimvarLeaf:
    """A primvar of the shape, of `width` numbers."""

    name: str
    width: int
    fallback: tuple[float, ...] = (0.0,)


@dataclass(eq=False)
class ImageLeaf:
    """A picture: `texture` as it lies in the file, the colour space of what is in it, and where it is looked up."""

    texture: Texture
    space: str
    coordinates: Callable[[Evaluation], Values]


Leaf = PrimvarLeaf | ImageLeaf


@dataclass
class Evaluation:
    """One pass over a network.

    Attributes:
        reading: the reading in progress.
        leaf_values: values (P, width) of a leaf; pictures have four.
        images: the pictures met so far by their node, common to the passes over one network.
    """

    reading: Reading
    leaf_values: Callable[[Evaluation, Leaf], Values]
    images: dict[Sdf.Path, ImageLeaf | None]
    _done: dict[Sdf.Path, Values | None] = field(default_factory=dict)

    def input(self, node: UsdShade.Shader, name: str, default: object = 0.0) -> Values:
        """(P, width) of an input: connected, authored, or the default; "st" stands for texture coordinates."""
        source = producer(self.reading, node, name)
        if source is not None and is_output(source):
            return self.output(source)
        value = self.reading.get(source) if source is not None else None
        if value is None:
            if isinstance(default, str):
                return self.leaf_values(self, PrimvarLeaf(default, 2, (0.0, 0.0)))
            return np.reshape(np.asarray(default, np.float64), (1, -1))
        try:
            numbers = np.reshape(np.asarray(value, np.float64), (1, -1))
        except (TypeError, ValueError):
            raise Undrawable(node.GetPrim(), f"{name} is {value!r}, no number") from None
        if not np.isfinite(numbers).all():
            raise Undrawable(node.GetPrim(), f"{name} is not finite")
        if str(source.GetTypeName()).startswith("color"):
            numbers = spaces.to_linear(numbers, self._space(source))
        return numbers

    def output(self, output: Usd.Attribute) -> Values:
        """(P, width) of a node's output."""
        path = output.GetPath()
        if path not in self._done:
            self._done[path] = None
            self._done[path] = self._computed(output)
        found = self._done[path]
        if found is None:
            raise Undrawable(output.GetPrim(), "it is connected to itself")
        return found

    def _computed(self, output: Usd.Attribute) -> Values:
        node = UsdShade.Shader(output.GetPrim())
        category = category_of(node)
        try:
            with np.errstate(all="ignore"):
                values = self._node_values(node, category)
        except (ValueError, IndexError) as error:
            raise Undrawable(node.GetPrim(), f"its inputs do not fit together: {one_line(error)}") from None
        name = str(output.GetBaseName())
        component = _COMPONENTS.get(name.removeprefix("out"))
        if component is not None and name != "out":
            return column(values, component)
        width = WIDTHS.get(str(output.GetTypeName()))
        if width is None or (category in NODES and category != "convert" and values.shape[1] != 1):
            return values
        return converted(values, width)

    def _node_values(self, node: UsdShade.Shader, category: str) -> Values:
        if category in NODES:
            return NODES[category](lambda name, default: self.input(node, name, default))
        if category == "swizzle":
            channels = str(self._token(node, "channels", "rgb"))
            return SWIZZLE(lambda name, default: self.input(node, name, default), channels)
        if category == "texcoord":
            index = int(self.input(node, "index", 0)[0, 0])
            return self.leaf_values(self, PrimvarLeaf(f"st{index}" if index else "st", 2, (0.0, 0.0)))
        if category == "geomcolor":
            return self.leaf_values(self, PrimvarLeaf("displayColor", 3, (0.0, 0.0, 0.0)))
        if category in READERS:
            return self.leaf_values(self, self._primvar(node, category))
        if category in IMAGES:
            return self._image_values(node, category)
        identifier = node.GetShaderId() or "a shader without an id"
        raise Undrawable(node.GetPrim(), f"{identifier} is not read")

    def _primvar(self, node: UsdShade.Shader, category: str) -> PrimvarLeaf:
        reader = category == "UsdPrimvarReader"
        name = str(self._token(node, "varname" if reader else "geomprop", ""))
        if not name:
            raise Undrawable(node.GetPrim(), "it names no primvar")
        fallback = self.input(node, "fallback" if reader else "default", 0.0)[0]
        width = next((WIDTHS.get(str(o.GetTypeName()), 3) for o in node.GetOutputs()), 3)
        return PrimvarLeaf(name.removeprefix("primvars:"), width, tuple(map(float, fallback)))

    def _image_values(self, node: UsdShade.Shader, category: str) -> Values:
        path = node.GetPath()
        if path not in self.images:
            self.images[path] = self._image(node, category)
        leaf = self.images[path]
        if leaf is None:
            return self._default(node, category)[None]
        texels = self.leaf_values(self, leaf)
        if leaf.texture.sourceColorSpace == "raw":
            texels = spaces.to_linear(texels, leaf.space)
        if category == "UsdUVTexture":
            return texels * self.input(node, "scale", (1.0,) * 4) + self.input(node, "bias", (0.0,) * 4)
        if category == "gltf_normalmap":
            return 2.0 * texels[:, :3] - 1.0
        if category == "gltf_colorimage":
            return texels * self.input(node, "color", (1.0,) * 4) * self.input(node, "geomcolor", (1.0,) * 4)
        if category == "gltf_image":
            factor = self.input(node, "factor", 1.0)
            return texels[:, : max(factor.shape[1], _output_width(node))] * factor
        return texels

    def _image(self, node: UsdShade.Shader, category: str) -> ImageLeaf | None:
        """The picture of a node as it is in the file; None, with a remark, where it names no file."""
        attribute = producer(self.reading, node, "file")
        file = asset_file(self.reading, attribute)
        if not file:
            self.reading.remark(node.GetPrim(), "it names no file; its default is taken")
            return None
        space = self._space(attribute)
        if category == "UsdUVTexture" and not space:
            space = {"auto": ""}.get(stated := str(self._token(node, "sourceColorSpace", "auto")), stated)
        colors = _output_width(node) >= 3 and category != "gltf_normalmap"
        source = "sRGB" if spaces.is_srgb(space) else "auto" if not space and colors else "raw"
        names = ("wrapS", "wrapT") if category == "UsdUVTexture" else ("uaddressmode", "vaddressmode")
        wraps = ["repeat" if category == "tiledimage" else self._wrap(node, name) for name in names]
        fallback = tuple(map(float, self._default(node, category)))
        texture = Texture(file, "rgb", *wraps, source, fallback=fallback, prim=str(node.GetPath()))
        return ImageLeaf(texture, space, lambda passing: _coordinates(passing, node, category))

    def _default(self, node: UsdShade.Shader, category: str) -> Values:
        """(4,) what an image gives where there is no picture."""
        name, value = "default", 0.0
        if category == "UsdUVTexture":
            name, value = "fallback", (0.0, 0.0, 0.0, 1.0)
        elif category == "gltf_normalmap":
            value = (0.5, 0.5, 1.0)
        return converted(self.input(node, name, value), 4)[0]

    def _wrap(self, node: UsdShade.Shader, name: str) -> str:
        stated = str(self._token(node, name, "periodic"))
        if stated not in _WRAPS:
            self.reading.remark(node.GetPrim(), f"{name} {stated!r} is not known; periodic is taken")
        return _WRAPS.get(stated, "repeat")

    def _token(self, node: UsdShade.Shader, name: str, default: str) -> object:
        source = producer(self.reading, node, name)
        value = self.reading.get(source) if source is not None and not is_output(source) else None
        return default if value is None else value

    def _space(self, attribute: Usd.Attribute) -> str:
        name = str(attribute.GetColorSpace() or "")
        if not spaces.known(name):
            self.reading.remark(attribute.GetPrim(), f"the colour space {name} is not known; lin_rec709 is taken")
            return "lin_rec709"
        return name


def category_of(node: UsdShade.Shader) -> str:
    """The category of a node by its id: ND_multiply_color3FA is a multiply; "" for what is not read."""
    name = (node.GetShaderId() or "").removeprefix("ND_")
    fitting = [c for c in _CATEGORIES if name == c or name.startswith(f"{c}_")]
    return max(fitting, key=len, default="")


def _output_width(node: UsdShade.Shader) -> int:
    widths = [WIDTHS.get(str(output.GetTypeName()), 0) for output in node.GetOutputs()]
    return max(widths, default=0) or 3


def _coordinates(passing: Evaluation, node: UsdShade.Shader, category: str) -> Values:
    """(P, 2) where a picture is looked up."""
    st = passing.input(node, "st" if category == "UsdUVTexture" else "texcoord", "st")[:, :2]
    if category == "tiledimage":
        moved = st * passing.input(node, "uvtiling", (1.0, 1.0)) - passing.input(node, "uvoffset", (0.0, 0.0))
        size = passing.input(node, "realworldtilesize", (1.0, 1.0)) / passing.input(
            node, "realworldimagesize", (1.0, 1.0)
        )
        return moved * size
    if category.startswith("gltf_"):
        order = 0.0 if category == "gltf_colorimage" else passing.input(node, "operationorder", 0.0)
        return placed(
            st,
            passing.input(node, "pivot", (0.0, 1.0)),
            1.0 / passing.input(node, "scale", (1.0, 1.0)),
            -passing.input(node, "rotate", 0.0),
            passing.input(node, "offset", (0.0, 0.0)) * (-1.0, 1.0),
            np.reshape(order, (1, -1)),
        )
    return st
