"""What is asked of a scene, and whether it can be asked."""

from __future__ import annotations

from dataclasses import dataclass

from ..given import is_count, is_number, shown
from ..outputs import FILM_OUTPUTS, OUTPUTS, of_samples, term_of, terms_of
from ..scene import SceneError

#: The transports: from none to all light, and how each goes on.
TRANSPORTS = ("none", "local", "direct", "whitted", "path")
#: Those that see one surface a ray: they follow no bounce.
ONE_SURFACE = ("local", "direct")
#: Those that add up the lights at a surface, and reflect no other light in its rough parts.
LIGHT_BY_LIGHT = ("local", "direct", "whitted")
VISIBILITIES = ("rays", "raster", "painter")
SAMPLERS = ("sobol", "independent")
#: In the order of `DeviceScene.light_sampling`.
LIGHT_SAMPLINGS = ("tree", "power", "none")
#: How rays of colour meet triangles: by our walk, or by Warp's own query, which leaks.
RAY_ACCURACIES = ("watertight", "fast")


@dataclass(frozen=True)
class Request:
    """What is asked of a scene; see `Renderer` for the meanings."""

    outputs: tuple[str, ...] = ("color",)
    visibility: str = "auto"
    transport: str = "auto"
    bounces: int | None = None
    dome_light_visible: bool = False
    lights_visible: bool = False
    energy_compensation: bool = False
    camera_light: str = "auto"
    filter: str = "box"
    sampler: str = "sobol"
    texture_bytes: int = 0
    denoise: bool = False
    light_sampling: str = "tree"
    filter_textures: bool = True
    adaptive: bool = False
    ray_accuracy: str = "watertight"

    @property
    def colored(self) -> bool:
        """Whether any output is made of samples of light."""
        return of_samples(self.outputs)

    @property
    def last_term(self) -> int | None:
        """The highest single term of color that is asked for, None where color with all of them is."""
        terms = terms_of(self.outputs)
        of_all = any(name == "color" or name in FILM_OUTPUTS for name in self.outputs)
        return terms[-1] if terms and not of_all else None


def check_outputs(names: tuple[str, ...]) -> None:
    """Raise a SceneError at the first name that is no output."""
    for name in names:
        if not isinstance(name, str):
            raise SceneError(f"outputs: {name!r} is not the name of an output")
        if name not in OUTPUTS and name not in FILM_OUTPUTS and name != "color" and term_of(name) is None:
            known = ", ".join((*OUTPUTS, *FILM_OUTPUTS))
            raise SceneError(f"output {name!r} is not one of color, color:0, color:1, …, {known}")


def check_seed(seed: object) -> None:
    """Raise a SceneError unless it is a whole number, of any size and sign."""
    if not is_number(seed) or seed != seed // 1:
        raise SceneError(f"seed must be a whole number, not {shown(seed)}")


def check_request(request: Request) -> None:
    """Raise a SceneError at what cannot be asked of any scene."""
    if not request.outputs:
        raise SceneError("outputs: none is asked for")
    check_outputs(request.outputs)
    if request.transport not in (*TRANSPORTS, "auto"):
        raise SceneError(f"transport {request.transport!r} is not one of auto, {', '.join(TRANSPORTS)}")
    if request.transport == "none" and request.colored:
        name = next(name for name in request.outputs if of_samples([name]))
        raise SceneError(f"transport 'none' gives no {name}: ask for other outputs alone, or for transport 'path'")
    if request.visibility not in (*VISIBILITIES, "auto"):
        raise SceneError(f"visibility {request.visibility!r} is not one of auto, {', '.join(VISIBILITIES)}")
    if request.ray_accuracy not in RAY_ACCURACIES:
        raise SceneError(f"ray accuracy {request.ray_accuracy!r} is not one of {', '.join(RAY_ACCURACIES)}")
    if request.sampler not in SAMPLERS:
        raise SceneError(f"sampler {request.sampler!r} is not one of {', '.join(SAMPLERS)}")
    if request.light_sampling not in LIGHT_SAMPLINGS:
        raise SceneError(f"light sampling {request.light_sampling!r} is not one of {', '.join(LIGHT_SAMPLINGS)}")
    if request.denoise and "color" not in request.outputs:
        raise SceneError("denoising is of color, which is not among the outputs")
    if request.bounces is not None and not is_count(request.bounces):
        raise SceneError(f"bounces must be a whole number, 0 or more, not {shown(request.bounces)}")
    if not is_number(request.texture_bytes) or not request.texture_bytes >= 0:
        raise SceneError(f"texture_bytes must be 0 or more, not {shown(request.texture_bytes)}")
    if request.bounces and request.transport in ONE_SURFACE:
        raise SceneError(f"bounces {request.bounces}: transport {request.transport!r} follows none")
