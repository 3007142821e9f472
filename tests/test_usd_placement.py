"""Transforms, visibility, purpose, time and instances put every shape where the stage says."""

import numpy as np
import pytest
from usd_stage import scene_of, stage_of

from warprender.scene import SceneError
from warprender.usd import load

TRANSLATED = """double3 xformOp:translate = ({x}, 0, 0)
    uniform token[] xformOpOrder = [{order}]"""


def at(x: float, reset: bool = False) -> str:
    order = '"!resetXformStack!", "xformOp:translate"' if reset else '"xformOp:translate"'
    return TRANSLATED.format(x=x, order=order)


def positions(scene, path):
    return scene.placements[path].transforms[:, 3, :3].tolist()


def test_transforms_compose_in_float64():
    scene = scene_of(f'def Xform "a" {{ {at(1e7)} def Xform "b" {{ {at(0.125)} def Sphere "s" {{ }} }} }}')
    assert positions(scene, "/a/b/s") == [[1e7 + 0.125, 0, 0]]


def test_reset_xform_stack_cuts_inheritance():
    scene = scene_of(f'def Xform "a" {{ {at(5)} def Sphere "s" {{ {at(1, reset=True)} }} }}')
    assert positions(scene, "/a/s") == [[1, 0, 0]]


def test_invisible_prunes_the_subtree():
    scene = scene_of(
        """def Xform "a" { token visibility = "invisible"
            def Sphere "s" { token visibility = "inherited" }
            def SphereLight "l" { } }
        def Sphere "t" { }"""
    )
    assert list(scene.placements) == ["/t"] and not scene.lights


def test_purposes_follow_usdrecord():
    text = "".join(
        f'def Xform "{p}" {{ token purpose = "{p}"\n def Sphere "s" {{ }} }}'
        for p in ("default", "render", "proxy", "guide")
    )
    assert list(scene_of(text).placements) == ["/default/s", "/proxy/s"]
    assert list(scene_of(text, purposes=["render"]).placements) == ["/default/s", "/render/s"]
    with pytest.raises(SceneError, match="shadow"):
        scene_of(text, purposes=["shadow"])


def test_inactive_and_abstract_prims_are_not_drawn():
    scene = scene_of('def Sphere "a" ( active = false ) { } class Sphere "b" { } over "c" { } def Sphere "d" { }')
    assert list(scene.placements) == ["/d"]


def test_time_none_is_the_start_time_code_if_authored_else_the_earliest():
    text = """def Sphere "s" { double radius = 9
        double radius.timeSamples = { 10: 1, 20: 3, } }"""
    start = "startTimeCode = 15"
    assert scene_of(text, start).placements["/s"].shape.radius == 2
    assert scene_of(text, start, time=20).placements["/s"].shape.radius == 3
    assert scene_of(text).placements["/s"].shape.radius == 1
    assert scene_of(text, time=float("nan")).placements["/s"].shape.radius == 9


def test_singular_and_infinite_transforms_are_skipped_with_one_warning_each():
    scene = scene_of(
        """def Sphere "flat" { float3 xformOp:scale = (1, 1, 0)
            uniform token[] xformOpOrder = ["xformOp:scale"] }
        def Sphere "lost" { double3 xformOp:translate = (nan, 0, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"] }
        def Sphere "odd" { uniform token[] xformOpOrder = ["xformOp:nonsense"] }
        def Sphere "good" { }"""
    )
    assert list(scene.placements) == ["/odd", "/good"]
    assert [line.split(":")[0] for line in scene.warnings] == ["/odd", "/flat", "/lost"]


def test_transforms_that_are_not_affine_are_named():
    scene = scene_of(
        """def Sphere "s" { matrix4d xformOp:transform = ((1, 0, 0, 0.5), (0, 1, 0, 0), (0, 0, 1, 0), (3, 0, 0, 2))
            uniform token[] xformOpOrder = ["xformOp:transform"] }"""
    )
    assert scene.placements["/s"].transforms[0, :, 3].tolist() == [0, 0, 0, 1]
    assert scene.warnings == ["/s: its transform is not affine; the last column is ignored"]


NATIVE = """
class "proto" { def Mesh "m" {
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)] } 
    def SphereLight "l" { } }
class "outer" { def "inner" ( instanceable = true
    inherits = </proto> ) { } }
"""


def test_native_instances_share_their_shapes():
    scene = scene_of(
        NATIVE
        + "".join(f'def Xform "i{k}" ( instanceable = true\n inherits = </outer> ) {{ {at(k)} }}' for k in range(3))
    )
    assert [positions(scene, f"/i{k}/inner/m") for k in range(3)] == [[[k, 0, 0]] for k in range(3)]
    assert len({id(p.shape) for p in scene.placements.values()}) == 1
    assert [scene.lights[f"/i{k}/inner/l"].transform[3, 0] for k in range(3)] == [0, 1, 2]


def test_instances_that_inherit_other_colours_do_not_share():
    scene = scene_of(
        NATIVE
        + """def Xform "red" ( instanceable = true
            inherits = </proto> ) { color3f[] primvars:displayColor = [(1, 0, 0)] }
        def Xform "blue" ( instanceable = true
            inherits = </proto> ) { color3f[] primvars:displayColor = [(0, 0, 1)] }"""
    )
    red, blue = (scene.meshes[f"/{name}/m"].primvars["displayColor"].values for name in ("red", "blue"))
    assert red.tolist() == [[1, 0, 0]] and blue.tolist() == [[0, 0, 1]]


def instancer(body: str, prototype: str = 'def Sphere "s" { }', count: int = 4) -> str:
    return f"""def PointInstancer "p" {{
        rel prototypes = [</p/proto>]
        int[] protoIndices = {[0] * count}
        point3f[] positions = {[(k, 0, 0) for k in range(count)]}
        {body}
        def Xform "proto" {{ {at(0.5)} {prototype} }}
    }}"""


def test_point_instances_apply_the_prototype_root_first():
    scene = scene_of(instancer("float3[] scales = [(2, 2, 2), (1, 1, 1), (1, 1, 1), (1, 1, 1)]\n" + at(10)))
    placement = scene.placements["/p/proto/s"]
    assert placement.transforms[:, 3, 0].tolist() == [11, 11.5, 12.5, 13.5]
    assert placement.instance_ids.tolist() == [0, 1, 2, 3]


def test_ids_hide_instances():
    scene = scene_of(instancer("int64[] ids = [7, 8, 9, 3000000000]\nint64[] invisibleIds = [8, 3000000000]"))
    assert scene.placements["/p/proto/s"].instance_ids.tolist() == [0, 2]


def test_orientationsf_and_zero_orientations_are_finite():
    scene = scene_of(instancer("quatf[] orientationsf = [(0, 0, 0, 1), (0, 0, 0, 0), (1, 0, 0, 0), (1, 0, 0, 0)]"))
    transforms = scene.placements["/p/proto/s"].transforms
    np.testing.assert_allclose(transforms[0, :3, :3], np.diag([-1, -1, 1]), atol=1e-6)
    assert np.isfinite(transforms).all()


def test_bad_proto_indices_are_counted_in_one_warning():
    text = instancer("").replace("[0, 0, 0, 0]", "[0, 5, -1, 0]")
    scene = scene_of(text)
    assert scene.placements["/p/proto/s"].instance_ids.tolist() == [0, 3]
    assert scene.warnings == ["/p: 2 protoIndices are outside 0…0"]


def test_nested_instancers_multiply():
    inner = """def PointInstancer "q" {
        rel prototypes = [</p/proto/q/s>]
        int[] protoIndices = [0, 0]
        point3f[] positions = [(0, 1, 0), (0, 2, 0)]
        def Sphere "s" { } }"""
    scene = scene_of(instancer("", prototype=inner, count=2))
    placement = scene.placements["/p/proto/q/s"]
    assert placement.transforms[:, 3, :2].tolist() == [[0.5, 1], [0.5, 2], [1.5, 1], [1.5, 2]]
    assert placement.instance_ids.tolist() == [0, 1, 2, 3]


def test_an_instancer_among_its_own_prototypes_ends():
    scene = scene_of(instancer("").replace("[</p/proto>]", "[</p>]"))
    assert not scene.placements and len(scene.warnings) == 1


def test_lights_under_a_point_instancer_are_instanced():
    scene = scene_of(instancer("", prototype='def SphereLight "l" { float inputs:radius = 0.25 }'))
    assert [light.transform[3, 0] for light in scene.lights.values()] == [0.5, 1.5, 2.5, 3.5]


def test_a_million_instances_make_one_placement():
    from pxr import Vt

    stage = stage_of(instancer(""))
    count = 1_000_000
    prim = stage.GetPrimAtPath("/p")
    prim.GetAttribute("protoIndices").Set(Vt.IntArray(count, 0))
    places = np.arange(3 * count, dtype=np.float32).reshape(-1, 3)
    prim.GetAttribute("positions").Set(Vt.Vec3fArray.FromNumpy(places))
    scene = load(stage)
    assert scene.placements["/p/proto/s"].transforms.shape == (count, 4, 4)
    assert scene.placements["/p/proto/s"].transforms[-1, 3, 2] == places[-1, 2]


def test_variants_and_masks():
    text = """def Xform "a" ( variants = { string size = "small" }
        prepend variantSets = "size" ) {
        variantSet "size" = {
            "small" { def Sphere "s" { double radius = 1 } }
            "large" { def Sphere "s" { double radius = 2 } }
        } }
        def Sphere "b" { }"""
    chosen = {"/a": {"size": "large"}}
    assert scene_of(text, variants=chosen).placements["/a/s"].shape.radius == 2
    assert list(scene_of(text, mask=["/b"]).placements) == ["/b"]
    with pytest.raises(SceneError, match="size=huge"):
        scene_of(text, variants={"/a": {"size": "huge"}})
