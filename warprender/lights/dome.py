"""UsdLuxDomeLight and DomeLight_1, of one colour or with a picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import warp as wp

from ..given import shown
from ..numerics import INFINITY
from ..records import DeviceScene, LightRecord, LightSample
from .environment import LightTexture, density_of, draw_direction, fault_of_texture, radiance_from
from .light import Light, infinite_sample, linear_part, local_sample, no_light

if TYPE_CHECKING:
    from .portal import PortalLight


@dataclass
class DomeLight(Light):
    """Light from every direction. `normalize` does not change it.

    Rays that leave a surface find a dome of one colour, and next-event estimation does not sample it: where radiance
    does not depend on the direction, no choice of directions is better than the material's own, but for portals.

    What all lights have, as `intensity` and `color`, is in `Light`.

    Attributes:
        texture: multiplies the radiance, by latitude and longitude (`environment.to_latlong` for other formats).
        poleAxis: "Y" or "Z", where the picture's top is in light space.
        portals: openings through which next-event estimation aims at the dome; they change its noise alone.
    """

    texture: LightTexture | None = None
    poleAxis: str = "Y"
    portals: tuple[PortalLight, ...] = ()

    infinite = True

    def fault(self) -> str:
        """As of every light, of the texture, the pole and the portals."""
        if fault := super().fault() or fault_of_texture(self.texture):
            return fault
        if self.poleAxis not in ("Y", "Z"):
            return f"poleAxis is {self.poleAxis!r}, not 'Y' or 'Z'"
        if not isinstance(self.portals, (tuple, list)) or not all(
            hasattr(portal, "opening") for portal in self.portals
        ):
            return f"portals is {shown(self.portals)}, not a tuple of PortalLight"
        return next((f"one of its portals: {fault}" for portal in self.portals if (fault := portal.fault())), "")

    def kind(self) -> str:
        """One of its own with a texture, one with portals."""
        if self.portals:
            return "DomeLight.portals"
        return "DomeLight" if self.texture is None else "DomeLight.texture"

    def power(self, scene_radius: float) -> float:
        """Power through a disk as large as the scene, or through the portals; 0 with neither: never chosen."""
        radiance = self.brightness()
        if self.texture is not None:
            radiance *= self.texture.mean_over_sphere()
        if self.portals:
            return radiance * np.pi * sum(portal.opening().size_factor() for portal in self.portals)
        return radiance * 4 * (np.pi * scene_radius) ** 2 if self.texture is not None else 0.0

    def local_to_world(self) -> np.ndarray:
        """(3, 3) from the picture's space, whose pole is +Y."""
        linear = linear_part(self.transform)
        if self.poleAxis == "Z":
            # A quarter turn about X takes the pole from Y to Z.
            return np.stack([linear[0], linear[2], -linear[1]])
        return linear


@wp.func
def sample(scene: DeviceScene, light: LightRecord, p: wp.vec3, u: wp.vec2) -> LightSample:
    """Nothing."""
    return no_light()


@wp.func
def meet(scene: DeviceScene, light: LightRecord, origin: wp.vec3, direction: wp.vec3) -> LightSample:
    """The dome's radiance."""
    return infinite_sample(direction, light.radiance, 0.0)


@wp.func
def sample_textured(scene: DeviceScene, light: LightRecord, p: wp.vec3, u: wp.vec2) -> LightSample:
    """A direction in proportion to the picture's luminance."""
    return textured(scene, light, draw_direction(scene.images[light.image], u))


@wp.func
def meet_textured(scene: DeviceScene, light: LightRecord, origin: wp.vec3, direction: wp.vec3) -> LightSample:
    """The picture in the ray's direction."""
    return textured(scene, light, wp.normalize(light.inverse * direction))


@wp.func
def textured(scene: DeviceScene, light: LightRecord, local: wp.vec3) -> LightSample:
    """Sample for a unit direction of the picture's space; the light is there where its density is 0, too."""
    density = density_of(scene.images[light.image], local)
    result = local_sample(light, local, 1.0, wp.max(density, 1.0e-30))
    result.distance = INFINITY
    result.radiance = wp.cw_mul(light.radiance, radiance_from(scene.images[light.image], local))
    return result
