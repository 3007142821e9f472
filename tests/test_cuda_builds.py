"""Every family of kernels compiles for CUDA, which needs no GPU."""

import pytest
import warp as wp

from warprender.film import _resolve_kernel
from warprender.integrators.none import outputs_kernel
from warprender.integrators.path import path_kernel
from warprender.outputs import OUTPUTS
from warprender.plan import OutputsKey, everything


def all_outputs():
    path = everything()
    return outputs_kernel(OutputsKey(path.shapes, path.materials, path.camera, tuple(sorted(OUTPUTS)), True))


FAMILIES = {"film": _resolve_kernel, "outputs": all_outputs, "path": lambda: path_kernel(everything())}


@pytest.mark.parametrize("family", FAMILIES)
def test_kernels_compile_for_cuda(family, tmp_path):
    module = FAMILIES[family]().module
    wp.compile_aot_module(module, device=None, arch=90, use_ptx=True, module_dir=str(tmp_path))
    (ptx,) = tmp_path.glob("*.ptx")
    assert ".target sm_90" in ptx.read_text()
