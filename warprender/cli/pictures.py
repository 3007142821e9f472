"""Which files one command writes: OUTPUT, or those that the stage's render products name."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .framespec import frame_paths
from .request import outputs, times

if TYPE_CHECKING:
    from .. import StageReader
    from ..scene import RenderProduct


@dataclass(frozen=True)
class Picture:
    """One file.

    Attributes:
        frame: number of the frame, counted from 0.
        time: its time code, None for the stage's own start.
        path: the file.
        outputs: what it shows.
        product: number of the render product, None for the render settings themselves.
    """

    frame: int
    time: float | None
    path: str
    outputs: tuple[str, ...]
    product: int | None = None


def asked_pictures(args: argparse.Namespace) -> list[Picture]:
    """The pictures of OUTPUT, one for each frame.

    Raises:
        ValueError: the file names and the frames do not go together, or there is no such output.
    """
    asked = outputs(args)
    paths = frame_paths(args.output, args.frames)
    return [Picture(i, time, path, asked) for i, (time, path) in enumerate(zip(times(args), paths, strict=True))]


def product_pictures(args: argparse.Namespace, stage: StageReader) -> tuple[list[Picture], list[str]]:
    """The pictures of the stage's render products, and warnings about those that cannot be written.

    Raises:
        ValueError: there is none, none can be written, or frames would overwrite each other.
    """
    from .. import images

    pictures, warnings, path = [], [], ""
    for frame, time in enumerate(times(args)):
        settings = stage.settings(time)
        path = settings.path
        for number, product in enumerate(settings.products):
            try:
                path_now = _path_at(args, product, frame)
                images.check_destination(path_now)
            except ValueError as problem:
                warnings.append(f"{product.path}: {problem}")
                continue
            shown = _kept(outputs(args, product), path_now, product, warnings)
            pictures.append(Picture(frame, time, path_now, shown, number))
    if not pictures:
        reason = warnings[0] if warnings else f"{path or args.stage} has no render products to name files"
        raise ValueError(f"without OUTPUT there is nothing to draw: {reason}")
    _check_overwriting(pictures)
    return pictures, warnings


def _path_at(args: argparse.Namespace, product: RenderProduct, frame: int) -> str:
    """The product's file; a placeholder is filled in where the name has one, as it need not: it may vary in time."""
    name = product.productName
    return frame_paths(name, args.frames)[frame] if "#" in name else name


def _kept(asked: tuple[str, ...], path: str, product: RenderProduct, warnings: list[str]) -> tuple[str, ...]:
    """The outputs that the file can hold; color where it can hold none of them."""
    from .. import images

    kept = tuple(images.kept(path, asked))
    if len(kept) < len(asked):
        lost = ", ".join(name for name in asked if name not in kept)
        warnings.append(f"{product.path}: {path} does not keep {lost}; .exr holds all")
    return kept or ("color",)


def _check_overwriting(pictures: Sequence[Picture]) -> None:
    """Raise ValueError where two products or frames would go to one file."""
    taken: dict[str, Picture] = {}
    for picture in pictures:
        other = taken.setdefault(picture.path, picture)
        if other.frame != picture.frame:
            raise ValueError(f"{picture.path}: all frames would go there; productName needs a placeholder, as ###")
        if other.product != picture.product:
            raise ValueError(f"{picture.path}: two render products have this productName")
