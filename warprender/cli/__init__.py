"""The command line: one file a command.

A command's file offers `add_parser(commands)` and `run(args) -> exit code`. Warp, USD and NumPy are imported
inside `run`, so that help and usage errors come at once. Exit codes: 0 done, 1 an error, 2 wrong usage, 130
interrupted.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from typing import NoReturn

from .. import __version__
from . import check, compare, measure, plan, render, reproduce, study, warm
from .report import error, interrupted

#: The commands, in the order of the help. Adding one is one file and one entry.
COMMANDS = (render, plan, warm, check, compare, reproduce, study, measure)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line and return its exit code; bad input is one line on stderr.

    Called with arguments, from a program, it does not say that kernels are compiled.

    Raises:
        SystemExit: wrong usage (code 2) or --help (code 0), as argparse does.
    """
    args = build_parser().parse_args(argv)
    args.told = getattr(args, "told", False) and argv is None
    args.typed = list(sys.argv[1:] if argv is None else argv)
    try:
        return args.run(args)
    except KeyboardInterrupt:
        return interrupted("the picture under way is not saved")
    except (ValueError, OSError) as problem:
        return error(problem)


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line; subcommands inherit it."""

    def parse_known_args(
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Find an OUTPUT that comes after flags too: argparse takes one that may be left out as left out by then."""
        found, rest = super().parse_known_args(args, namespace)
        if getattr(found, "output", "") is None and rest and not rest[0].startswith("-"):
            found.output = rest.pop(0)
        if rest and self._subparsers is None:
            self.error(f"unrecognized arguments: {' '.join(rest)}{self._alike(rest[0])}")
        return found, rest

    def _alike(self, flag: str) -> str:
        """A hint at the flag that may be meant."""
        flags = {known.lower(): known for known in self._option_string_actions}
        found = get_close_matches(flag.split("=")[0].lower(), flags, 1, 0.75) if flag.startswith("--") else []
        return f" (is {flags[found[0]]} meant?)" if found else ""

    def error(self, message: str) -> NoReturn:
        """Leave with code 2, without the page of usage that would push the message out of sight."""
        self.exit(2, f"{self.prog}: error: {message}; see {self.prog} --help\n")


def build_parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    parser = Parser(
        prog="warprender",
        description="Render OpenUSD stages on the CPU and on CUDA; flags as usdrecord's.",
        epilog="warprender COMMAND --help explains a command's flags.",
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for command in COMMANDS:
        command.add_parser(commands)
    return parser
