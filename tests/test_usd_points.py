"""Points are exact spheres, one quadric for all; values by instance reach each copy."""

import numpy as np
from usd_stage import scene_of

from warprender.shapes import Sphere

POINTS = """def Points "p" {
    point3f[] points = [(0, 0, 0), (1, 0, 0), (nan, 0, 0), (3, 0, 0)]
    float[] widths = [1, 2, 1, 4] ( interpolation = "vertex" )
    color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)] ( interpolation = "vertex" )
    double3 xformOp:translate = (0, 5, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"] }"""


def test_points_share_one_sphere_and_scale_it_by_their_widths():
    scene = scene_of(POINTS)
    placement = scene.placements["/p"]
    assert isinstance(placement.shape, Sphere) and placement.shape.radius == 0.5
    assert placement.transforms[:, 3, :2].tolist() == [[0, 5], [1, 5], [3, 5]]
    assert placement.transforms[:, 0, 0].tolist() == [1, 2, 4]
    assert scene.warnings == ["/p: 1 points or widths are not finite"]


def test_colours_of_points_go_by_instance():
    placement = scene_of(POINTS).placements["/p"]
    color = placement.shape.primvars["displayColor"]
    assert color.interpolation == "instance" and placement.instance_ids.tolist() == [0, 1, 3]
    assert color.values[placement.instance_ids].tolist() == [[1, 0, 0], [0, 1, 0], [1, 1, 1]]


def test_widths_may_be_constant_or_missing():
    bare = 'def Points "p" { point3f[] points = [(0, 0, 0), (1, 0, 0)]\n%s }'
    assert scene_of(bare % "").placements["/p"].transforms[:, 0, 0].tolist() == [1, 1]
    constant = 'float[] widths = [3] ( interpolation = "constant" )'
    assert scene_of(bare % constant).placements["/p"].transforms[:, 0, 0].tolist() == [3, 3]


INSTANCER = """def PointInstancer "%s" {
    rel prototypes = [</proto>]
    int[] protoIndices = [0, 0]
    point3f[] positions = [(0, 0, 0), (1, 0, 0)]
    color3f[] primvars:displayColor = %s ( interpolation = "vertex" )
}"""


def test_instancers_colour_their_copies():
    scene = scene_of(
        'over "proto" { def Sphere "s" { } }'
        + INSTANCER % ("a", [(1, 0, 0), (0, 1, 0)])
        + INSTANCER % ("b", [(0, 0, 1), (1, 1, 1)])
    )
    a, b = (p.shape.primvars["displayColor"].values.tolist() for p in scene.placements.values())
    assert a == [[1, 0, 0], [0, 1, 0]] and b == [[0, 0, 1], [1, 1, 1]]


def test_colours_of_an_outer_instancer_reach_the_inner_copies():
    scene = scene_of(
        """over "leaf" { def Sphere "s" { } }
        over "proto" { def PointInstancer "q" { rel prototypes = [</leaf>]
            int[] protoIndices = [0, 0, 0]
            point3f[] positions = [(0, 1, 0), (0, 2, 0), (0, 3, 0)] } }"""
        + INSTANCER % ("a", [(1, 0, 0), (0, 1, 0)])
    )
    (placement,) = scene.placements.values()
    colors = placement.shape.primvars["displayColor"].values[placement.instance_ids]
    assert (colors[placement.transforms[:, 3, 0] == 0] == [1, 0, 0]).all()
    assert (colors[placement.transforms[:, 3, 0] == 1] == [0, 1, 0]).all()


def test_a_hundred_thousand_points_cost_no_triangles():
    from pxr import Vt
    from usd_stage import stage_of

    from warprender.usd import load

    stage = stage_of('def Points "p" { }')
    places = np.random.default_rng(0).random((100_000, 3), np.float32)
    stage.GetPrimAtPath("/p").GetAttribute("points").Set(Vt.Vec3fArray.FromNumpy(places))
    placement = load(stage).placements["/p"]
    assert placement.transforms.shape == (100_000, 4, 4) and isinstance(placement.shape, Sphere)


def test_colours_by_instance_reach_the_picture():
    import warprender as wr

    scene = scene_of(
        """def Points "p" { point3f[] points = [(-1, 0, 0), (1, 0, 0)]
            color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] ( interpolation = "vertex" ) }
        def Camera "main_cam" { float2 clippingRange = (0.1, 100)
            double3 xformOp:translate = (0, 0, 10)
            uniform token[] xformOpOrder = ["xformOp:translate"] }"""
    )
    frame = wr.render(scene, resolution=(42, 30), samples=1, outputs=("albedo",))
    albedo = frame.numpy("albedo")[:, :, :3]
    left, right = albedo[:, :21].reshape(-1, 3), albedo[:, 21:].reshape(-1, 3)
    assert left[:, 0].max() > 0.9 and left[:, 1].max() == 0
    assert right[:, 1].max() > 0.9 and right[:, 0].max() == 0
