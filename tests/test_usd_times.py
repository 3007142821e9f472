"""A stage read at several times shares what does not change, and rereads what does."""

import numpy as np
from usd_stage import stage_of

from warprender.usd import StageReader

TRIANGLE = """int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]"""


def test_shapes_that_do_not_change_are_the_same_objects():
    reader = StageReader(
        stage_of(
            f"""def Mesh "still" {{ {TRIANGLE}
                double3 xformOp:translate.timeSamples = {{ 1: (0, 0, 0), 2: (5, 0, 0), }}
                uniform token[] xformOpOrder = ["xformOp:translate"] }}
            def Mesh "moving" {{ {TRIANGLE}
                point3f[] points.timeSamples = {{ 1: [(0, 0, 0), (1, 0, 0), (0, 1, 0)],
                    2: [(0, 0, 1), (1, 0, 1), (0, 1, 1)], }} }}
            def Xform "group" {{ color3f[] primvars:displayColor.timeSamples = {{ 1: [(1, 0, 0)], 2: [(0, 1, 0)], }}
                def Mesh "coloured" {{ {TRIANGLE} }} }}"""
        )
    )
    first, second = reader.read(1), reader.read(2)
    assert first.meshes["/still"] is second.meshes["/still"]
    assert second.placements["/still"].transforms[0, 3, 0] == 5
    assert first.meshes["/moving"].points[:, 2].tolist() == [0, 0, 0]
    assert second.meshes["/moving"].points[:, 2].tolist() == [1, 1, 1]
    assert second.meshes["/group/coloured"].primvars["displayColor"].values.tolist() == [[0, 1, 0]]


def test_subdivision_keeps_its_connectivity_while_points_move():
    body = """int[] faceVertexCounts.timeSamples = { 1: [4], 2: [4], 3: [3], }
        int[] faceVertexIndices.timeSamples = { 1: [0, 1, 2, 3], 2: [0, 1, 2, 3], 3: [0, 1, 2], }
        point3f[] points.timeSamples = { 1: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)],
            2: [(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)], }"""
    reader = StageReader(stage_of(f'def Mesh "m" {{ {body} }}'), complexity="medium")
    surfaces = []
    for time in (1, 2, 3):
        scene = reader.read(time)
        surfaces.append(reader._last.surfaces["/m"])
        assert np.ptp(scene.meshes["/m"].points[:, 2]) == 0
    assert surfaces[0] is surfaces[1] is not surfaces[2]


def test_colours_by_instance_may_change():
    reader = StageReader(
        stage_of(
            """over "proto" { def Sphere "s" { } }
            def PointInstancer "p" { rel prototypes = [</proto>]
                int[] protoIndices = [0]
                point3f[] positions = [(0, 0, 0)]
                color3f[] primvars:displayColor ( interpolation = "vertex" )
                color3f[] primvars:displayColor.timeSamples = { 1: [(1, 0, 0)], 2: [(0, 1, 0)], } }"""
        )
    )
    colors = [
        next(iter(reader.read(t).placements.values())).shape.primvars["displayColor"].values.tolist() for t in (1, 2)
    ]
    assert colors == [[[1, 0, 0]], [[0, 1, 0]]]
