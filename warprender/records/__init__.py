"""The structs that cross kernels. Lengths are scene units, positions are relative to the scene's origin.

Arrays inside arrays of structs are not kept alive by Warp: the Python owner of a `DeviceScene` holds every one.
"""

from .bsdf import EVENT_ABSORB, EVENT_DELTA, EVENT_PASS, EVENT_SCATTER, Bsdf, BsdfSample, BsdfValue
from .camera import CameraRecord
from .hits import Hit, Ray, Surface
from .lights import (
    SHADOW_CHANGED,
    SHADOW_NONE,
    SHADOW_PLAIN,
    ImageRecord,
    LightLeaf,
    LightNode,
    LightRecord,
    LightSample,
    ProfileRecord,
)
from .materials import (
    MATERIAL_INPUTS,
    BrdfRecord,
    InputRecord,
    LevelRecord,
    MaterialRecord,
    MaterialValues,
    PictureRecord,
)
from .scene import BY_CHANCE, BY_POWER, DeviceScene
from .shapes import GeometryRecord, InstanceRecord, PrimvarRecord, SdfRecord
from .world import MESH, MOVED, NOT_DRAWN, SPHERE, Geometry, Instance, World

__all__ = [
    "BY_CHANCE",
    "BY_POWER",
    "EVENT_ABSORB",
    "EVENT_DELTA",
    "EVENT_PASS",
    "EVENT_SCATTER",
    "MATERIAL_INPUTS",
    "MESH",
    "MOVED",
    "NOT_DRAWN",
    "SHADOW_CHANGED",
    "SHADOW_NONE",
    "SHADOW_PLAIN",
    "SPHERE",
    "BrdfRecord",
    "Bsdf",
    "BsdfSample",
    "BsdfValue",
    "CameraRecord",
    "DeviceScene",
    "Geometry",
    "GeometryRecord",
    "Hit",
    "ImageRecord",
    "InputRecord",
    "Instance",
    "InstanceRecord",
    "LevelRecord",
    "LightLeaf",
    "LightNode",
    "LightRecord",
    "LightSample",
    "MaterialRecord",
    "MaterialValues",
    "PictureRecord",
    "PrimvarRecord",
    "ProfileRecord",
    "Ray",
    "SdfRecord",
    "Surface",
    "World",
]
