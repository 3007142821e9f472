"""A virtual gonioreflectometer: light and viewer are moved over the hemisphere, and a material's BRDF is written down.

What comes out is a `BrdfTable`, the same that is read from files of measured materials. Each cell holds the BRDF at
its centre, not a mean over the cell, so that what is read back is exact there.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import warp as wp

from .launch import launch
from .materials import Material
from .materials.brdf_table import MERL_CELLS, MISSING, BrdfTable, directions
from .materials.dispatch import material_functions
from .placement import materials_of
from .records import EVENT_ABSORB, EVENT_DELTA, EVENT_PASS, DeviceScene, Surface
from .sampling import DIMENSION_BSDF, DIMENSION_LOBE, random_pair, sample_stream
from .scene import Scene, SceneError
from .upload import Upload

#: Path of the sample that is measured.
_SAMPLE = "/sample"


def measure_brdf(
    material: Material,
    cells: tuple[int, int, int] = MERL_CELLS,
    energy_compensation: bool = False,
    device: str = "cpu",
    threads: int | None = None,
) -> BrdfTable:
    """Measure the BRDF of a material over all pairs of directions above the horizon.

    Args:
        material: of any kind; what varies over the surface cannot be measured.
        cells: numbers of cells over θ_half, θ_diff and φ_diff; MERL's tools read those of the default alone.
        energy_compensation: measure with the option of `Renderer` of that name.
        device: Warp device, as "cpu" or "cuda:0".
        threads: CPU threads, None for all cores.

    Returns:
        Values in 1/sr; cells whose centre lies below the horizon are marked missing. Mirror reflection and light that
        goes through have no BRDF: `remarks` says where they are left out.

    Raises:
        SceneError: an input of the material varies, or a number of cells is below 1.
    """
    if len(cells) != 3 or min(cells) < 1:
        raise SceneError(f"cells {cells}: three numbers of 1 or more are needed")
    if varying := [name for name, _ in material.varying().values()]:
        raise SceneError(f"{', '.join(varying)} varies over the surface, and only constants are measured")
    scene = Scene()
    scene.add_sphere(_SAMPLE, material=material)
    number = list(scene.materials).index(materials_of(scene.placements[_SAMPLE])[0])
    upload = Upload(scene, {}, np.zeros(3), device)
    upload.record.energy_compensation = int(energy_compensation)
    features = ("energy compensation",) if energy_compensation else ()
    wo, wi = directions(cells)
    above = (wo[..., 2] > 0) & (wi[..., 2] > 0)
    if not above.any():
        raise SceneError(f"cells {cells}: none has its centre above the horizon")
    pairs = [wp.array(w[above].astype(np.float32), dtype=wp.vec3, device=device) for w in (wo, wi)]
    found = wp.empty(len(pairs[0]), dtype=wp.vec3, device=device)
    events = wp.empty(len(pairs[0]), dtype=wp.int32, device=device)
    kernel = measure_kernel(type(material).__name__, features)
    launch(kernel, len(found), [upload.record, number, *pairs, found, events], device, threads)
    values = np.full((*cells, 3), MISSING, np.float32)
    values[above] = np.maximum(found.numpy(), 0.0)
    return BrdfTable(values, "", _left_out(set(np.unique(events.numpy()))))


def _left_out(events: set[int]) -> tuple[str, ...]:
    remarks = []
    if int(EVENT_DELTA) in events:
        remarks.append("a lobe is a perfect mirror, which no table can hold; it is left out")
    if int(EVENT_PASS) in events:
        remarks.append("light that goes through is no reflection; it is left out")
    return tuple(remarks)


@cache
def measure_kernel(material: str, features: tuple[str, ...]) -> wp.Kernel:
    """The kernel for a kind of `MATERIALS`: item i is the pair of directions number i.

    It writes the BRDF and the event of one sampled direction, EVENT_PASS for any that leaves on the other side: mirrors
    and holes show themselves there alone.
    """
    prepare, evaluate, sample = material_functions((material,), features)

    @wp.kernel(module="unique", enable_backward=False)
    def measure(
        first: wp.int32,
        scene: DeviceScene,
        material: wp.int32,
        wo: wp.array(dtype=wp.vec3),
        wi: wp.array(dtype=wp.vec3),
        found: wp.array(dtype=wp.vec3),
        events: wp.array(dtype=wp.int32),
    ):
        i = first + wp.tid()
        surface = Surface()
        surface.normal = wp.vec3(0.0, 0.0, 1.0)
        surface.geometric_normal = surface.normal
        surface.outgoing = wo[i]
        surface.front = 1
        surface.material = material
        bsdf = prepare(scene, surface)
        value = evaluate(scene, bsdf, wo[i], wi[i])
        found[i] = (value.diffuse + value.specular) / wi[i][2]
        stream = sample_stream(wp.uint32(0), i, 0, 0)
        lobe = random_pair(stream, 0, DIMENSION_LOBE)[0]
        sampled = sample(scene, bsdf, wo[i], random_pair(stream, 0, DIMENSION_BSDF), lobe)
        through = sampled.event != EVENT_ABSORB and sampled.direction[2] < 0.0
        events[i] = wp.where(through, EVENT_PASS, sampled.event)

    return measure


def find_material(scene: Scene, path: str) -> Material:
    """The material at a prim path.

    Raises:
        SceneError: no drawn prim is bound to a material of that path.
    """
    if path and path in scene.materials:
        return scene.materials[path]
    bound = ", ".join(key for key in scene.materials if key)
    raise SceneError(f"{path}: no drawn prim is bound to such a material; there is {bound or 'none'}")
