"""Whole pictures through the one kernel that has every effect compiled in (see conftest.py)."""

import numpy as np

import warprender as wr
from warprender.plan import everything


def prepare(scene, camera, size=16, **options):
    """A renderer of size × size pixels.

    Unless asked otherwise paths, for every transport is a kernel of its own, and independent numbers, so that standard
    errors are exact.
    """
    resolution = size if isinstance(size, tuple) else (size, size)
    renderer = wr.Renderer(scene, camera, resolution, **{"transport": "path", "sampler": "independent", **options})
    renderer.plan.path = everything()
    return renderer


def picture(scene, camera, size=16, samples=64, seed=0, **options):
    """Mean colour (H, W, 4) and its standard error (H, W, 3), both float64."""
    renderer = prepare(scene, camera, size, **options)
    frame = renderer.render(samples=samples, seed=seed)
    return frame.numpy("color").astype(np.float64), renderer.standard_error()


def mean_and_error(color, error, where=...):
    """Mean over pixels and channels, and its standard error when channels of a pixel are wholly correlated."""
    value, spread = color[..., :3][where], error[where]
    return value.mean(), np.sqrt((spread.mean(-1) ** 2).sum()) / spread[..., 0].size


def outputs(scene, camera, names, size=16):
    """AOVs by name as numpy arrays."""
    resolution = size if isinstance(size, tuple) else (size, size)
    frame = wr.Renderer(scene, camera, resolution, outputs=names, transport="none").render()
    return {name: frame.numpy(name) for name in names}
