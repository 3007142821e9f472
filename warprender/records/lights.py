"""Lights, the tree that chooses among them, and their pictures and profiles."""

from __future__ import annotations

import warp as wp

from .hits import Hit


@wp.struct
class LightSample:
    """A direction towards a light, the distance to it (inf for lights at infinity), its radiance and the pdf.

    pdf is per solid angle; 0 means no light there. `delta` is 1 for lights that no ray can meet. `hit` is the place on
    geometry that glows, whose material says what it emits; for all other lights its instance is -1.
    """

    direction: wp.vec3
    distance: wp.float32
    radiance: wp.vec3
    pdf: wp.float32
    delta: wp.int32
    hit: Hit


@wp.struct
class LightRecord:
    """One light. `linear` has the world vectors of the local axes as columns; `size` is the kind's own.

    `determinant` is |det linear|. `choice` is the probability that next-event estimation picks this light, or for
    lights in the tree the probability of the tree. There `leaf` is its leaf, -1 for lights at infinity; a mesh has
    many leaves, those of its faces in `glow_leaves` from number `first_face` on.
    `image` indexes `images`, `profile` indexes `profiles`, `links` and `shadow_links` are rows of `link_sets`: the
    prims that the light shines on and those that keep it off; -1 for none, none, all and all.
    `cone` has the angles from -Z at which the light begins and ends to fade, in radians. `shadow` indexes the SHADOW
    constants. `instance` is the geometry that glows. `count` entries from number `first` on are the light's own: of
    `portals` a dome's, of `glow_triangles` those of the leaf of a mesh that is aimed at.
    """

    kind: wp.int32
    radiance: wp.vec3
    position: wp.vec3
    linear: wp.mat33
    inverse: wp.mat33
    determinant: wp.float32
    size: wp.vec3
    diffuse: wp.float32
    specular: wp.float32
    is_dome: wp.int32
    choice: wp.float32
    leaf: wp.int32
    image: wp.int32
    focus: wp.float32
    focus_tint: wp.vec3
    cone: wp.vec2
    profile: wp.int32
    angle_scale: wp.float32
    links: wp.int32
    shadow_links: wp.int32
    shadow: wp.int32
    shadow_color: wp.vec3
    shadow_distance: wp.float32
    shadow_falloff: wp.float32
    shadow_gamma: wp.float32
    instance: wp.int32
    first_face: wp.int32
    first: wp.int32
    count: wp.int32


#: Shadows as light makes them; as ShadowAPI and shadow linking change them; and none at all.
SHADOW_PLAIN = wp.constant(wp.int32(0))
SHADOW_CHANGED = wp.constant(wp.int32(1))
SHADOW_NONE = wp.constant(wp.int32(2))


@wp.struct
class LightNode:
    """A node of the light tree: box, cone of emission, power. `child` is the first of `children` neighbours, in a
    leaf, which has none, -1 - leaf. Light leaves within `cos_spread`'s angle of `axis`, or of its opposite too where
    `two_sided`, and fades over `cos_fade`'s angle beyond. `round_share` of the power shines alike to all sides of that
    cone, the rest by the cosine to normals whose mean along the axis is `mean_cos`.
    """

    lower: wp.vec3
    upper: wp.vec3
    axis: wp.vec3
    cos_spread: wp.float32
    cos_fade: wp.float32
    power: wp.float32
    child: wp.int32
    children: wp.int32
    two_sided: wp.int32
    round_share: wp.float32
    mean_cos: wp.float32


@wp.struct
class LightLeaf:
    """A leaf of the light tree: a light, or `count` triangles of one from `first` of `glow_triangles` on, of this
    world area. `trail` has two bits for each level: which child leads to it.
    """

    light: wp.int32
    first: wp.int32
    count: wp.int32
    area: wp.float32
    trail: wp.uint64


@wp.struct
class ImageRecord:
    """A light's picture, and the tables by which directions are drawn from it where it is a dome's.

    `rows` (R + 1) and `columns` (R, C + 1) are cumulative distributions, `density` (R, C) is per solid angle.
    """

    texels: wp.array2d(dtype=wp.vec3)
    rows: wp.array(dtype=wp.float32)
    columns: wp.array2d(dtype=wp.float32)
    density: wp.array2d(dtype=wp.float32)


@wp.struct
class ProfileRecord:
    """A photometric profile: `values` (H, V) over angles in radians, `horizontal` from 0 to 2π, `vertical` from -Z."""

    horizontal: wp.array(dtype=wp.float32)
    vertical: wp.array(dtype=wp.float32)
    values: wp.array2d(dtype=wp.float32)
