"""Ten stages by rays and by the rasterizer: the same face in every pixel but at edges.

    python tests/test_stages_by_raster.py

prints the table of docs/raster.md.
"""

from pathlib import Path

import numpy as np
import pytest
from first_hits import first_hits, reasons

import warprender as wr

OURS = Path(__file__).parents[1] / "scenes_usd"
ASSETS = Path(__file__).parents[2] / "shared" / "usd_assets"
STAGES = [OURS / f"{name}.usda" for name in ("card", "cornell_box", "skyline")] + [
    ASSETS / name
    for name in (
        "newton_sim_assets/bunny.usd",
        "newton_sim_assets/bear.usd",
        "newton_sim_assets/humanoid.usda",
        "openusd_baselines/Implicits/implicits.usda",
        "openusd_baselines/SubdivisionOsd3/lefthandedMesh.usda",
        "wg_creases_pyramids/Creases_SpinningPyramids.usda",
        "wg_test_assets/_common/teapot.usda",
        "wg_usdz_animation/CesiumMan.usdz",
    )
]
SIZE = (320, 240)


def compare(path, size):
    """Triangles drawn, pixels that see something, and the reasons of those that differ."""
    scene = wr.load(path)
    _, by_rays = first_hits(scene, None, "rays", size)
    renderer, by_raster = first_hits(scene, None, "raster", size)
    seen = int((by_rays["instance"] >= 0).sum())
    return renderer._first_hits._draws._face_count, seen, reasons(renderer, by_rays, by_raster)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("path", STAGES, ids=lambda path: path.stem)
def test_a_stage_by_rays_and_by_raster(path):
    if not path.exists():
        pytest.skip(f"{path} is not there")
    _, seen, found = compare(path, SIZE)
    assert seen > 0.01 * np.prod(SIZE)
    assert None not in found.values(), [pixel for pixel, reason in found.items() if reason is None]
    assert len(found) < 1e-3 * np.prod(SIZE)


def main():
    print("| stage | triangles | pixels that see | another face | at an edge | equally deep | neither |")
    print("|---|---|---|---|---|---|---|")
    for path in (path for path in STAGES if path.exists()):
        triangles, seen, found = compare(path, (1280, 720))
        counts = [list(found.values()).count(reason) for reason in ("edge", "depth", None)]
        print(
            "|", " | ".join(map(str, [path.stem, f"{triangles:,}", f"{seen:,}", len(found), *counts])), "|", flush=True
        )


if __name__ == "__main__":
    main()
