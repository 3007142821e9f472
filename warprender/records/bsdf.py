"""What a material is at one surface point, and how light leaves there."""

from __future__ import annotations

import warp as wp


@wp.struct
class Bsdf:
    """A material's inputs resolved at a surface. Each kind reads the fields that its own file fills.

    `present` scales all that the surface does to light but let it through; `cover` is the share of it that the
    diffuse part, already scaled by it, leaves to nothing else. `ambient` is reflected of every light by the transports
    that add up lights one by one, and by no other. `table` indexes `DeviceScene.brdfs`.

    `eta` is the index of refraction beyond the surface over that on the viewer's side, 0 for what does not refract;
    `transmission` is the factor of what crosses, `absorption` that of the medium inside per scene unit, and `thin` is
    1 for a sheet that has both its faces.
    """

    kind: wp.int32
    emission: wp.vec3
    ambient: wp.vec3
    diffuse: wp.vec3
    f0: wp.vec3
    f90: wp.vec3
    multiple: wp.vec3
    alpha: wp.float32
    coat: wp.float32
    coat_f0: wp.float32
    coat_alpha: wp.float32
    present: wp.float32
    cover: wp.float32
    pass_through: wp.float32
    table: wp.int32
    eta: wp.float32
    transmission: wp.vec3
    absorption: wp.vec3
    thin: wp.int32


@wp.struct
class BsdfValue:
    """f · |cos θ| for a pair of directions, split as UsdLux's `diffuse` and `specular` need it, and the pdf."""

    diffuse: wp.vec3
    specular: wp.vec3
    pdf: wp.float32


@wp.struct
class BsdfSample:
    """A sampled direction in the shading frame and f · |cos θ| / pdf; pdf 0 marks a delta lobe.

    `event` is one of the EVENT constants; `stay` is the probability that it is not EVENT_PASS.
    """

    direction: wp.vec3
    diffuse: wp.vec3
    specular: wp.vec3
    pdf: wp.float32
    event: wp.int32
    stay: wp.float32


EVENT_ABSORB = wp.constant(wp.int32(0))
EVENT_SCATTER = wp.constant(wp.int32(1))
EVENT_DELTA = wp.constant(wp.int32(2))
EVENT_PASS = wp.constant(wp.int32(3))
