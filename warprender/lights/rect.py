"""UsdLuxRectLight: uniform over the solid angle that it fills (Ureña, Fajardo and King 2013)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..numerics import PI
from ..records import DeviceScene, LightRecord, LightSample
from .environment import LightTexture, texel_at
from .light import Light, flat_to_world, forwards, local_sample, no_light, point_to_light

#: Below this solid angle the closed form has lost its digits in float32; the rectangle is sampled by area.
_SMALLEST_SOLID_ANGLE = wp.constant(wp.float32(0.02))


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
    """A rectangle seen from a point: its corners relative to the point, and the constants of Ureña et al. 2013."""

    x0: wp.float32
    x1: wp.float32
    y0: wp.float32
    y1: wp.float32
    z0: wp.float32
    b0: wp.float32
    b1: wp.float32
    k: wp.float32
    solid_angle: wp.float32


@wp.func
def corner_angle(x: float, y: float, z: float) -> float:
    """Signed solid angle of the rectangle from the foot of the perpendicular to the corner (x, y)."""
    return wp.atan2(x * y, wp.abs(z) * wp.sqrt(x * x + y * y + z * z))


@wp.func
def spherical_rect(light: LightRecord, q: wp.vec3) -> SphericalRect:
    """The light seen from q in light space, q.z < 0."""
    r = SphericalRect()
    r.x0 = -light.size[0] - q[0]
    r.x1 = light.size[0] - q[0]
    r.y0 = -light.size[1] - q[1]
    r.y1 = light.size[1] - q[1]
    r.z0 = q[2]
    # Angles at the corners less π/2. The arc cosine of n n' would lose half its digits near the rectangle's plane.
    a0 = corner_angle(r.x1, r.y0, r.z0)
    a1 = corner_angle(r.x1, r.y1, r.z0)
    a2 = corner_angle(r.x0, r.y1, r.z0)
    a3 = corner_angle(r.x0, r.y0, r.z0)
    r.b0 = -r.y0 / wp.sqrt(r.z0 * r.z0 + r.y0 * r.y0)
    r.b1 = r.y1 / wp.sqrt(r.z0 * r.z0 + r.y1 * r.y1)
    r.k = PI + a2 - a3
    r.solid_angle = a1 - a0 - a2 + a3
    return r


@wp.func
def point_in_solid_angle(r: SphericalRect, u: wp.vec2) -> wp.vec3:
    """Vector from the point to a place on the rectangle, uniform in solid angle; z along +local Z."""
    au = u[0] * r.solid_angle + r.k
    sin_au = wp.sin(au)
    fu = (wp.cos(au) * r.b0 - r.b1) / wp.where(sin_au == 0.0, 1.0e-20, sin_au)
    cu = wp.clamp(wp.sign(fu) / wp.sqrt(fu * fu + r.b0 * r.b0), -1.0, 1.0)
    xu = wp.clamp(-(cu * r.z0) / wp.max(wp.sqrt(1.0 - cu * cu), 1.0e-7), r.x0, r.x1)
    d2 = xu * xu + r.z0 * r.z0
    h0 = r.y0 / wp.sqrt(d2 + r.y0 * r.y0)
    h1 = r.y1 / wp.sqrt(d2 + r.y1 * r.y1)
    hv = h0 + u[1] * (h1 - h0)
    yv = wp.clamp(hv * wp.sqrt(d2) / wp.sqrt(wp.max(1.0 - hv * hv, 1.0e-12)), r.y0, r.y1)
    return wp.vec3(xu, yv, -r.z0)


@wp.func
def density(light: LightRecord, r: SphericalRect, direction: wp.vec3, distance: float) -> float:
    """Pdf per solid angle of light space, the same rule for sampling and for meeting."""
    if r.solid_angle >= _SMALLEST_SOLID_ANGLE:
        return 1.0 / r.solid_angle
    area = 4.0 * light.size[0] * light.size[1]
    return distance * distance / (area * wp.max(direction[2], 1.0e-20))


@wp.func
def sample(scene: DeviceScene, light: LightRecord, p: wp.vec3, u: wp.vec2) -> LightSample:
    """A direction from p to the light."""
    q = point_to_light(light, p)
    if q[2] >= 0.0:
        return no_light()
    r = spherical_rect(light, q)
    place = wp.vec3(r.x0 + u[0] * (r.x1 - r.x0), r.y0 + u[1] * (r.y1 - r.y0), -r.z0)
    if r.solid_angle >= _SMALLEST_SOLID_ANGLE:
        place = point_in_solid_angle(r, u)
    distance = wp.length(place)
    direction = place / distance
    return local_sample(light, direction, distance, density(light, r, direction, distance))


@wp.func
def meet(scene: DeviceScene, light: LightRecord, origin: wp.vec3, direction: wp.vec3) -> LightSample:
    """What a ray meets of the light."""
    q = point_to_light(light, origin)
    local = wp.normalize(light.inverse * direction)
    if q[2] >= 0.0 or local[2] <= 0.0:
        return no_light()
    t = -q[2] / local[2]
    if wp.abs(q[0] + t * local[0]) > light.size[0] or wp.abs(q[1] + t * local[1]) > light.size[1]:
        return no_light()
    return local_sample(light, local, t, density(light, spherical_rect(light, q), local, t))


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
