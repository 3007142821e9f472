"""UsdLuxRectLight: uniform over the solid angle that it fills (Ureña, Fajardo and King 2013), or from far its area."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..numerics import PI
from ..records import DeviceScene, LightRecord, LightSample
from .environment import LightTexture, fault_of_texture, texel_at
from .light import Light, flat_to_world, forwards, local_sample, no_light, point_to_light

#: Below this solid angle the closed form has lost its digits in float32; the rectangle is sampled by area.
_SMALLEST_SOLID_ANGLE = wp.constant(wp.float32(0.02))
#: From this many half diagonals away on it is sampled by area too: in the Cornell box 18 % less time a sample, for 5 %
#: more variance.
_FAR = wp.constant(wp.float32(2.0))


@dataclass
class RectLight(Light):
    """A rectangle in the local XY plane, centred, that emits towards local -Z.

    What all lights have, as `intensity` and `color`, is in `Light`.

    Attributes:
        width: along local X, in light space: scene units unless `transform` scales.
        height: along local Y, likewise.
        texture: multiplies the radiance; its first texel is at (+X, +Y), so that it reads right from the lit side.
    """

    width: float = 1.0
    height: float = 1.0
    texture: LightTexture | None = None

    def fault(self) -> str:
        """As of every light, and of the texture."""
        return super().fault() or fault_of_texture(self.texture)

    def kind(self) -> str:
        """One of its own with a texture."""
        return "RectLight" if self.texture is None else "RectLight.texture"

    def power(self, scene_radius: float) -> float:
        """With the texture's mean."""
        return super().power(scene_radius) * (1.0 if self.texture is None else self.texture.mean())

    def size(self) -> tuple[float, float, float]:
        """Half width, half height."""
        return (self.width / 2, self.height / 2, 0.0)

    def size_factor(self) -> float:
        """World area."""
        x, y, _ = self.local_to_world()
        return float(np.linalg.norm(np.cross(x * self.width, y * self.height)))

    def half_extent(self) -> tuple[float, float, float]:
        """Flat."""
        return self.size()

    def emission_cone(self) -> tuple[np.ndarray, float, float]:
        """To one side."""
        return forwards(self)

    def local_to_world(self) -> np.ndarray:
        """(3, 3) for row vectors."""
        return flat_to_world(self.transform)


@wp.struct
class SphericalRect:
    """A rectangle seen from a point: its corners relative to the point, and the constants of Ureña et al. 2013.

    `sin0` and `sin1` are of the angles under which y0 and y1 are seen in the plane x = 0, `cos0` of the first; `turn`
    is cosine and sine of the angle that the edge at x0 takes from the solid angle.
    """

    x0: wp.float32
    x1: wp.float32
    y0: wp.float32
    y1: wp.float32
    z0: wp.float32
    sin0: wp.float32
    sin1: wp.float32
    cos0: wp.float32
    turn: wp.vec2
    solid_angle: wp.float32


@wp.func
def corner_angle(x: wp.vec2, y: wp.vec2) -> wp.vec2:
    """Signed solid angle of the rectangle from the foot of the perpendicular to a corner, as its cosine and sine.

    `x` and `y` are cosine and sine of the angles under which its sides are seen. Nothing cancels.
    """
    return wp.vec2(wp.sqrt(y[0] * y[0] + x[0] * x[0] * y[1] * y[1]), x[1] * y[1])


@wp.func
def seen_angle(x: float, height: float) -> wp.vec2:
    """Cosine and sine of the angle under which a length x is seen from this height above its foot."""
    return wp.vec2(height, x) / wp.max(wp.sqrt(x * x + height * height), 1.0e-30)


@wp.func
def less(a: wp.vec2, b: wp.vec2) -> wp.vec2:
    """Angle a - b; angles as cosine and sine."""
    return wp.vec2(a[0] * b[0] + a[1] * b[1], a[1] * b[0] - a[0] * b[1])


@wp.func
def spherical_rect(light: LightRecord, q: wp.vec3) -> SphericalRect:
    """The light seen from q in light space, q.z < 0."""
    r = SphericalRect()
    r.x0 = -light.size[0] - q[0]
    r.x1 = light.size[0] - q[0]
    r.y0 = -light.size[1] - q[1]
    r.y1 = light.size[1] - q[1]
    r.z0 = q[2]
    # Angles of corners are added as complex numbers: one arc tangent for four. The arc cosine of normals' products
    # would lose half its digits near the rectangle's plane.
    height = wp.abs(r.z0)
    x0 = seen_angle(r.x0, height)
    x1 = seen_angle(r.x1, height)
    y0 = seen_angle(r.y0, height)
    y1 = seen_angle(r.y1, height)
    right = less(corner_angle(x1, y1), corner_angle(x1, y0))
    left = less(corner_angle(x0, y0), corner_angle(x0, y1))
    angle = wp.atan2(right[1] * left[0] + right[0] * left[1], right[0] * left[0] - right[1] * left[1])
    if right[1] >= 0.0 and left[1] >= 0.0:
        # Above the rectangle it may fill up to the half sphere: both parts obtuse are more than π together.
        if angle < 0.0 or (right[0] < 0.0 and left[0] < 0.0 and angle < 0.5 * PI):
            angle += 2.0 * PI
    r.sin0 = y0[1]
    r.sin1 = y1[1]
    r.cos0 = y0[0]
    r.turn = left
    r.solid_angle = wp.max(angle, 0.0)
    return r


@wp.func
def point_in_solid_angle(r: SphericalRect, u: wp.vec2) -> wp.vec3:
    """Vector from the point to a place on the rectangle, uniform in solid angle; z along +local Z."""
    part = u[0] * r.solid_angle
    # Half a turn less than Ureña's angle, so both its sine and cosine change their signs.
    au = less(wp.vec2(wp.cos(part), wp.sin(part)), r.turn)
    fu = -(au[0] * r.sin0 - r.sin1) / wp.where(au[1] == 0.0, 1.0e-20, au[1])
    # The sine of the plane's angle from cos0, where Ureña et al. subtract from 1.
    across = wp.sqrt(wp.max((wp.abs(fu) - r.cos0) * (wp.abs(fu) + r.cos0), 1.0e-14))
    xu = wp.clamp(-wp.sign(fu) * r.z0 / across, r.x0, r.x1)
    d2 = xu * xu + r.z0 * r.z0
    h0 = r.y0 / wp.sqrt(d2 + r.y0 * r.y0)
    h1 = r.y1 / wp.sqrt(d2 + r.y1 * r.y1)
    hv = h0 + u[1] * (h1 - h0)
    yv = wp.clamp(hv * wp.sqrt(d2 / wp.max(1.0 - hv * hv, 1.0e-12)), r.y0, r.y1)
    return wp.vec3(xu, yv, -r.z0)


@wp.func
def is_far(light: LightRecord, q: wp.vec3) -> bool:
    """Whether the light is sampled by area from a point in light space."""
    half = light.size[0] * light.size[0] + light.size[1] * light.size[1]
    return wp.dot(q, q) > _FAR * _FAR * half


@wp.func
def by_area(light: LightRecord, way: wp.vec3, height: float) -> LightSample:
    """Sample of the place at a world vector from a point, which is at this height over the light's plane in its space.

    1 / area per area of light space is distance² / (area cosine) per solid angle; both scale into the world.
    """
    result = no_light()
    distance = wp.length(way)
    if distance > 0.0:
        area = 4.0 * light.size[0] * light.size[1]
        result.direction = way / distance
        result.distance = distance
        result.radiance = light.radiance
        result.pdf = (distance / area) * (distance / height) * (distance / light.determinant)
    return result


@wp.func
def sample(scene: DeviceScene, light: LightRecord, p: wp.vec3, u: wp.vec2) -> LightSample:
    """A direction from p to the light."""
    q = point_to_light(light, p)
    if q[2] >= 0.0:
        return no_light()
    if not is_far(light, q):
        r = spherical_rect(light, q)
        if r.solid_angle >= _SMALLEST_SOLID_ANGLE:
            place = point_in_solid_angle(r, u)
            distance = wp.length(place)
            return local_sample(light, place / distance, distance, 1.0 / r.solid_angle)
    place = wp.vec3((2.0 * u[0] - 1.0) * light.size[0] - q[0], (2.0 * u[1] - 1.0) * light.size[1] - q[1], -q[2])
    return by_area(light, light.linear * place, -q[2])


@wp.func
def meet(scene: DeviceScene, light: LightRecord, origin: wp.vec3, direction: wp.vec3) -> LightSample:
    """What a ray meets of the light."""
    q = point_to_light(light, origin)
    way = light.inverse * direction
    if q[2] >= 0.0 or way[2] <= 0.0:
        return no_light()
    t = -q[2] / way[2]
    if wp.abs(q[0] + t * way[0]) > light.size[0] or wp.abs(q[1] + t * way[1]) > light.size[1]:
        return no_light()
    if not is_far(light, q):
        solid_angle = spherical_rect(light, q).solid_angle
        if solid_angle >= _SMALLEST_SOLID_ANGLE:
            length = wp.length(way)
            return local_sample(light, way / length, t * length, 1.0 / solid_angle)
    return by_area(light, direction * t, -q[2])


@wp.func
def textured(scene: DeviceScene, light: LightRecord, p: wp.vec3, plain: LightSample) -> LightSample:
    """The sample with the texel of the place that it meets."""
    result = plain
    if plain.pdf > 0.0:
        place = point_to_light(light, p + plain.direction * plain.distance)
        u = 0.5 - 0.5 * place[0] / light.size[0]
        v = 0.5 - 0.5 * place[1] / light.size[1]
        result.radiance = wp.cw_mul(plain.radiance, texel_at(scene.images[light.image], u, v, False))
    return result


@wp.func
def sample_textured(scene: DeviceScene, light: LightRecord, p: wp.vec3, u: wp.vec2) -> LightSample:
    """`sample` with the light's texture."""
    return textured(scene, light, p, sample(scene, light, p, u))


@wp.func
def meet_textured(scene: DeviceScene, light: LightRecord, origin: wp.vec3, direction: wp.vec3) -> LightSample:
    """`meet` with the light's texture."""
    return textured(scene, light, origin, meet(scene, light, origin, direction))
