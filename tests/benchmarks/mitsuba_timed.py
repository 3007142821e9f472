"""Runs in an environment with Mitsuba, for `bench_path.py`: renders when a line on stdin says so.

python mitsuba_timed.py SCENE.json FOLDER SAMPLER DEPTH THREADS

Each line is "SAMPLES SEED". The picture goes to FOLDER/picture.npy, and "took", seconds of processor and of clock to
stdout, where Mitsuba's remarks go too.
"""

import json
import sys
import time
from pathlib import Path

import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")
sys.path.insert(0, str(Path(__file__).parents[1] / "mitsuba"))

import drjit as dr  # noqa: E402
from reference import loaded  # noqa: E402

#: Samples of one call: more of them take gigabytes.
MOST = 256


def main(file: Path, folder: Path, sampler: str, depth: int, threads: int) -> None:
    """Answers until stdin ends."""
    dr.set_thread_count(threads)
    description = json.loads(file.read_text())
    description["sensor"]["sampler"] = {"type": sampler}
    integrator = {"type": "path", "max_depth": depth}
    scene = mi.load_dict({**loaded(description), "integrator": integrator})
    for line in sys.stdin:
        samples, seed = map(int, line.split())
        processor, clock = time.process_time(), time.perf_counter()
        parts = [min(MOST, samples - first) for first in range(0, samples, MOST)]
        picture = sum(
            np.array(mi.render(scene, spp=n, seed=1000 * seed + part)) * (n / samples) for part, n in enumerate(parts)
        )
        processor, clock = time.process_time() - processor, time.perf_counter() - clock
        np.save(folder / "picture.npy", picture[..., :3])
        print("took", processor, clock, flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3], int(sys.argv[4]), int(sys.argv[5]))
