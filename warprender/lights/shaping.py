"""UsdLux ShapingAPI: focus, cone and photometric profile, all by the direction of emission in light space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..numerics import PI
from ..records import DeviceScene, LightRecord
from ..watched import Watched
from .ies import IesProfile, profile_value


@dataclass
class Shaping(Watched):
    """How emission depends on its direction; the light's axis is local -Z.

    Attributes:
        focus: exponent of |cos| to the axis; spheres and cylinders shine backwards as well as forwards.
        focusTint: colour of what the focus takes away.
        coneAngle: angle from the axis, in degrees, beyond which nothing is emitted; 180 cuts nothing.
        coneSoftness: share of the cone over which it fades, 0 to 1.
        iesProfile: photometric profile, or None; the cone does not cut it.
        iesAngleScale: scales the profile's vertical angles, about the axis when positive, about its opposite when
            negative; 0 leaves them alone.
        iesNormalize: divide the profile by its power, the integral over all directions, as the schema says; hdEmbree
            divides by its mean over the sphere or half sphere, 4π or 2π times less.
    """

    focus: float = 0.0
    focusTint: tuple[float, float, float] = (0.0, 0.0, 0.0)
    coneAngle: float = 180.0
    coneSoftness: float = 0.0
    iesProfile: IesProfile | None = None
    iesAngleScale: float = 0.0
    iesNormalize: bool = False

    def cone(self) -> tuple[float, float]:
        """Angles in radians at which emission begins and ends to fade; both beyond π where nothing is cut."""
        if self.coneAngle >= 180.0 or self.iesProfile is not None:
            return (4.0, 4.0)
        cut = float(np.radians(max(self.coneAngle, 0.0)))
        return ((1.0 - float(np.clip(self.coneSoftness, 0.0, 1.0))) * cut, cut)

    def profile_scale(self) -> float:
        """Factor on the light's radiance: one over the profile's power where that is asked for."""
        if self.iesProfile is None or not self.iesNormalize:
            return 1.0
        power = self.iesProfile.power()
        return 1.0 / power if power > 0 else 0.0

    def effects(self) -> tuple[str, ...]:
        """Which device functions it needs: "shaping", "ies"."""
        shaped = self.focus > 0 or self.cone()[1] < np.pi
        return ("shaping",) * shaped + ("ies",) * (self.iesProfile is not None)


@wp.func
def focus_and_cone(light: LightRecord, emission: wp.vec3) -> wp.vec3:
    """Factor on the radiance for a unit direction of emission in light space."""
    factor = wp.vec3(1.0, 1.0, 1.0)
    if light.focus > 0.0:
        k = wp.pow(wp.min(wp.abs(emission[2]), 1.0), light.focus)
        factor = light.focus_tint * (1.0 - k) + wp.vec3(k, k, k)
    if light.cone[1] < PI:
        theta = angle_from_axis(emission)
        if theta > light.cone[1]:
            return wp.vec3(0.0, 0.0, 0.0)
        if theta > light.cone[0]:
            t = (theta - light.cone[0]) / (light.cone[1] - light.cone[0])
            factor = factor * (1.0 - t * t * (3.0 - 2.0 * t))
    return factor


@wp.func
def photometric(scene: DeviceScene, light: LightRecord, emission: wp.vec3) -> float:
    """The profile's value for a unit direction of emission in light space.

    The horizontal angle is that of the direction towards the light, as in OpenUSD's hdEmbree.
    """
    theta = angle_from_axis(emission)
    # An animation that passes through 0 may miss it by its rounding.
    if light.angle_scale > 1.0e-6:
        theta = wp.min(theta / light.angle_scale, PI)
    elif light.angle_scale < -1.0e-6:
        theta = wp.max((theta - PI) / -light.angle_scale + PI, 0.0)
    phi = wp.atan2(-emission[1], -emission[0])
    return profile_value(scene.profiles[light.profile], theta, wp.where(phi < 0.0, phi + 2.0 * PI, phi))


@wp.func
def angle_from_axis(emission: wp.vec3) -> float:
    """Angle to -Z, with all its digits for narrow cones, where acos has none."""
    return wp.atan2(wp.sqrt(emission[0] * emission[0] + emission[1] * emission[1]), -emission[2])
