"""Measure the BRDF of a material over the hemisphere, and write it as files of measured materials are."""

from __future__ import annotations

import argparse

from .arguments import add_device_arguments, add_stage_arguments


def add_parser(commands: argparse._SubParsersAction) -> None:
    """Add the command and its flags."""
    parser = commands.add_parser(
        "measure",
        usage="%(prog)s [FLAGS] STAGE MATERIAL OUTPUT.binary",
        help="measure a material's BRDF and write it in MERL's format",
        description=__doc__,
        allow_abbrev=False,
    )
    parser.add_argument("stage", metavar="STAGE", help="USD file")
    parser.add_argument("material", metavar="MATERIAL", help="prim path of a material that a drawn prim is bound to")
    parser.add_argument("output", metavar="OUTPUT.binary", help="file to write")
    add_stage_arguments(parser.add_argument_group("stage"))
    group = parser.add_argument_group("measurement")
    group.add_argument(
        "--cells",
        type=cells,
        default=(90, 90, 180),
        metavar="HxDxP",
        help="cells over θ_half, θ_diff and φ_diff (default: 90x90x180, MERL's; its tools read no other)",
    )
    group.add_argument(
        "--energyCompensation",
        action="store_true",
        help="give back the light that rough specular lobes lose, which UsdPreviewSurface does not",
    )
    add_device_arguments(parser.add_argument_group("device"))
    parser.set_defaults(run=run)


def cells(text: str) -> tuple[int, ...]:
    """Three numbers of cells of HxDxP."""
    numbers = text.split("x")
    if len(numbers) != 3 or not all(number.isdecimal() and int(number) > 0 for number in numbers):
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form 90x90x180")
    return tuple(map(int, numbers))


def run(args: argparse.Namespace) -> int:
    """Measure and write; prints the file, its cells and the albedo seen along the normal."""
    from ..gonioreflectometer import find_material, measure_brdf
    from .quiet import start_warp
    from .report import Warnings
    from .request import open_stage, remarks, times

    start_warp(args.device)
    warnings = Warnings()
    scene = open_stage(args).read(times(args)[0])
    warnings.show([*remarks(args), *scene.warnings])
    material = find_material(scene, args.material)
    table = measure_brdf(material, args.cells, args.energyCompensation, args.device, args.threads)
    table.write(args.output)
    warnings.show(f"{args.material}: {warning}" for warning in table.warnings)
    albedo = ", ".join(f"{share:.4f}" for share in table.albedos[0])
    print(f"{args.output}: {' x '.join(map(str, table.cells))} cells, albedo along the normal {albedo}")
    return 0
