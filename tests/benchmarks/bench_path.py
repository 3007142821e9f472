"""Path tracing beside Mitsuba 3 (llvm_ad_rgb): samples a second, and time to equal error.

    DRJIT_LIBLLVM_PATH=…/libLLVM.so.19.1 python tests/benchmarks/bench_path.py --mitsuba PYTHON
    python tests/benchmarks/bench_path.py cornell plates --mitsuba PYTHON --samples 16 64 --repeats 6
    python tests/benchmarks/bench_path.py cornell --mitsuba PYTHON --size 64 --samples 4 16 64 256 --plot FILE.png

PYTHON is the interpreter of an environment with `pip install mitsuba`; its LLVM variants need Debian's libllvm19. The
scenes are those of `tests/mitsuba/compare.py`, where their pictures are compared, and `gloss`, defined here. Both
renderers follow the same number of reflections with the same number of threads. They are warm, and take turns within
one run. Time is that of the processor over the threads, which other work on the machine changes least, beside the
clock's. The error is the standard deviation over pictures of different seeds, of pixels whose channels are below 1 in
all of them: each renderer's own expectation is its converged reference. `apart` says how far the two expectations lie
from each other: RMS difference of the mean pictures' 16x16 blocks over the mean, beside what noise explains.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent), str(HERE.parent / "mitsuba")]

import bumpy_balls  # noqa: E402
import compare  # noqa: E402
import scenes  # noqa: E402

import warprender as wr  # noqa: E402
from warprender.lights import LightTexture  # noqa: E402


def gloss() -> wr.Scene:
    """Two bumpy balls of 49,152 triangles, rough metal and clear glass, under a sky with a bright cap."""
    scene = wr.Scene()
    metal = wr.PreviewSurface(diffuseColor=(0.95, 0.75, 0.55), metallic=1.0, roughness=0.2**0.5)
    for name, x, seed, material in (("metal", -1.15, 1, metal), ("glass", 1.15, 5, wr.Dielectric())):
        points, faces = bumpy_balls.bumpy(64, 1.0, 0.2, seed)
        sides = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
        normals = np.zeros_like(points)
        for corner in range(3):
            np.add.at(normals, faces[:, corner], sides)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        pose = (x, 1.25, 0, 0, 0, 0, 1)
        scene.add_mesh(f"/{name}", points, faces, normals=normals, material=material, pose=pose)
    floor = np.array([(-30, 0, -30), (-30, 0, 30), (30, 0, 30), (30, 0, -30)])
    scene.add_mesh("/floor", floor, [[0, 1, 2, 3]], color=(0.5, 0.5, 0.5))
    angle = (np.arange(64) + 0.5) / 64 * np.pi
    cap = np.where(angle < np.radians(12), 30.0, 0.0)[:, None] * (1.0, 0.9, 0.75)
    gradient = np.where(np.cos(angle) > 0, 0.35 + 0.65 * np.cos(angle), 0.1)[:, None] * (0.6, 0.8, 1.0)
    sky = np.repeat((cap + gradient)[:, None], 128, 1).astype(np.float32)
    scene.add_light(wr.DomeLight(texture=LightTexture.of(sky)))
    scene.add_camera("/camera", scenes.camera((0.0, 2.2, 6.0), (0.0, 0.75, 0.0), fov=40.0))
    scene.settings.camera = "/camera"
    return scene


#: Scene, and the reflections that both follow.
SCENES = {
    "cornell": (compare.cornell, 6),
    "plates": (compare.plates, 6),
    "gloss": (gloss, 10),
    "lamps": (compare.lamps, 3),
}


class Ours:
    """This renderer; one `render` is a picture and the seconds of processor and clock that it took."""

    def __init__(self, scene: wr.Scene, size: int, bounces: int, threads: int, sampler: str) -> None:
        """Compiled and warm."""
        shown = {"lights_visible": True, "sampler": sampler}
        self.renderer = wr.Renderer(scene, resolution=(size, size), bounces=bounces, threads=threads, **shown)
        self.renderer.render(samples=1)

    def render(self, samples: int, seed: int) -> tuple[np.ndarray, float, float]:
        """Picture (H, W, 3) float64."""
        processor, clock = time.process_time(), time.perf_counter()
        picture = self.renderer.render(samples=samples, seed=seed).numpy("color")
        return picture[..., :3].astype(np.float64), time.process_time() - processor, time.perf_counter() - clock


class Mitsuba:
    """Mitsuba in a process of its own, that renders when it is told to."""

    def __init__(self, command: list[str], folder: Path) -> None:
        """Starts it; it has compiled when the first picture is there."""
        self.folder = folder
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.warm: set[int] = set()

    def render(self, samples: int, seed: int) -> tuple[np.ndarray, float, float]:
        """Picture (H, W, 3) float64; the first of each number of samples is drawn twice, to have it compiled."""
        for _ in range(1 if samples in self.warm else 2):
            print(samples, seed, file=self.process.stdin, flush=True)
            answer = "remark"
            while answer and "took " not in answer:
                answer = self.process.stdout.readline()
            if not answer:
                raise RuntimeError("Mitsuba ended; see its message above")
        self.warm.add(samples)
        processor, clock = map(float, answer.split("took ")[1].split())
        return np.load(self.folder / "picture.npy").astype(np.float64), processor, clock

    def close(self) -> None:
        """Ends the process."""
        self.process.stdin.close()
        self.process.wait()


def describe(folder: Path, scene: wr.Scene, camera: wr.Camera, size: int) -> None:
    """The scene as Mitsuba's, in the folder."""
    description = {"type": "scene", "sensor": compare.sensor(camera, size)}
    for number, placement in enumerate(scene.placements.values()):
        description[f"shape{number}"] = compare.shape(folder, number, scene, placement)
    for number, light in enumerate(scene.lights.values()):
        description[f"light{number}"] = compare.emitter(folder, light)
    (folder / "scene.json").write_text(json.dumps(description))


def deviation(pictures: list[np.ndarray], dim: np.ndarray) -> float:
    """RMS over pixels of the standard deviation over pictures."""
    return float(np.sqrt(np.var(pictures, axis=0, ddof=1)[dim].mean()))


def blocks(picture: np.ndarray) -> np.ndarray:
    """Means of blocks of 16x16 pixels."""
    n = picture.shape[0] // 16
    return picture[: n * 16, : n * 16].reshape(n, 16, n, 16, 3).mean((1, 3))


def apart(ours: list[np.ndarray], theirs: list[np.ndarray]) -> tuple[float, float]:
    """Relative RMS difference of two mean pictures' blocks, and what their noise explains of it."""
    a, b = np.array([blocks(p) for p in ours]), np.array([blocks(p) for p in theirs])
    noise = np.sqrt((a.var(0, ddof=1) / len(a) + b.var(0, ddof=1) / len(b)).mean())
    return float(np.sqrt(((a.mean(0) - b.mean(0)) ** 2).mean()) / b.mean()), float(noise / b.mean())


def measure(name: str, options: argparse.Namespace) -> None:
    """The table of one scene."""
    make, bounces = SCENES[name]
    scene, size, threads = make(), options.size, options.threads
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        renderers = {s: Ours(scene, size, bounces, threads, s) for s in ("sobol", "independent")}
        describe(folder, scene, renderers["sobol"].renderer.camera, size)
        for sampler in ("independent", "multijitter"):
            place = folder / sampler
            place.mkdir()
            command = [options.mitsuba, str(HERE / "mitsuba_timed.py"), str(folder / "scene.json"), str(place)]
            renderers[f"Mitsuba {sampler}"] = Mitsuba([*command, sampler, str(bounces + 2), str(threads)], place)
        pictures = {(key, n): [] for key in renderers for n in options.samples}
        times = {key: [] for key in pictures}
        for seed in range(options.repeats):
            for key, n in pictures:
                picture, processor, clock = renderers[key].render(n, seed)
                pictures[key, n].append(picture)
                times[key, n].append((processor, clock))
        for renderer in renderers.values():
            if isinstance(renderer, Mitsuba):
                renderer.close()
    report(name, options, bounces, pictures, times)
    if options.plot:
        plot(name, options, bounces, pictures, times)


def report(name, options, bounces, pictures, times) -> None:
    """Print the table; `to equal error` is time for the error of Mitsuba's multijitter at the most samples."""
    most = max(options.samples)
    dim = np.max([p for group in pictures.values() for p in group], axis=(0, 3)) < 1
    aim = deviation(pictures["Mitsuba multijitter", most], dim)
    print(f"\n{name}, {options.size}x{options.size}, {bounces} bounces, {options.threads} threads, ", end="")
    print(f"{options.repeats} pictures each, {100 * (1 - dim.mean()):.0f} % of the pixels left out")
    print("| | samples | error | ns of processor a sample | Msamples/s | s to equal error, processor | clock |")
    print("|---|---|---|---|---|---|---|")
    for (key, n), group in pictures.items():
        error = deviation(group, dim)
        processor, clock = np.min(times[key, n], axis=0)
        count = options.size**2 * n
        # Error falls with the number of samples by the slope that was seen, at least as its root.
        slope = 0.5
        if n != min(options.samples):
            least = min(options.samples)
            slope = np.log(deviation(pictures[key, least], dim) / error) / np.log(n / least)
        factor = (error / aim) ** (1 / max(slope, 0.5))
        print(
            f"| {key} | {n} | {error:.5f} | {1e9 * processor / count:.0f} | {1e-6 * count / clock:.2f} "
            f"| {factor * processor:.2f} | {factor * clock:.2f} |"
        )
    difference, noise = apart(pictures["sobol", most], pictures["Mitsuba multijitter", most])
    print(f"apart {difference:.5f}, noise {noise:.5f}", flush=True)


def plot(name, options, bounces, pictures, times) -> None:
    """Error over seconds of the processor, of both renderers, both axes logarithmic."""
    from matplotlib.figure import Figure

    dim = np.max([p for group in pictures.values() for p in group], axis=(0, 3)) < 1
    figure = Figure(figsize=(5.6, 3.7), layout="constrained")
    axes = figure.subplots()
    for marker, key in zip("osD^", dict.fromkeys(key for key, _ in pictures), strict=True):
        seconds = [np.median(times[key, n], axis=0)[0] for n in options.samples]
        errors = [deviation(pictures[key, n], dim) for n in options.samples]
        label, line = (key, "--") if key.startswith("Mitsuba") else (f"warprender {key}", "-")
        axes.plot(seconds, errors, marker=marker, linestyle=line, label=label)
    axes.set(xscale="log", yscale="log", xlabel="processor seconds", ylabel="standard deviation of a pixel")
    samples = ", ".join(map(str, options.samples))
    axes.set_title(f"{name}, {options.size} × {options.size}, {bounces} bounces, {samples} samples", fontsize=10)
    axes.grid(True, which="both", alpha=0.2)
    axes.legend(fontsize=8)
    figure.savefig(options.plot, dpi=90)


def main() -> None:
    """Every scene in turn."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=", ".join(SCENES))
    parser.add_argument("--mitsuba", default=sys.executable, help="Python with Mitsuba")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--samples", type=int, nargs="+", default=[16, 64])
    parser.add_argument("--repeats", type=int, default=4)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--plot", metavar="FILE.png", help="plot the last scene's error over time")
    options = parser.parse_args()
    for name in options.scenes or SCENES:
        measure(name, options)


if __name__ == "__main__":
    main()
