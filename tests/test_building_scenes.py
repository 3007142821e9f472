"""Scenes built in Python: what the `add_*` methods refuse, before anything reaches a device."""

import numpy as np
import pytest
import warp as wp

import warprender as wr

TRIANGLE = np.eye(3, dtype=np.float32)


@pytest.mark.parametrize(
    ("points", "options", "said"),
    [
        (np.zeros((3, 2)), {}, r"points have the shape \(3, 2\)"),
        (wp.zeros((3, 3), dtype=wp.float32, device="cpu"), {}, "wp.vec3"),
        (TRIANGLE, {"color": np.zeros((2, 3))}, r"color has the shape \(2, 3\)"),
        (TRIANGLE, {"normals": np.zeros((4, 3))}, r"normals has the shape \(4, 3\)"),
        (TRIANGLE, {"pose": (1, 2, 3)}, "a pose is seven numbers"),
    ],
)
def test_arrays_of_the_wrong_shape_are_named(points, options, said):
    with pytest.raises(wr.SceneError, match=f"/mesh: .*{said}"):
        wr.Scene().add_mesh("/mesh", points, [[0, 1, 2]], **options)


def test_an_index_out_of_range_is_named():
    with pytest.raises(wr.SceneError, match="/mesh: a face index is outside 0…2"):
        wr.Scene().add_mesh("/mesh", TRIANGLE, [[0, 1, 3]])


def test_a_path_names_one_thing():
    scene = wr.Scene()
    scene.add_sphere("/here")
    with pytest.raises(wr.SceneError, match="/here: the path is already in the scene"):
        scene.add_camera("/here", wr.Camera())


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"outputs": ()}, "none is asked for"),
        ({"outputs": "colour"}, "output 'colour' is not one of color, color:0, color:1, …, depth"),
        ({"transport": "none"}, "transport 'none' gives no color"),
    ],
)
def test_requests_that_give_no_picture_are_refused(options, said):
    with pytest.raises(wr.SceneError, match=said):
        wr.Renderer(wr.Scene(), resolution=(4, 4), **options)
