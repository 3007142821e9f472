"""The structs that cross kernels. Lengths are scene units, positions are relative to the scene's origin.

Arrays inside arrays of structs are not kept alive by Warp: the Python owner of a `DeviceScene` holds every one.
"""

from __future__ import annotations

import warp as wp

from .numerics import mat34

#: Kinds of `Geometry`.
MESH, SPHERE = 0, 1

#: `Instance.placed` of what is hidden or has no usable transform; its `to_object` is zero, which no ray enters.
NOT_DRAWN = 2
#: `Instance.placed` where `to_object` moves points and no more.
MOVED = 3

#: Number of inputs that a material row has room for.
MATERIAL_INPUTS = 16

MaterialValues = wp.types.matrix(shape=(MATERIAL_INPUTS, 3), dtype=wp.float32)


@wp.struct
class Ray:
    """Points origin + t direction with 0 ≤ t < t_max; t counts in lengths of the direction."""

    origin: wp.vec3
    direction: wp.vec3
    t_max: wp.float32


@wp.struct
class Hit:
    """What a ray or a pixel sees first; a miss has t = inf and ids -1. u weights vertex 1, v vertex 2."""

    t: wp.float32
    instance: wp.int32
    face: wp.int32
    u: wp.float32
    v: wp.float32


@wp.struct
class Surface:
    """A hit point with all that shading needs; both normals are on the side of `outgoing`.

    `error` bounds |position - exact| per axis; `front` says whether the authored normal faces the viewer.
    `footprint` is the width across the ray of what one look-up at the point stands for; 0 is the point alone.
    """

    position: wp.vec3
    error: wp.vec3
    geometric_normal: wp.vec3
    normal: wp.vec3
    outgoing: wp.vec3
    front: wp.int32
    hit: Hit
    geometry: wp.int32
    material: wp.int32
    footprint: wp.float32


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
class Geometry:
    """A shape in its own space: the triangles of a tree, or a sphere about the origin."""

    kind: wp.int32  # MESH or SPHERE
    radius: wp.float32
    mesh: wp.uint64  # wp.Mesh, walked on CUDA; 0: no faces
    nodes: wp.uint64  # wide nodes and blocks of triangles, walked on the CPU; 0: no faces
    blocks: wp.uint64


@wp.struct
class Instance:
    """One geometry, placed in the world; matrices for column vectors. The tree's scale is in `to_object`."""

    to_object: mat34
    to_world: mat34
    geometry: wp.int32
    placed: wp.int32  # 0 where to_object is the identity, MOVED, NOT_DRAWN, or 1 for anything else


@wp.struct
class World:
    """All instances and the tree over their boxes: what ``scene_closest`` and ``scene_occluded`` walk.

    Where `listed` is 1, only `members` from number `first_member` up to `last_member` are there, and no tree is walked.
    """

    geometries: wp.array(dtype=Geometry)
    instances: wp.array(dtype=Instance)
    count: wp.int32
    tree: wp.uint64  # wp.Bvh over the instances' boxes, walked on CUDA
    nodes: wp.uint64  # the same made wide, and its leaves' items, walked on the CPU
    items: wp.uint64
    few: wp.uint64  # all triangles, where they are few and only moved (CPU), or 0
    pad: wp.float32  # growth of those boxes per unit of the ray origin's largest component
    lowers: wp.array(dtype=wp.vec3)
    uppers: wp.array(dtype=wp.vec3)
    members: wp.array(dtype=wp.int32)
    listed: wp.int32
    first_member: wp.int32
    last_member: wp.int32


@wp.struct
class MaterialRecord:
    """One material: its kind, and values by the input numbers that the kind's file names.

    What varies over the surface are the `varying` entries of `DeviceScene.inputs` from number `first` on; the entry
    of a tangent-space normal is number `normal`, `table` indexes `DeviceScene.brdfs`; -1 where there is none.
    """

    kind: wp.int32
    values: MaterialValues
    first: wp.int32
    varying: wp.int32
    normal: wp.int32
    table: wp.int32


@wp.struct
class InputRecord:
    """Where input `number` comes from: a picture, a set of tiles, or with neither (-1) a primvar as it is.

    `footprint` multiplies the surface's. `primvar` is the slot of the texture coordinates, or of the value itself,
    -1 for `absent`, which also stands in where a shape has no such primvar. A picture is seen at
    linear · coordinates + offset; `channel` is 0 … 3, or 4 for all. `tangents` is the slot of the tangents along
    those coordinates, -1 where nothing asks for them.
    """

    number: wp.int32
    footprint: wp.float32
    picture: wp.int32
    tiles: wp.int32
    primvar: wp.int32
    tangents: wp.int32
    absent: wp.vec4
    linear: wp.mat22
    offset: wp.vec2
    wrap_s: wp.int32
    wrap_t: wp.int32
    channel: wp.int32
    scale: wp.vec4
    bias: wp.vec4
    fallback: wp.vec4


@wp.struct
class PictureRecord:
    """A picture: its `levels`, finest first, from number `level` on; `format` is one of texels.FORMATS."""

    format: wp.int32
    level: wp.int32
    levels: wp.int32


@wp.struct
class LevelRecord:
    """One level of a picture: rows from the bottom, from word number `first` of `DeviceScene.texels` on."""

    first: wp.int32
    width: wp.int32
    height: wp.int32


@wp.struct
class BrdfRecord:
    """A measured BRDF: `values` in 1/sr over √θ_half, θ_diff and φ_diff, and tables that half-vectors are drawn from.

    `rows` (A, R + 1) and `columns` (A, R, C + 1) are cumulative distributions over √θ_half and over the angle between
    the azimuths of half-vector and viewer, for each of A angles of the viewer; rows of 0 have nothing to draw.
    """

    values: wp.array3d(dtype=wp.vec3)
    rows: wp.array2d(dtype=wp.float32)
    columns: wp.array3d(dtype=wp.float32)


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


@wp.struct
class PrimvarRecord:
    """A primvar: `width` floats a value; `interpolation` indexes INTERPOLATIONS, -1 where the shape has none.

    `indices` has three entries a triangle for faceVarying values.
    """

    interpolation: wp.int32
    width: wp.int32
    values: wp.array(dtype=wp.float32)
    indices: wp.array(dtype=wp.int32)


@wp.struct
class SdfRecord:
    """A signed distance function in object space: number `function` of the plan's, asked between two corners.

    `values` (X, Y, Z) are samples on a grid over the box, empty for functions that have none.
    """

    function: wp.int32
    lower: wp.vec3
    upper: wp.vec3
    lipschitz: wp.float32
    precision: wp.float32
    parameters: wp.vec4
    values: wp.array3d(dtype=wp.float32)


@wp.struct
class GeometryRecord:
    """A shape in object space, stored once. `kind` indexes SHAPES; its tree is in `DeviceScene.world`.

    `sdf` is its number in `DeviceScene.sdfs`, if it is one.
    """

    kind: wp.int32
    points: wp.array(dtype=wp.vec3)
    indices: wp.array(dtype=wp.int32)
    faces: wp.array(dtype=wp.int32)
    face_material: wp.array(dtype=wp.int32)
    normals: PrimvarRecord
    radius: wp.float32
    sdf: wp.int32


@wp.struct
class InstanceRecord:
    """What a placed shape is; where it is stands in `World.instances`. `material` -1 asks the geometry's
    `face_material`. `semantic` is the number of its label, or -1. `light` is the light that it is, where
    it glows and next-event estimation aims at it; else -1.
    """

    geometry: wp.int32
    material: wp.int32
    prim: wp.int32
    instance_id: wp.int32
    semantic: wp.int32
    light: wp.int32


#: `DeviceScene.light_sampling`: lights are chosen by power alone; or are not aimed at where a path may meet them.
BY_POWER, BY_CHANCE = wp.constant(wp.int32(1)), wp.constant(wp.int32(2))


@wp.struct
class DeviceScene:
    """Everything that a kernel reads of a scene. `primvars` has `primvar_count` entries a geometry.

    `local_reflection` is 1 where lights are added up one by one and rough lobes reflect nothing else.
    `light_sampling` is how paths aim at lights: 0, or `BY_POWER` or `BY_CHANCE`.

    `eye` is the camera's place, where the camera light is.

    `sdf_instances` are the numbers of the instances that are signed distance functions.

    `albedo` is `materials.albedo.albedo_table`. `tiles` has 100 picture numbers a UDIM set, -1 where there is none;
    `decode` is the sRGB curve for the 256 codes.

    `lights` has first `finite_lights` that rays may meet, whose boxes are
    in `light_boxes`, then `infinite_lights`, last the geometry that glows. `light_cdf` is over the infinite lights
    and, as its last entry, the tree of all others. `link_sets` has a bit for each prim. `glow_triangles` are faces
    in the order of leaves and `glow_cdf` is over the areas of each leaf's; `glow_leaves` has the leaf of each face, -1
    where it is not aimed at. `portals` are rectangles through which domes are aimed at.
    """

    instances: wp.array(dtype=InstanceRecord)
    geometries: wp.array(dtype=GeometryRecord)
    world: World
    sdfs: wp.array(dtype=SdfRecord)
    sdf_instances: wp.array(dtype=wp.int32)
    materials: wp.array(dtype=MaterialRecord)
    albedo: wp.array2d(dtype=wp.vec4)
    eye: wp.vec3
    energy_compensation: wp.int32
    local_reflection: wp.int32
    light_sampling: wp.int32
    inputs: wp.array(dtype=InputRecord)
    pictures: wp.array(dtype=PictureRecord)
    levels: wp.array(dtype=LevelRecord)
    texels: wp.array(dtype=wp.uint32)
    tiles: wp.array(dtype=wp.int32)
    decode: wp.array(dtype=wp.float32)
    brdfs: wp.array(dtype=BrdfRecord)
    primvars: wp.array(dtype=PrimvarRecord)
    primvar_count: wp.int32
    display_color: wp.int32
    display_opacity: wp.int32
    lights: wp.array(dtype=LightRecord)
    finite_lights: wp.int32
    infinite_lights: wp.int32
    light_boxes: wp.uint64
    light_cdf: wp.array(dtype=wp.float32)
    light_nodes: wp.array(dtype=LightNode)
    light_leaves: wp.array(dtype=LightLeaf)
    portals: wp.array(dtype=LightRecord)
    images: wp.array(dtype=ImageRecord)
    profiles: wp.array(dtype=ProfileRecord)
    link_sets: wp.array2d(dtype=wp.uint32)
    glow_triangles: wp.array(dtype=wp.int32)
    glow_cdf: wp.array(dtype=wp.float64)
    glow_leaves: wp.array(dtype=wp.int32)


@wp.struct
class CameraRecord:
    """A camera: `rotation` has right, up and backward as columns; the window is at distance 1 (or in scene units).

    `window` is left, bottom, right, top. `near` and `far` are along -Z. `lens_radius` 0 is a pinhole. `planes`
    (a, b, c, d) are in camera space; where a x + b y + c z + d < 0 nothing is seen.
    """

    position: wp.vec3
    rotation: wp.mat33
    window: wp.vec4
    width: wp.int32
    height: wp.int32
    near: wp.float32
    far: wp.float32
    lens_radius: wp.float32
    focus_distance: wp.float32
    orthographic: wp.int32
    origin: wp.vec3
    planes: wp.array(dtype=wp.vec4)
