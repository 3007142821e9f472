"""Reflection and refraction at the smooth boundary of two dielectrics.

`eta` is the index of refraction on the far side over that on the viewer's side.
"""

from __future__ import annotations

import warp as wp


@wp.func
def squared_cosine_beyond(cosine: float, eta: float) -> float:
    """eta² cos² of the refracted direction: eta² - 1 + cos², below 0 where all is reflected (Snell's law)."""
    return (eta - 1.0) * (eta + 1.0) + cosine * cosine


@wp.func
def fresnel_dielectric(cosine: float, eta: float) -> float:
    """Reflected share of unpolarised light that arrives at this cosine (≥ 0); 1 beyond the critical angle.

    Fresnel's amplitudes with their differences of squares divided out: where eta is near 1 nothing cancels.
    """
    c = wp.clamp(cosine, 0.0, 1.0)
    squared = squared_cosine_beyond(c, eta)
    if squared <= 0.0:
        # Grazing along a boundary of equal media meets no boundary.
        return wp.where(eta == 1.0, 0.0, 1.0)
    g = wp.sqrt(squared)
    contrast = (1.0 - eta) * (1.0 + eta)
    across = c + g
    along = eta * eta * c + g
    perpendicular = contrast / (across * across)
    parallel = contrast * ((eta * eta + 1.0) * c * c - 1.0) / (along * along)
    return wp.min(0.5 * (perpendicular * perpendicular + parallel * parallel), 1.0)


@wp.func
def refracted(wo: wp.vec3, normal: wp.vec3, eta: float) -> wp.vec3:
    """Unit direction in which light that arrives from wo goes on beyond the boundary; zero where all is reflected.

    Args:
        wo: Towards the viewer, unit, on the side of the normal.
        normal: Of the boundary, unit.
        eta: See above.
    """
    cosine = wp.dot(wo, normal)
    squared = squared_cosine_beyond(cosine, eta)
    if squared < 0.0:
        return wp.vec3(0.0, 0.0, 0.0)
    return (normal * (cosine - wp.sqrt(squared)) - wo) / eta


@wp.func
def thin_sheet(reflected: float) -> float:
    """Reflected share of a sheet whose two faces each reflect this share: all bounces between them (Stokes 1862)."""
    return 2.0 * reflected / (1.0 + reflected)
