"""Build a scene in Python: a sphere on a floor under a rectangular light. Colour and AOVs go into one EXR.

python examples/build_scene.py --out scene.exr
"""

import argparse
from math import sqrt

import numpy as np

import warprender as wr

#: A quarter turn about X: what looked down -Z looks down -Y.
FACING_DOWN = (-sqrt(0.5), 0.0, 0.0, sqrt(0.5))
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def build() -> wr.Scene:
    """Y is up; a pose is position and quaternion xyzw."""
    scene = wr.Scene()
    corners = [[-4, 0, 4], [4, 0, 4], [4, 0, -4], [-4, 0, -4]]
    scene.add_mesh("/floor", np.array(corners, np.float32), [[0, 1, 2, 3]], color=(0.6, 0.6, 0.6))
    red = wr.PreviewSurface(diffuseColor=(0.7, 0.1, 0.05), roughness=0.2)
    scene.add_sphere("/ball", radius=1.0, material=red, pose=(0, 1, 0, *UPRIGHT))
    scene.add_light(wr.RectLight(width=2, height=2, intensity=8), "/lamp", pose=(0, 4, 2, *FACING_DOWN))
    scene.add_camera("/camera", wr.Camera(focalLength=35), pose=(0, 1, 6, *UPRIGHT))
    return scene


def main() -> None:
    parser = argparse.ArgumentParser(description="Build a scene in Python and render it with AOVs.")
    parser.add_argument("--out", default="scene.exr", help="EXR file (default: scene.exr)")
    parser.add_argument("--samples", type=int, default=64, help="samples for each pixel (default: 64)")
    parser.add_argument("--width", type=int, default=400, help="pixels (default: 400)")
    args = parser.parse_args()

    outputs = ("color", "cameraDepth", "normal", "primId")
    frame = wr.render(
        build(), resolution=(args.width, args.width), samples=args.samples, camera="/camera", outputs=outputs
    )
    frame.save(args.out)
    print(f"{args.out}: {frame!r}")

    # The middle of the picture looks straight at the ball, whose front is 5 units away; primId 0 is the floor.
    middle = args.width // 2
    assert frame.numpy("primId")[middle, middle] == 1
    assert abs(frame.numpy("cameraDepth")[middle, middle] - 5.0) < 0.01
    assert frame.numpy("color")[middle, middle, 0] > 0.0


if __name__ == "__main__":
    main()
