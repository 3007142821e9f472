"""A progress bar with the time left, on a terminal alone."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from .report import remark

#: Called between passes with the share that is done, 0 to 1, and a callable that gives the frame so far.
Progress = Callable[[float, Callable], None]


def announce_compiling() -> None:
    """Say on a stderr that is no terminal, once, that kernels are compiled; a terminal has a bar that says so."""
    from ..launch import tell_of_compiling

    if not sys.stderr.isatty():
        tell_of_compiling(lambda: remark("compiling kernels for this stage, once: this takes up to a minute"))


@contextmanager
def progress_bar(title: str) -> Iterator[Progress | None]:
    """Show a bar while the body runs and yield what moves it; None where stderr is no terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    with steps_bar(title) as show:
        yield lambda done, frame_so_far: show(done, title)


@contextmanager
def steps_bar(title: str) -> Iterator[Callable[[float, str], None]]:
    """Show a bar while the body runs and yield `show(share done, words)`; it does nothing without a terminal."""
    if not sys.stderr.isatty():
        yield lambda done, words: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        # Until the first pass is through, loading and compiling give no share to count.
        task = bar.add_task(f"{title}: reading, compiling kernels that are new", total=None)

        def show(done: float, words: str) -> None:
            bar.update(task, total=1.0, completed=done, description=words)

        yield show
