"""Small tables of BRDFs with known contents."""

import numpy as np

import warprender as wr
from warprender.materials.brdf_table import directions


def centres(cells):
    """θ_half, θ_diff and φ_diff of the cells' centres, broadcasting to `cells`."""
    theta_half = ((np.arange(cells[0]) + 0.5) / cells[0])[:, None, None] ** 2 * np.pi / 2
    theta_diff = ((np.arange(cells[1]) + 0.5) / cells[1])[:, None] * np.pi / 2
    return theta_half, theta_diff, (np.arange(cells[2]) + 0.5) / cells[2] * np.pi


def constant(value, cells=(12, 10, 16)):
    """The same in every cell."""
    return wr.BrdfTable(np.broadcast_to(np.asarray(value, float), (*cells, 3)))


def lobes(cells=(40, 30, 24)):
    """A coloured base, a highlight, a retroreflecting one, and something of φ_diff; missing below the horizon."""
    theta_half, theta_diff, phi_diff = centres(cells)
    highlight = 2.0 * np.exp(-((theta_half / 0.15) ** 2)) * (1 + theta_diff**2)
    back = 0.4 * np.exp(-((theta_diff / 0.3) ** 2))
    uneven = 0.05 * np.sin(theta_diff) * (1 + np.cos(2 * phi_diff))
    grey = np.broadcast_to(highlight + back * np.sin(theta_half) + uneven, cells)
    values = grey[..., None] * (1.0, 0.9, 0.7) + (0.05, 0.1, 0.02)
    wo, wi = directions(cells)
    values[(wo[..., 2] <= 0) | (wi[..., 2] <= 0)] = -1.0
    return wr.BrdfTable(values)


def few_cells():
    """Noise in cells so coarse that linear look-up bends in each of them."""
    return wr.BrdfTable(np.random.default_rng(1).random((4, 3, 2, 3)) * 0.3)


def spike(cells=(90, 90, 180), at=(2, 30, 45), value=1000.0):
    """0 but for one cell."""
    values = np.zeros((*cells, 3), np.float32)
    values[at] = value
    return wr.BrdfTable(values)
