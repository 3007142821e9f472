"""Traps of Warp that the package relies on avoiding (CONTRIBUTING.md lists them): each test is one of them, avoided."""

import gc
import json
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import scenes
import warp as wp
from pictures import outputs

import warprender as wr
from warprender.integrators.none import outputs_kernel
from warprender.launch import launch
from warprender.lights import LIGHTS
from warprender.lights.dispatch import FUNCTIONS, light_functions
from warprender.numerics import is_finite, safe_normalize
from warprender.plan import OutputsKey
from warprender.records import DeviceScene
from warprender.upload import Upload

#: Lights with the same pdf for all samples at (0, 0, -1), and its closed form.
KINDS = {
    "DistantLight": (wr.DistantLight(angle=120.0), 1 / np.pi),
    "RectLight": (wr.RectLight(width=2.0, height=2.0), 3 / (2 * np.pi)),
    "SphereLight": (wr.SphereLight(radius=0.6), 1 / (2 * np.pi * 0.2)),
}


def densities(names):
    """Pdf that the chain for these names gives each kind of light, by a kernel made of this chain."""
    sample_light, _ = light_functions(names)

    @wp.kernel(module="unique", enable_backward=False)
    def sample(scene: DeviceScene, out: wp.array(dtype=wp.float32)):
        i = wp.tid()
        out[i] = sample_light(scene, scene.lights[i], wp.vec3(0.0, 0.0, -1.0), wp.vec2(0.3, 0.6)).pdf

    held = Upload(wr.Scene(), {f"/{name}": KINDS[name][0] for name in names}, np.zeros(3), "cpu")
    out = wp.empty(len(names), dtype=wp.float32)
    wp.launch(sample, len(names), [held.record, out])
    # On the device finite lights come first.
    order = sorted(names, key=lambda name: KINDS[name][0].infinite)
    return [out.numpy().tolist()[order.index(name)] for name in names]


def dispatched():
    """Pairs of kinds, and what their chain says; each pair is another permutation, all tables have length 2."""
    pairs = [("DistantLight", "RectLight"), ("RectLight", "SphereLight"), ("SphereLight", "DistantLight")]
    return [(names, densities(names)) for names in pairs]


def assert_right(answers):
    for names, got in answers:
        np.testing.assert_allclose(got, [KINDS[name][1] for name in names], rtol=1e-5)


def test_permuted_tables_of_functions_dispatch_to_the_right_one(tmp_path):
    # A table indexed by `wp.static` in a func runs another table's binary; a chain of closures does not. Once in this
    # process, once in a fresh one with an empty kernel cache, once in a fresh one with the cache that it left.
    assert_right(dispatched())
    environment = {**os.environ, "WARP_CACHE_PATH": str(tmp_path), "PYTHONPATH": os.pathsep.join(sys.path)}
    for _ in range(2):
        command = [sys.executable, __file__]
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
        assert_right(json.loads(done.stdout.splitlines()[-1]))


def test_plans_of_equal_hash_have_their_own_kernels():
    # Python gives -1 and -2, and any two values that collide, one hash: kernels are kept by value.
    class Colliding(OutputsKey):
        def __hash__(self):
            return 1

    key = Colliding(("Mesh",), ("DisplayColor",), ("perspective",), ("cameraDepth",), False)
    other = replace(key, outputs=("primId",))
    assert hash(key) == hash(other)
    assert outputs_kernel(key) is not outputs_kernel(other)
    assert outputs_kernel(key) is outputs_kernel(replace(other, outputs=("cameraDepth",)))


@wp.kernel(module="unique", enable_backward=False)
def count_visits(first: wp.int32, visits: wp.array(dtype=wp.int32)):
    i = first + wp.tid()
    visits[i] = visits[i] + 1


@pytest.mark.parametrize("count", [0, 1, 255, 256, 257, 513, 100_003])
@pytest.mark.parametrize("threads", [1, 2, 3, 16])
def test_chunks_of_a_launch_visit_every_item_once(count, threads):
    visits = wp.zeros(count + 1000, dtype=wp.int32)
    launch(count_visits, count, [visits], "cpu", threads)
    seen = visits.numpy()
    assert (seen[:count] == 1).all() and (seen[count:] == 0).all()


def test_arrays_inside_structs_outlive_the_code_that_made_them():
    # Warp keeps no nested array alive: the upload does. A sheet of many triangles, with primvars, after a purge.
    points, faces = scenes.icosphere(3)
    scene = wr.Scene()
    scene.add_mesh("/ball", points.copy(), faces, normals=points.copy(), color=np.abs(points))
    names = ("albedo", "normal", "position")
    renderer = wr.Renderer(scene, scenes.camera((0, 0, 4)), (16, 16), outputs=names, transport="none")
    before = {name: renderer.render().numpy(name).copy() for name in names}
    gc.collect()
    litter = [np.full(1000, np.nan) for _ in range(1000)]
    after = renderer.render()
    for name in names:
        np.testing.assert_array_equal(after.numpy(name), before[name])
    del litter


def values_of(func, vectors, dtype):
    @wp.kernel(module="unique", enable_backward=False)
    def apply(v: wp.array(dtype=wp.vec3), out: wp.array(dtype=dtype)):
        i = wp.tid()
        out[i] = func(v[i])

    out = wp.empty(len(vectors), dtype=dtype)
    wp.launch(apply, len(vectors), [wp.array(np.asarray(vectors, np.float32), dtype=wp.vec3), out])
    return out.numpy()


def test_vectors_of_any_length_have_a_direction():
    # wp.normalize gives zero below lengths of 1e-23 and above 1e19, and a NaN for infinities.
    directions = np.array([(1, 2, 2), (-2, 1, 2), (0, 0, -3), (3, 0, 0), (1e-3, 3, 0)]) / 3
    for scale in (1e-37, 1e-30, 1e-23, 1e-15, 1.0, 1e15, 1e19, 1e25, 1e37):
        got = values_of(safe_normalize, directions * scale, wp.vec3)
        expected = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        np.testing.assert_allclose(got, expected, atol=5e-7 if scale < 1e-36 else 2e-7)
    bad = [(0, 0, 0), (np.nan, 0, 1), (np.inf, 0, 0), (0, -np.inf, 1)]
    np.testing.assert_array_equal(values_of(safe_normalize, bad, wp.vec3), 0.0)


def test_nan_is_found_before_a_clamp_hides_it():
    # wp.clamp(NaN, 0, 1) is 0 and wp.min(NaN, 1) is 1.
    vectors = [(0, 0, 0), (np.nan, 0, 0), (0, np.nan, 0), (0, 0, np.nan), (np.inf, 0, 0), (0, -np.inf, 0), (3e38, 1, 1)]
    got = values_of(is_finite, vectors, wp.bool)
    np.testing.assert_array_equal(got, [True, False, False, False, False, False, True])


def test_a_scene_without_triangles_does_not_reach_an_empty_mesh():
    # A query of an empty wp.Mesh ends the process.
    view = scenes.camera((0, 0, 4))
    scene = wr.Scene()
    assert (outputs(scene, view, ("primId",))["primId"] == -1).all()
    scene.add_mesh("/none", np.zeros((0, 3)), [])
    scene.add_mesh("/point", np.zeros((1, 3)), [])
    scene.add_mesh("/bad", np.full((3, 3), np.nan), [[0, 1, 2]])
    assert (outputs(scene, view, ("primId",))["primId"] == -1).all()
    scene.add_mesh("/quad", *scenes.quad())
    assert set(np.unique(outputs(scene, view, ("primId",))["primId"])) == {-1, 3}


def test_an_index_out_of_range_is_an_error_and_not_a_crash():
    scene = wr.Scene()
    for index in (-1, 3, 10**6, 2**31 - 1):
        with pytest.raises(wr.SceneError, match="/mesh"):
            scene.add_mesh("/mesh", np.eye(3), [[0, 1, index]])


def test_barycentrics_weigh_vertices_1_and_2():
    # Warp's own u and v weigh vertices 0 and 1: a colour at each vertex tells.
    scene = wr.Scene()
    corners = np.array([(-1, -1, 0), (1, -1, 0), (-1, 1, 0)])
    scene.add_mesh("/triangle", corners, [[0, 1, 2]], color=np.eye(3))
    got = outputs(scene, scenes.window(2.0), ("albedo", "primId"), 8)
    x = (np.arange(8) + 0.5) / 8
    u, v = np.meshgrid(x, x[::-1])
    inside = u + v < 0.99
    assert (got["primId"][inside] == 0).all()
    np.testing.assert_allclose(got["albedo"][inside], np.stack([1 - u - v, u, v], -1)[inside], atol=1e-6)


def test_every_kind_of_light_has_functions():
    assert {kind().kind() for kind in LIGHTS} <= set(FUNCTIONS)
    assert {name.split(".")[0] for name in FUNCTIONS} == {kind.__name__ for kind in LIGHTS}


if __name__ == "__main__":
    print(json.dumps(dispatched()))
