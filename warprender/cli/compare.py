"""Measure how far picture A lies from picture B, the reference.

Exit code 0 says that A is within every limit that is given, or the same as B where none is; 1 that it is not.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from .arguments import share
from .quiet import without_lines

if TYPE_CHECKING:
    from ..study.pictures import Pair

#: Limits by flag: what they limit, as `measure` names it.
_LIMITS = {
    "rmse": "root mean squared difference",
    "relativeMse": "mean of squared difference over (squared reference + 0.01)",
    "maximum": "largest difference of a value",
    "flip": "mean FLIP, 0 to 1; needs the package flip-evaluator",
}


def add_parser(commands: argparse._SubParsersAction) -> None:
    """Add the command and its flags."""
    parser = commands.add_parser(
        "compare",
        usage="%(prog)s [FLAGS] A B",
        help="measure how far two pictures lie apart",
        description=__doc__,
        allow_abbrev=False,
    )
    parser.add_argument("first", metavar="A", help="picture: PNG, JPEG, TIFF, HDR or EXR")
    parser.add_argument("second", metavar="B", help="reference of the same size")
    parser.add_argument("--aov", default="color", metavar="NAME", help="layer to compare, of EXR files")
    limits = parser.add_argument_group("limits")
    for name, meaning in _LIMITS.items():
        limits.add_argument(f"--{name}", type=share, metavar="LIMIT", help=meaning)
    parser.add_argument(
        "--output",
        metavar="FILE",
        help="difference picture: .exr holds A - B, other formats |A - B| over its largest value",
    )
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print the figures, write the difference picture, and answer by the limits."""
    from .. import images
    from ..study.metrics import FLIP_MISSING, flip_available
    from ..study.pictures import read_pair

    if args.output:
        images.check_destination(args.output)
    if args.flip is not None and not flip_available():
        raise ValueError(FLIP_MISSING)
    if args.flip is not None and args.aov != "color":
        raise ValueError(f"--flip measures color, not {args.aov}")
    with without_lines(b"libpng"):
        pair = read_pair(args.first, args.second, args.aov)
    figures = measure(pair, args.aov == "color")
    if args.output:
        _write_difference(args.output, pair)
    limits = {name: getattr(args, name) for name in _LIMITS if getattr(args, name) is not None}
    beyond = {n: v for n, v in limits.items() if not figures[n] <= v} if limits else _beyond_same(figures)
    if args.json:
        _print_json(figures, beyond)
    else:
        _print_lines(args, figures, beyond, pair)
    return 1 if beyond else 0


def measure(pair: Pair, color: bool) -> dict[str, float | None]:
    """Every figure by name; "flip" is None where it cannot be measured."""
    from ..study.metrics import differences, flip, flip_available

    found = differences(pair.first[..., :3], pair.second[..., :3])
    seen = None
    if color and flip_available():
        seen, _ = flip(pair.first[..., :3], pair.second[..., :3], pair.encoded)
    whole = differences(pair.first, pair.second)
    return {
        "rmse": found.rmse,
        "relativeMse": found.relative_mse,
        "maximum": whole.maximum,
        "mean": found.mean,
        "different": whole.different,
        "flip": seen,
    }


def _beyond_same(figures: dict[str, float | None]) -> dict[str, float]:
    return {"maximum": 0.0} if figures["maximum"] != 0.0 else {}


def _print_lines(args: argparse.Namespace, figures: dict, beyond: dict[str, float], pair: Pair) -> None:
    import numpy as np

    from ..study.metrics import FLIP_MISSING

    kind = "as stored, sRGB-encoded" if pair.encoded else ("linear" if args.aov == "color" else "as stored")
    print(f"{args.first} against {args.second}: {args.aov}, values {kind}{pair.left_out}")
    print(f"RMSE          {figures['rmse']:.6g}")
    print(f"relative MSE  {figures['relativeMse']:.6g}")
    print(f"maximum       {figures['maximum']:.6g}")
    print(f"mean A - B    {figures['mean']:+.6g}")
    print(f"pixels        {100 * figures['different']:.4g} % differ")
    if args.aov == "color":
        print(f"FLIP          {FLIP_MISSING if figures['flip'] is None else format(figures['flip'], '.6g')}")
    bad = [int((~np.isfinite(values)).any(-1).sum()) for values in (pair.first, pair.second)]
    if any(bad):
        print(f"not finite    {bad[0]} pixels of A, {bad[1]} of B")
    if not beyond:
        print("within the limits" if figures["maximum"] else "same")
    for name, limit in beyond.items():
        print(f"beyond --{name} {limit:g}" if limit or getattr(args, name) is not None else "not the same")


def _print_json(figures: dict, beyond: dict[str, float]) -> None:
    import json

    from .report import plain

    print(json.dumps(plain({**figures, "beyond": list(beyond)}), indent=2))


def _write_difference(path: str, pair: Pair) -> None:
    """A − B as it is in EXR; else its size over the largest, with alpha 1."""
    from pathlib import Path

    import numpy as np

    from .. import images
    from ..study.metrics import difference

    gap = difference(pair.first, pair.second)
    if Path(path).suffix.lower() in images.LAYERED_FORMATS:
        images.write(path, {"color": gap.astype(np.float32)})
        return
    size = np.abs(gap[..., :3])
    largest = size[np.isfinite(size)].max(initial=0.0)
    size = np.minimum(size / (largest or 1.0), 1.0)
    size = np.broadcast_to(size, (*size.shape[:2], 3)) if size.shape[2] == 1 else size
    if size.shape[2] == 2:
        size = np.concatenate([size, np.zeros_like(size[..., :1])], axis=2)
    images.write(path, {"color": size.astype(np.float32)})
