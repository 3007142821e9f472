"""Open Image Denoise (Áfra 2019) over a finished picture. It is biased: it trades noise for a guess."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

#: Outputs that guide the denoiser, besides color.
GUIDES = ("albedo", "normal")

#: What the network answers for black is below this; so is what counts as lit.
_FAINT = 1e-3

MISSING = 'denoising needs the package pyoidn: pip install "warprender[denoise]"'


def available() -> bool:
    """Whether pyoidn is installed."""
    return find_spec("pyoidn") is not None


def denoised(color: np.ndarray, albedo: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """The picture without noise, as far as the network guesses it.

    Args:
        color: (H, W, 4) float32, linear, premultiplied; alpha is passed on, and so is what is black before
            nothing.
        albedo: (H, W, 3) float32 of the first hits.
        normal: (H, W, 3) float32, unit vectors; anything else where nothing is seen.

    Returns:
        (H, W, 4) float32.

    Raises:
        ValueError: pyoidn is missing, or reports an error.
    """
    # "cleanAux" would trust the guides wholly. They have no noise, but what pixels' centres see has jagged edges: on
    # a ball before black it doubled the error of the inner pixels.
    if not available():
        raise ValueError(MISSING)
    import pyoidn

    seen = np.abs((normal * normal).sum(-1, keepdims=True) - 1.0) < 1e-3
    result = np.zeros((*color.shape[:2], 3), np.float32)
    images = {
        pyoidn.OIDN_IMAGE_COLOR: color[..., :3],
        pyoidn.OIDN_IMAGE_ALBEDO: np.clip(albedo, 0.0, 1.0),
        pyoidn.OIDN_IMAGE_NORMAL: np.where(seen, normal, 0.0),
    }
    # The library reads these arrays in place: they live until it is done.
    images = {name: np.ascontiguousarray(array, np.float32) for name, array in images.items()}
    with pyoidn.Device(pyoidn.OIDN_DEVICE_TYPE_CPU) as device:
        device.commit()
        with pyoidn.Filter(device, pyoidn.OIDN_FILTER_TYPE_RT) as network:
            for name, array in images.items():
                network.set_image(name, array, pyoidn.OIDN_FORMAT_FLOAT3)
            network.set_image(pyoidn.OIDN_IMAGE_OUTPUT, result, pyoidn.OIDN_FORMAT_FLOAT3)
            network.set_bool("hdr", True)
            network.commit()
            network.execute()
        problem = device.get_error()
    if problem:
        raise ValueError(f"Open Image Denoise: {problem}")
    # The network guesses black as up to 3e-4, too much where nothing is seen: no alpha covers it. Rims may be filled.
    empty = (color[..., 3:] == 0.0) & (result.max(2, keepdims=True) < _FAINT)
    return np.where(empty, color, np.concatenate([result, color[..., 3:]], axis=2))
