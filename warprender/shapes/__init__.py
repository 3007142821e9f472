"""Shapes: what can be placed in a scene. One kind, one file; `SHAPES` is the list of kinds."""

from .mesh import Mesh, triangulate
from .primvar import Primvar
from .sdf import Sdf
from .sphere import Sphere

#: Shape kinds in the order of their ids on the device.
SHAPES = (Mesh, Sphere, Sdf)

__all__ = ["SHAPES", "Mesh", "Primvar", "Sdf", "Sphere", "triangulate"]
