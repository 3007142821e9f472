"""A MaterialX document as a USD layer, laid out as OpenUSD's own MaterialX plug-in does.

Materials stand at /MaterialX/Materials/NAME. Each holds the nodes that it needs, with their ids and connections, so
that it can be referenced by itself.
"""

from __future__ import annotations

import os
import posixpath

import MaterialX as mx
from pxr import Ar, Sdf, Tf, Usd, UsdShade

from .references import ROOT

MATERIALS = f"{ROOT}/Materials"
#: USD's types of MaterialX's.
_TYPES = {
    "float": "float", "integer": "int", "boolean": "bool", "color3": "color3f", "color4": "color4f",
    "vector2": "float2", "vector3": "float3", "vector4": "float4", "string": "string", "filename": "asset",
    "surfaceshader": "token", "displacementshader": "token",
}  # fmt: skip
_UNREADABLE = (mx.Exception, mx.ExceptionParseError, mx.ExceptionFileMissing)
_TERMINALS = {"surfaceshader": "surface", "displacementshader": "displacement"}


def document_layer(path: str) -> Sdf.Layer:
    """The layer of a `.mtlx` file.

    Args:
        path: where it lies, also in a package (`a.usdz[b.mtlx]`).

    Raises:
        ValueError: it cannot be read.
    """
    document = _read(path)
    layer = Sdf.Layer.CreateAnonymous(".usda")
    stage = Usd.Stage.Open(layer)
    stage.SetDefaultPrim(stage.DefinePrim(ROOT, "Scope"))
    stage.DefinePrim(MATERIALS, "Scope")
    for node in document.getMaterialNodes():
        _Material(stage, document, path, node).write()
    return layer


def _read(path: str) -> mx.Document:
    document = mx.createDocument()
    try:
        if "[" in path:
            asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
            with asset:
                mx.readFromXmlString(document, bytes(asset.GetBuffer()).decode())
        else:
            mx.readFromXmlFile(document, path, mx.FileSearchPath(os.path.dirname(path)))
    except (*_UNREADABLE, OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: {' '.join(str(error).split())}") from None
    # Nodes that the document itself defines are replaced by what they are made of.
    document.flattenSubgraphs()
    for graph in document.getNodeGraphs():
        if not graph.getNodeDefString():
            graph.flattenSubgraphs()
    return document


class _Material:
    """One material being written, with copies of the nodes that it needs."""

    def __init__(self, stage: Usd.Stage, document: mx.Document, path: str, node: mx.Node) -> None:
        self.stage, self.document, self.path, self.node = stage, document, path, node
        self.root = Sdf.Path(MATERIALS).AppendChild(Tf.MakeValidIdentifier(node.getName()))

    def write(self) -> None:
        material = UsdShade.Material.Define(self.stage, self.root)
        for name, terminal in _TERMINALS.items():
            source = self.node.getInput(name)
            if source is None or not source.getNodeName():
                continue
            output = material.CreateOutput(f"mtlx:{terminal}", Sdf.ValueTypeNames.Token)
            self._connect(output, source, self.document, self.root)

    def _connect(
        self, sink: UsdShade.Input | UsdShade.Output, source: mx.PortElement, scope: mx.GraphElement, parent: Sdf.Path
    ) -> None:
        """Connect an input, or an output of a graph, to what it names, which is written first where it is not yet."""
        kind = source.getType()
        if source.getNodeGraphString():
            graph = self.document.getNodeGraph(source.getNodeGraphString())
            if graph is not None:
                path = self._write_graph(graph)
                outputs = graph.getOutputs()
                name = source.getOutputString() or (outputs[0].getName() if outputs else "out")
                sink.ConnectToSource(UsdShade.NodeGraph.Get(self.stage, path).ConnectableAPI(), name)
            return
        node = scope.getNode(source.getNodeName())
        if node is None:
            return
        shader = self._write_node(node, scope, parent)
        name = source.getOutputString() or "out"
        output = shader.GetOutput(name) or shader.CreateOutput(name, _type(kind))
        sink.ConnectToSource(output)

    def _write_node(self, node: mx.Node, scope: mx.GraphElement, parent: Sdf.Path) -> UsdShade.Shader:
        path = parent.AppendChild(Tf.MakeValidIdentifier(node.getName()))
        shader = UsdShade.Shader.Get(self.stage, path)
        if shader:
            return shader
        shader = UsdShade.Shader.Define(self.stage, path)
        shader.CreateIdAttr(node.getNodeDefString() or f"ND_{node.getCategory()}_{node.getType()}")
        if node.getType() != "multioutput":
            shader.CreateOutput("out", _type(node.getType()))
        for source in node.getInputs():
            self._write_input(shader.ConnectableAPI(), source, scope, parent)
        return shader

    def _write_graph(self, graph: mx.NodeGraph) -> Sdf.Path:
        path = self.root.AppendChild(Tf.MakeValidIdentifier(graph.getName()))
        if self.stage.GetPrimAtPath(path):
            return path
        prim = UsdShade.NodeGraph.Define(self.stage, path)
        for source in graph.getInputs():
            self._write_input(prim.ConnectableAPI(), source, self.document, self.root)
        for output in graph.getOutputs():
            made = prim.CreateOutput(Tf.MakeValidIdentifier(output.getName()), _type(output.getType()))
            self._connect(made, output, graph, path)
        return path

    def _write_input(
        self, prim: UsdShade.ConnectableAPI, source: mx.Input, scope: mx.GraphElement, parent: Sdf.Path
    ) -> None:
        made = prim.CreateInput(source.getName(), _type(source.getType()))
        space = source.getActiveColorSpace()
        if source.getType() in ("color3", "color4", "filename"):
            made.GetAttr().SetColorSpace(space or "raw")
        if source.getInterfaceName():
            graph = UsdShade.NodeGraph.Get(self.stage, parent)
            if graph:
                made.ConnectToSource(graph.CreateInput(source.getInterfaceName(), _type(source.getType())))
        elif source.getNodeName() or source.getNodeGraphString():
            self._connect(made, source, scope, parent)
        elif source.getValueString():
            made.Set(self._value(source))

    def _value(self, source: mx.Input) -> object:
        if source.getType() == "filename":
            return Sdf.AssetPath(_beside(self.path, source.getResolvedValueString()))
        value = source.getValue()
        if isinstance(value, int | float | str | bool):
            return value
        return value.asTuple()


def _type(name: str) -> Sdf.ValueTypeName:
    return Sdf.ValueTypeNames.Find(_TYPES.get(name, "token"))


def _beside(path: str, file: str) -> str:
    """A file that a document names, as seen from where the document lies."""
    if "[" in path:
        package, _, inner = path[:-1].partition("[")
        return f"{package}[{posixpath.normpath(posixpath.join(posixpath.dirname(inner), file))}]"
    return os.path.normpath(os.path.join(os.path.dirname(path), file))
