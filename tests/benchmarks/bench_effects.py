"""What each effect costs: a base scene and one effect more at a time, as the table of `docs/cost_of_effects.md`.

    python tests/benchmarks/bench_effects.py > table.md
    python tests/benchmarks/bench_effects.py lens texture

Kernels are compiled into an empty cache. Each scene is drawn by its own kernel, the base scene also by the kernel of
each effect (what code costs that nothing asks for), and every scene by the kernel with everything compiled in. They
take turns; times are the processor's, the least of several short runs, for one thread. Pictures must agree bit for bit.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import warp as wp

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent)]

import scenes  # noqa: E402
from brdf_tables import lobes  # noqa: E402

import warprender as wr  # noqa: E402
from warprender.lights import LightTexture  # noqa: E402
from warprender.lights.shadow import Shadow  # noqa: E402
from warprender.lights.shaping import Shaping  # noqa: E402
from warprender.plan import everything  # noqa: E402

NOISE = np.random.default_rng(0).random((64, 64, 4)).astype(np.float32)
ABOVE = scenes.look_at((1, 2, 1))
BALL = (1.2, 0.0, 0.0, 0, 0, 0, 1)


@wp.func
def ball(p: wp.vec3) -> float:
    """Distance to a ball."""
    return wp.length(p) - 0.5


def base() -> wr.Scene:
    """A cube on a ground under a rectangular lamp."""
    scene = wr.Scene()
    scene.add_mesh("/box", *scenes.cube(1.0), color=(0.7, 0.5, 0.3))
    ground = np.array([(-3, -0.5, 3), (3, -0.5, 3), (3, -0.5, -3), (-3, -0.5, -3)])
    scene.add_mesh("/ground", ground, [[0, 1, 2, 3]], color=(0.6,) * 3)
    scene.add_light(wr.RectLight(intensity=5.0), "/lamp", pose=ABOVE)
    scene.add_camera("/camera", scenes.camera((2, 2, 4)))
    scene.settings.camera = "/camera"
    return scene


def sheet(**inputs: object) -> Callable[[wr.Scene], None]:
    """A sheet beside the cube of UsdPreviewSurface with these inputs."""

    def add(scene: wr.Scene) -> None:
        points, faces = scenes.quad(1.0)
        material = wr.PreviewSurface(**inputs)
        scene.add_mesh("/sheet", points + (1.2, 0, 0), faces, material=material, st=points[:, :2])

    return add


def sphere_of(material: object) -> Callable[[wr.Scene], None]:
    """A sphere beside the cube."""
    return lambda scene: scene.add_sphere("/ball", 0.5, material=material, pose=BALL)


def mesh_of(material: object) -> Callable[[wr.Scene], None]:
    """A ball of triangles beside the cube."""
    return lambda scene: scene.add_mesh(
        "/ball", *scenes.icosphere(3), material=material, pose=np.diag([0.5, 0.5, 0.5, 1])
    )


def light(made: object) -> Callable[[wr.Scene], None]:
    """A second light."""
    return lambda scene: scene.add_light(made, "/second", pose=scenes.look_at((-2, 2, 1)))


def lamp_with(**fields: object) -> Callable[[wr.Scene], None]:
    """The lamp changed."""

    def change(scene: wr.Scene) -> None:
        for name, value in fields.items():
            setattr(scene.lights["/lamp"], name, value)

    return change


def camera_with(**fields: object) -> Callable[[wr.Scene], None]:
    """The camera changed."""

    def change(scene: wr.Scene) -> None:
        for name, value in fields.items():
            setattr(scene.cameras["/camera"], name, value)

    return change


#: Effect to what adds it to the base scene, and arguments of `Renderer`.
EFFECTS: dict[str, tuple[Callable[[wr.Scene], None], dict]] = {
    "base": (lambda scene: None, {}),
    "UsdPreviewSurface": (sheet(), {}),
    "texture": (sheet(diffuseColor=wr.Texture(NOISE)), {}),
    "normal map": (sheet(normal=wr.Texture(NOISE, scale=(1, 1, 1, 1), bias=(-0.5, -0.5, 0.5, 0))), {}),
    "cut-out": (sheet(opacity=wr.Texture(NOISE, "a"), opacityThreshold=0.5), {}),
    "opacity 0.5": (sheet(opacity=0.5), {}),
    "energy compensation": (sheet(roughness=0.8), {"energy_compensation": True}),
    "transmission": (mesh_of(wr.Dielectric()), {}),
    "measured BRDF": (mesh_of(wr.MeasuredBRDF(lobes())), {}),
    "sphere": (sphere_of(None), {}),
    "signed distance function": (lambda scene: scene.add_sdf("/ball", ball, [(-0.6,) * 3, (0.6,) * 3], pose=BALL), {}),
    "sphere light": (light(wr.SphereLight(radius=0.3, intensity=5.0)), {}),
    "disk light": (light(wr.DiskLight(radius=0.3, intensity=5.0)), {}),
    "cylinder light": (light(wr.CylinderLight(radius=0.2, length=0.5, intensity=5.0)), {}),
    "distant light": (light(wr.DistantLight(intensity=1.0, angle=1.0)), {}),
    "dome": (light(wr.DomeLight(intensity=0.5)), {}),
    "dome with a picture": (light(wr.DomeLight(texture=LightTexture.of(NOISE[..., :3]))), {}),
    "glowing mesh": (mesh_of(wr.PreviewSurface(emissiveColor=(2, 2, 2))), {}),
    "shaping": (lamp_with(shaping=Shaping(coneAngle=40.0, coneSoftness=0.5)), {}),
    "changed shadows": (lamp_with(shadow=Shadow(color=(0.2, 0.1, 0.3))), {}),
    "light linking": (lamp_with(unlit=frozenset(["/box"])), {}),
    "depth of field": (camera_with(fStop=4.0, focusDistance=4.5), {}),
    "outputs normal and cameraDepth": (lambda scene: None, {"outputs": ("color", "normal", "cameraDepth")}),
    "outputs color:0 and color:1": (lambda scene: None, {"outputs": ("color", "color:0", "color:1")}),
}


class Way:
    """A scene drawn by one kernel, and the least time that a sample took."""

    def __init__(self, name: str, key: object = None) -> None:
        """Compiled, which `compiling` says the seconds of; `key` takes the place of the plan's own."""
        add, options = EFFECTS[name]
        scene = base()
        add(scene)
        self.renderer = wr.Renderer(scene, resolution=(SIZE, SIZE), bounces=4, threads=1, **options)
        self.own = self.renderer.plan.path
        if key is not None:
            self.renderer.plan.path = key
        start = time.perf_counter()
        self.renderer.render(samples=1)
        self.compiling = time.perf_counter() - start
        self.nanoseconds = np.inf

    def run(self) -> None:
        """Draw once more."""
        start = time.process_time()
        self.frame = self.renderer.render(samples=SAMPLES)
        taken = 1e9 * (time.process_time() - start) / (SAMPLES * SIZE**2)
        self.nanoseconds = min(self.nanoseconds, taken)

    def agrees(self, other: Way) -> bool:
        """Whether both drew the same bits."""
        return np.array_equal(self.frame.numpy("color"), other.frame.numpy("color"))


SIZE, SAMPLES = 64, 32


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("effects", nargs="*", metavar="EFFECT", help=", ".join(EFFECTS))
    parser.add_argument("--runs", type=int, default=8)
    options = parser.parse_args()
    wp.config.quiet = True
    with tempfile.TemporaryDirectory() as cache:
        wp.config.kernel_cache_dir = cache
        wr.render(base(), resolution=(8, 8), samples=1, transport="none", outputs="normal")
        plain, general = Way("base"), everything()
        print(
            "| effect | compiling, s | ns a sample | by the kernel of everything | rays a sample: bounce, shadow ",
            end="",
        )
        print("| the base scene by this kernel, against its own |")
        print("|---|---|---|---|---|---|", flush=True)
        for name in options.effects or EFFECTS:
            row(name, plain, general, options.runs)


def row(name: str, plain: Way, general: object, runs: int) -> None:
    """Measure and print one effect."""
    own = plain if name == "base" else Way(name)
    whole = Way(name, replace(general, sdfs=own.own.sdfs))
    ways = [plain, own, whole]
    contained = all(set(getattr(plain.own, f)) <= set(getattr(own.own, f)) for f in ("shapes", "materials", "lights"))
    unused = Way("base", own.own) if contained and not own.own.terms and not own.own.sdfs else None
    ways += [unused] if unused else []
    for way in ways:
        way.nanoseconds = np.inf
    for _ in range(runs):
        for way in dict.fromkeys(ways):
            way.run()
    if not own.agrees(whole) or (unused and not unused.agrees(plain)):
        raise SystemExit(f"{name}: the pictures differ")
    rays, camera = own.frame.stats["rays"], own.frame.stats["rays"]["camera"]
    print(f"| {name} | {own.compiling:.1f} | {own.nanoseconds:.0f} | {whole.nanoseconds:.0f} ", end="")
    print(f"| {rays['bounce'] / camera:.2f}, {rays['shadow'] / camera:.2f} ", end="")
    print(f"| {unused.nanoseconds / plain.nanoseconds:.2f} |" if unused else "| |", flush=True)


if __name__ == "__main__":
    main()
