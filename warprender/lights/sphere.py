"""UsdLuxSphereLight: uniform over the cone of directions that it fills."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..numerics import PI, from_frame, tangent_of
from ..records import DeviceScene, LightRecord, LightSample
from ..sampling import one_minus_cos, uniform_cone
from .light import Light, linear_part, local_sample, no_light, point_to_light


@dataclass
class SphereLight(Light):
    """A sphere about the local origin that emits outwards.

    What all lights have, as `intensity` and `color`, is in `Light`.

    Attributes:
        radius: in light space: scene units unless `transform` scales.
        treatAsPoint: may be sampled as a point of the same power; drawn as the sphere that it is.
    """

    radius: float = 0.5
    treatAsPoint: bool = False

    def size(self) -> tuple[float, float, float]:
        """Radius."""
        return (self.radius, 0.0, 0.0)

    def size_factor(self) -> float:
        """World area of the ellipsoid, by the approximation that the UsdLux guide names (Thomsen)."""
        a, b, c = np.linalg.norm(linear_part(self.transform), axis=1) * self.radius
        p = 1.6
        return 4.0 * np.pi * (((a * b) ** p + (a * c) ** p + (b * c) ** p) / 3.0) ** (1.0 / p)

    def half_extent(self) -> tuple[float, float, float]:
        """The radius on all sides."""
        return (self.radius,) * 3


@wp.func
def cone_of(radius: float, distance: float) -> float:
    """1 - cos of the half angle under which a sphere is seen; 0 from inside, where nothing is emitted."""
    if distance <= radius:
        return 0.0
    sine = radius / distance
    return one_minus_cos(sine * sine)


@wp.func
def distance_to(radius: float, origin: wp.vec3, direction: wp.vec3) -> float:
    """Distance along the unit direction to the near side of the sphere, -1 on a miss.

    The discriminant comes from the perpendicular vector, which does not cancel far away (Haines et al. 2019).
    """
    along = -wp.dot(origin, direction)
    perpendicular = origin + direction * along
    square = radius * radius - wp.dot(perpendicular, perpendicular)
    if square < 0.0 or along <= 0.0:
        return -1.0
    return along - wp.sqrt(square)


@wp.func
def sample(scene: DeviceScene, light: LightRecord, p: wp.vec3, u: wp.vec2) -> LightSample:
    """A direction from p to the light."""
    radius = light.size[0]
    q = point_to_light(light, p)
    d = wp.length(q)
    cone = cone_of(radius, d)
    if cone <= 0.0:
        return no_light()
    axis = -q / d
    local = uniform_cone(u, cone)
    direction = from_frame(tangent_of(axis), axis, local)
    # At the rim rounding may step off the sphere: the tangent's length then stands for the distance.
    t = distance_to(radius, q, direction)
    if t < 0.0:
        t = wp.sqrt((d - radius) * (d + radius))
    return local_sample(light, direction, t, 1.0 / (2.0 * PI * cone))


@wp.func
def meet(scene: DeviceScene, light: LightRecord, origin: wp.vec3, direction: wp.vec3) -> LightSample:
    """What a ray meets of the light."""
    q = point_to_light(light, origin)
    local = wp.normalize(light.inverse * direction)
    cone = cone_of(light.size[0], wp.length(q))
    t = distance_to(light.size[0], q, local)
    if t < 0.0 or cone <= 0.0:
        return no_light()
    return local_sample(light, local, t, 1.0 / (2.0 * PI * cone))
