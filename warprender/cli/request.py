"""From parsed flags to the scene and the renderer that they ask for."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .. import StageReader
    from ..renderer import Renderer
    from ..scene import RenderProduct, Scene

#: What the time code "default" is as a number, in USD and in `load`.
DEFAULT_TIME = float("nan")


def times(args: argparse.Namespace) -> list[float | None]:
    """The time code of each frame as `load` takes it; None is the stage's startTimeCode, if authored."""
    if args.frames:
        return list(args.frames.times)
    return [DEFAULT_TIME if args.defaultTime else None]


def open_stage(args: argparse.Namespace) -> StageReader:
    """The stage, to be read at each of `times`.

    Raises:
        SceneError: the stage, or something that a flag names in it, cannot be read.
    """
    from .. import StageReader

    variants: dict[str, dict[str, str]] = {}
    for prim, name, value in args.variant:
        variants.setdefault(prim, {})[name] = value
    return StageReader(
        args.stage,
        purposes=args.purposes,
        variants=variants or None,
        mask=args.mask,
        session_layer=args.sessionLayer,
        complexity=args.complexity,
        render_settings=args.renderSettingsPrimPath,
        render_pass=args.renderPassPrimPath,
        draw_modes=not args.disableDrawMode,
    )


def build_renderer(args: argparse.Namespace, scene: Scene, shown: tuple[str, ...] | None = None) -> Renderer:
    """The renderer of `scene` with the camera, the size and the accuracy that the flags ask for.

    Args:
        args: parsed flags; `camera` may be a `Camera` too.
        scene: what to draw.
        shown: outputs; None for those of --aov.

    Raises:
        SceneError: no such camera.
        ValueError: an output, transport, device or filter that does not exist.
    """
    from .. import Camera, Renderer
    from ..framing import choose_camera, choose_camera_path, choose_resolution

    given = isinstance(args.camera, Camera)
    camera = args.camera if given else choose_camera(scene, args.camera)
    return Renderer(
        scene,
        # By its path, where it has one: it may move while its shutter is open.
        camera=camera if given else choose_camera_path(scene, args.camera) or camera,
        resolution=args.resolution or choose_resolution(scene, camera, args.imageWidth),
        outputs=shown or outputs(args),
        visibility=args.visibility,
        transport=args.transport,
        device=args.device,
        threads=args.threads,
        bounces=args.bounces,
        camera_light=args.cameraLight,
        dome_light_visible=args.enableDomeLightVisibility,
        lights_visible=args.enableLightVisibility,
        filter=args.filter,
        sampler=args.sampler,
        energy_compensation=args.energyCompensation,
        denoise=args.denoise,
        light_sampling=args.lightSampling,
        filter_textures=not args.disableTextureFilter,
        adaptive=args.adaptive,
        ray_accuracy=args.rayAccuracy,
    )


def outputs(args: argparse.Namespace, product: RenderProduct | None = None) -> tuple[str, ...]:
    """The outputs of --aov, each once, else those of the render product, else color.

    Raises:
        SceneError: there is no such output.
    """
    from ..plan import check_outputs

    asked = [name for names in args.aov or () for name in names]
    check_outputs(asked)
    return tuple(dict.fromkeys(asked)) or (product.outputs if product else ("color",))


def remarks(args: argparse.Namespace) -> list[str]:
    """Warnings about flags that are read but change nothing."""
    lines = []
    if args.renderer and args.renderer.lower() != "warprender":
        lines.append(f"--renderer {args.renderer}: read and ignored; warprender draws the picture")
    if args.resolver == "inherit":
        lines.append("--resolver inherit: read and ignored; paths are resolved from the stage's root layer")
    if args.memstats:
        lines.append("--memstats: read and ignored; this USD does not count its memory")
    return lines
