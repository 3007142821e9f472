"""Materials evaluated and sampled by themselves, in the shading frame."""

import numpy as np
import warp as wp

import warprender as wr
from warprender.materials import MATERIALS
from warprender.materials.dispatch import material_functions
from warprender.records import BsdfSample, BsdfValue, DeviceScene, Surface
from warprender.upload import Upload

ABSORB, SCATTER, DELTA, PASS = range(4)


def _kernels():
    prepare, evaluate, sample = material_functions(tuple(sorted(kind.__name__ for kind in MATERIALS)))

    @wp.func
    def surface_seen_from(wo: wp.vec3, front: int) -> Surface:
        surface = Surface()
        surface.normal = wp.vec3(0.0, 0.0, 1.0)
        surface.geometric_normal = surface.normal
        surface.outgoing = wo
        surface.material = 1
        surface.front = front
        return surface

    @wp.kernel(module="unique", enable_backward=False)
    def evaluate_all(
        scene: DeviceScene,
        front: int,
        wo: wp.array(dtype=wp.vec3),
        wi: wp.array(dtype=wp.vec3),
        out: wp.array(dtype=BsdfValue),
    ):
        i = wp.tid()
        out[i] = evaluate(scene, prepare(scene, surface_seen_from(wo[i], front)), wo[i], wi[i])

    @wp.kernel(module="unique", enable_backward=False)
    def sample_all(
        scene: DeviceScene,
        front: int,
        wo: wp.array(dtype=wp.vec3),
        u: wp.array(dtype=wp.vec3),
        out: wp.array(dtype=BsdfSample),
    ):
        i = wp.tid()
        bsdf = prepare(scene, surface_seen_from(wo[i], front))
        out[i] = sample(scene, bsdf, wo[i], wp.vec2(u[i][0], u[i][1]), u[i][2])

    return evaluate_all, sample_all


_EVALUATE, _SAMPLE = _kernels()


def _run(kernel, material, front, wo, values, dtype):
    scene = wr.Scene()
    scene.add_sphere("/look", material=material)
    held = Upload(scene, {}, np.zeros(3), "cpu")
    held.record.display_color = held.record.display_opacity = -1
    values = np.asarray(values, np.float32)
    wo = np.broadcast_to(np.asarray(wo, np.float32), values.shape)
    out = wp.empty(len(values), dtype=dtype)
    wp.launch(
        kernel, len(values), [held.record, front, wp.array(wo, dtype=wp.vec3), wp.array(values, dtype=wp.vec3), out]
    )
    return out.numpy()


def evaluated(material, wo, wi, front=1):
    """`BsdfValue` of pairs of directions (N, 3) in the shading frame, wo on its upper side."""
    return _run(_EVALUATE, material, front, wo, wi, BsdfValue)


def sampled(material, wo, n=1 << 15, seed=0, front=1):
    """`BsdfSample` of n samples."""
    return _run(_SAMPLE, material, front, wo, np.random.default_rng(seed).random((n, 3), np.float32), BsdfSample)


def weights(samples):
    """Value of f cos θ / pdf of each sample: (N, 3), 0 where it was absorbed."""
    weight = samples["diffuse"].astype(float) + samples["specular"]
    return np.where((samples["event"] == ABSORB)[:, None], 0.0, weight)


def towards(cosine, phi=0.3):
    """Unit directions with this cosine to the normal."""
    sine = np.sqrt(1 - np.square(cosine))
    return np.stack(np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), cosine), -1)


def hemisphere(n, seed=2):
    """(n, 3) uniform directions."""
    rng = np.random.default_rng(seed)
    return towards(rng.random(n), 2 * np.pi * rng.random(n))
