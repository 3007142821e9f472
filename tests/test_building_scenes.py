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


NAN = float("nan")


def add_mesh(scene, **options):
    scene.add_mesh(**({"path": "/mesh", "points": TRIANGLE, "faces": [[0, 1, 2]]} | options))


def add_sphere(scene, **options):
    scene.add_sphere("/ball", **options)


def add_instances(scene, **options):
    add_mesh(scene)
    scene.add_instances(**({"path": "/copies", "prototype": "/mesh"} | options))


def add_light(scene, light, **options):
    scene.add_light(light, "/lamp", **options)


def add_camera(scene, camera, **options):
    scene.add_camera("/camera", camera, **options)


def add_sdf(scene, **options):
    scene.add_sdf(**({"path": "/sdf", "distance": np.ones((2, 2, 2)), "bounds": [[0, 0, 0], [1, 1, 1]]} | options))


def set_poses(scene, **options):
    add_mesh(scene)
    scene.set_poses(**({"paths": ["/mesh"], "poses": [[0, 0, 0, 0, 0, 0, 1]]} | options))


def set_visible(scene, paths):
    add_mesh(scene)
    scene.set_visible(paths, False)


@pytest.mark.parametrize(
    ("add", "options", "said"),
    [
        (add_mesh, {"path": None}, "a path is a text such as '/World/box', not None"),
        (add_mesh, {"path": ""}, "a path is a text"),
        (add_mesh, {"points": "abc"}, "/mesh: points is 'abc', not an array of numbers"),
        (add_mesh, {"points": [[0, 0], [1, 2, 3]]}, "/mesh: points is .*, not an array of numbers"),
        (add_mesh, {"points": TRIANGLE.astype(complex)}, "/mesh: points is .*, not an array of numbers"),
        (add_mesh, {"faces": None}, "/mesh: faces is None"),
        (add_mesh, {"faces": "abc"}, "/mesh: faces"),
        (add_mesh, {"faces": [[0.0, 1.0, 2.0]]}, r"/mesh: faces is \[\[0.0, 1.0, 2.0\]\], not a row of ints"),
        (add_mesh, {"faces": [[0, 1, 2], [0.5, 1, 2, 0]]}, r"/mesh: faces\[1\] is \[0.5, 1, 2, 0\], not a row of ints"),
        (add_mesh, {"faces": [[True, False, True]]}, "/mesh: faces.* not a row of ints"),
        (add_mesh, {"faces": [[[0, 1, 2]]]}, r"/mesh: faces have the shape \(1, 1, 3\)"),
        (add_mesh, {"faces": np.array([[0, 1, 2**63]], np.uint64)}, "/mesh: a face index is outside 0…2"),
        (add_mesh, {"color": "red"}, "/mesh: color is 'red'"),
        (add_mesh, {"color": (NAN, 0, 0)}, "/mesh: color has values that are not finite"),
        (add_mesh, {"st": "x"}, "/mesh: st is 'x'"),
        (add_mesh, {"material": {"diffuseColor": 1}}, "/mesh/material: .* is not a material"),
        (add_mesh, {"material": wr.PreviewSurface}, "/mesh/material: .* is not a material"),
        (
            add_mesh,
            {"material": wr.PreviewSurface(roughness="low")},
            "/mesh/material: roughness is 'low', not a number",
        ),
        (add_mesh, {"material": wr.PreviewSurface(metallic=NAN)}, "/mesh/material: metallic is nan, not a number"),
        (add_mesh, {"material": wr.PreviewSurface(diffuseColor=0.5)}, "diffuseColor is 0.5, not 3 numbers"),
        (add_mesh, {"material": wr.PreviewSurface(opacityMode="x")}, "opacityMode is 'x', not one of"),
        (add_mesh, {"material": wr.Phong(exponent=None)}, "/mesh/material: exponent is None, not a number"),
        (add_mesh, {"material": wr.Dielectric(ior=np.inf)}, "/mesh/material: ior is inf, not a number"),
        (add_mesh, {"pose": "x"}, "/mesh: a pose is seven numbers or a 4×4 matrix, not 'x'"),
        (add_mesh, {"pose": [0, 0, 0, 0, 0, 0, 0]}, "/mesh: the quaternion of its pose is 0"),
        (add_mesh, {"pose": [NAN, 0, 0, 0, 0, 0, 1]}, "/mesh: its pose has numbers that are not finite"),
        (add_mesh, {"pose": np.array([[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])}, "in the last row"),
        (add_sphere, {"radius": "big"}, "/ball: radius is 'big', not a number"),
        (add_sphere, {"radius": NAN}, "/ball: radius is nan, not a number"),
        (add_sphere, {"radius": None}, "/ball: radius is None, not a number"),
        (add_instances, {"poses": None}, "/copies: poses are None"),
        (add_instances, {"poses": [[0, 0, 0, 0, 0, 0, 1], [0, 0, 0, 0, 0, 0, 0]]}, r"/copies\[1\]: the quaternion"),
        (add_light, {"light": "sun"}, "/lamp: 'sun' is not a Light"),
        (add_light, {"light": wr.RectLight}, "/lamp: .* is not a Light"),
        (add_light, {"light": wr.PortalLight()}, "/lamp: .* is not a Light"),
        (add_light, {"light": wr.SphereLight(radius="x")}, "/lamp: radius is 'x', not a number"),
        (add_light, {"light": wr.DistantLight(angle=NAN)}, "/lamp: angle is nan, not a number"),
        (add_light, {"light": wr.RectLight(color=1.0)}, "/lamp: color is 1.0, not 3 numbers"),
        (add_light, {"light": wr.RectLight(texture="x.png")}, "/lamp: texture is 'x.png', not a LightTexture"),
        (add_light, {"light": wr.DiskLight(intensity=1e40)}, "/lamp: intensity and exposure make 1e.40, too much"),
        (add_light, {"light": wr.DiskLight(shaping=wr.Shaping(focus=NAN))}, "/lamp: focus is nan, not a number"),
        (add_light, {"light": wr.DiskLight(shadow=None)}, "/lamp: shadow is None, not a Shadow"),
        (add_light, {"light": wr.DiskLight(transform=1.0)}, r"/lamp: transform is 1.0, not a \(4, 4\) array"),
        (add_light, {"light": wr.DomeLight(portals=(1,))}, r"/lamp: portals is \(1,\)"),
        (add_camera, {"camera": None}, "/camera: None is not a Camera"),
        (add_camera, {"camera": wr.Camera(focalLength="50mm")}, "/camera: focalLength is '50mm', not a number"),
        (add_camera, {"camera": wr.Camera(fStop=NAN)}, "/camera: fStop is nan, not a number"),
        (add_camera, {"camera": wr.Camera(clippingRange=0.1)}, "/camera: clippingRange is 0.1, not 2 numbers"),
        (add_camera, {"camera": wr.Camera(clippingPlanes=(1, 2))}, r"clippingPlanes is \(1, 2\), not rows of 4"),
        (add_sdf, {"precision": -1.0}, "/sdf: precision is -1.0, not a number above 0"),
        (add_sdf, {"lipschitz": "x"}, "/sdf: lipschitz is 'x', not a number above 0"),
        (add_sdf, {"parameters": (1, 2, 3, 4, 5)}, r"/sdf: parameters are \(1, 2, 3, 4, 5\), not up to four"),
        (set_poses, {"paths": None}, "None is no prim path"),
        (set_poses, {"paths": [5]}, "5 is no prim path"),
        (set_visible, {"paths": None}, "set_visible: None is no prim path"),
    ],
)
def test_what_is_not_as_described_is_named_in_one_line(add, options, said):
    with pytest.raises(wr.SceneError, match=said) as refused:
        add(wr.Scene(), **options)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "faces", [[0, 1, 2, 2, 1, 0], [[0, 1, 2], [2, 1, 0]], np.array([[0, 1, 2], [2, 1, 0]], np.uint64)]
)
@pytest.mark.parametrize("on_device", [False, True])
def test_triangles_come_in_rows_or_one_after_the_other(faces, on_device):
    faces = wp.array(np.array(faces, np.int32), dtype=wp.int32, device="cpu") if on_device else faces
    mesh = wr.Scene().add_mesh("/mesh", TRIANGLE, faces)
    assert mesh.triangles.tolist() == [[0, 1, 2], [2, 1, 0]]


def test_faces_of_too_few_corners_are_counted():
    scene = wr.Scene()
    assert scene.add_mesh("/mesh", TRIANGLE, [[0, 1], [0, 1, 2], []]).faces.tolist() == [1]
    assert scene.warnings == ["/mesh: 2 faces have fewer than three corners and are not drawn"]


def test_what_is_assigned_later_is_looked_at_too():
    scene = wr.Scene()
    add_mesh(scene, material=wr.PreviewSurface())
    renderer = wr.Renderer(scene, resolution=(4, 4), outputs="primId")
    scene.materials["/mesh/material"].metallic = "full"
    with pytest.raises(wr.SceneError, match="/mesh/material: metallic is 'full', not a number"):
        renderer.update()


@pytest.mark.parametrize("value", [NAN, np.inf])
def test_points_that_are_not_finite_leave_the_rest_in_the_picture(value):
    scene = wr.Scene()
    scene.add_mesh("/mesh", np.vstack([TRIANGLE, np.full((3, 3), value)]), [[0, 1, 2], [3, 4, 5]])
    frame = wr.Renderer(scene, resolution=(4, 4), outputs="primId", visibility="rays").render()
    assert (frame.numpy("primId") == 0).any()
    assert scene.warnings == ["/mesh: 1 triangles with non-finite points are not drawn"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"outputs": ()}, "none is asked for"),
        ({"outputs": "colour"}, "output 'colour' is not one of color, color:0, color:1, …, depth"),
        ({"outputs": None}, "outputs: None is not the name of an output"),
        ({"transport": "none"}, "transport 'none' gives no color"),
        ({"resolution": "640x480"}, "resolution is '640x480'"),
        ({"resolution": (4.5, 4)}, r"resolution is \(4.5, 4\)"),
        ({"resolution": (4, 4, 4)}, r"resolution is \(4, 4, 4\)"),
        ({"resolution": 8}, "resolution is 8"),
        ({"resolution": (0, 4)}, "resolution 0x4 has no pixels"),
        ({"bounces": 1.5}, "bounces must be a whole number, 0 or more, not 1.5"),
        ({"bounces": 2**40}, "bounces must be a whole number"),
        ({"texture_bytes": -1}, "texture_bytes must be 0 or more, not -1"),
    ],
)
def test_requests_that_give_no_picture_are_refused(options, said):
    with pytest.raises(wr.SceneError, match=said):
        wr.Renderer(wr.Scene(), **({"resolution": (4, 4)} | options))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"samples": "x"}, "samples must be a number above 0, not 'x'"),
        ({"error": NAN}, "error must be a number above 0, not nan"),
        ({"seconds": -1}, "seconds must be a number above 0, not -1"),
        ({"seed": 1.5}, "seed must be a whole number, not 1.5"),
        ({"seed": None}, "seed must be a whole number, not None"),
    ],
)
def test_limits_that_are_none_are_refused(options, said):
    with pytest.raises(wr.SceneError, match=said):
        wr.Renderer(wr.Scene(), resolution=(4, 4), outputs="primId").render(**options)
