"""Random hierarchies: what is drawn, and where, is what USD's own queries say prim by prim."""

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom

from warprender.usd import load

PURPOSES = ("default", "render", "proxy", "guide")
TIME = 3.0


def random_stage(seed: int) -> Usd.Stage:
    """A tree of transforms, gprims, lights and cameras, some of it in classes that native instances inherit."""
    rng = np.random.default_rng(seed)
    stage = Usd.Stage.CreateInMemory()
    library = stage.CreateClassPrim("/library")
    for number in range(2):
        grow(stage, rng, str(library.GetPath().AppendChild(f"asset{number}")), 2)
    for number in range(3):
        grow(stage, rng, f"/tree{number}", 4)
    for number in range(6):
        parent = rng.choice(["", "/tree0", "/tree1"])
        prim = UsdGeom.Xform.Define(stage, f"{parent}/instance{number}").GetPrim()
        dress(rng, prim)
        prim.GetInherits().AddInherit(f"/library/asset{rng.integers(2)}")
        prim.SetInstanceable(bool(rng.random() < 0.7))
    return stage


def grow(stage, rng, path, depth):
    kinds = ["Xform", "Scope", "Xform", "Sphere", "Cube", "SphereLight", "Camera", ""]
    prim = stage.DefinePrim(path, str(rng.choice(kinds[:3] if depth > 1 else kinds)))
    dress(rng, prim)
    if depth:
        for number in range(rng.integers(1, 4)):
            grow(stage, rng, f"{path}/p{number}", depth - 1)
            if rng.random() < 0.05:
                stage.GetPrimAtPath(f"{path}/p{number}").SetActive(False)


def dress(rng, prim):
    """Transform operations, a purpose and visibility by chance; some vary in time."""
    imageable, xformable = UsdGeom.Imageable(prim), UsdGeom.Xformable(prim)
    if imageable and rng.random() < 0.3:
        imageable.CreatePurposeAttr(str(rng.choice(PURPOSES)))
    if imageable and rng.random() < 0.15:
        visibility = imageable.CreateVisibilityAttr()
        visibility.Set("invisible", 1.0)
        visibility.Set(str(rng.choice(["invisible", "inherited"])), 2.0)
    if not xformable:
        return
    pivot = Gf.Vec3f(*rng.normal(size=3))
    if rng.random() < 0.6:
        translate = xformable.AddTranslateOp()
        for time in (1.0, 4.0):
            translate.Set(Gf.Vec3d(*rng.normal(size=3)), time)
    if rng.random() < 0.4:
        xformable.AddTranslateOp(UsdGeom.XformOp.PrecisionFloat, "pivot").Set(pivot)
        xformable.AddOrientOp().Set(Gf.Quatf(*rng.normal(size=4)).GetNormalized())
        xformable.AddScaleOp().Set(Gf.Vec3f(*rng.uniform(0.5, 2, 3)))
        xformable.AddTranslateOp(UsdGeom.XformOp.PrecisionFloat, "pivot", True)
    if rng.random() < 0.15:
        xformable.SetResetXformStack(True)


def expected(stage: Usd.Stage, included: set[str]) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Matrices of the gprims and of the lights by path, asked for one by one."""
    gprims, lights = {}, {}
    for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)):
        found = gprims if prim.IsA(UsdGeom.Gprim) else lights if prim.HasAPI("LightAPI") else None
        if found is None:
            continue
        imageable = UsdGeom.Imageable(prim)
        if imageable.ComputeVisibility(TIME) == "invisible" or imageable.ComputePurpose() not in included:
            continue
        found[str(prim.GetPath())] = np.array(imageable.ComputeLocalToWorldTransform(TIME))
    return gprims, lights


@pytest.mark.parametrize("seed", range(25))
@pytest.mark.parametrize("purposes", [("proxy",), ("render", "guide")])
def test_gprims_and_lights_stand_where_usd_says(seed, purposes):
    stage = random_stage(seed)
    scene = load(stage, TIME, purposes=purposes)
    gprims, lights = expected(stage, {"default", *purposes})
    assert set(scene.placements) == set(gprims) and set(scene.lights) == set(lights)
    for path, placement in scene.placements.items():
        np.testing.assert_allclose(placement.transforms[0], gprims[path], atol=1e-12)
    for path, light in scene.lights.items():
        np.testing.assert_allclose(light.transform, lights[path], atol=1e-12)


def test_the_random_stages_have_all_that_they_are_for():
    stages = [random_stage(seed) for seed in range(25)]
    drawn = [expected(stage, {"default", "proxy"}) for stage in stages]
    assert sum(len(gprims) for gprims, _ in drawn) > 200 and sum(len(lights) for _, lights in drawn) > 50
    assert sum(len(stage.GetPrototypes()) for stage in stages) > 20
