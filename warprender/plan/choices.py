"""How light gets to the camera and how first surfaces are found, where "auto" leaves it open."""

from __future__ import annotations

from ..camera import Camera
from ..lights import Light
from ..scene import Scene, SceneError
from .bounds import bounces_called_for
from .occurring import Occurring
from .request import Request

#: Nanoseconds of one CPU thread, measured at 1280×720 with 100,000 and a million triangles, a quarter of the picture
#: covered: a camera ray (116, 133); a rasterized pixel, and a triangle (120 where it covers 8 pixels, 30 where 1).
RAY_COST, PIXEL_COST, TRIANGLE_COST = 120.0, 25.0, 60.0

#: As many lights as "direct" adds up.
_FEW = 32


def choose_transport(found: Occurring, request: Request, lights: dict[str, Light]) -> tuple[str, str]:
    """The transport, and why: with "auto" the cheapest that leaves out nothing that the scene calls for.

    "direct" and "whitted" stand in for "path" where they have the same expectation and no more noise.
    """
    if request.transport != "auto":
        return request.transport, "asked for"
    if not request.colored:
        return "none", "no color is asked for"
    if not lights and not found.emitting:
        return "local", "nothing gives light"
    if found.albedo <= 0.0:
        return "local", "nothing reflects light"
    if set(found.lobes) <= {"clearcoat", "mirror"}:
        return "whitted", "all surfaces are perfect mirrors"
    if bounces_called_for(found.albedo, request) == 0 and _is_exact_direct(found, lights):
        return "direct", "light is reflected once, and lights are points, suns and plain domes"
    return "path", f"surfaces reflect light to each other, {found.brightest} the most"


def _is_exact_direct(found: Occurring, lights: dict[str, Light]) -> bool:
    """Whether adding up lights finds all that is reflected once, without missing what paths meet by chance.

    Lights without a size and domes of one colour need no two ways to be found. Perfect lobes find domes by the second
    way alone, as do paths geometry that glows faintly; Phong's model is not the same in both transports.
    """
    if found.emitting or "mirror" in found.lobes or "refraction" in found.lobes or "Phong" in found.materials:
        return False
    return len(lights) <= _FEW and all(light.is_delta() or light.kind() == "DomeLight" for light in lights.values())


def choose_color_visibility(
    found: Occurring, camera: Camera, request: Request, pixels: int, transport: str
) -> tuple[str, str]:
    """How the first hits of colour are found, and why. Rays where the rasterizer cannot see what they do."""
    auto = request.visibility == "auto"
    instead = auto and request.transport == "auto" and transport in ("direct", "whitted")
    for reason, applies in (
        ("the camera has depth of field", "lens" in camera.effects()),
        (f"{found.passing} lets paths straight through", found.passing and transport == "path"),
        ("paths are made of rays", transport == "path" and auto),
        ("in place of paths, each pixel sees places of its own", instead),
        ("the camera has clippingPlanes", "clippingPlanes" in camera.effects()),
        ("pixels get samples of their own number", request.adaptive),
        (f"{found.distances} is a signed distance function", auto and found.distances),
    ):
        if applies:
            return "rays", reason
    return _cheaper(found, request, pixels)


def choose_visibility(scene: Scene, found: Occurring, camera: Camera, request: Request, pixels: int) -> tuple[str, str]:
    """How the AOVs' first hits are found, and why.

    Raises:
        SceneError: what is asked for cannot show this scene.
    """
    only_rays = "the camera has clippingPlanes" if "clippingPlanes" in camera.effects() else ""
    if request.visibility == "painter" and found.other_shape:
        kind = type(scene.placements[found.other_shape].shape).__name__
        raise SceneError(f"visibility 'painter' draws triangles alone, and {found.other_shape} is a {kind.lower()}")
    if request.visibility in ("raster", "painter") and only_rays:
        raise SceneError(f"visibility {request.visibility!r}: {only_rays}, which only rays can follow")
    if request.visibility == "auto" and found.distances:
        only_rays = only_rays or f"{found.distances} is a signed distance function"
    return ("rays", only_rays) if only_rays else _cheaper(found, request, pixels)


def _cheaper(found: Occurring, request: Request, pixels: int) -> tuple[str, str]:
    """What is asked for, or what should take less time, where both show the same."""
    if request.visibility != "auto":
        return request.visibility, "asked for"
    rays, raster = pixels * RAY_COST, pixels * PIXEL_COST + found.triangles * TRIANGLE_COST
    milliseconds = f"about {1e-6 * raster:.3g} ms of one thread by raster, {1e-6 * rays:.3g} ms by rays"
    return "raster" if raster < rays else "rays", f"{found.triangles} triangles, {pixels} pixels: {milliseconds}"
