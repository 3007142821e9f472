"""--traceToFile: USD's own tracing of what it did."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def tracing(path: str | None, form: str) -> Iterator[None]:
    """Trace what USD does in the body into the file `path`, as "chrome" or "trace"; nothing where it is None.

    Raises:
        ValueError: the file cannot be written.
    """
    if not path:
        yield
        return
    from pxr import Tf, Trace

    collector = Trace.Collector()
    collector.enabled = True
    try:
        yield
    finally:
        collector.enabled = False
    reporter = Trace.Reporter.globalReporter
    try:
        with open(path, "w", encoding="utf-8"):
            pass
        (reporter.ReportChromeTracingToFile if form == "chrome" else reporter.Report)(path)
    except (OSError, Tf.ErrorException) as problem:
        raise ValueError(f"{path}: the trace cannot be written: {problem}") from None
