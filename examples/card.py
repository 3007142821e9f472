"""Andrew Kensler's ray tracer on the back of a business card, its scene as a USD stage, and rendered.

Mirror balls that spell "aek" stand on a red and white floor, under a lamp that moves in a unit square from sample to
sample, below a sky that darkens upwards, seen through a wide lens. A path tracer differs in three things: the lamp is
a square that shines downwards and loses power with distance, the sky lights the floor in place of a constant, and the
glint on each ball is the lamp's reflection.

python examples/card.py --out card.png
"""

import argparse
from math import pi
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdRender, UsdShade, Vt

import warprender as wr
from warprender import images

#: A ball of radius 1 for each mark, a unit apart, the left one at x = 18 and the lowest row at z = 4.
LETTERS = """
..............#....
..............#....
.###....###...#....
....#..#...#..#...#
....#..#...#..#..#.
.####..#####..#.#..
#...#..#......##...
#...#..#......#.#..
.####...###...#..#.
"""
#: Share that a ball reflects, and the sky's colour at the horizon; it falls with the fourth power of 1 - height.
MIRROR, HORIZON = 0.5, (0.7, 0.6, 1.0)
WHITE, RED = (0.9, 0.9, 0.9), (0.9, 0.3, 0.3)
#: Side of the floor's squares, and where they end: beyond is their mean, which is what the eye would see.
SQUARE, TILES = 5, ((-10, 14), (-24, 6))
EYE, LOOKING, FOCUS = Gf.Vec3d(17, 16, 8), Gf.Vec3d(-6, -16, 0), 16.0
LAMP = (9.5, 9.5, 16.0)


def ball_centres() -> np.ndarray:
    """(49, 3) centres."""
    rows = LETTERS.split()
    marks = [(18 - x, 0, 12 - y) for y, row in enumerate(rows) for x, mark in enumerate(row) if mark == "#"]
    return np.array(marks, np.float32)


def tile_color(x: float, y: float) -> tuple[float, float, float]:
    """Colour of the floor at a place."""
    return RED if (np.ceil(x / SQUARE) + np.ceil(y / SQUARE)) % 2 else WHITE


def sky(rows: int = 512) -> np.ndarray:
    """(rows, 1, 3) colours by latitude, straight up first. The floor hides what is below the horizon."""
    height = np.cos((np.arange(rows) + 0.5) / rows * pi).clip(0, 1)[:, None, None]
    return (1 - height) ** 4 * np.array(HORIZON)


def add_floor(stage: Usd.Stage) -> None:
    """Squares of two colours, and four far sheets of their mean around them."""
    (x0, x1), (y0, y1) = TILES
    xs, ys = np.arange(x0, x1 + 1), np.arange(y0, y1 + 1)
    points = [(SQUARE * x, SQUARE * y, 0) for y in ys for x in xs]
    faces, colors = [], []
    for j in range(len(ys) - 1):
        for i in range(len(xs) - 1):
            corner = j * len(xs) + i
            faces.append((corner, corner + 1, corner + len(xs) + 1, corner + len(xs)))
            colors.append((WHITE, RED).index(tile_color(SQUARE * (xs[i] + 0.5), SQUARE * (ys[j] + 0.5))))
    inner = [0, len(xs) - 1, len(points) - 1, len(points) - len(xs)]
    outer = [len(points) + k for k in range(4)]
    points += [(-5000, -5000, 0), (5000, -5000, 0), (5000, 5000, 0), (-5000, 5000, 0)]
    faces += [(outer[k], outer[(k + 1) % 4], inner[(k + 1) % 4], inner[k]) for k in range(4)]
    colors += [2] * 4

    floor = UsdGeom.Mesh.Define(stage, "/World/floor")
    floor.CreatePointsAttr(np.array(points, np.float32))
    floor.CreateFaceVertexCountsAttr([4] * len(faces))
    floor.CreateFaceVertexIndicesAttr(np.array(faces, np.int32).reshape(-1))
    floor.CreateSubdivisionSchemeAttr("none")
    kind = Sdf.ValueTypeNames.Color3fArray
    color = UsdGeom.PrimvarsAPI(floor).CreatePrimvar("displayColor", kind, UsdGeom.Tokens.uniform)
    color.Set(np.array([WHITE, RED, np.mean([WHITE, RED], 0)], np.float32))
    color.SetIndices(Vt.IntArray(colors))


def add_letters(stage: Usd.Stage) -> None:
    """The balls: a metal that reflects the same share at every angle."""
    balls = UsdGeom.Points.Define(stage, "/World/letters")
    balls.CreatePointsAttr(ball_centres())
    balls.CreateWidthsAttr([2.0])
    balls.SetWidthsInterpolation("constant")
    material = UsdShade.Material.Define(stage, "/World/mirror")
    surface = UsdShade.Shader.Define(stage, "/World/mirror/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(MIRROR))
    surface.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(1.0)
    surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.0)
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(balls.GetPrim()).Bind(material)


def add_lights(stage: Usd.Stage, picture: Path) -> None:
    """The lamp, which gives white squares right below it a radiance of 0.6, and the sky with its picture."""
    lamp = UsdLux.RectLight.Define(stage, "/World/lamp")
    lamp.CreateWidthAttr(1.0)
    lamp.CreateHeightAttr(1.0)
    lamp.CreateIntensityAttr(0.6 / WHITE[0] * pi * LAMP[2] ** 2)
    UsdGeom.XformCommonAPI(lamp).SetTranslate(LAMP)
    images.write(picture, {"color": sky().astype(np.float32)})
    dome = UsdLux.DomeLight.Define(stage, "/World/sky")
    dome.CreateTextureFileAttr(f"./{picture.name}")
    dome.CreateTextureFormatAttr("latlong")
    # The picture's pole is +Y; here up is Z.
    UsdGeom.XformCommonAPI(dome).SetRotate(Gf.Vec3f(90, 0, 0))


def write_stage(path: Path) -> None:
    """The stage, and beside it the sky's picture."""
    stage = Usd.Stage.CreateNew(str(path)) if not path.exists() else Usd.Stage.Open(str(path))
    stage.GetRootLayer().Clear()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    add_floor(stage)
    add_letters(stage)
    add_lights(stage, path.with_name(f"{path.stem}_sky.exr"))

    # The picture is 512 pixels of 0.002 wide at distance 1, and the lens 99 of them at the focus.
    camera = UsdGeom.Camera.Define(stage, "/World/main_cam")
    camera.CreateFocalLengthAttr(50.0)
    camera.CreateHorizontalApertureAttr(50 * 512 * 0.002)
    camera.CreateVerticalApertureAttr(50 * 512 * 0.002)
    camera.CreateClippingRangeAttr((0.01, 20000.0))
    camera.CreateFocusDistanceAttr(FOCUS)
    camera.CreateFStopAttr(5.0 / (99 * 0.002))
    camera.AddTransformOp().Set(Gf.Matrix4d().SetLookAt(EYE, EYE + LOOKING, Gf.Vec3d(0, 0, 1)).GetInverse())
    settings = UsdRender.Settings.Define(stage, "/Render/settings")
    settings.CreateResolutionAttr(Gf.Vec2i(512, 512))
    settings.CreateCameraRel().SetTargets([camera.GetPath()])
    stage.SetMetadata("renderSettingsPrimPath", str(settings.GetPath()))
    stage.GetRootLayer().Save()


def main() -> None:
    parser = argparse.ArgumentParser(description="The business card ray tracer's scene.")
    parser.add_argument("--out", default="card.png", help="image file (default: card.png)")
    parser.add_argument("--samples", type=int, default=64, help="samples for each pixel (default: 64)")
    parser.add_argument("--width", type=int, default=512, help="pixels (default: 512)")
    args = parser.parse_args()

    stage = Path(args.out).with_suffix(".usda")
    write_stage(stage)
    scene = wr.load(str(stage))
    options = {"resolution": (args.width, args.width), "dome_light_visible": True}
    frame = wr.render(scene, samples=args.samples, **options)
    frame.save(args.out)
    print(f"{stage}\n{args.out}: {frame!r}")

    assert not scene.warnings and len(scene.placements["/World/letters"].transforms) == 49
    # The upper corners see the sky alone: the colour of the horizon, as dark as they look high.
    corner = frame.numpy("color")[0, [0, -1], :3]
    high = 0.512 / np.sqrt(1 + 2 * 0.512**2)
    assert np.abs(corner / HORIZON - (1 - high) ** 4).max() < 0.05


if __name__ == "__main__":
    main()
