"""UsdLuxPortalLight: an opening through which next-event estimation aims at a dome.

A portal gives no light and takes none: UsdLux says that it guides the sampling of a dome. Directions are drawn through
the portals, and in proportion to the picture of a dome that has one; the density is that of both together. So whatever
the portals leave out is still found, and the picture is the same without them but for its noise.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import warp as wp

from ..given import fault_of_fields, fault_of_matrix
from ..records import DeviceScene, LightRecord, LightSample
from . import dome, rect
from .light import no_light, point_to_light

#: Share of the samples of a dome with a picture that are drawn through its portals.
_THROUGH = wp.constant(wp.float32(0.5))

_sample_rect = rect.sample
_meet_rect = rect.meet
_meet_plain = dome.meet
_meet_textured = dome.meet_textured
_sample_textured = dome.sample_textured


@dataclass
class PortalLight:
    """A rectangle in the local XY plane, centred, that lets a dome's light through towards local -Z.

    Attributes:
        width: along local X, in its own space.
        height: along local Y, likewise.
        transform: (4, 4) float64 matrix to the world for row vectors.
    """

    width: float = 1.0
    height: float = 1.0
    transform: np.ndarray = field(default_factory=lambda: np.eye(4))

    def fault(self) -> str:
        """What is wrong with its fields, in a few words; "" for a good portal."""
        return fault_of_fields(self) or fault_of_matrix("transform", self.transform)

    def opening(self) -> rect.RectLight:
        """The same rectangle as a light, by whose functions it is aimed at."""
        return rect.RectLight(width=self.width, height=self.height, transform=self.transform)


@wp.func
def weight_of(portal: LightRecord, p: wp.vec3) -> float:
    """What a portal is chosen by: roughly the solid angle that it fills; 0 where p is not on its lit side."""
    q = point_to_light(portal, p)
    if portal.determinant <= 0.0 or q[2] >= 0.0:
        return 0.0
    return wp.max(rect.spherical_rect(portal, q).solid_angle, 1.0e-5)


@wp.func
def weight_of_all(scene: DeviceScene, light: LightRecord, p: wp.vec3) -> float:
    """The sum over the dome's portals."""
    total = wp.float32(0.0)
    for i in range(light.count):
        total += weight_of(scene.portals[light.first + i], p)
    return total


@wp.func
def with_density(scene: DeviceScene, light: LightRecord, p: wp.vec3, total: float, found: LightSample) -> LightSample:
    """The dome's own sample with the density of both ways to draw its direction."""
    result = found
    if total <= 0.0:
        return result
    through = wp.float32(0.0)
    for i in range(light.count):
        portal = scene.portals[light.first + i]
        weight = weight_of(portal, p)
        if weight > 0.0:
            through += weight / total * _meet_rect(scene, portal, p, found.direction).pdf
    result.pdf = through
    if light.image >= 0:
        result.pdf = _THROUGH * through + (1.0 - _THROUGH) * found.pdf
    return result


@wp.func
def dome_along(scene: DeviceScene, light: LightRecord, p: wp.vec3, direction: wp.vec3) -> LightSample:
    """The dome in a direction, with its own density."""
    if light.image >= 0:
        return _meet_textured(scene, light, p, direction)
    return _meet_plain(scene, light, p, direction)


@wp.func
def sample(scene: DeviceScene, light: LightRecord, p: wp.vec3, u: wp.vec2) -> LightSample:
    """A direction through a portal, or as the dome alone would draw it."""
    total = weight_of_all(scene, light, p)
    place = u[0]
    if light.image >= 0:
        share = wp.where(total > 0.0, _THROUGH, 0.0)
        if place >= share:
            own = _sample_textured(scene, light, p, wp.vec2((place - share) / (1.0 - share), u[1]))
            return with_density(scene, light, p, total, own)
        place = place / share
    if total <= 0.0:
        return no_light()
    aim = place * total
    chosen = wp.int32(-1)
    low = wp.float32(0.0)
    width = wp.float32(0.0)
    for i in range(light.count):
        weight = weight_of(scene.portals[light.first + i], p)
        if weight > 0.0 and (chosen < 0 or aim >= low + width):
            low += width
            width = weight
            chosen = i
    rest = wp.clamp((aim - low) / width, 0.0, 1.0)
    towards = _sample_rect(scene, scene.portals[light.first + chosen], p, wp.vec2(rest, u[1]))
    if towards.pdf <= 0.0:
        return no_light()
    return with_density(scene, light, p, total, dome_along(scene, light, p, towards.direction))


@wp.func
def meet(scene: DeviceScene, light: LightRecord, origin: wp.vec3, direction: wp.vec3) -> LightSample:
    """The dome's radiance in the ray's direction."""
    total = weight_of_all(scene, light, origin)
    return with_density(scene, light, origin, total, dome_along(scene, light, origin, direction))
