"""What the commands say: results on stdout, everything else as single lines on stderr."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable


def error(problem: object) -> int:
    """One line on stderr, however many the exception has; returns the exit code of an error."""
    print(f"warprender: error: {_one_line(problem)}", file=sys.stderr)
    return 1


def interrupted(outcome: str) -> int:
    """Say what Ctrl-C left behind; returns the exit code that shells expect of it."""
    print(f"warprender: interrupted; {outcome}", file=sys.stderr)
    return 130


def remark(words: str) -> None:
    """What is going on, on stderr."""
    print(f"warprender: {words}", file=sys.stderr, flush=True)


class Warnings:
    """Prints each warning once, also when the frames of a range repeat it."""

    def __init__(self) -> None:
        self._seen: set[str] = set()

    def show(self, messages: Iterable[str]) -> None:
        """Print those messages that are new."""
        for message in map(_one_line, messages):
            if message not in self._seen:
                self._seen.add(message)
                print(f"warprender: warning: {message}", file=sys.stderr)


def write_stats(path: str, stage: str, frames: list[dict]) -> None:
    """Write {"stage": …, "frames": […]} as JSON.

    Raises:
        OSError: the file cannot be written.
    """
    with open(path, "w", encoding="utf-8") as file:
        json.dump(plain({"stage": stage, "frames": frames}), file, indent=2)
        file.write("\n")


def plain(value: object) -> object:
    """The value in JSON's types: NumPy's numbers and arrays unwrapped, and null for what is not finite."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, dict):
        return {str(key): plain(v) for key, v in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if isinstance(value, (str, int, float, type(None))) else str(value)


def _one_line(message: object) -> str:
    return " ".join(str(message).split()) or type(message).__name__
