"""MaterialX's surfaces as a PreviewSurface, or as a Dielectric where they refract.

What their lobes can say is drawn, and a remark names each input that they cannot.

The specular workflow carries their weights and tints: F0 of the dielectric from its index of refraction, F90 its
weight, and white for metals. Where metalness varies over the surface the metallic workflow mixes on the device; the
weight of the specular lobe then goes into the index of refraction.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdShade

from ...materials import Dielectric, PreviewSurface
from ..reading import Reading
from ..textures import is_output, producer
from .inputs import Resolved, resolve
from .network import Evaluation, category_of
from .nodes import Inputs, Values

WHITE, BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
#: Nodes that answer normals of the tangent space.
_NORMAL_MAPS = ("normalmap", "gltf_normalmap", "normal")


@dataclass(frozen=True)
class Model:
    """How one kind of surface becomes a PreviewSurface.

    Attributes:
        color: albedo of the base, of the diffuse part and of the metal alike.
        metalness: 0 dielectric … 1 metal.
        dielectric: F0 of the dielectric.
        edge: its F90.
        others: further inputs of a PreviewSurface, and their numbers of components.
        normal: name of the input with the normal.
        ignored: inputs that are not drawn, with the values at which they do nothing, by the input that switches them
            on; "" for those that are always on.
        transmission: name of the weight of what is refracted.
        glass: inputs of the `Dielectric` that stands for a surface that refracts; an `attenuationDistance` of 0 is
            none.
        opaque: inputs that such a surface does not draw, with the values at which they do nothing.
    """

    color: Callable[[Inputs], Values]
    metalness: Callable[[Inputs], Values]
    dielectric: Callable[[Inputs], Values]
    edge: Callable[[Inputs], Values]
    others: Mapping[str, tuple[int, Callable[[Inputs], Values]]]
    normal: str
    ignored: Mapping[str, Mapping[str, object]]
    transmission: str
    glass: Mapping[str, tuple[int, Callable[[Inputs], Values]]]
    opaque: Mapping[str, object]


def normal_reflectance(ior: Values) -> Values:
    """F0 of a dielectric."""
    return ((1.0 - ior) / (1.0 + ior)) ** 2


def tinted(color: str, depth: str) -> dict[str, tuple[int, Callable[[Inputs], Values]]]:
    """What colours the light inside: the surface where the depth is 0, else the way, as far as the depth."""
    return {
        "transmissionColor": (3, lambda i: np.where(i(depth, 0.0) > 0, 1.0, i(color, WHITE))),
        "attenuationColor": (3, lambda i: np.where(i(depth, 0.0) > 0, i(color, WHITE), 1.0)),
        "attenuationDistance": (1, lambda i: i(depth, 0.0)),
    }


STANDARD_SURFACE = Model(
    color=lambda i: i("base", 1.0) * i("base_color", (0.8, 0.8, 0.8)),
    metalness=lambda i: i("metalness", 0.0),
    dielectric=lambda i: i("specular", 1.0) * i("specular_color", WHITE) * normal_reflectance(i("specular_IOR", 1.5)),
    edge=lambda i: i("specular", 1.0) * i("specular_color", WHITE),
    others={
        "roughness": (1, lambda i: i("specular_roughness", 0.2)),
        "clearcoat": (1, lambda i: i("coat", 0.0)),
        "clearcoatRoughness": (1, lambda i: i("coat_roughness", 0.1)),
        "ior": (1, lambda i: i("coat_IOR", 1.5)),
        "emissiveColor": (3, lambda i: i("emission", 0.0) * i("emission_color", WHITE)),
        "opacity": (1, lambda i: i("opacity", WHITE).mean(1, keepdims=True)),
    },
    normal="normal",
    ignored={
        "": {
            "diffuse_roughness": 0.0, "specular_anisotropy": 0.0, "subsurface": 0.0,
            "sheen": 0.0, "thin_film_thickness": 0.0,
        },
        "coat": {
            "coat_color": WHITE, "coat_anisotropy": 0.0, "coat_affect_color": 0.0, "coat_affect_roughness": 0.0,
            "coat_normal": None,
        },
        "transmission": {
            "transmission_scatter": BLACK, "transmission_dispersion": 0.0, "transmission_extra_roughness": 0.0,
        },
    },
    transmission="transmission",
    glass={
        "ior": (1, lambda i: i("specular_IOR", 1.5)),
        "roughness": (1, lambda i: i("specular_roughness", 0.2)),
        "specularColor": (3, lambda i: i("specular", 1.0) * i("specular_color", WHITE)),
        **tinted("transmission_color", "transmission_depth"),
        "thinWalled": (1, lambda i: i("thin_walled", 0.0)),
    },
    opaque={"metalness": 0.0, "coat": 0.0, "emission": 0.0, "opacity": WHITE},
)  # fmt: skip

OPEN_PBR_SURFACE = Model(
    color=lambda i: i("base_weight", 1.0) * i("base_color", (0.8, 0.8, 0.8)),
    metalness=lambda i: i("base_metalness", 0.0),
    dielectric=lambda i: (
        i("specular_weight", 1.0) * i("specular_color", WHITE) * normal_reflectance(i("specular_ior", 1.5))
    ),
    edge=lambda i: i("specular_weight", 1.0) * i("specular_color", WHITE),
    others={
        "roughness": (1, lambda i: i("specular_roughness", 0.3)),
        "clearcoat": (1, lambda i: i("coat_weight", 0.0)),
        "clearcoatRoughness": (1, lambda i: i("coat_roughness", 0.0)),
        "ior": (1, lambda i: i("coat_ior", 1.6)),
        "emissiveColor": (3, lambda i: i("emission_luminance", 0.0) * i("emission_color", WHITE)),
        "opacity": (1, lambda i: i("geometry_opacity", 1.0)),
    },
    normal="geometry_normal",
    ignored={
        "": {
            "base_diffuse_roughness": 0.0, "specular_roughness_anisotropy": 0.0,
            "subsurface_weight": 0.0, "fuzz_weight": 0.0, "thin_film_weight": 0.0,
        },
        "coat_weight": {"coat_color": WHITE, "coat_roughness_anisotropy": 0.0, "geometry_coat_normal": None},
        "transmission_weight": {"transmission_scatter": BLACK, "transmission_dispersion_scale": 0.0},
    },
    transmission="transmission_weight",
    glass={
        "ior": (1, lambda i: i("specular_ior", 1.5)),
        "roughness": (1, lambda i: i("specular_roughness", 0.3)),
        "specularColor": (3, lambda i: i("specular_weight", 1.0) * i("specular_color", WHITE)),
        **tinted("transmission_color", "transmission_depth"),
        "thinWalled": (1, lambda i: i("geometry_thin_walled", 0.0)),
    },
    opaque={"base_metalness": 0.0, "coat_weight": 0.0, "emission_luminance": 0.0, "geometry_opacity": 1.0},
)  # fmt: skip

GLTF_PBR = Model(
    color=lambda i: i("base_color", WHITE),
    metalness=lambda i: i("metallic", 1.0),
    dielectric=lambda i: (
        np.minimum(normal_reflectance(i("ior", 1.5)) * i("specular_color", WHITE), 1.0) * i("specular", 1.0)
    ),
    edge=lambda i: i("specular", 1.0),
    others={
        "roughness": (1, lambda i: i("roughness", 1.0)),
        "clearcoat": (1, lambda i: i("clearcoat", 0.0)),
        "clearcoatRoughness": (1, lambda i: i("clearcoat_roughness", 0.0)),
        "ior": (1, lambda i: np.array([[1.5]])),
        "emissiveColor": (3, lambda i: i("emissive", BLACK) * i("emissive_strength", 1.0)),
        "opacity": (1, lambda i: np.where(i("alpha_mode", 0.0) > 0, i("alpha", 1.0), 1.0)),
        "opacityThreshold": (1, lambda i: np.where(i("alpha_mode", 0.0) == 1, i("alpha_cutoff", 0.5), 0.0)),
    },
    normal="normal",
    ignored={
        "": {
            "iridescence": 0.0, "sheen_color": BLACK, "anisotropy_strength": 0.0,
            "dispersion": 0.0,
        },
        "clearcoat": {"clearcoat_normal": None},
    },
    transmission="transmission",
    glass={
        "ior": (1, lambda i: i("ior", 1.5)),
        "roughness": (1, lambda i: i("roughness", 1.0)),
        "specularColor": (3, lambda i: i("specular", 1.0) * i("specular_color", WHITE)),
        "transmissionColor": (3, lambda i: i("base_color", WHITE)),
        "attenuationColor": (3, lambda i: i("attenuation_color", WHITE)),
        "attenuationDistance": (1, lambda i: i("attenuation_distance", 0.0)),
        "thinWalled": (1, lambda i: 1.0 * (i("thickness", 0.0) <= 0)),
    },
    opaque={"clearcoat": 0.0, "emissive": BLACK},
)  # fmt: skip

#: Surfaces by the beginnings of their ids, which may end in a version.
MODELS = {
    "ND_standard_surface_surfaceshader": STANDARD_SURFACE,
    "ND_open_pbr_surface_surfaceshader": OPEN_PBR_SURFACE,
    "ND_gltf_pbr_surfaceshader": GLTF_PBR,
}


def is_node(output: Usd.Attribute) -> bool:
    """Whether an output is computed by a node of MaterialX's."""
    return (UsdShade.Shader(output.GetPrim()).GetShaderId() or "").startswith("ND_")


def is_surface(shader: UsdShade.Shader) -> bool:
    """Whether the shader is a surface of MaterialX's that is drawn."""
    return _model(shader) is not None


def read_surface(reading: Reading, shader: UsdShade.Shader) -> PreviewSurface | Dielectric:
    """The material that stands for a surface of MaterialX's: glass where most of the light is refracted."""
    model = _model(shader)
    _remark_ignored(reading, shader, model)
    surface = _Surface(reading, shader)
    if _refracts(reading, shader, model, surface):
        return Dielectric(**_glass_inputs(reading, shader, model, surface))
    return PreviewSurface(**_opaque_inputs(reading, model, surface))


def _refracts(reading: Reading, shader: UsdShade.Shader, model: Model, surface: _Surface) -> bool:
    """Whether the surface is glass: it is either that or opaque, by its weight; a remark where it is in between."""
    weight = surface.get(1, lambda i: i(model.transmission, 0.0))
    if not isinstance(weight, float | None):
        reading.remark(shader.GetPrim(), f"{model.transmission} varies and is not drawn")
        return False
    weight = weight or 0.0
    if 0.0 < weight < 1.0:
        taken = "taken as 1" if weight >= 0.5 else "not drawn"
        reading.remark(shader.GetPrim(), f"{model.transmission} is {weight:.3g} and is {taken}")
    return weight >= 0.5


def _glass_inputs(reading: Reading, shader: UsdShade.Shader, model: Model, surface: _Surface) -> dict[str, object]:
    for name, neutral in model.opaque.items():
        if _is_set(reading, shader, name, neutral):
            reading.remark(shader.GetPrim(), f"{name} is not drawn where light is refracted")
    found = {name: surface.get(*field) for name, field in model.glass.items()}
    found["normal"] = surface.normal(model.normal)
    found = {name: value for name, value in found.items() if value is not None}
    if isinstance(found.get("attenuationDistance"), float) and found["attenuationDistance"] <= 0:
        del found["attenuationDistance"]
    return found


def _opaque_inputs(reading: Reading, model: Model, surface: _Surface) -> dict[str, object]:
    found = surface.base(model) | {name: surface.get(*field) for name, field in model.others.items()}
    if "useSpecularWorkflow" not in found:
        # The index of refraction is the base's then.
        del found["ior"]
        found["ior"] = surface.get(1, lambda i: _ior_of(model.dielectric(i)))
    found["normal"] = surface.normal(model.normal)
    found = {name: value for name, value in found.items() if value is not None}
    if "normal" in found:
        reading.primvars.setdefault("st", None)
    return found | {"opacityMode": "presence"}


def displacement_input(reading: Reading, shader: UsdShade.Shader) -> Resolved | None:
    """Displacement along the normal of a MaterialX displacement shader; None, with a remark, where it is a vector."""
    if shader.GetShaderId().startswith("ND_displacement_vector3"):
        reading.remark(shader.GetPrim(), "displacement by vectors is not drawn")
        return None
    return _Surface(reading, shader).get(1, lambda i: i("displacement", 0.0) * i("scale", 1.0))


class _Surface:
    """One shader, whose inputs are asked for as functions of its authored ones."""

    def __init__(self, reading: Reading, shader: UsdShade.Shader) -> None:
        self.reading, self.shader = reading, shader

    def get(self, width: int, function: Callable[[Inputs], Values]) -> Resolved | None:
        def value(passing: Evaluation) -> Values:
            return function(lambda name, default: passing.input(self.shader, name, default))

        return resolve(self.reading, self.shader.GetPrim(), value, width)

    def base(self, model: Model) -> dict[str, object]:
        """The diffuse part and the first specular lobe."""
        metalness = self.get(1, model.metalness)
        if not isinstance(metalness, float | None):
            return {"diffuseColor": self.get(3, model.color), "metallic": metalness}
        share = min(max(metalness or 0.0, 0.0), 1.0)
        return {
            "useSpecularWorkflow": 1,
            "diffuseColor": self.get(3, lambda i: model.color(i) * (1.0 - share)),
            "specularColor": self.get(3, lambda i: model.dielectric(i) * (1.0 - share) + model.color(i) * share),
            "specularEdgeColor": self.get(3, lambda i: model.edge(i) * (1.0 - share) + share),
        }

    def normal(self, name: str) -> Resolved | None:
        source = producer(self.reading, self.shader, name)
        if source is None or not is_output(source):
            return None
        if category_of(UsdShade.Shader(source.GetPrim())) not in _NORMAL_MAPS:
            self.reading.remark(source.GetPrim(), "a normal that is not of a normal map is not drawn")
            return None
        found = self.get(3, lambda i: i(name, (0.0, 0.0, 1.0)))
        return None if found == (0.0, 0.0, 1.0) else found


def _model(shader: UsdShade.Shader) -> Model | None:
    name = shader.GetShaderId() or ""
    return next((model for start, model in MODELS.items() if name.startswith(start)), None)


def _ior_of(reflectance: Values) -> Values:
    root = np.sqrt(np.clip(reflectance.mean(1, keepdims=True), 0.0, 0.98))
    return (1.0 + root) / (1.0 - root)


def _remark_ignored(reading: Reading, shader: UsdShade.Shader, model: Model) -> None:
    for switch, inputs in model.ignored.items():
        if switch and not _is_set(reading, shader, switch, 0.0):
            continue
        for name, neutral in inputs.items():
            if _is_set(reading, shader, name, neutral):
                reading.remark(shader.GetPrim(), f"{name} is not drawn")


def _is_set(reading: Reading, shader: UsdShade.Shader, name: str, neutral: object) -> bool:
    """Whether an input does anything: it is connected, or authored with another value than the one that does not."""
    source = producer(reading, shader, name)
    if source is None:
        return False
    if is_output(source):
        return True
    value = reading.get(source)
    return value is not None and neutral is not None and not np.array_equal(np.asarray(value), np.asarray(neutral))
