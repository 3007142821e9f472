"""The last picture of "Ray Tracing in One Weekend" (Shirley, Black, Hollasch 2020) as a USD stage, and rendered.

Small balls of three materials, strewn over a ball so large that it is the ground; three large ones; a sky from white to
blue; a lens focused at 10. Balls of one material are one `Points` prim, and what varies from ball to ball is a primvar.

python examples/one_weekend.py --out one_weekend.png
"""

import argparse
from math import radians, tan
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdRender, UsdShade

import warprender as wr
from warprender import images

ZENITH, NADIR = (0.5, 0.7, 1.0), (1.0, 1.0, 1.0)
EYE, TARGET = Gf.Vec3d(13, 2, 3), Gf.Vec3d(0, 0, 0)
#: Vertical field of view, and how wide the cone to the point in focus is, in degrees.
FIELD, DEFOCUS, FOCUS = 20.0, 0.6, 10.0


def balls(seed: int = 1) -> dict[str, list]:
    """Rows (centre, radius, colour, fuzz) by material: the book's rules with other random numbers."""
    random = np.random.default_rng(seed).random
    rows = {"diffuse": [], "metal": [], "glass": []}
    for a in range(-11, 11):
        for b in range(-11, 11):
            choice, centre = random(), np.array([a + 0.9 * random(), 0.2, b + 0.9 * random()])
            if np.linalg.norm(centre - (4, 0.2, 0)) <= 0.9:
                continue
            if choice < 0.8:
                rows["diffuse"].append((centre, 0.2, random(3) * random(3), 0.0))
            elif choice < 0.95:
                rows["metal"].append((centre, 0.2, 0.5 + 0.5 * random(3), 0.5 * random()))
            else:
                rows["glass"].append((centre, 0.2, (1, 1, 1), 0.0))
    rows["diffuse"] += [((-4, 1, 0), 1.0, (0.4, 0.2, 0.1), 0.0), ((0, -1000, 0), 1000.0, (0.5, 0.5, 0.5), 0.0)]
    rows["metal"].append(((4, 1, 0), 1.0, (0.7, 0.6, 0.5), 0.0))
    rows["glass"].append(((0, 1, 0), 1.0, (1, 1, 1), 0.0))
    return rows


def add_balls(stage: Usd.Stage, name: str, rows: list, material: UsdShade.Material | None) -> None:
    """One `Points` prim, with `displayColor` and `roughness` for each point."""
    points = UsdGeom.Points.Define(stage, f"/World/{name}")
    centre, radius, color, fuzz = (np.round(np.array(column, np.float64), 4) for column in zip(*rows, strict=True))
    points.CreatePointsAttr(centre.astype(np.float32))
    points.CreateWidthsAttr((2 * radius).astype(np.float32))
    points.SetWidthsInterpolation("vertex")
    primvars = UsdGeom.PrimvarsAPI(points)
    kinds = Sdf.ValueTypeNames
    primvars.CreatePrimvar("displayColor", kinds.Color3fArray, "vertex").Set(color.astype(np.float32))
    if name == "metal":
        # A metal of the book adds a point of a ball of radius `fuzz` to the unit reflection: about GGX's alpha is half.
        roughness = np.round(np.sqrt(fuzz / 2), 4).astype(np.float32)
        primvars.CreatePrimvar("roughness", kinds.FloatArray, "vertex").Set(roughness)
    if material:
        UsdShade.MaterialBindingAPI.Apply(points.GetPrim()).Bind(material)


def add_material(stage: Usd.Stage, name: str, shader: str, inputs: dict, primvars: dict) -> UsdShade.Material:
    """A material of one surface shader, with constant inputs and inputs read from primvars."""
    material = UsdShade.Material.Define(stage, f"/World/looks/{name}")
    surface = UsdShade.Shader.Define(stage, material.GetPath().AppendChild("surface"))
    surface.CreateIdAttr(shader)
    for key, value in inputs.items():
        surface.CreateInput(key, Sdf.ValueTypeNames.Float).Set(value)
    for key, (varname, kind) in primvars.items():
        reader = UsdShade.Shader.Define(stage, material.GetPath().AppendChild(varname))
        reader.CreateIdAttr(f"UsdPrimvarReader_{kind}")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set(varname)
        result = reader.CreateOutput("result", getattr(Sdf.ValueTypeNames, kind.capitalize()))
        surface.CreateInput(key, getattr(Sdf.ValueTypeNames, kind.capitalize())).ConnectToSource(result)
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    return material


def sky(rows: int = 512) -> np.ndarray:
    """(rows, 1, 3) colours by latitude, the pole first: as high as a direction points, so blue it is."""
    height = np.cos((np.arange(rows) + 0.5) / rows * np.pi)[:, None, None]
    return ((1 - height) * np.array(NADIR) + (1 + height) * np.array(ZENITH)) / 2


def write_stage(path: Path) -> None:
    """The stage, and beside it the sky's picture."""
    stage = Usd.Stage.CreateNew(str(path)) if not path.exists() else Usd.Stage.Open(str(path))
    stage.GetRootLayer().Clear()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    UsdGeom.Scope.Define(stage, "/World/looks")
    looks = {
        "diffuse": None,
        "metal": add_material(
            stage, "metal", "UsdPreviewSurface", {"metallic": 1.0},
            {"diffuseColor": ("displayColor", "float3"), "roughness": ("roughness", "float")},
        ),
        "glass": add_material(stage, "glass", "warprender:Dielectric", {"ior": 1.5}, {}),
    }  # fmt: skip
    for name, rows in balls().items():
        add_balls(stage, name, rows, looks[name])

    picture = path.with_name(f"{path.stem}_sky.exr")
    images.write(picture, {"color": sky().astype(np.float32)})
    dome = UsdLux.DomeLight.Define(stage, "/World/sky")
    dome.CreateTextureFileAttr(f"./{picture.name}")
    dome.CreateTextureFormatAttr("latlong")

    camera = UsdGeom.Camera.Define(stage, "/World/main_cam")
    height = 2 * 50 * tan(radians(FIELD / 2))
    camera.CreateFocalLengthAttr(50.0)
    camera.CreateVerticalApertureAttr(height)
    camera.CreateHorizontalApertureAttr(height * 16 / 9)
    camera.CreateClippingRangeAttr((0.01, 10000.0))
    camera.CreateFocusDistanceAttr(FOCUS)
    camera.CreateFStopAttr(5.0 / (2 * FOCUS * tan(radians(DEFOCUS / 2))))
    camera.AddTransformOp().Set(Gf.Matrix4d().SetLookAt(EYE, TARGET, Gf.Vec3d(0, 1, 0)).GetInverse())
    settings = UsdRender.Settings.Define(stage, "/Render/settings")
    settings.CreateResolutionAttr(Gf.Vec2i(1200, 675))
    settings.CreateCameraRel().SetTargets([camera.GetPath()])
    stage.SetMetadata("renderSettingsPrimPath", str(settings.GetPath()))
    stage.GetRootLayer().Save()


def main() -> None:
    parser = argparse.ArgumentParser(description='The last picture of "Ray Tracing in One Weekend".')
    parser.add_argument("--out", default="one_weekend.png", help="image file (default: one_weekend.png)")
    parser.add_argument("--samples", type=int, default=64, help="samples for each pixel (default: 64)")
    parser.add_argument("--width", type=int, default=400, help="pixels (default: 400)")
    args = parser.parse_args()

    stage = Path(args.out).with_suffix(".usda")
    write_stage(stage)
    scene = wr.load(str(stage))
    size = (args.width, max(1, round(args.width * 9 / 16)))
    frame = wr.render(scene, resolution=size, samples=args.samples, dome_light_visible=True)
    frame.save(args.out)
    count = sum(len(placement.transforms) for placement in scene.placements.values())
    print(f"{stage}: {count} balls\n{args.out}: {frame!r}")

    assert not scene.warnings and 470 <= count <= 488
    # In the top row there is only sky, whose blue is full and whose red follows from how high each pixel looks.
    top = frame.numpy("color")[0, :, :3]
    assert np.abs(top[:, 2] - 1).max() < 1e-3
    assert (top[:, 0] > 0.6).all() and (top[:, 0] < top[:, 1]).all()


if __name__ == "__main__":
    main()
