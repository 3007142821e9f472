"""Arrays that other libraries share by DLPack: pictures out, points and poses in, over the same memory."""

import numpy as np
import pytest
import scenes
import warp as wp

import warprender as wr

OUTPUTS = ("cameraDepth", "normal", "position", "primId", "instanceId", "elementId")
LIBRARIES = ("numpy", "torch", "jax")
CORNERS = np.float32([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])


def reader(library):
    """Functions that take an array over by DLPack, and say where an array lies."""
    if library == "numpy":
        return np.from_dlpack, lambda array: array.ctypes.data
    if library == "torch":
        torch = pytest.importorskip("torch", reason="PyTorch is not installed")
        return torch.from_dlpack, lambda array: array.data_ptr()
    jax = pytest.importorskip("jax", reason="JAX is not installed")
    return jax.dlpack.from_dlpack, lambda array: array.unsafe_buffer_pointer()


def quad_scene(points=CORNERS, **options):
    scene = wr.Scene()
    scene.add_mesh("/quad", points, [[0, 1, 2, 3]], **options)
    return scene


def aovs(scene):
    return wr.Renderer(scene, scenes.window(1.5), (8, 8), outputs=OUTPUTS, transport="none")


def depth_of(renderer):
    renderer.update()
    return np.unique(renderer.render().numpy("cameraDepth")).tolist()


@pytest.mark.parametrize("library", LIBRARIES)
def test_pictures_are_taken_over_without_a_copy(library):
    read, place = reader(library)
    frame = aovs(quad_scene()).render()
    for name, array in frame.outputs.items():
        taken = read(array)
        assert place(taken) == array.ptr, name
        assert tuple(taken.shape) == frame.numpy(name).shape
        np.testing.assert_array_equal(np.asarray(taken), frame.numpy(name))
    sensor = wr.CameraSensor(quad_scene(), 8, 8, fov=20, outputs=("rgba8", "color", "cameraDepth", "semantic"))
    for _ in range(2):
        images = sensor.update(np.array([(0, 0, 5, 0, 0, 0, 1)] * 2, np.float32))
    for name, channels in (("rgba8", (4,)), ("color", (4,)), ("cameraDepth", ()), ("semantic", ())):
        taken = read(getattr(images, name))
        assert place(taken) == getattr(images, name).ptr and tuple(taken.shape) == (2, 8, 8, *channels)
    assert str(read(images.rgba8).dtype).endswith("uint8")


def test_torch_writes_points_and_normals_in_place():
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    points, normals = torch.tensor(CORNERS), torch.tensor([[0.0, 0.6, 0.8]] * 4)
    scene = quad_scene(points, normals=normals)
    assert scene.meshes["/quad"].points.ptr == points.data_ptr()
    renderer = aovs(scene)
    assert depth_of(renderer) == [5.0]
    points[:, 2] += 0.5
    normals[:] = torch.tensor([0.0, 0.8, 0.6])
    assert depth_of(renderer) == [4.5]
    np.testing.assert_allclose(renderer.render().numpy("normal")[4, 4], (0, 0.8, 0.6), rtol=1e-6)


@pytest.mark.parametrize("library", ["torch", "jax"])
def test_poses_are_taken_over(library):
    read, _ = reader(library)
    rows = read(np.array([(0, 0, 1.25, 0, 0, 0, 1)], np.float32))
    scene = quad_scene()
    renderer = aovs(scene)
    for poses in (rows, wp.from_dlpack(rows), wp.from_dlpack(rows, dtype=wp.transformf)):
        scene.set_poses("/quad", np.array([(0, 0, 0.5, 0, 0, 0, 1)]))
        assert depth_of(renderer) == [4.5]
        scene.set_poses("/quad", poses)
        assert depth_of(renderer) == [3.75]
    sensor = wr.CameraSensor(scene, 8, 8, fov=20, outputs=("cameraDepth",))
    eyes = read(np.array([(0, 0, 5, 0, 0, 0, 1), (0, 0, 6, 0, 0, 0, 1)], np.float32))
    assert sensor.update(eyes).numpy("cameraDepth")[:, 4, 4].tolist() == [3.75, 4.75]


def test_jax_hands_new_points_over_on_the_device():
    pytest.importorskip("jax", reason="JAX is not installed")
    import jax.numpy as jnp

    scene = quad_scene()
    renderer = aovs(scene)
    moved = jnp.asarray(CORNERS) + jnp.float32([0, 0, 0.25])
    wp.copy(scene.meshes["/quad"].points, wp.from_dlpack(moved, dtype=wp.vec3))
    assert depth_of(renderer) == [4.75]
    assert depth_of(aovs(quad_scene(moved))) == [4.75]


def test_what_cannot_be_shared_is_copied_or_named():
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    for points in (torch.tensor(CORNERS, dtype=torch.float64), torch.tensor(CORNERS.T.copy()).T):
        scene = quad_scene(points)
        assert depth_of(aovs(scene)) == [5.0]
    with pytest.raises(wr.SceneError, match=r"^/quad: .*cannot be shared"):
        quad_scene(torch.tensor(CORNERS, requires_grad=True))
