"""Compares pictures with Mitsuba 3 (scalar_rgb), pixel by pixel, in units of their standard errors.

    python tests/mitsuba/compare.py cornell --mitsuba PYTHON > tests/mitsuba/cornell.txt
    python tests/mitsuba/compare.py lights --mitsuba PYTHON > tests/mitsuba/lights.txt
    python tests/mitsuba/compare.py dome --mitsuba PYTHON > tests/mitsuba/dome.txt
    python tests/mitsuba/compare.py glass --samples 1024 --mitsuba PYTHON > tests/mitsuba/glass.txt
    python tests/mitsuba/compare.py rough --samples 1024 --mitsuba PYTHON > tests/mitsuba/rough.txt
    python tests/mitsuba/compare.py plates --size 128 --samples 1024 --mitsuba PYTHON > tests/mitsuba/plates.txt
    python tests/mitsuba/compare.py lamps --size 96 --times 4 --mitsuba PYTHON > tests/mitsuba/lamps.txt

PYTHON is the interpreter of an environment with `pip install mitsuba`. Both renderers get the same triangles, which
are read from warprender's own scene. Surfaces are Lambert's, dielectrics or metals: a metal of UsdPreviewSurface
reflects its colour at every angle, which is Mitsuba's rough conductor without a material. Of rough surfaces Mitsuba
multiplies the Smith terms of both directions, warprender correlates them by height: for the metals the ratio is
1 + Λi Λo / (1 + Λi + Λo), at most 1.0001 for the alphas and angles of `plates`; rough dielectrics are not quite the
same model. The other materials of the two are not the same at all.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

import scenes  # noqa: E402

import warprender as wr  # noqa: E402
from warprender.images import write  # noqa: E402
from warprender.lights import LightTexture  # noqa: E402


def cornell() -> wr.Scene:
    """The Cornell box of `scenes_usd`."""
    return wr.load(str(HERE.parent.parent / "scenes_usd" / "cornell_box.usda"))


def lights() -> wr.Scene:
    """A smooth mesh and a quadric on a floor, under a sphere light, a distant light and a dome."""
    scene = wr.Scene()
    points, faces = scenes.icosphere(4)
    pose = np.diag([1.0, 0.7, 1.2, 1.0])
    pose[3, :3] = -1.2, 0.7, 0.0
    scene.add_mesh("/smooth", points, faces, normals=points, color=(0.8, 0.5, 0.3), pose=pose)
    scene.add_sphere("/quadric", 1.0, color=(0.3, 0.6, 0.8), pose=(1.2, 1.0, -0.5, 0, 0, 0, 1))
    floor = np.array([(-6, 0, -6), (-6, 0, 6), (6, 0, 6), (6, 0, -6)])
    scene.add_mesh("/floor", floor, [[0, 1, 2, 3]], color=(0.6, 0.6, 0.6))
    scene.add_light(wr.SphereLight(radius=0.4, intensity=20.0, color=(1, 0.8, 0.6)), pose=(0.3, 3.0, 1.5, 0, 0, 0, 1))
    # Lights of UsdLux occlude nothing, those of Mitsuba do: a black ball inside makes the two alike.
    scene.add_sphere("/lamp", 0.4 * 0.9999, color=(0, 0, 0), pose=(0.3, 3.0, 1.5, 0, 0, 0, 1))
    sun = scenes.look_at((3.0, 4.0, -2.0))
    scene.add_light(wr.DistantLight(intensity=1.5, angle=0.0, color=(0.7, 0.8, 1.0)), pose=sun)
    scene.add_light(wr.DomeLight(intensity=0.3, color=(0.8, 0.9, 1.0)))
    scene.add_camera("/camera", scenes.camera((0.5, 2.5, 6.0), (0.0, 0.9, 0.0), fov=45.0))
    scene.settings.camera = "/camera"
    return scene


def dome() -> wr.Scene:
    """The shapes of `lights` under a turned picture of a sky with clouds and a sun of one texel."""
    scene = lights()
    for path in [path for path in scene.placements if path == "/lamp"]:
        del scene.placements[path]
    sky = np.random.default_rng(5).random((24, 48, 3)).astype(np.float32) * (0.4, 0.6, 1.0)
    sky[12:] *= 0.1
    sky[5, 9] = 400.0, 350.0, 250.0
    turn = scenes.look_at((0.6, 0.2, 1.0))
    # From above, where no sky is seen: straight at it a pixel has no noise that small differences could hide in.
    scene.cameras["/camera"] = scenes.camera((0.3, 7.0, 4.5), (0.0, 0.2, -0.2), fov=38.0)
    scene.lights = {"/sky": wr.DomeLight(intensity=0.8, texture=LightTexture.of(sky), transform=turn)}
    return scene


def glass() -> wr.Scene:
    """Balls, a block and a pane of smooth glass on a floor, under a dome and a lamp."""
    scene = wr.Scene()
    clear, bubble = wr.Dielectric(), wr.Dielectric(ior=1 / 1.5)
    scene.add_sphere("/ball", 0.9, material=clear, pose=(-1.2, 0.9, 0.0, 0, 0, 0, 1))
    # A shell: the inner boundary is seen from the glass, where the index inside it is that of air to glass.
    scene.add_sphere("/shell", 0.7, material=clear, pose=(1.0, 0.7, 0.9, 0, 0, 0, 1))
    scene.add_sphere("/air", 0.6, material=bubble, pose=(1.0, 0.7, 0.9, 0, 0, 0, 1))
    block = np.diag([0.6, 1.1, 0.6, 1.0])
    block[3, :3] = 1.3, 1.11, -1.2
    scene.add_mesh(
        "/block", *scenes.cube(2.0), material=wr.Dielectric(ior=1.33), pose=scenes.look_at((0.4, 0.2, 1)) @ block
    )
    pane = scenes.look_at((0.5, 0.0, 1.0))
    pane[3, :3] = -0.4, 0.8, 1.8
    scene.add_mesh("/pane", *scenes.quad(1.2), material=wr.Dielectric(thinWalled=1), pose=pane)
    return surrounded(scene)


def rough() -> wr.Scene:
    """A ball, a block and a lens of rough glass, from fine to coarse."""
    scene = wr.Scene()
    scene.add_sphere("/ball", 0.9, material=wr.Dielectric(roughness=0.25), pose=(-1.2, 0.9, 0.0, 0, 0, 0, 1))
    lens = np.diag([0.8, 0.8, 0.3, 1.0])
    lens[3, :3] = 0.9, 0.8, 1.0
    scene.add_mesh("/lens", *scenes.icosphere(4), material=wr.Dielectric(roughness=0.35, ior=1.7), pose=lens)
    block = np.diag([0.6, 1.1, 0.6, 1.0])
    block[3, :3] = 1.3, 1.11, -1.2
    scene.add_mesh(
        "/block", *scenes.cube(2.0), material=wr.Dielectric(roughness=0.5), pose=scenes.look_at((0.4, 0, 1)) @ block
    )
    return surrounded(scene)


def surrounded(scene: wr.Scene) -> wr.Scene:
    """A floor, a wall, a lamp and a dome around a scene, and a camera."""
    floor = np.array([(-6, 0, -6), (-6, 0, 6), (6, 0, 6), (6, 0, -6)])
    scene.add_mesh("/floor", floor, [[0, 1, 2, 3]], color=(0.7, 0.5, 0.3))
    scene.add_mesh("/wall", floor[:, [0, 2, 1]] * (1, 1, 0) + (0, 0, -3), [[0, 1, 2, 3]], color=(0.2, 0.4, 0.7))
    scene.add_light(wr.SphereLight(radius=0.8, intensity=12.0), pose=(0.3, 3.8, 1.5, 0, 0, 0, 1))
    # Lights of UsdLux occlude nothing, those of Mitsuba do: a black ball inside makes the two alike.
    scene.add_sphere("/lamp", 0.8 * 0.9999, color=(0, 0, 0), pose=(0.3, 3.8, 1.5, 0, 0, 0, 1))
    scene.add_light(wr.DomeLight(intensity=0.4, color=(0.8, 0.9, 1.0)))
    scene.add_camera("/camera", scenes.camera((0.5, 2.5, 6.0), (0.0, 0.9, 0.0), fov=45.0))
    scene.settings.camera = "/camera"
    return scene


def lamp(scene: wr.Scene, name: str, place: tuple, radius: float, intensity: float, color: tuple = (1, 1, 1)) -> None:
    """A sphere light; a black ball inside of it occludes, as the lights of Mitsuba do and those of UsdLux do not.

    Smaller by more than the rounding of its place, and by too little for what passes beside it to be seen.
    """
    pose = (*place, 0, 0, 0, 1)
    scene.add_light(wr.SphereLight(radius=radius, intensity=intensity, color=color), f"/{name}", pose=pose)
    scene.add_sphere(f"/{name}_inside", radius * 0.999, color=(0, 0, 0), pose=pose)


def plates() -> wr.Scene:
    """Metals of four roughnesses that reflect sphere lights of four sizes, which are above the picture (Veach 1997)."""
    scene = wr.Scene()
    eye, row = np.array([0.0, 2.0, 9.0]), np.array([0.0, 2.2, -2.5])
    for number, radius in enumerate((0.05, 0.15, 0.4, 0.8)):
        color = [(1.0, 0.6, 0.5), (0.7, 1.0, 0.6), (0.6, 0.7, 1.0), (1.0, 0.9, 0.6)][number]
        lamp(scene, f"lamp{number}", (1.3 * number - 1.95, *row[1:]), radius, 1.5 / radius, color)
    for number, alpha in enumerate((0.005, 0.02, 0.05, 0.1)):
        middle = np.array([0.0, -0.1 - 0.45 * number, -1.0 + 1.35 * number])
        to_eye, to_row = eye - middle, row - middle
        normal = to_eye / np.linalg.norm(to_eye) + to_row / np.linalg.norm(to_row)
        normal /= np.linalg.norm(normal)
        across = np.cross((1.0, 0, 0), normal)
        side = np.array([4.0, 0, 0])
        points = [middle - side + 0.5 * across, middle - side - 0.5 * across]
        points = np.array([*points, middle + side - 0.5 * across, middle + side + 0.5 * across])
        if np.dot(np.cross(points[1] - points[0], points[2] - points[0]), normal) < 0:
            points = points[::-1]
        metal = wr.PreviewSurface(diffuseColor=(0.9, 0.8, 0.6), metallic=1.0, roughness=alpha**0.5)
        scene.add_mesh(f"/plate{number}", points, [[0, 1, 2, 3]], material=metal)
    floor = np.array([(-9, -2.5, -4), (-9, -2.5, 9), (9, -2.5, 9), (9, -2.5, -4)])
    scene.add_mesh("/floor", floor, [[0, 1, 2, 3]], color=(0.4, 0.4, 0.4))
    wall = np.array([(-9, -2.5, -4), (9, -2.5, -4), (9, 6, -4), (-9, 6, -4)])
    scene.add_mesh("/wall", wall, [[0, 1, 2, 3]], color=(0.3, 0.4, 0.5))
    scene.add_camera("/camera", scenes.camera(tuple(eye), (0.0, -0.85, 0.0), fov=27.0))
    scene.settings.camera = "/camera"
    return scene


def lamps() -> wr.Scene:
    """Two hundred small lamps over a mesh and a floor, out of the picture.

    Mitsuba chooses one of them at random: none is so near that only a few of its samples would find it.
    """
    scene = wr.Scene()
    points, faces = scenes.icosphere(4)
    pose = np.diag([1.5, 1.0, 1.5, 1.0])
    pose[3, 1] = 1.0
    scene.add_mesh("/ball", points, faces, normals=points, color=(0.7, 0.7, 0.7), pose=pose)
    floor = np.array([(-5, 0, -5), (-5, 0, 5), (5, 0, 5), (5, 0, -5)])
    scene.add_mesh("/floor", floor, [[0, 1, 2, 3]], color=(0.6, 0.6, 0.6))
    rng = np.random.default_rng(8)
    for number in range(200):
        turn, height, away = rng.random() * 2 * np.pi, rng.uniform(1.5, 3.5), rng.uniform(2.6, 4.5)
        place = (away * np.cos(turn), height, away * np.sin(turn))
        lamp(scene, f"lamp{number}", place, 0.04, 40.0 * rng.random(), tuple(rng.uniform(0.3, 1.0, 3)))
    scene.add_camera("/camera", scenes.camera((0.0, 1.45, 6.5), (0.0, -0.55, 0.0), fov=30.0))
    scene.settings.camera = "/camera"
    return scene


#: What is compared, by name.
SCENES = {
    "cornell": cornell,
    "lights": lights,
    "dome": dome,
    "glass": glass,
    "rough": rough,
    "plates": plates,
    "lamps": lamps,
}


def rgb(value) -> dict:
    """A colour."""
    return {"type": "rgb", "value": [float(v) for v in value]}


def matrix(rows: np.ndarray) -> list:
    """A row-vector matrix as Mitsuba's column-vector one."""
    return np.asarray(rows).T.tolist()


def write_ply(path: Path, points: np.ndarray, triangles: np.ndarray, normals: np.ndarray | None) -> None:
    """A mesh as text with all digits."""
    names = ["x", "y", "z"] if normals is None else ["x", "y", "z", "nx", "ny", "nz"]
    rows = points if normals is None else np.concatenate([points, normals], 1)
    header = ["ply", "format ascii 1.0", f"element vertex {len(points)}", *[f"property float {n}" for n in names]]
    header += [f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header"]
    with open(path, "w") as file:
        file.write("\n".join(header) + "\n")
        np.savetxt(file, rows, fmt="%.9g")
        np.savetxt(file, np.concatenate([np.full((len(triangles), 1), 3), triangles], 1), fmt="%d")


def look(scene: wr.Scene, placement) -> dict:
    """The Lambert colour, the dielectric or the metal of a placement."""
    material = scene.materials[placement.material]
    if isinstance(material, wr.Dielectric):
        indices = {"int_ior": material.ior, "ext_ior": 1.0}
        if material.thinWalled:
            return {"type": "thindielectric", **indices}
        if material.roughness > 0:
            return {"type": "roughdielectric", "distribution": "ggx", "alpha": material.roughness**2, **indices}
        return {"type": "dielectric", **indices}
    if isinstance(material, wr.PreviewSurface):
        if material.metallic != 1.0:
            raise ValueError(f"{placement.path}: neither glass nor metal")
        metal = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": material.roughness**2}
        return {"type": "twosided", "bsdf": {**metal, "specular_reflectance": rgb(material.diffuseColor)}}
    color = placement.shape.primvars["displayColor"].values[0]
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb(color)}}


def shape(folder: Path, number: int, scene: wr.Scene, placement) -> dict:
    """A placed mesh or sphere with its material."""
    common = {"to_world": matrix(placement.transforms[0]), "bsdf": look(scene, placement)}
    if isinstance(placement.shape, wr.scene.Sphere):
        return {"type": "sphere", "radius": placement.shape.radius, **common}
    mesh = placement.shape
    smooth = mesh.normals.values if mesh.normals else None
    path = folder / f"{number}.ply"
    write_ply(path, np.asarray(mesh.points), mesh.triangles, smooth)
    return {"type": "ply", "filename": str(path), "face_normals": smooth is None, **common}


def write_sky(path: Path, texels: np.ndarray, finer: int = 16) -> None:
    """A dome's picture as Mitsuba puts it on the sphere: its first and last row are the poles themselves.

    Sampled so finely between the texels that the two bilinear look-ups differ by 1 in 10⁴ of a texel's contrast.
    """
    height, width = texels.shape[:2]
    y = np.clip(np.linspace(0, height, height * finer) - 0.5, 0, height - 1)
    x = (np.arange(width * finer) + 0.5) / finer - 0.5
    j, i = np.floor(y).astype(int), np.floor(x).astype(int)
    rows = texels[j] + (texels[np.minimum(j + 1, height - 1)] - texels[j]) * (y - j)[:, None, None]
    columns = rows[:, i % width] + (rows[:, (i + 1) % width] - rows[:, i % width]) * (x - i)[None, :, None]
    write(path, {"color": np.concatenate([columns, np.ones((*columns.shape[:2], 1))], 2).astype(np.float32)})


def emitter(folder: Path, light) -> dict:
    """A light."""
    radiance = light.radiance()
    if isinstance(light, wr.DomeLight) and light.texture is not None:
        path = folder / "sky.exr"
        write_sky(path, light.texture.texels * radiance.astype(np.float32))
        return {"type": "envmap", "filename": str(path), "to_world": matrix(light.transform)}
    if isinstance(light, wr.DomeLight):
        return {"type": "constant", "radiance": rgb(radiance)}
    if isinstance(light, wr.DistantLight):
        direction = (-light.local_to_world()[2]).tolist()
        return {"type": "directional", "direction": direction, "irradiance": rgb(radiance)}
    glow = {"emitter": {"type": "area", "radiance": rgb(radiance)}}
    glow["bsdf"] = {"type": "diffuse", "reflectance": rgb((0, 0, 0))}
    if isinstance(light, wr.SphereLight):
        return {"type": "sphere", "radius": light.radius, "to_world": matrix(light.transform), **glow}
    # Mitsuba's rectangle has corners at ±1 and emits to +Z.
    turned = np.diag([-light.width / 2, light.height / 2, -1.0, 1.0])
    return {"type": "rectangle", "to_world": matrix(turned @ light.transform), **glow}


def sensor(camera: wr.Camera, size: int) -> dict:
    """The camera; Mitsuba's looks to +Z."""
    fov = 2 * np.degrees(np.arctan(camera.horizontalAperture / (2 * camera.focalLength)))
    near, far = camera.clippingRange
    film = {"type": "hdrfilm", "width": size, "height": size, "pixel_format": "rgb", "component_format": "float32"}
    return {
        "type": "perspective",
        "fov": float(fov),
        "fov_axis": "x",
        "near_clip": near,
        "far_clip": far,
        "to_world": matrix(np.diag([-1.0, 1.0, -1.0, 1.0]) @ camera.transform),
        "film": {**film, "rfilter": {"type": "box"}},
        "sampler": {"type": "independent"},
    }


def main() -> None:
    """Render twice, compare, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", choices=tuple(SCENES))
    parser.add_argument("--mitsuba", default=sys.executable, help="Python with Mitsuba")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--times", type=int, default=1, help="samples of Mitsuba for one of warprender's")
    parser.add_argument("--keep", type=Path, help="folder for the pictures")
    options = parser.parse_args()

    scene = SCENES[options.scene]()
    # Sobol points know their error from four replicates only, whose z is not normal.
    shown = {"lights_visible": True, "sampler": "independent"}
    renderer = wr.Renderer(scene, resolution=(options.size, options.size), **shown)
    ours = renderer.render(samples=options.samples).numpy("color")[..., :3].astype(np.float64)
    our_error = renderer.standard_error()

    with tempfile.TemporaryDirectory() as scratch:
        folder = options.keep or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        description = {"type": "scene", "sensor": sensor(renderer.camera, options.size)}
        for number, placement in enumerate(scene.placements.values()):
            description[f"shape{number}"] = shape(folder, number, scene, placement)
        for number, light in enumerate(scene.lights.values()):
            description[f"light{number}"] = emitter(folder, light)
        (folder / "scene.json").write_text(json.dumps(description))
        command = [options.mitsuba, str(HERE / "reference.py"), str(folder), str(options.samples * options.times)]
        subprocess.run(command, check=True)
        reference = np.load(folder / "reference.npz")
        if options.keep:
            np.savez(folder / "ours.npz", mean=ours, error=our_error)
        report(options, ours, our_error, reference["mean"], reference["error"])


def report(options, ours, our_error, theirs, their_error) -> None:
    """The table: z = difference / its standard error, where either renderer saw any spread."""
    error = np.sqrt(our_error**2 + their_error**2)
    samples = f"{options.samples} samples a pixel" + f", Mitsuba {options.times} times as many" * (options.times > 1)
    print(f"{options.scene}, {options.size}x{options.size}, {samples}; box filter of one pixel")
    print("channel  warprender   Mitsuba      ratio    ±        z mean   z std   |z|>3    max |z|")
    for c, name in enumerate("RGB"):
        lit = error[..., c] > 1e-6 * np.maximum(theirs[..., c], 1e-6)
        z = (ours - theirs)[..., c][lit] / error[..., c][lit]
        a, b = ours[..., c].mean(), theirs[..., c].mean()
        spread = np.sqrt((error[..., c] ** 2).sum()) / error[..., c].size / b
        share = (np.abs(z) > 3).mean()
        print(
            f"{name:7}  {a:.7f}    {b:.7f}    {a / b:.5f}  {spread:.5f}  {z.mean():+.4f}  {z.std():.4f}  "
            f"{share:.5f}  {np.abs(z).max():.2f}"
        )
    print("A standard normal z has mean 0, deviation 1 and 0.00270 beyond 3.")


if __name__ == "__main__":
    main()
