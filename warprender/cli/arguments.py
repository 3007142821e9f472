"""The flags that commands share: usdrecord's by its names and meanings, then ours."""

from __future__ import annotations

import argparse

from .framespec import FrameSpec, parse_frames

COMPLEXITIES = ("low", "medium", "high", "veryhigh")


def add_picture_arguments(parser: argparse.ArgumentParser) -> None:
    """STAGE and every flag that says which picture of it is meant."""
    parser.add_argument("stage", metavar="STAGE", help="USD file")
    add_stage_arguments(parser.add_argument_group("stage"))
    _add_view_arguments(parser.add_argument_group("view"))
    _add_light_arguments(parser.add_argument_group("lights"))
    _add_accuracy_arguments(parser.add_argument_group("accuracy"))
    add_device_arguments(parser.add_argument_group("device"))


def add_stage_arguments(group: argparse._ArgumentGroup) -> None:
    """Flags that say which part or variant of the stage is meant, and at which time."""
    group.add_argument(
        "--mask", type=names, metavar="PRIMPATH[,PRIMPATH...]", help="draw these prims and what is below them"
    )
    group.add_argument(
        "--purposes",
        type=names,
        metavar="PURPOSE[,PURPOSE...]",
        help="purposes drawn besides default (default: the render settings' includedPurposes, or proxy)",
    )
    group.add_argument("--disableDrawMode", action="store_true", help="draw models that ask for boxes or cards in full")
    group.add_argument("--sessionLayer", metavar="FILE", help="open the stage with this session layer")
    group.add_argument(
        "--variant",
        type=variant,
        action="append",
        default=[],
        metavar="/PRIM:SET=VALUE",
        help="select a variant; may be repeated",
    )
    settings = group.add_mutually_exclusive_group()
    settings.add_argument("--renderSettingsPrimPath", "-rs", metavar="PRIMPATH", help="RenderSettings prim")
    settings.add_argument(
        "--renderPassPrimPath",
        "-rp",
        metavar="PRIMPATH",
        help="RenderPass prim: its RenderSettings, without what it prunes or hides",
    )
    group.add_argument(
        "--resolver",
        choices=("root", "inherit"),
        default="root",
        help="read for usdrecord's sake; asset paths are resolved from the root layer",
    )
    group.add_argument(
        "--complexity",
        "-c",
        choices=COMPLEXITIES,
        default="low",
        help="refinement of subdivision surfaces (default: low)",
    )
    times = group.add_mutually_exclusive_group()
    times.add_argument(
        "--defaultTime",
        "-d",
        action="store_true",
        help="draw the default time; without it, the stage's startTimeCode or its earliest samples",
    )
    times.add_argument(
        "--frames",
        "-f",
        type=frame_spec,
        metavar="FRAMESPEC[,FRAMESPEC...]",
        help="time codes: a, or a:b from a to b, or a:bxs in steps of s",
    )


def _add_view_arguments(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--camera",
        "-cam",
        metavar="NAME",
        help="camera by name or prim path; else the settings' camera, main_cam, or one that frames all",
    )
    size = group.add_mutually_exclusive_group()
    size.add_argument(
        "--imageWidth",
        "-w",
        type=positive_int,
        metavar="PIXELS",
        help="width; the camera's aspect gives the height (default: the render settings' resolution, or 960)",
    )
    size.add_argument("--resolution", type=resolution, metavar="WxH", help="width and height in pixels")
    group.add_argument(
        "--aov",
        type=names,
        action="append",
        metavar="NAME[,NAME...]",
        help="outputs to render, as color,cameraDepth,primId (default: color); may be repeated",
    )
    group.add_argument(
        "--filter",
        default="box",
        metavar="NAME",
        help="reconstruction filter: box, triangle or gaussian (default: box, one pixel wide)",
    )
    group.add_argument("--sampler", default="sobol", metavar="NAME", help="sobol or independent (default: sobol)")
    group.add_argument(
        "--colorCorrectionMode",
        "-color",
        choices=("disabled", "sRGB", "openColorIO"),
        default="sRGB",
        help="colours of 8-bit pictures; openColorIO takes the default view of the configuration that $OCIO names; "
        ".exr and .hdr stay linear (default: sRGB)",
    )


def _add_light_arguments(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--cameraLight",
        choices=("on", "off", "auto"),
        default="auto",
        help="a light at the camera (default: auto, on where the stage has no light)",
    )
    group.add_argument(
        "--disableCameraLight",
        dest="cameraLight",
        action="store_const",
        const="off",
        help="the same as --cameraLight off",
    )
    group.add_argument(
        "--enableDomeLightVisibility", action="store_true", help="show dome lights to the camera, behind everything"
    )
    group.add_argument("--enableLightVisibility", action="store_true", help="show every light to the camera")


def _add_accuracy_arguments(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--transport",
        default="auto",
        metavar="NAME",
        help="how light gets to the camera: none (no color, other outputs alone), local (each light reflected once, no "
        "shadows), direct (the same with shadows), whitted (perfect reflection and refraction too), path (all light) "
        "or auto: none, local or path, the first that leaves out nothing (default: auto)",
    )
    group.add_argument(
        "--visibility",
        default="auto",
        metavar="NAME",
        help="how first surfaces are found: rays, raster, painter or auto, what takes less time (default: auto)",
    )
    group.add_argument(
        "--samples",
        type=positive_int,
        metavar="COUNT",
        help="stop at this many samples for each pixel (default: 64 without --error and --seconds)",
    )
    group.add_argument(
        "--error",
        type=positive_float,
        metavar="SHARE",
        help="stop at this relative standard error of the picture, as 0.01",
    )
    group.add_argument(
        "--seconds", type=positive_float, metavar="TIME", help="stop after this many seconds of sampling"
    )
    group.add_argument(
        "--bounces",
        type=count,
        metavar="COUNT",
        help="reflections followed after the camera's hit (default: as many as matter)",
    )
    group.add_argument(
        "--energyCompensation",
        action="store_true",
        help="give back the light that rough reflecting lobes lose, which UsdPreviewSurface does not (nor glass)",
    )
    group.add_argument(
        "--denoise",
        action="store_true",
        help="let Open Image Denoise go over color: less noise, some bias; needs the package pyoidn",
    )
    group.add_argument(
        "--adaptive",
        action="store_true",
        help="more samples among noisy pixels, fewer among quiet ones; the picture stays unbiased",
    )
    group.add_argument(
        "--lightSampling",
        default="tree",
        metavar="NAME",
        help="how paths aim at lights: tree, power, or none where chance may meet them; changes noise and time alone "
        "(default: tree)",
    )
    group.add_argument(
        "--rayAccuracy",
        default="watertight",
        metavar="NAME",
        help="how rays of color meet triangles: watertight, or fast, Warp's own query, which loses some at edges and "
        "on the CPU takes longer (default: watertight)",
    )
    group.add_argument(
        "--disableTextureFilter", action="store_true", help="look textures up at one point, at their finest level"
    )
    group.add_argument(
        "--seed", type=count, default=0, metavar="NUMBER", help="another gives an independent picture (default: 0)"
    )


def add_device_arguments(group: argparse._ArgumentGroup) -> None:
    """Flags that say where it runs."""
    group.add_argument("--device", default="cpu", metavar="NAME", help="Warp device, as cpu or cuda:0 (default: cpu)")
    group.add_argument(
        "--disableGpu", dest="device", action="store_const", const="cpu", help="the same as --device cpu"
    )
    group.add_argument(
        "--threads", type=positive_int, metavar="COUNT", help="CPU threads (default: all cores); changes no pixel"
    )
    group.add_argument("--renderer", "-r", metavar="NAME", help="read for usdrecord's sake; there is one renderer here")
    group.add_argument("--traceToFile", metavar="FILE", help="write what USD did, and how long it took")
    group.add_argument(
        "--traceFormat", choices=("chrome", "trace"), default="chrome", help="as JSON or as text (default: chrome)"
    )
    group.add_argument("--memstats", action="store_true", help="read for usdrecord's sake; it counts nothing here")


def names(text: str) -> list[str]:
    """A list separated by commas or spaces."""
    return text.replace(",", " ").split()


def variant(text: str) -> tuple[str, str, str]:
    """Prim path, variant set and selection of /Prim:set=value."""
    prim, colon, choice = text.partition(":")
    name, equals, value = choice.partition("=")
    if not (prim.startswith("/") and colon and name and equals):
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form /Prim:set=value")
    return prim, name, value


def frame_spec(text: str) -> FrameSpec:
    """Frame ranges, as `parse_frames` reads them."""
    try:
        return parse_frames(text)
    except ValueError as problem:
        raise argparse.ArgumentTypeError(str(problem)) from None


def resolution(text: str) -> tuple[int, int]:
    """Width and height of WxH."""
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form WxH, as 640x480")
    return int(width), int(height)


def positive_int(text: str) -> int:
    """A whole number from 1 on."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 1 on")
    return int(text)


def count(text: str) -> int:
    """A whole number from 0 on."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 0 on")
    return int(text)


def positive_float(text: str) -> float:
    """A finite number above 0."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number above 0")
    return value


def share(text: str) -> float:
    """A number from 0 on."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not value >= 0.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number from 0 on")
    return value
