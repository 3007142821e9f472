"""The graphics pipeline: transform, project, rasterize, test depth, shade by Phong's model; and the formula by hand.

python examples/graphics_pipeline.py --out phong.png
"""

import argparse
from pathlib import Path

import numpy as np

import warprender as wr

STAGE = Path(__file__).parent.parent / "scenes_usd" / "phong.usda"


def phong(look: wr.Phong, normal: np.ndarray, view: np.ndarray, light: np.ndarray) -> np.ndarray:
    """I = k_a + k_d (l·n) + k_s (r·v)^α for unit vectors (N, 3) and a light of intensity 1."""
    cosine = (normal @ light)[:, None]
    mirrored = 2 * cosine * normal - light
    highlight = np.maximum((mirrored * view).sum(1, keepdims=True), 0) ** look.exponent * (cosine > 0)
    diffuse, specular = np.array(look.diffuseColor), np.array(look.specularColor)
    return np.array(look.ambientColor) + diffuse * np.maximum(cosine, 0) + specular * highlight


def main() -> None:
    parser = argparse.ArgumentParser(description="Phong's model, rasterized.")
    parser.add_argument("--out", default="phong.png", help="image file (default: phong.png)")
    parser.add_argument("--samples", type=int, default=16, help="for each pixel (default: 16)")
    parser.add_argument("--width", type=int, default=480, help="pixels (default: 480)")
    args = parser.parse_args()

    scene, outputs = wr.load(STAGE, complexity="high"), ("color", "position", "normal", "primId")
    size = (args.width, args.width * 3 // 4)
    renderer = wr.Renderer(scene, resolution=size, outputs=outputs, transport="local", visibility="raster")
    frame = renderer.render(samples=args.samples)
    frame.save(args.out)
    print(f"{args.out}: rays {frame.stats['rays']}")
    assert set(frame.stats["rays"].values()) == {0}

    # The first sample is at the pixels' centres, as position and normal are.
    color, position, normal, prim = (renderer.render(samples=1).numpy(name) for name in outputs)
    towards = scene.lights["/World/sun"].transform[2, :3]
    eye = renderer.camera.transform[3, :3]
    for number, placement in enumerate(scene.placements.values()):
        seen = prim == number
        view = (eye - position[seen]).astype(np.float64)
        view /= np.linalg.norm(view, axis=1, keepdims=True)
        expected = phong(scene.materials[placement.material], normal[seen].astype(np.float64), view, towards)
        assert seen.sum() > 0.005 * seen.size
        assert np.allclose(color[seen][:, :3], expected, rtol=1e-3, atol=1e-5)


if __name__ == "__main__":
    main()
