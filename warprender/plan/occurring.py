"""What occurs in a scene: one look at every prim, which notes the first that calls for each effect."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import warp as wp

from ..materials import TRANSMITTING, DisplayColor
from ..materials.inputs import NORMAL
from ..placement import Placement, materials_of
from ..scene import Scene
from ..shapes import Mesh, Primvar, Sdf
from ..textures import Texture


@dataclass
class Occurring:
    """Effects of shapes and materials, each with the path of the first prim that calls for it; "" where none does.

    Attributes:
        shapes: kind of shape to prim.
        materials: kind of material to prim.
        lobes: of `materials.material.LOBES`, to prim: of surfaces that reflect anything.
        reads: "texture" or "primvar" and the input that is read from one, to prim.
        features: of `materials.inputs.FEATURES`, to prim; those of materials alone.
        mapped_by: features that normals are read with.
        cut_out: a prim whose material is there or not, by a threshold.
        passing: a prim that lets rays go straight through.
        emitting: a prim that emits.
        other_shape: a prim that is no mesh.
        distances: a prim that is a signed distance function.
        sdfs: the functions, each once, in drawing order.
        albedo: upper bound on the reflected share of light over all surfaces.
        brightest: the prim that has it.
        triangles: of all copies together.
    """

    shapes: dict[str, str] = field(default_factory=dict)
    materials: dict[str, str] = field(default_factory=dict)
    lobes: dict[str, str] = field(default_factory=dict)
    reads: dict[str, str] = field(default_factory=dict)
    features: dict[str, str] = field(default_factory=dict)
    mapped_by: set[str] = field(default_factory=set)
    cut_out: str = ""
    passing: str = ""
    emitting: str = ""
    other_shape: str = ""
    distances: str = ""
    sdfs: tuple[wp.Function, ...] = ()
    albedo: float = 0.0
    brightest: str = ""
    triangles: int = 0


def occurring(scene: Scene, energy_compensation: bool = False) -> Occurring:
    """Look at all prims of a scene; compensation may add to what a surface reflects, up to all."""
    found = Occurring(sdfs=distance_functions(scene))
    albedos: dict[str, float] = {}
    for path, placement in scene.placements.items():
        _of_shape(found, placement)
        for key in dict.fromkeys(materials_of(placement)):
            material = scene.materials[key]
            if key not in albedos:
                albedos[key] = material.largest_albedo()
                _of_material(found, path, material)
            _of_surface(found, placement, material, albedos[key])
    if energy_compensation and found.albedo > 0.0:
        found.albedo = 1.0
    found.albedo = min(found.albedo, 1.0)
    return found


def distance_functions(scene: Scene) -> tuple[wp.Function, ...]:
    """The functions of all `Sdf` shapes, each once, in drawing order."""
    shapes = (placement.shape for placement in scene.placements.values())
    return tuple(dict.fromkeys(shape.kernel_function() for shape in shapes if isinstance(shape, Sdf)))


def _of_shape(found: Occurring, placement: Placement) -> None:
    path, shape = placement.path, placement.shape
    found.shapes.setdefault(type(shape).__name__, path)
    if isinstance(shape, Mesh):
        found.triangles += len(shape.triangles) * len(placement.transforms)
        return
    found.other_shape = found.other_shape or path
    if isinstance(shape, Sdf):
        found.distances = found.distances or path


def _of_material(found: Occurring, path: str, material: object) -> None:
    """What a material calls for wherever it is."""
    found.materials.setdefault(type(material).__name__, path)
    for number, (name, source) in material.varying().items():
        reads = "texture" if isinstance(source, Texture) else "primvar"
        found.features.setdefault(reads, path)
        found.reads.setdefault(f"{reads} {name}", path)
        if number == NORMAL:
            found.features.setdefault("normal map", path)
            found.mapped_by.add(reads)
    if isinstance(material, TRANSMITTING):
        found.features.setdefault("transmission", path)
    if material.is_cut_out():
        found.cut_out = found.cut_out or path
    if material.passes_light():
        found.passing = found.passing or path
    if material.largest_emission() > 0:
        found.emitting = found.emitting or path


def _of_surface(found: Occurring, placement: Placement, material: object, albedo: float) -> None:
    """What depends on primvars, too; `albedo` is the material's own, which a displayColor takes the place of."""
    if isinstance(material, DisplayColor):
        primvars: dict[str, Primvar] = placement.shape.primvars
        colors, opacity = primvars.get("displayColor"), primvars.get("displayOpacity")
        if colors is not None and len(colors.values):
            albedo = float(np.fmax.reduce(colors.values, axis=None, initial=0.0))
        if opacity is not None and not (opacity.values >= 1.0).all():
            found.passing = found.passing or placement.path
    if albedo > 0.0:
        for lobe in material.lobes():
            found.lobes.setdefault(lobe, placement.path)
    if albedo > found.albedo:
        found.albedo, found.brightest = albedo, placement.path
