"""Stages with something broken in them: each is read and drawn, and must not crash, hang or give a NaN.

    python tests/fuzz_stages.py [--seconds 600] [--seed 0] [--first 0]

A mutant is a copy of one stage in which one to three properties or prims were changed: counts, indices, numbers that
are not finite, missing pieces. It follows from (seed, number) alone. Mutants are drawn one after the other in one
worker process; where that process ends or says nothing for a while, the mutant is to blame and a new worker goes on
behind it. `--first N --count 1 --keep FILE.usda` writes one mutant to look at.
"""

import argparse
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Tf, Usd

STAGE = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 0.01
    upAxis = "Y"
)
def Xform "World" {
    def Mesh "polygons" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
        int[] faceVertexCounts = [4, 3, 5]
        int[] faceVertexIndices = [0, 1, 2, 3, 3, 2, 4, 0, 3, 4, 5, 6]
        uniform token subdivisionScheme = "none"
        uniform token orientation = "rightHanded"
        point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0, 2, 0), (-2, 2, 0.5), (-2, 0, 0.5)]
        normal3f[] normals = [(0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 1, 1), (0, 1, 1)] (
            interpolation = "vertex" )
        float3[] extent = [(-2, -1, 0), (1, 2, 1)]
        int[] holeIndices = [1]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1), (0, 2), (1, 2), (2, 2)] (
            interpolation = "vertex" )
        int[] primvars:st:indices = [0, 1, 2, 3, 4, 5, 6]
        rel material:binding = </World/look>
        def GeomSubset "part" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [2]
            rel material:binding = </World/glow>
        }
    }
    def Mesh "surface" {
        int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
        int[] faceVertexIndices = [0, 1, 3, 2, 2, 3, 5, 4, 4, 5, 7, 6, 6, 7, 1, 0, 1, 7, 5, 3, 6, 0, 2, 4]
        uniform token subdivisionScheme = "catmullClark"
        uniform token interpolateBoundary = "edgeAndCorner"
        int[] creaseIndices = [0, 1, 3, 2]
        int[] creaseLengths = [4]
        float[] creaseSharpnesses = [2.5]
        int[] cornerIndices = [7]
        float[] cornerSharpnesses = [3]
        point3f[] points = [(-1, -1, 1), (1, -1, 1), (-1, 1, 1), (1, 1, 1), (-1, 1, -1), (1, 1, -1), (-1, -1, -1),
            (1, -1, -1)]
        color3f[] primvars:displayColor = [(0.2, 0.5, 0.8)]
        float[] primvars:displayOpacity = [0.5]
        double3 xformOp:translate = (2, 0, -2)
        float3 xformOp:scale = (0.5, 0.5, 0.5)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
    }
    def PointInstancer "copies" {
        rel prototypes = [</World/copies/ball>, </World/copies/cone>]
        int[] protoIndices = [0, 1, 0]
        point3f[] positions = [(-2, -1, 0), (0, -1.5, 1), (2, -1, 0)]
        quath[] orientations = [(1, 0, 0, 0), (0.7, 0.7, 0, 0), (1, 0, 0, 0)]
        float3[] scales = [(1, 1, 1), (0.5, 2, 0.5), (1, 1, 1)]
        int64[] ids = [5, 6, 7]
        int64[] invisibleIds = [6]
        def Sphere "ball" { double radius = 0.4 }
        def Cone "cone" { double height = 1
            double radius = 0.3
            uniform token axis = "Y" }
    }
    def BasisCurves "hair" {
        int[] curveVertexCounts = [4, 4]
        point3f[] points = [(0, 0, 1), (0.2, 0.4, 1), (0.3, 0.8, 1), (0, 1.2, 1), (0, 0, 2), (-0.2, 1, 2), (0, 1.5, 2),
            (1, 2, 2)]
        float[] widths = [0.1, 0.05]  ( interpolation = "uniform" )
        uniform token type = "cubic"
        uniform token basis = "bspline"
        uniform token wrap = "nonperiodic"
    }
    def NurbsPatch "patch" {
        int uVertexCount = 3
        int vVertexCount = 2
        int uOrder = 3
        int vOrder = 2
        double[] uKnots = [0, 0, 0, 1, 1, 1]
        double[] vKnots = [0, 0, 1, 1]
        double2 uRange = (0, 1)
        double2 vRange = (0, 1)
        point3f[] points = [(-1, -2, -1), (0, -2, 0), (1, -2, -1), (-1, -2, 1), (0, -1, 1), (1, -2, 1)]
    }
    def Points "dust" {
        point3f[] points = [(0, 0, 1.5), (0.5, 0.5, 1.5)]
        float[] widths = [0.2, 0.3]
    }
    def TetMesh "block" {
        point3f[] points = [(0, 0, -3), (1, 0, -3), (0, 1, -3), (0, 0, -2)]
        int4[] tetVertexIndices = [(0, 1, 2, 3)]
    }
    def Material "look" {
        token outputs:surface.connect = </World/look/surface.outputs:surface>
        def Shader "surface" {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0.6, 0.4, 0.2)
            float inputs:roughness = 0.3
            float inputs:metallic = 0.5
            float inputs:ior = 1.5
            float inputs:clearcoat = 0.5
            float inputs:opacity = 0.8
            float inputs:opacityThreshold = 0
            normal3f inputs:normal = (0, 0, 1)
            token outputs:surface
        }
    }
    def Material "glow" {
        token outputs:surface.connect = </World/glow/surface.outputs:surface>
        def Shader "surface" {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:emissiveColor = (3, 2, 1)
            token outputs:surface
        }
    }
    def RectLight "lamp" ( prepend apiSchemas = ["ShapingAPI", "ShadowAPI"] ) {
        float inputs:intensity = 5
        float inputs:exposure = 0
        float inputs:width = 2
        float inputs:height = 1
        color3f inputs:color = (1, 0.9, 0.8)
        float inputs:colorTemperature = 4000
        bool inputs:enableColorTemperature = 1
        bool inputs:normalize = 1
        float inputs:shaping:cone:angle = 60
        float inputs:shaping:cone:softness = 0.2
        float inputs:shaping:focus = 2
        float inputs:shadow:distance = 10
        double3 xformOp:translate = (0, 4, 3)
        float3 xformOp:rotateXYZ = (-60, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
    }
    def DomeLight "sky" { float inputs:intensity = 0.3 }
    def DistantLight "sun" { float inputs:intensity = 500
        float inputs:angle = 0.5 }
    def CylinderLight "tube" { float inputs:radius = 0.1
        float inputs:length = 2 }
    def SphereLight "bulb" { float inputs:radius = 0.2
        bool treatAsPoint = 0 }
    def Camera "eye" {
        float focalLength = 30
        float horizontalAperture = 20
        float verticalAperture = 20
        float2 clippingRange = (0.1, 100)
        float fStop = 8
        float focusDistance = 8
        double3 xformOp:translate = (0, 0, 9)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
"""

#: Numbers that break things.
BAD_FLOATS = (float("nan"), float("inf"), -float("inf"), 0.0, -0.0, -1.0, 1e-45, 1e-30, 1e30, 3e38, 1e300)
BAD_INTEGERS = (-(2**31), -1, 0, 1, 2, 3, 100, 1_000_000, 2**31 - 1)
#: Seconds after which a mutant hangs.
PATIENCE = 60.0
PIXELS = 12


def mutant(seed: int, number: int) -> Sdf.Layer:
    """A broken copy of the stage."""
    rng = np.random.default_rng((seed, number))
    layer = Sdf.Layer.CreateAnonymous(f"mutant{number}.usda")
    text = STAGE.replace("{ ", "{\n").replace(" }", "\n}")
    assert layer.ImportFromString(text)
    for _ in range(rng.integers(1, 4)):
        _break_one(layer, rng)
    return layer


def _break_one(layer: Sdf.Layer, rng: np.random.Generator) -> None:
    paths: list[Sdf.Path] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, paths.append)
    paths.remove(Sdf.Path.absoluteRootPath)
    specs = [s for s in map(layer.GetObjectAtPath, paths) if isinstance(s, (Sdf.PropertySpec, Sdf.PrimSpec))]
    spec = specs[rng.integers(len(specs))]
    if isinstance(spec, Sdf.PrimSpec):
        if rng.random() < 0.3 and spec.nameParent:
            del spec.nameParent.nameChildren[spec.name]
        elif rng.random() < 0.5:
            names = (
                "Mesh",
                "Xform",
                "Scope",
                "Sphere",
                "PointInstancer",
                "BasisCurves",
                "NurbsPatch",
                "RectLight",
                "Points",
            )
            spec.typeName = names[rng.integers(len(names))]
        return
    if rng.random() < 0.15:
        spec.owner.RemoveProperty(spec)
    elif isinstance(spec, Sdf.RelationshipSpec):
        target = ("/World/nowhere", str(spec.owner.path), "/World", "/World/polygons")[rng.integers(4)]
        spec.targetPathList.explicitItems = [Sdf.Path(target)]
    elif spec.default is not None:
        try:
            spec.default = _broken(spec.default, rng)
        except (Tf.ErrorException, TypeError, ValueError, OverflowError):
            spec.ClearDefaultValue()


def _broken(value: object, rng: np.random.Generator) -> object:
    """Another value of the same type, or as near to it as Python gets."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, str):
        words = ("", "none", "left", "bilinear", "loop", "catmullRom", "bezier", "periodic", "pinned", "X", "vertex")
        return words[rng.integers(len(words))]
    if isinstance(value, int):
        return int(BAD_INTEGERS[rng.integers(len(BAD_INTEGERS))])
    if isinstance(value, float):
        return float(BAD_FLOATS[rng.integers(len(BAD_FLOATS))])
    if isinstance(value, Sdf.AssetPath):
        return Sdf.AssetPath("missing.png")
    items = list(value)
    if type(value).__module__.startswith("pxr.Vt"):
        return type(value)(_broken_list(items, rng))
    if items and isinstance(value, (Gf.Vec2f, Gf.Vec3f, Gf.Vec2d, Gf.Vec3d, Gf.Vec4i)):
        place = rng.integers(len(items))
        items[place] = _broken(items[place], rng)
        return type(value)(*items)
    return value


def _broken_list(items: list, rng: np.random.Generator) -> list:
    way = rng.integers(6)
    if way == 0 or not items:
        return []
    place = int(rng.integers(len(items)))
    if way == 1:
        return items[:place]
    if way == 2:
        return items + items[: place + 1]
    if way == 3:
        return items * 7
    if way == 4:
        rng.shuffle(order := np.arange(len(items)))
        return [items[k] for k in order]
    return [*items[:place], _broken(items[place], rng), *items[place + 1 :]]


def draw(layer: Sdf.Layer) -> None:
    """Read a mutant and draw it; raises where colours or depths are not finite."""
    from pictures import prepare

    import warprender as wr
    from warprender.plan import OutputsKey, everything

    try:
        scene = wr.load(Usd.Stage.Open(layer), complexity="medium")
        camera = "/World/eye" if "/World/eye" in scene.cameras else None
        renderer = prepare(scene, camera, PIXELS, outputs=("color", "cameraDepth", "normal", "primId"), bounces=3)
    except wr.SceneError as error:
        assert "\n" not in str(error), f"not one line: {error}"
        return
    # One kernel for all: each kind of shape and material of its own would cost seconds to compile.
    key, all_effects = renderer.plan.outputs, everything()
    shapes, materials = all_effects.shapes, all_effects.materials
    fields = (key.camera, key.outputs, True, all_effects.features, all_effects.sdfs)
    renderer.plan.outputs = OutputsKey(shapes, materials, *fields)
    frame = renderer.render(samples=2)
    for name in ("color", "cameraDepth"):
        values = frame.numpy(name)
        assert np.isfinite(values).all(), f"{name} is not finite in {(~np.isfinite(values)).sum()} places"
    assert not any("\n" in warning for warning in scene.warnings), "a warning of several lines"


def work(seed: int, first: int, seconds: float) -> None:
    """Draw mutants one after the other; a line before each, and one for each failure."""
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    untouched = Sdf.Layer.CreateAnonymous("sound.usda")
    untouched.ImportFromString(STAGE.replace("{ ", "{\n").replace(" }", "\n}"))
    draw(untouched)
    end, number = time.monotonic() + seconds, first
    while time.monotonic() < end:
        print(f"mutant {number}", flush=True)
        try:
            draw(mutant(seed, number))
        except Exception as error:
            kind = f"{type(error).__name__}: {' '.join(str(error).split())[:300]}"
            print(f"failure {number} {kind} ({_place(error)})", flush=True)
        number += 1
    print("done", flush=True)


def _place(error: BaseException) -> str:
    trace = error.__traceback__
    while trace.tb_next is not None:
        trace = trace.tb_next
    return f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}"


def fuzz(seed: int, first: int, seconds: float) -> tuple[int, list[str]]:
    """Mutants drawn, and a line for each that failed, crashed or hung."""
    end, number, failures = time.monotonic() + seconds, first, []
    while (left := end - time.monotonic()) > 0:
        command = [sys.executable, __file__, "--work", "--seed", str(seed), "--first", str(number)]
        worker = subprocess.Popen(
            [*command, "--seconds", str(left)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        # Starting takes its time on an empty kernel cache.
        timer = threading.Timer(10 * PATIENCE, worker.kill)
        timer.start()
        errors: list[str] = []
        reader = threading.Thread(target=lambda w=worker, e=errors: e.extend(w.stderr), daemon=True)
        reader.start()
        current = None
        for line in worker.stdout:
            timer.cancel()
            timer = threading.Timer(PATIENCE, worker.kill)
            timer.start()
            if line.startswith("mutant"):
                current = int(line.split()[1])
            elif line.startswith("failure"):
                failures.append(line.strip())
        code = worker.wait()
        timer.cancel()
        reader.join(1.0)
        if code == 0:
            number = number if current is None else current + 1
            break
        if current is None:
            raise RuntimeError(f"the worker did not start: {''.join(errors)[-2000:]}")
        failures.append(f"failure {current} the process ended with {code}: crash, or a hang of {PATIENCE:.0f} s")
        number = current + 1
    return number - first, failures


def main() -> int:
    """Fuzz for a while; exit code 1 where something failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--keep", metavar="FILE.usda", help="write the mutant --first and stop")
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.work:
        work(options.seed, options.first, options.seconds)
        return 0
    if options.keep:
        mutant(options.seed, options.first).Export(options.keep)
        return 0
    drawn, failures = fuzz(options.seed, options.first, options.seconds)
    print("\n".join(failures))
    print(f"{drawn} mutants of seed {options.seed}, {len(failures)} failures")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
