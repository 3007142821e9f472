"""Perfectly specular lobes of a surface, all at once: what Whitted's ray tracer follows instead of drawing one."""

from __future__ import annotations

from functools import cache

import warp as wp

from ..records import Bsdf, DeviceScene
from .dielectric import beyond, radiance_scale, reflectance
from .dispatch import kind_of
from .microfacet import SMALLEST_ALPHA, schlick
from .preview_surface import coat_albedo, coat_fresnel


@wp.struct
class PerfectLobes:
    """Factors of the light from the mirror direction and from beyond the surface, and where it goes on there.

    `beyond` is in the shading frame; `bent` is 0 where that is straight through, which is no bounce.
    """

    reflected: wp.vec3
    transmitted: wp.vec3
    beyond: wp.vec3
    bent: wp.int32


@wp.func
def of_preview_surface(scene: DeviceScene, bsdf: Bsdf, wo: wp.vec3) -> wp.vec3:
    """Mirror factor of a UsdPreviewSurface: of its base and its coat, where they are smooth."""
    factor = wp.vec3(0.0, 0.0, 0.0)
    if bsdf.alpha < SMALLEST_ALPHA:
        factor = schlick(bsdf.f0, bsdf.f90, wo[2]) * (1.0 - coat_albedo(scene, bsdf, wo[2]))
    if bsdf.coat > 0.0 and bsdf.coat_alpha < SMALLEST_ALPHA:
        coat = coat_fresnel(bsdf, wo[2])
        factor += wp.vec3(coat, coat, coat)
    return factor * bsdf.present


@cache
def perfect_function(names: tuple[str, ...]) -> wp.Function:
    """`perfect(scene, bsdf, wo) -> PerfectLobes` for these kinds of materials; zero for those that have none.

    Args:
        names: class names of the kinds that occur.
    """
    preview, dielectric = kind_of("PreviewSurface"), kind_of("Dielectric")
    with_preview, with_dielectric = "PreviewSurface" in names, "Dielectric" in names

    @wp.func
    def perfect(scene: DeviceScene, bsdf: Bsdf, wo: wp.vec3) -> PerfectLobes:
        lobes = PerfectLobes()
        lobes.transmitted = wp.vec3(1.0, 1.0, 1.0) * bsdf.pass_through
        lobes.beyond = -wo
        if wp.static(with_preview):
            if bsdf.kind == wp.static(preview) and wo[2] > 0.0:
                lobes.reflected = of_preview_surface(scene, bsdf, wo)
        if wp.static(with_dielectric):
            if bsdf.kind == wp.static(dielectric) and bsdf.alpha <= 0.0 and wo[2] > 0.0:
                reflected = reflectance(bsdf, wo[2])
                lobes.reflected = bsdf.f90 * reflected
                lobes.transmitted = bsdf.transmission * ((1.0 - reflected) * radiance_scale(bsdf))
                lobes.beyond = beyond(bsdf, wo, wp.vec3(0.0, 0.0, 1.0))
                lobes.bent = 1
                if lobes.beyond[2] >= 0.0:
                    lobes.transmitted = wp.vec3(0.0, 0.0, 0.0)
        return lobes

    return perfect
