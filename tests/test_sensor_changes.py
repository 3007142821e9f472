"""Sensors of scenes that change: before the first update, in what is numbered, in their lights; and poses lent."""

import numpy as np
import warp as wp

import warprender as wr

POSE = np.array([[0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 1.0]])
BOUNDS = [[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]


@wp.func
def ball(p: wp.vec3) -> float:
    return wp.length(p) - 0.9


@wp.func
def plate(p: wp.vec3) -> float:
    return wp.max(wp.max(wp.abs(p[0]), wp.abs(p[1])) - 0.5, wp.abs(p[2]) - 0.25)


class Lent:
    """An array of another library, which shares its memory."""

    def __init__(self, rows):
        self.rows = rows

    def __dlpack__(self, **options):
        return self.rows.__dlpack__(**options)

    def __dlpack_device__(self):
        return self.rows.__dlpack_device__()

    def __array__(self, dtype=None, copy=None):
        return self.rows.astype(dtype or self.rows.dtype)


def sensor_of(scene):
    return wr.CameraSensor(scene, 32, 32, fov=45, outputs=("cameraDepth",), visibility="rays")


def assert_plate_seen(images):
    """Its face is 4.75 away, and a pixel is 4.75 · 2 tan 22.5° / 32 = 0.123 wide: 8 × 8 centres lie before it."""
    depth = images.numpy("cameraDepth")[0]
    seen = np.isfinite(depth) & (depth > 0) & (depth < 100)
    assert seen.sum() == 64
    np.testing.assert_allclose(depth[seen], 4.75, atol=1e-3)


def test_distance_functions_keep_their_prims_when_one_goes():
    scene = wr.Scene()
    scene.add_sdf("/ball", ball, BOUNDS, pose=[-50, 0, 0, 0, 0, 0, 1])
    scene.add_sdf("/plate", plate, BOUNDS)
    sensor = sensor_of(scene)
    assert_plate_seen(sensor.update(POSE))
    scene.remove("/ball")
    assert_plate_seen(sensor.update(POSE))


def test_what_was_added_before_the_first_update_is_seen():
    scene = wr.Scene()
    sensor = sensor_of(scene)
    scene.add_sdf("/plate", plate, BOUNDS)
    assert_plate_seen(sensor.update(POSE))


def test_poses_of_another_library_are_only_read():
    scene = wr.Scene()
    scene.add_sdf("/plate", plate, BOUNDS)
    sensor = sensor_of(scene)
    near, far = POSE.astype(np.float32), POSE.astype(np.float32) + np.float32([0, 0, 1, 0, 0, 0, 0])
    depths = [
        float(sensor.update(poses).numpy("cameraDepth")[0, 16, 16])
        for poses in (Lent(near), Lent(far), POSE, Lent(far))
    ]
    np.testing.assert_allclose(depths, [4.75, 5.75, 4.75, 5.75], atol=1e-3)
    assert near[0, 2] == 5 and far[0, 2] == 6


def test_lights_of_another_kind_are_seen():
    """The bits of a sensor that was made later, with the lamp there; its light comes from the side."""

    def sensor():
        return wr.CameraSensor(scene, 16, 16, fov=45, visibility="rays", camera_light="on")

    scene = wr.Scene()
    scene.add_sphere("/ball")
    first = sensor()
    before = first.update(POSE).numpy("color").copy()
    scene.add_light(wr.SphereLight(radius=0.5, intensity=30.0), "/lamp", pose=[2, 0, 3, 0, 0, 0, 1])
    after = first.update(POSE).numpy("color").copy()
    np.testing.assert_array_equal(after, sensor().update(POSE).numpy("color"))
    assert (after[0, 8, 8, :3] > before[0, 8, 8, :3]).all()
    scene.remove("/lamp")
    np.testing.assert_array_equal(first.update(POSE).numpy("color"), before)
