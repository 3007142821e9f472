"""Render a picture again by the receipt that it carries, and say whether it has the same bits or what changed.

Exit code 0 says that the bits are the same, 1 that they are not.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING

from .arguments import positive_int
from .progress import progress_bar
from .quiet import without_lines

if TYPE_CHECKING:
    import numpy as np

    from .. import Frame


#: What a receipt must have, by type.
_PARTS = {"stage": str, "request": dict, "camera": dict, "resolution": list, "samples": (int, float), "seed": int}


def add_parser(commands: argparse._SubParsersAction) -> None:
    """Add the command and its flags."""
    parser = commands.add_parser(
        "reproduce",
        usage="%(prog)s [FLAGS] PICTURE",
        help="render a picture again by its receipt, and say what changed",
        description=__doc__,
        allow_abbrev=False,
    )
    parser.add_argument("picture", metavar="PICTURE", help="PNG or EXR that warprender has written")
    parser.add_argument("--stage", metavar="FILE", help="the stage, where it is no longer at the receipt's path")
    parser.add_argument("--output", metavar="FILE", help="keep the new picture")
    parser.add_argument("--device", metavar="NAME", help="Warp device (default: the receipt's)")
    parser.add_argument("--threads", type=positive_int, metavar="COUNT", help="CPU threads; changes no pixel")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print "same bits", or a line for everything that is not as the receipt says and the first pixel that differs."""
    from pathlib import Path

    from .. import images

    if args.output:
        images.check_destination(args.output)
    receipt = read_receipt(args.picture)
    stage = args.stage or receipt["stage"]
    if not stage:
        raise ValueError(f"{args.picture}: is of a scene built in Python: there is no stage to render again")
    if not Path(stage).is_file():
        raise ValueError(f"{args.picture}: its stage {stage} does not exist; --stage names another place")
    frame = _render(args, receipt, stage)
    changed = [*_changes(receipt, frame.receipt, stage)]
    differing = _differing_pixels(args.picture, receipt, frame)
    if args.output:
        frame.save(args.output, **receipt.get("file", {}))
    for line in [*(f"changed: {line}" for line in changed), *differing]:
        print(line)
    if not differing:
        print(f"{args.picture}: same bits")
    elif not changed:
        print("all else in the receipt is as it was: another file that the stage reads changed, or warprender's code")
    return 1 if differing else 0


def read_receipt(picture: str) -> dict:
    """The receipt in a picture's metadata.

    Raises:
        ValueError: the picture cannot be read, or carries none.
    """
    import json

    from .. import images

    with without_lines(b"libpng"):
        _, metadata = images.read(picture)
    if "warprender" not in metadata:
        raise ValueError(f"{picture}: carries no receipt of warprender's; PNG and EXR that it wrote do")
    try:
        receipt = json.loads(str(metadata["warprender"]))
    except json.JSONDecodeError:
        receipt = None
    if not isinstance(receipt, dict):
        raise ValueError(f"{picture}: its receipt cannot be read")
    for name, kind in _PARTS.items():
        if not isinstance(receipt.get(name), kind):
            raise ValueError(f"{picture}: its receipt has no {name}, or one of another kind")
    if len(receipt["resolution"]) != 2:
        raise ValueError(f"{picture}: its receipt has no width and height")
    return receipt


def _render(args: argparse.Namespace, receipt: dict, stage: str) -> Frame:
    """The picture that the receipt describes.

    Raises:
        ValueError: the receipt has settings that this version does not know.
    """
    import numpy as np

    from .. import Camera, Renderer, load
    from .quiet import start_warp
    from .report import Warnings

    device = args.device or receipt.get("device", "cpu")
    start_warp(device)
    try:
        scene = load(stage, **receipt.get("loading", {}))
        Warnings().show(scene.warnings)
        for product in scene.settings.products if receipt.get("product") else ():
            if product.productName == receipt["product"]:
                scene = scene.for_product(product)
                break
        camera = Camera(**{**receipt["camera"], "transform": np.array(receipt["camera"]["transform"])})
        camera.clippingPlanes = tuple(map(tuple, camera.clippingPlanes))
        size, path = tuple(receipt["resolution"]), receipt.get("cameraPath")
        # A camera that moves while its shutter is open is the stage's own.
        moving = camera.shutterOpen < camera.shutterClose and path in scene.cameras
        renderer = Renderer(
            scene, path if moving else camera, size, device=device, threads=args.threads, **receipt["request"]
        )
    except (TypeError, KeyError, AttributeError) as unknown:
        raise ValueError(f"{args.picture}: its receipt is of another version: {unknown}") from None
    with progress_bar(args.picture) as progress:
        return renderer.render(samples=receipt["samples"] or None, seed=receipt["seed"], progress=progress)


def _changes(then: dict, now: dict, stage: str) -> Iterator[str]:
    """What differs between two receipts, beginning with what most likely changed the picture."""
    if then.get("stageHash") != now["stageHash"]:
        yield f"stage {stage}: its contents"
    for path, value in then.get("layerHashes", {}).items():
        if path not in now["layerHashes"]:
            yield f"layer {path}: is no longer used"
        elif now["layerHashes"][path] != value:
            yield f"layer {path}: its contents"
    for path in now["layerHashes"]:
        if path not in then.get("layerHashes", {}):
            yield f"layer {path}: is new"
    for package, version in now["versions"].items():
        before = then.get("versions", {}).get(package)
        if before != version:
            yield f"{package}: version {before or 'none'} then, {version or 'none'} now"
    for name in ("machine", "device"):
        if then.get(name) != now[name]:
            yield f"{name}: {then.get(name)} then, {now[name]} now"
    if then.get("plan") is None:
        yield "plan: not in the receipt"
        return
    yield from (f"plan {line}" for line in _differences(then["plan"], now["plan"]))


def _differences(then: object, now: object, path: str = "") -> Iterator[str]:
    """The leaves in which two JSON values differ."""
    import json

    if json.dumps(then, sort_keys=True) == json.dumps(now, sort_keys=True):
        return
    if isinstance(then, dict) and isinstance(now, dict):
        for name in {**then, **now}:
            yield from _differences(then.get(name), now.get(name), f"{path}.{name}" if path else name)
    else:
        yield f"{path}: {then} then, {now} now"


def _differing_pixels(picture: str, receipt: dict, frame: Frame) -> list[str]:
    """A line for each layer that differs, with its first pixel; the new picture goes through the same file format."""
    import tempfile
    from pathlib import Path

    import numpy as np

    from .. import images

    old, _ = images.read(picture)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / ("again" + Path(picture).suffix)
        frame.save(path, **receipt.get("file", {}))
        new, _ = images.read(path)
    lines = []
    for name in {**old, **new}:
        if name not in old or name not in new:
            lines.append(f"layer {name}: is in the {'new' if name in new else 'old'} picture alone")
        elif old[name].shape != new[name].shape:
            lines.append(f"layer {name}: {_shape(old[name])} then, {_shape(new[name])} now")
        else:
            bits = (np.ascontiguousarray(a).view(np.uint32) for a in (old[name], new[name]))
            differ = np.not_equal(*bits).reshape(*old[name].shape[:2], -1).any(-1)
            if differ.any():
                y, x = np.argwhere(differ)[0]
                values = f"{_text(old[name][y, x])} then, {_text(new[name][y, x])} now"
                share = f"{int(differ.sum())} of {differ.size} pixels differ"
                lines.append(f"layer {name}: {share}, the first (x={x}, y={y}): {values}")
    return lines


def _shape(values: np.ndarray) -> str:
    return "×".join(map(str, values.shape))


def _text(value: np.ndarray) -> str:
    import numpy as np

    return " ".join(format(v, "g") for v in np.ravel(value))
