"""Skinning follows UsdSkel: linear blends, dual quaternions, blend shapes, and the space that results."""

import numpy as np
import pytest
from usd_stage import scene_of

from warprender.shapes.skinning import (
    Influences,
    blended,
    dual_quaternion_blended,
    normal_matrices,
    transformed_points,
    turned_normals,
)


def turned(degrees: float, axis: int = 2, at=(0, 0, 0)) -> np.ndarray:
    """A rotation for row vectors, then a translation."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    matrix = np.eye(4)
    a, b = (axis + 1) % 3, (axis + 2) % 3
    matrix[a, a], matrix[a, b], matrix[b, a], matrix[b, b] = c, s, -s, c
    matrix[3, :3] = at
    return matrix


def halves(joints: int = 2) -> Influences:
    return Influences(np.arange(joints)[None], np.full((1, joints), 1 / joints))


@pytest.mark.parametrize("blend", [blended, dual_quaternion_blended])
def test_one_joint_moves_its_points_rigidly(blend):
    generator = np.random.default_rng(3)
    joints = np.stack([turned(a, k % 3, generator.normal(size=3)) for k, a in enumerate((0, 10, 90, 179, 180, 250))])
    influences = Influences(np.arange(6)[:, None], np.ones((6, 1)))
    np.testing.assert_allclose(blend(joints, influences), joints, atol=1e-12)


def test_half_way_between_half_turns_linear_blending_collapses_and_dual_quaternions_do_not():
    joints = np.stack([turned(-80), turned(80)])
    point = np.array([[1.0, 0, 0]])
    linear = transformed_points(point, blended(joints, halves()))
    dual = transformed_points(point, dual_quaternion_blended(joints, halves()))
    np.testing.assert_allclose(linear, [[np.cos(np.radians(80)), 0, 0]], atol=1e-12)
    np.testing.assert_allclose(dual, point, atol=1e-12)


def test_dual_quaternions_blend_scale_and_mirrors_linearly():
    joints = np.stack([np.diag([2.0, 1, -1, 1]), np.diag([4.0, 1, -1, 1])])
    np.testing.assert_allclose(dual_quaternion_blended(joints, halves())[0], np.diag([3.0, 1, -1, 1]), atol=1e-12)


def test_points_without_weights_stay():
    still = Influences(np.zeros((1, 2), int), np.zeros((1, 2)))
    for blend in (blended, dual_quaternion_blended):
        np.testing.assert_array_equal(blend(np.stack([turned(30)]), still)[0], np.eye(4))


def test_normals_of_a_flattened_joint_are_finite():
    flat = normal_matrices(np.diag([1.0, 1.0, 0.0, 1.0])[None])
    np.testing.assert_array_equal(turned_normals(np.array([[0.6, 0.0, 0.8]]), flat), [[0, 0, 1]])


def test_normals_turn_by_cofactors():
    squash = np.diag([2.0, 1.0, 1.0, 1.0])[None]
    normal = turned_normals(np.array([[1.0, 1.0, 0.0]]), normal_matrices(squash))
    np.testing.assert_allclose(normal, [np.array([1, 2, 0]) / np.sqrt(5)])


RIG = """def SkelRoot "r" {
    double3 xformOp:translate = (100, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Skeleton "s" ( prepend apiSchemas = ["SkelBindingAPI"] ) {
        uniform token[] joints = ["a", "a/b"]
        uniform matrix4d[] bindTransforms = [
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)),
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (1, 0, 0, 1))]
        uniform matrix4d[] restTransforms = [
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)),
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (1, 0, 0, 1))]
        rel skel:animationSource = </r/s/anim>
        def SkelAnimation "anim" {
            uniform token[] joints = ["a/b"]
            quatf[] rotations = [(0.70710678, 0, 0, 0.70710678)]
            float3[] translations = [(1, 0, 0)]
            half3[] scales = [(1, 1, 1)]
            uniform token[] blendShapes = ["up"]
            float[] blendShapeWeights = [0.5] } }
    def Mesh "m" ( prepend apiSchemas = ["SkelBindingAPI"] ) {
        double3 xformOp:translate = (0, 0, 77)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 1, 0)]
        normal3f[] normals = [(1, 0, 0), (1, 0, 0), (1, 0, 0)]
        int[] primvars:skel:jointIndices = [0, 1, 1] ( interpolation = "vertex" )
        float[] primvars:skel:jointWeights = [1, 1, 2] ( interpolation = "vertex" )
        rel skel:skeleton = </r/s>
        %s } }"""


def test_joints_turn_points_and_normals_in_skeleton_space():
    scene = scene_of(RIG % "")
    placement = scene.placements["/r/m"]
    np.testing.assert_allclose(placement.transforms[0, 3, :3], [100, 0, 0], atol=1e-9)
    np.testing.assert_allclose(placement.shape.points, [[0, 0, 0], [1, 1, 0], [0, 1, 0]], atol=1e-6)
    np.testing.assert_allclose(placement.shape.normals.values, [[1, 0, 0], [0, 1, 0], [0, 1, 0]], atol=1e-6)
    assert not scene.warnings


def test_blend_shapes_come_before_the_joints():
    shape = """uniform token[] skel:blendShapes = ["up"]
        rel skel:blendShapeTargets = </r/m/up>
        def BlendShape "up" { uniform vector3f[] offsets = [(0, 0, 4)]
            uniform int[] pointIndices = [1] }"""
    points = scene_of(RIG % shape).meshes["/r/m"].points
    np.testing.assert_allclose(points, [[0, 0, 0], [1, 1, 2], [0, 1, 0]], atol=1e-6)


SHAPES = """uniform token[] skel:blendShapes = ["up"]
    rel skel:blendShapeTargets = </r/m/up>
    def BlendShape "up" { uniform vector3f[] offsets = [(0, 0, 4), (0, 0, 8)]
        uniform vector3f[] normalOffsets = [(0, 0, 2), (-2, 4, 0)]
        uniform int[] pointIndices = [1, 2]
        %s }"""


@pytest.mark.parametrize("corners", [False, True])
def test_blend_shapes_bend_normals_before_the_joints_turn_them(corners):
    text = RIG % (SHAPES % "")
    if corners:
        normals = "normal3f[] normals = [(1, 0, 0), (1, 0, 0), (1, 0, 0)]"
        text = text.replace(normals, normals + ' ( interpolation = "faceVarying" )')
        text = text.replace("faceVertexIndices = [0, 1, 2]", "faceVertexIndices = [0, 2, 1]")
    values = scene_of(text).meshes["/r/m"].normals.values
    # Half of the offsets: (1, 0, 1) and (0, 2, 0); the joint takes x to y and y to -x.
    expected = np.array([[1, 0, 0], [0, 0.5**0.5, 0.5**0.5], [-1, 0, 0]])
    np.testing.assert_allclose(values, expected[[0, 2, 1]] if corners else expected, atol=1e-6)


@pytest.mark.parametrize(
    ("weight", "height"), [(0.125, 2.0), (0.25, 4.0), (0.5, 4 / 3), (1.0, -4.0), (1.5, -28 / 3), (-0.25, -4.0)]
)
def test_shapes_in_between_are_passed_through(weight, height):
    """Offset 4 at weight 1/4 and -4 at 1: straight lines between them, and on beyond the ends."""
    between = "uniform vector3f[] inbetweens:b = [(0, 0, 4), (0, 0, 4)] ( weight = 0.25 )"
    text = RIG % (SHAPES % between).replace("[(0, 0, 4), (0, 0, 8)]", "[(0, 0, -4), (0, 0, -4)]")
    points = (
        scene_of(text.replace("blendShapeWeights = [0.5]", f"blendShapeWeights = [{weight}]")).meshes["/r/m"].points
    )
    np.testing.assert_allclose(points[:, 2], [0, height, height], atol=1e-5)


def test_blend_shapes_without_joints_bend_normals_too():
    text = (RIG % (SHAPES % "")).replace("int[] primvars:skel:jointIndices", "int[] unused")
    text = text.replace("float[] primvars:skel:jointWeights", "float[] unread")
    mesh = scene_of(text).meshes["/r/m"]
    np.testing.assert_allclose(mesh.points, [[0, 0, 0], [2, 0, 2], [2, 1, 4]], atol=1e-6)
    np.testing.assert_allclose(mesh.normals.values, [[1, 0, 0], [1, 0, 1], [0, 2, 0]], atol=1e-6)


def test_blend_shapes_that_do_not_fit_are_named():
    text = RIG % (SHAPES % "").replace("pointIndices = [1, 2]", "pointIndices = [1, 7]")
    scene = scene_of(text)
    assert scene.warnings == ["/r/m: blend shape 0 does not fit its points"]
    text = RIG % (SHAPES % "").replace("normalOffsets = [(0, 0, 2), (-2, 4, 0)]", "normalOffsets = [(0, 0, 2)]")
    scene = scene_of(text)
    assert scene.warnings == ["/r/m: blend shape 0 does not fit its normals"]


def test_joint_indices_out_of_range_leave_the_rest_pose_with_a_warning():
    scene = scene_of((RIG % "").replace("[0, 1, 1] (", "[0, 1, 9] ("))
    np.testing.assert_allclose(scene.meshes["/r/m"].points, [[0, 0, 0], [2, 0, 0], [2, 1, 0]])
    assert len(scene.warnings) == 1 and scene.warnings[0].startswith("/r/m: its skeleton")


def test_a_prim_without_points_moves_with_its_joint():
    rigid = """def Sphere "ball" ( prepend apiSchemas = ["SkelBindingAPI"] ) {
        int[] primvars:skel:jointIndices = [1] ( interpolation = "constant" )
        float[] primvars:skel:jointWeights = [1] ( interpolation = "constant" )
        matrix4d primvars:skel:geomBindTransform = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (2, 0, 0, 1))
        rel skel:skeleton = </r/s> }
    def Mesh"""
    scene = scene_of((RIG % "").replace("def Mesh", rigid))
    np.testing.assert_allclose(scene.placements["/r/ball"].transforms[0, 3, :3], [101, 1, 0], atol=1e-6)


BETWEEN = """uniform vector3f[] inbetweens:b = [(0, 1, 4), (0, 2, 4)] ( weight = 0.75 )
    uniform vector3f[] inbetweens:b:normalOffsets = [(0, 1, 0), (0, 2, 0.5)]"""


@pytest.mark.parametrize(
    ("method", "scale"),
    [
        ("classicLinear", "1, 1, 1"),
        ("classicLinear", "2, 1, 0.5"),
        ("classicLinear", "-1, 1, 1"),
        ("dualQuaternion", "1, 1, 1"),
        ("dualQuaternion", "2, 1, 0.5"),
    ],
)
def test_both_methods_agree_with_usds_own_baking(method, scale):
    """Points and normals of two joints that share their points, after a blend shape and one in between."""
    from pxr import Gf, UsdGeom, UsdSkel
    from usd_stage import stage_of

    from warprender.usd import load

    shape = SHAPES % BETWEEN + f'uniform token primvars:skel:skinningMethod = "{method}"'
    sharing = {
        "[0, 1, 1] (": "[0, 1, 0, 1, 1, 0] ( elementSize = 2\n",
        "[1, 1, 2] (": "[0.75, 0.25, 0.5, 0.5, 0.4, 0.6] ( elementSize = 2\n",
        "(1, 0, 0), (1, 0, 0), (1, 0, 0)]": '(1, 0, 0), (0, 1, 0), (0.6, 0, 0.8)] ( interpolation = "vertex" )',
        "quatf[] rotations =": "quatf[] rotations.timeSamples = { 1:",
        "70710678)]\n": "70710678)] }\n",
        "half3[] scales = [(1, 1, 1)]": f"half3[] scales = [({scale})]",
    }
    text = RIG % shape
    for old, new in sharing.items():
        assert old in text
        text = text.replace(old, new)
    stage = stage_of(text)
    scene = load(stage, time=1)
    mesh = scene.meshes["/r/m"]
    UsdSkel.BakeSkinning(UsdSkel.Root(stage.GetPrimAtPath("/r")), Gf.Interval(1, 1))
    baked = UsdGeom.Mesh(stage.GetPrimAtPath("/r/m"))
    points, normals = (np.array(a.Get(1.0), float) for a in (baked.GetPointsAttr(), baked.GetNormalsAttr()))
    assert not scene.warnings
    # Baked points are in the mesh's own space, which stands 77 above the skeleton's.
    np.testing.assert_allclose(mesh.points, points + (0, 0, 77), atol=1e-5)
    np.testing.assert_allclose(mesh.normals.values, normals, atol=1e-5)


def test_prototypes_may_contain_skinned_meshes():
    scene = scene_of(
        RIG % ""
        + """def PointInstancer "p" { rel prototypes = [</r>]
            int[] protoIndices = [0, 0]
            point3f[] positions = [(0, 10, 0), (0, 20, 0)] }"""
    )
    alone, copies = scene.placements.values()
    assert alone.shape is copies.shape
    np.testing.assert_allclose(copies.transforms[:, 3, :3], [[100, 10, 0], [100, 20, 0]], atol=1e-9)


def test_native_instances_of_a_rig_share_the_posed_mesh():
    rig = (RIG % "").replace('def SkelRoot "r"', 'class SkelRoot "r"')
    uses = "".join(
        f"""def "i{k}" ( instanceable = true
            inherits = </r> ) {{ double3 xformOp:translate = ({k}, 0, 0) }}"""
        for k in range(2)
    )
    scene = scene_of(rig + uses)
    first, second = scene.placements.values()
    np.testing.assert_allclose(first.shape.points, [[0, 0, 0], [1, 1, 0], [0, 1, 0]], atol=1e-6)
    assert [p.transforms[0, 3, 0] for p in (first, second)] == pytest.approx([0, 1])
    assert first.shape is second.shape
