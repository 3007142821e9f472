"""AOVs: what a pixel's centre sees, besides colour. One function each, named and cleared as in Hydra.

A new AOV is a field of `OutputBuffers`, a function that writes it, and a line in `OUTPUTS`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import warp as wp

from .records import Bsdf, CameraRecord, InstanceRecord, Ray, Surface


@wp.struct
class OutputBuffers:
    """One array (H, W) for each output; those that are not asked for are empty."""

    depth: wp.array2d(dtype=wp.float32)
    cameraDepth: wp.array2d(dtype=wp.float32)
    distance: wp.array2d(dtype=wp.float32)
    normal: wp.array2d(dtype=wp.vec3)
    Neye: wp.array2d(dtype=wp.vec3)
    position: wp.array2d(dtype=wp.vec3)
    Peye: wp.array2d(dtype=wp.vec3)
    albedo: wp.array2d(dtype=wp.vec3)
    primId: wp.array2d(dtype=wp.int32)
    instanceId: wp.array2d(dtype=wp.int32)
    elementId: wp.array2d(dtype=wp.int32)
    semantic: wp.array2d(dtype=wp.int32)


@wp.struct
class Seen:
    """What the centre of pixel (x, y) sees: `face` is the authored face, `orthographic` is the projection."""

    x: wp.int32
    y: wp.int32
    camera: CameraRecord
    ray: Ray
    surface: Surface
    bsdf: Bsdf
    instance: InstanceRecord
    face: wp.int32
    orthographic: wp.int32


@wp.func
def eye_position(seen: Seen) -> wp.vec3:
    """The hit point in the camera's frame."""
    return wp.transpose(seen.camera.rotation) * (seen.surface.position - seen.camera.position)


@wp.func
def write_camera_depth(buffers: OutputBuffers, seen: Seen):
    """Distance along -Z, in scene units."""
    buffers.cameraDepth[seen.y, seen.x] = -eye_position(seen)[2]


@wp.func
def write_depth(buffers: OutputBuffers, seen: Seen):
    """Clip-space depth, 0 at the near and 1 at the far plane (OpenGL's window depth)."""
    z = -eye_position(seen)[2]
    depth = (z - seen.camera.near) / (seen.camera.far - seen.camera.near)
    if seen.orthographic == 0:
        depth = depth * seen.camera.far / z
    buffers.depth[seen.y, seen.x] = wp.clamp(depth, 0.0, 1.0)


@wp.func
def write_distance(buffers: OutputBuffers, seen: Seen):
    """Distance from the camera, or from its plane when orthographic, in scene units."""
    eye = eye_position(seen)
    distance = wp.length(eye)
    if seen.orthographic != 0:
        distance = -eye[2]
    buffers.distance[seen.y, seen.x] = distance


@wp.func
def write_normal(buffers: OutputBuffers, seen: Seen):
    """Unit shading normal in the world, on the viewer's side."""
    buffers.normal[seen.y, seen.x] = seen.surface.normal


@wp.func
def write_eye_normal(buffers: OutputBuffers, seen: Seen):
    """Unit shading normal in the camera's frame."""
    buffers.Neye[seen.y, seen.x] = wp.transpose(seen.camera.rotation) * seen.surface.normal


@wp.func
def write_position(buffers: OutputBuffers, seen: Seen):
    """The hit point in the world."""
    buffers.position[seen.y, seen.x] = seen.surface.position + seen.camera.origin


@wp.func
def write_eye_position(buffers: OutputBuffers, seen: Seen):
    """The hit point in the camera's frame."""
    buffers.Peye[seen.y, seen.x] = eye_position(seen)


@wp.func
def write_albedo(buffers: OutputBuffers, seen: Seen):
    """Diffuse colour plus reflectance at normal incidence."""
    buffers.albedo[seen.y, seen.x] = (seen.bsdf.diffuse + seen.bsdf.f0) * seen.bsdf.present


@wp.func
def write_prim_id(buffers: OutputBuffers, seen: Seen):
    """Number of the prim in drawing order."""
    buffers.primId[seen.y, seen.x] = seen.instance.prim


@wp.func
def write_instance_id(buffers: OutputBuffers, seen: Seen):
    """Index of the instance in its instancer."""
    buffers.instanceId[seen.y, seen.x] = seen.instance.instance_id


@wp.func
def write_element_id(buffers: OutputBuffers, seen: Seen):
    """The authored face."""
    buffers.elementId[seen.y, seen.x] = seen.face


@wp.func
def write_semantic(buffers: OutputBuffers, seen: Seen):
    """Number of the semantic label, a key of `Scene.semantics`; -1 for what has none."""
    buffers.semantic[seen.y, seen.x] = seen.instance.semantic


@dataclass(frozen=True)
class Output:
    """One AOV.

    Attributes:
        dtype: Warp type of a pixel.
        clear: what pixels hold where nothing is seen.
        write: `write(buffers, seen)`.
        of_material: whether it reads `seen.bsdf`.
        of_normal: whether it reads the shading normal.
    """

    dtype: type
    clear: float | int
    write: wp.Function
    of_material: bool = False
    of_normal: bool = False


#: AOVs by name. Clear values as in usdImaging and hdEmbree.
OUTPUTS: dict[str, Output] = {
    "depth": Output(wp.float32, 1.0, write_depth),
    "cameraDepth": Output(wp.float32, 0.0, write_camera_depth),
    "distance": Output(wp.float32, 0.0, write_distance),
    "normal": Output(wp.vec3, -1.0, write_normal, of_normal=True),
    "Neye": Output(wp.vec3, -1.0, write_eye_normal, of_normal=True),
    "position": Output(wp.vec3, 0.0, write_position),
    "Peye": Output(wp.vec3, 0.0, write_eye_position),
    "albedo": Output(wp.vec3, 0.0, write_albedo, of_material=True),
    "primId": Output(wp.int32, -1, write_prim_id),
    "instanceId": Output(wp.int32, -1, write_instance_id),
    "elementId": Output(wp.int32, -1, write_element_id),
    "semantic": Output(wp.int32, -1, write_semantic),
}


#: What the samples of a pixel tell of themselves, by name, with Warp type: for study. `Film.output` makes them.
FILM_OUTPUTS: dict[str, type] = {"sampleCount": wp.int32, "standardError": wp.vec3, "rayCount": wp.int32}


#: The single terms of color: what arrives after N scatterings.
_TERM = re.compile(r"color:(0|[1-9][0-9]{0,4})")


def term_of(name: str) -> int | None:
    """N of the output `color:N`, None for every other name."""
    found = _TERM.fullmatch(name)
    return int(found[1]) if found else None


def terms_of(names: Iterable[str]) -> tuple[int, ...]:
    """The terms of color among the outputs; each once, sorted."""
    return tuple(sorted({number for name in names if (number := term_of(name)) is not None}))


def output_names(outputs: object) -> tuple[str, ...]:
    """One name or several as a tuple; what is none is left for the plan to name."""
    return tuple(outputs) if isinstance(outputs, Iterable) and not isinstance(outputs, str) else (outputs,)


def of_samples(names: Iterable[str]) -> bool:
    """Whether any of the outputs is made of samples: color, one of its terms, or one of `FILM_OUTPUTS`."""
    return any(name == "color" or name in FILM_OUTPUTS or term_of(name) is not None for name in names)


def of_first_hits(names: Iterable[str]) -> tuple[str, ...]:
    """Those of the outputs that are AOVs, what a pixel's centre sees; each once, sorted."""
    return tuple(sorted(set(names) & set(OUTPUTS)))


def cleared_outputs(names: Sequence[str], width: int, height: int, device: str) -> dict[str, wp.array]:
    """An array (H, W) for each output, as it is where nothing is seen.

    All lie in one block: the allocator keeps a block of this size for the next frame, while several smaller ones go
    back to the system, and the first touch of fresh pages costs more than writing to them.
    """
    sizes = [wp.types.type_size_in_bytes(OUTPUTS[name].dtype) // 4 * width * height for name in names]
    block, arrays, first = wp.empty(sum(sizes), wp.float32, device=device), {}, 0
    for name, size in zip(names, sizes, strict=True):
        output = OUTPUTS[name]
        part = block[first : first + size].reshape((height, width, size // (width * height)))
        arrays[name] = part.view(output.dtype).reshape((height, width))
        arrays[name].fill_(output.dtype(output.clear))
        first += size
    return arrays
