"""Runs in an environment with Mitsuba: renders scene.json of a folder and keeps mean and standard error.

python reference.py FOLDER SAMPLES
"""

import json
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np

INTEGRATOR = {"type": "path", "max_depth": -1}
#: Enough for a standard error that is itself known to 9 %.
BATCHES = 64


def loaded(value):
    """The description with its matrices as Mitsuba's own."""
    if not isinstance(value, dict):
        return value
    value = {key: loaded(item) for key, item in value.items()}
    if "to_world" in value:
        value["to_world"] = mi.ScalarTransform4f(np.array(value["to_world"]))
    return value


def main(folder: Path, samples: int) -> None:
    """Mean and standard error of every pixel, from the spread of independent batches."""
    mi.set_variant("scalar_rgb")
    scene = mi.load_dict({**loaded(json.loads((folder / "scene.json").read_text())), "integrator": INTEGRATOR})
    batches = min(BATCHES, samples)
    total = squares = 0.0
    for seed in range(batches):
        picture = np.array(mi.render(scene, spp=samples // batches, seed=seed)).astype(np.float64)
        total, squares = total + picture, squares + picture**2
    mean = total / batches
    error = np.sqrt(np.maximum(squares / batches - mean**2, 0) / (batches - 1))
    np.savez(folder / "reference.npz", mean=mean, error=error)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
