"""UsdPreviewSurface."""

from __future__ import annotations
from dataclasses import dataclass


@dataclass
class PreviewSurface:
    """UsdPreviewSurface 2.6 with constant inputs; names and fallbacks as in the specification.

    Attributes:
        diffuseColor: linear Rec.709 albedo.
        emissiveColor: emitted radiance.
        useSpecularWorkflow: 1 takes F0 from `specularColor`, 0 from `metallic`, `diffuseColor` and `ior`.
        specularColor: F0 in the specular workflow.
        metallic: 0 dielectric … 1 metal.
        roughness: its square is the GGX alpha.
        clearcoat: weight of a second, white specular lobe.
        clearcoatRoughness: roughness of that lobe.
        opacity: 1 opaque … 0 clear.
        opacityMode: "transparent" (the diffuse part fades, reflections stay) or "presence" (all fades).
        opacityThreshold: above 0, a cut-out: below it nothing is drawn, from it on the surface is opaque.
        ior: index of refraction.
    """

    diffuseColor: tuple[float, float, float] = (0.18, 0.18, 0.18)
    emissiveColor: tuple[float, float, float] = (0.0, 0.0, 0.0)
    useSpecularWorkflow: int = 0
    specularColor: tuple[float, float, float] = (0.0, 0.0, 0.0)
    metallic: float = 0.0
    roughness: float = 0.5
    clearcoat: float = 0.0
    clearcoatRoughness: float = 0.01
    opacity: float = 1.0
    opacityMode: str = "transparent"
    opacityThreshold: float = 0.0
    ior: float = 1.5
