"""Whitted's picture of 1980: a sphere of glass and one that mirrors, over a checker, under a sky.

python examples/whitted.py --out whitted.png
"""

import argparse
from pathlib import Path

import numpy as np

import warprender as wr

STAGE = Path(__file__).parent.parent / "scenes_usd" / "whitted.usda"
SKY = 0.6 * np.array([0.35, 0.6, 1.0])
GLASS, RADIUS = np.array([-0.5, 1.6, 1.5]), 0.8


def reflected_sky(eye: np.ndarray, position: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the mirror shows the sky alone, and the colour there: the sky's, times the mirror's 0.9."""
    view = position - eye
    mirrored = view - 2 * (view * normal).sum(-1, keepdims=True) * normal
    mirrored /= np.linalg.norm(mirrored, axis=-1, keepdims=True)
    to_glass = GLASS - position
    along = (to_glass * mirrored).sum(-1)
    beside = np.linalg.norm(to_glass - along[..., None] * mirrored, axis=-1)
    free = (mirrored[..., 1] > 1e-3) & ((beside > RADIUS) | (along < 0))
    return free, 0.9 * SKY


def main() -> None:
    parser = argparse.ArgumentParser(description="Whitted's two spheres over a checker.")
    parser.add_argument("--out", default="whitted.png", help="image file (default: whitted.png)")
    parser.add_argument("--samples", type=int, default=16, help="for each pixel (default: 16)")
    parser.add_argument("--width", type=int, default=320, help="pixels (default: 320)")
    args = parser.parse_args()

    scene, size = wr.load(STAGE), (args.width, args.width * 3 // 4)
    outputs = ("color", "position", "normal", "primId")
    options = {"transport": "whitted", "visibility": "raster", "dome_light_visible": True}
    renderer = wr.Renderer(scene, resolution=size, outputs=outputs, **options)
    frame = renderer.render(samples=args.samples)
    frame.save(args.out)
    print(f"{args.out}: rays {frame.stats['rays']}")
    assert frame.stats["unfollowed rays"] == 0

    # One rasterized sample is at the pixels' centres, as position and normal are.
    color, position, normal, prim = (renderer.render(samples=1).numpy(name) for name in outputs)
    free, expected = reflected_sky(renderer.camera.transform[3, :3], position, normal)
    free &= prim == list(scene.placements).index("/World/mirror")
    assert free.sum() > 0.005 * free.size
    assert np.allclose(color[free][:, :3], expected, rtol=1e-4)


if __name__ == "__main__":
    main()
