"""A Newton robot with a camera at its wrist, which looks between the fingers at a table with a block on it.

Joint angles become poses by Newton's forward kinematics, the camera's pose follows on the device. Needs Newton
(`pip install newton`); without it the program says so and ends.

python examples/wrist_camera.py --out wrist.png
"""

import argparse

import numpy as np
import warp as wp

import warprender as wr
from warprender import images

try:
    import newton
except ImportError:
    newton = None

UPPER, FORE, HAND, SHOULDER = 0.5, 0.4, 0.1, 0.6  # lengths of the links, height of the shoulder
TABLE, BLOCK, STEPS, FOV = 0.2, 0.05, 24, 50.0  # height of the table, half the block's edge
WRIST = wp.transform(wp.vec3(0.0, 0.0, -0.02), wp.quat_identity())  # the camera in the hand, which points down its -Z


def build() -> "newton.Model":
    """A table with a block, and an arm of three hinges that swings in the plane y = 0."""
    builder = newton.ModelBuilder()
    still = newton.ModelBuilder.ShapeConfig(density=0.0)

    def box(body: int, at: tuple, half: tuple, label: str, color: tuple) -> None:
        pose = wp.transform(wp.vec3(*at), wp.quat_identity())
        builder.add_shape_box(body, xform=pose, hx=half[0], hy=half[1], hz=half[2], label=label, color=color, cfg=still)

    box(-1, (0.5, 0, TABLE / 2), (0.5, 0.4, TABLE / 2), "table", (0.8, 0.7, 0.55))
    box(-1, (0.62, 0.03, TABLE + BLOCK), (BLOCK,) * 3, "block", (0.8, 0.15, 0.1))
    links = [builder.add_link() for _ in range(3)]
    parents, ends = (-1, *links[:2]), ((0, 0, SHOULDER), (0, 0, -UPPER), (0, 0, -FORE))
    joints = []
    for link, parent, end in zip(links, parents, ends, strict=True):
        there = wp.transform(wp.vec3(*end), wp.quat_identity())
        joints.append(builder.add_joint_revolute(parent, link, parent_xform=there, axis=newton.Axis.Y))
    builder.add_articulation(joints)
    box(links[0], (0, 0, -UPPER / 2), (0.03, 0.03, UPPER / 2), "upper arm", (0.5, 0.5, 0.55))
    box(links[1], (0, 0, -FORE / 2), (0.025, 0.025, FORE / 2), "forearm", (0.5, 0.5, 0.55))
    for side in (-1, 1):
        box(links[2], (0, side * 0.04, -HAND / 2 - 0.02), (0.012, 0.006, HAND / 2), "finger", (0.2, 0.2, 0.25))
    return builder.finalize(device="cpu")


def angles_at(step: int) -> np.ndarray:
    """(3,) joint angles: the arm reaches out, with the hand kept pointing straight down."""
    reach = 0.35 + 0.35 * step / (STEPS - 1)
    drop = SHOULDER - (TABLE + 0.25)
    cosine = (reach**2 + drop**2 - UPPER**2 - FORE**2) / (2 * UPPER * FORE)
    elbow = np.arccos(cosine)
    # About +Y, links hang down -Z: an angle moves them towards -X.
    shoulder = -(np.arctan2(reach, drop) + np.arctan2(FORE * np.sin(elbow), UPPER + FORE * cosine))
    return np.array([shoulder, elbow, -shoulder - elbow], np.float32)


@wp.kernel
def mount(
    bodies: wp.array(dtype=wp.transformf), hand: int, camera: wp.transformf, poses: wp.array(dtype=wp.transformf)
):
    poses[0] = bodies[hand] * camera


def main() -> None:
    parser = argparse.ArgumentParser(description="Look from a robot's wrist.")
    parser.add_argument("--out", default="wrist.png", help="some of the views side by side (default: wrist.png)")
    parser.add_argument("--samples", type=int, default=4, help="views in the picture (default: 4)")
    parser.add_argument("--width", type=int, default=128, help="pixels of a view (default: 128)")
    args = parser.parse_args()
    if newton is None:
        print("wrist_camera.py: skipped, because Newton is not installed (pip install newton)")
        return

    model = build()
    state, robot = model.state(), wr.from_newton(model)
    robot.scene.add_light(wr.DistantLight(intensity=2.5, normalize=True), "/sun", (0, 0, 0, 0.3, 0.2, 0.0, 0.93))
    outputs = ("rgba8", "cameraDepth", "semantic")
    camera = wr.CameraSensor(robot.scene, args.width, args.width, fov=FOV, outputs=outputs, transport="direct")
    pose, speeds = wp.empty(1, dtype=wp.transformf), wp.zeros(3, dtype=float)
    kept, seen = [], set()
    for step in range(STEPS):
        newton.eval_fk(model, wp.array(angles_at(step), dtype=float), speeds, state)
        robot.sync(state)
        wp.launch(mount, 1, [state.body_q, 2, WRIST, pose])
        view = camera.update(pose)

        depth, what = view.numpy("cameraDepth")[0], view.numpy("semantic")[0]
        labels = {view.labels[i] for i in np.unique(what) if i >= 0}
        seen |= labels
        assert "finger" in labels, "the fingers are in every picture"
        # The hand points straight down, so each pixel of the table is as deep as the camera is above it.
        height = pose.numpy()[0, 2] - TABLE
        table = depth[what == next(i for i, label in view.labels.items() if label == "table")]
        assert len(table) and np.abs(table - height).max() < 1e-5, "what is seen is what kinematics says"
        block = depth[np.isin(what, [i for i, label in view.labels.items() if label == "block"])]
        assert not len(block) or block.min() > height - 2 * BLOCK - 1e-5, "nothing of the block is above its top"
        if step % max(STEPS // args.samples, 1) == 0:
            kept.append(view.numpy("rgba8")[0, ..., :3].copy())
    assert seen >= {"table", "block", "finger"}
    assert abs(block.min() - (height - 2 * BLOCK)) < 1e-5, "in the end it looks down on the block"
    images.write_png(args.out, np.concatenate(kept, axis=1) / 255.0, color_correction="disabled")
    print(f"{STEPS} views: table, block and fingers where kinematics has them")


if __name__ == "__main__":
    main()
