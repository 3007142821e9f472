"""Hard shadows of a sun and soft ones of a lamp, and both in closed form at each pixel's centre.

python examples/shadows.py --out shadows.png
"""

import argparse
from pathlib import Path

import numpy as np

import warprender as wr

STAGE = Path(__file__).parent.parent / "scenes_usd" / "shadows.usda"
ALBEDO, WALL, TOP = 0.7, -1.0, 0.7
BALL, RADIUS = np.array([1.2, 0.8, 0.6]), 0.8
LAMP, HALF = np.array([3.0, 3.5, 1.0]), 1.0
RUNS = 32
SIGNS = [(-1, -1), (1, -1), (1, 1), (-1, 1)]


def beside_ball(floor: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """How far rays (N, 3) from points (N, 3) of the floor pass the ball's centre, in its radii."""
    direction = towards / np.linalg.norm(towards, axis=-1, keepdims=True)
    to_ball = BALL - floor
    return np.linalg.norm(np.cross(to_ball, direction), axis=-1) / RADIUS


def over_wall(floor: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """How high over the wall's top rays from the floor pass it; inf where they do not cross it."""
    with np.errstate(divide="ignore"):
        along = (WALL - floor[:, 0]) / towards[..., 0]
    return np.where(along > 0, along * towards[..., 1] - TOP, np.inf)


def rectangle_irradiance(floor: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """On points (N, 3) of a floor that faces +Y, from polygons (N, K, 3) of radiance 1 (Lambert 1760)."""
    v = corners - floor[:, None]
    v /= np.linalg.norm(v, axis=-1, keepdims=True)
    w = np.roll(v, -1, axis=1)
    across = np.cross(v, w)
    sine = np.maximum(np.linalg.norm(across, axis=-1), 1e-30)
    return np.abs((np.arctan2(sine, (v * w).sum(-1)) * across[..., 1] / sine).sum(1)) / 2


def lamp_irradiance(floor: np.ndarray) -> np.ndarray:
    """Irradiance of a lamp of radiance 1 beyond the wall: of the part of it that is in sight, a rectangle too."""
    x = floor[:, 0]
    limit = np.where(x < WALL, x + LAMP[1] * (WALL - x) / TOP, np.inf)
    end = np.clip(limit, LAMP[0] - HALF, LAMP[0] + HALF)
    start, full = np.full_like(x, LAMP[0] - HALF), np.ones_like(x)
    low, high = (LAMP[2] - HALF) * full, (LAMP[2] + HALF) * full
    corners = [(start, low), (end, low), (end, high), (start, high)]
    return rectangle_irradiance(floor, np.stack([np.stack([a, LAMP[1] * full, b], -1) for a, b in corners], 1))


def check_sun(color: np.ndarray, floor: np.ndarray, light: wr.DistantLight) -> None:
    """Lit or dark as the ray to the sun says, except within a thousandth of an edge; lit by the cosine."""
    towards = light.transform[2, :3]
    ball, wall = beside_ball(floor, towards) - 1, over_wall(floor, towards)
    sure = (np.abs(ball) > 1e-3) & (np.abs(wall) > 1e-3)
    lit = (ball > 0) & (wall > 0)
    expected = lit[:, None] * ALBEDO / np.pi * light.intensity * np.array(light.color) * towards[1]
    assert sure.mean() > 0.98 and 0.1 < lit.mean() < 0.95
    np.testing.assert_allclose(color[sure], expected[sure], rtol=1e-4)


def check_lamp(colors: np.ndarray, floor: np.ndarray, light: wr.RectLight) -> None:
    """The mean of `colors` (RUNS, N, 3) where the ball is not near the rays; 4.5 standard errors of all pixels."""
    to_lamp = LAMP - floor
    # The rays to the lamp's corners spread around that to its centre; a tenth more for their obliqueness.
    spread = 1.1 * HALF * np.sqrt(2) * np.linalg.norm(BALL - floor, axis=1) / np.linalg.norm(to_lamp, axis=1)
    away = beside_ball(floor, to_lamp) > 1 + spread / RADIUS
    irradiance = lamp_irradiance(floor)
    expected = irradiance[:, None] * ALBEDO / np.pi * light.intensity * np.array(light.color)
    full = rectangle_irradiance(floor, np.array([LAMP + (a * HALF, 0, b * HALF) for a, b in SIGNS])[None])
    umbra = away & (irradiance == 0)
    penumbra = away & (irradiance > 0) & (irradiance < 0.999 * full)
    for name, there in (("lit", away & (irradiance > 0)), ("penumbra", penumbra)):
        totals = (colors - expected)[:, there].sum((1, 2))
        z = totals.mean() / (totals.std(ddof=1) / np.sqrt(RUNS))
        print(f"{name}: {there.sum()} pixels, off by {z:.1f} standard errors")
        assert there.sum() > 5 and abs(z) < 4.5
    assert umbra.sum() > 10 and (colors[:, umbra] == 0).all()


def main() -> None:
    parser = argparse.ArgumentParser(description="Hard and soft shadows.")
    parser.add_argument("--out", default="shadows.png", help="image file (default: shadows.png)")
    parser.add_argument("--samples", type=int, default=64, help="for each pixel (default: 64)")
    parser.add_argument("--width", type=int, default=480, help="pixels (default: 480)")
    args = parser.parse_args()

    scene, outputs = wr.load(STAGE), ("color", "position", "primId")
    size = (args.width, args.width * 3 // 4)
    renderer = wr.Renderer(scene, resolution=size, outputs=outputs, transport="direct", visibility="raster")
    frame = renderer.render(samples=args.samples)
    frame.save(args.out)
    print(f"{args.out}: rays {frame.stats['rays']}")

    # One rasterized sample is at the pixels' centres, as position is. Each light alone:
    sun, lamp = scene.lights["/World/sun"], scene.lights["/World/lamp"]
    at_floor = frame.numpy("primId") == list(scene.placements).index("/World/floor")
    floor = frame.numpy("position")[at_floor].astype(np.float64)
    intensity, lamp.intensity = lamp.intensity, 0.0
    renderer.update()
    check_sun(renderer.render(samples=1).numpy("color")[at_floor][:, :3], floor, sun)

    lamp.intensity, sun.intensity = intensity, 0.0
    renderer.update()
    runs = [renderer.render(samples=1, seed=seed).numpy("color")[at_floor][:, :3] for seed in range(RUNS)]
    check_lamp(np.array(runs, np.float64), floor, lamp)


if __name__ == "__main__":
    main()
