"""Every family of kernels compiles for CUDA, which needs no GPU.

The path tracer is compiled for a plain key: with every effect compiled in, CUDA's compiler takes minutes.
"""

import pytest
import warp as wp

from warprender import bodies
from warprender.film import _resolve_kernel
from warprender.gonioreflectometer import measure_kernel
from warprender.integrators import RADIANCE
from warprender.integrators.none import outputs_kernel
from warprender.integrators.samples import samples_kernel
from warprender.integrators.views import ViewKey, views_kernel
from warprender.outputs import OUTPUTS
from warprender.plan import OutputsKey, PathKey
from warprender.sensors.poses import place_kernel
from warprender.shapes import live_normals
from warprender.visibility import first_hits, placing, trees, view_raster
from warprender.visibility.attributes import _kernel as interpolate_kernel

CAMERA = ("perspective",)
PLAIN = PathKey(("Mesh", "Sphere"), ("DisplayColor",), ("RectLight",), (), CAMERA, True, False)


def all_outputs():
    return outputs_kernel(OutputsKey(PLAIN.shapes, PLAIN.materials, CAMERA, tuple(sorted(OUTPUTS)), False))


def views(found_by, transport="local", worlds=True):
    outputs = OutputsKey(PLAIN.shapes, PLAIN.materials, CAMERA, ("cameraDepth", "semantic"), False)
    return views_kernel(
        ViewKey(PLAIN, outputs, transport, found_by, worlds, True, ("color", "rgba8"), False, True), None
    )


GLASS = PathKey(
    ("Mesh", "Sphere"), ("Dielectric",), ("SphereLight",), (), CAMERA, True, False, features=("transmission",)
)

FAMILIES = {
    "film": _resolve_kernel,
    "interpolate": lambda: interpolate_kernel(3, True),
    "measured BRDF": lambda: measure_kernel("MeasuredBRDF", ()),
    "outputs": all_outputs,
    "rasterized": lambda: samples_kernel(CAMERA, (), RADIANCE["local"](PLAIN), True),
    **{name: lambda f=function: samples_kernel(CAMERA, (), f(PLAIN)) for name, function in RADIANCE.items()},
    "views by rays": lambda: views("rays", "direct"),
    "views by raster": lambda: views("raster", worlds=False),
    "views by a table": lambda: views("table"),
    "places of views": lambda: place_kernel(wp.transformf),
    "matrices of views": lambda: view_raster._view_matrices,
    "pixels of views for rays": lambda: view_raster._mark_rows,
    "faces of views": view_raster._keyed_faces,
    "pixels of views": view_raster._keyed_pixels,
    "poses": lambda: bodies.store_kernel(wp.transformf),
    "placing": lambda: placing._place_instances,
    "normals that follow": lambda: live_normals._follow,
    "box of a mesh": lambda: trees._mesh_box,
    "matrices to clip space": lambda: first_hits._matrices_to_clip,
    "pixels for rays": lambda: first_hits._box_pixels,
    "glass": lambda: samples_kernel(CAMERA, (), RADIANCE["path"](GLASS)),
}


@pytest.mark.parametrize("family", FAMILIES)
def test_kernels_compile_for_cuda(family, tmp_path):
    module = FAMILIES[family]().module
    wp.compile_aot_module(module, device=None, arch=90, use_ptx=True, module_dir=str(tmp_path))
    (ptx,) = tmp_path.glob("*.ptx")
    assert ".target sm_90" in ptx.read_text()
