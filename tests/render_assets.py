"""Render every stage below a folder and put the pictures beside their references on one page. Run by hand:

    python tests/render_assets.py OUTPUT [--assets ../shared/usd_assets] [--only TEXT] [--width 160] [--samples 8]

OUTPUT gets a PNG for each view, index.html and results.json. The exit code is 1 if a stage crashed the process, hung,
raised anything but `SceneError`, or gave numbers that are not finite.
"""

from __future__ import annotations

import argparse
import html
import json
import multiprocessing
import os
import sys
import time
import traceback
from collections import Counter
from dataclasses import asdict, dataclass, field
from pathlib import Path

from asset_views import View, find_views

#: Outcomes that make the run a failure.
BAD = ("crash", "hang", "exception", "not finite")
HERE = Path(__file__).resolve().parent


@dataclass
class Result:
    """What became of a view: `outcome` is drawn, refused (a clean SceneError) or one of `BAD`."""

    outcome: str
    seconds: float = 0.0
    message: str = ""
    picture: str = ""
    dropped: int = 0
    lit: float = 0.0
    warnings: list[str] = field(default_factory=list)


def main() -> int:
    """Draw, report, and answer whether all went well."""
    args = _arguments()
    args.output.mkdir(parents=True, exist_ok=True)
    views = [v for v in find_views(args.assets) if args.only in v.stage]
    if not views:
        sys.exit(f"{args.assets}: no stages here")
    results = []
    with Worker(args) as worker:
        for number, view in enumerate(views):
            result = worker.draw(view)
            results.append(result)
            print(f"{number + 1}/{len(views)} {result.outcome:10} {result.seconds:6.1f} s  {view.name}", flush=True)
    _write_page(args, views, results)
    _write_json(args.output / "results.json", views, results)
    return _summary(views, results)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output", type=Path)
    parser.add_argument("--assets", type=Path, default=HERE.parents[1] / "shared" / "usd_assets")
    parser.add_argument("--only", default="", help="stages whose path holds this text")
    parser.add_argument("--width", type=int, default=160)
    parser.add_argument("--samples", type=int, default=8)
    parser.add_argument("--limit", type=float, default=120.0, help="seconds for one stage")
    return parser.parse_args()


class Worker:
    """A process that draws one view after another; a new one takes over after a crash or a hang."""

    def __init__(self, args: argparse.Namespace) -> None:
        self._args = args
        self._context = multiprocessing.get_context("spawn")
        self._process = None

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_) -> None:
        self._stop()

    def draw(self, view: View) -> Result:
        """Draw one view within the time limit."""
        if self._process is None:
            self._start()
        start = time.perf_counter()
        self._pipe.send(view)
        result = Result("hang", message=f"more than {self._args.limit:g} s")
        try:
            if self._pipe.poll(self._args.limit):
                result = self._pipe.recv()
        except EOFError:
            self._process.join()
            result = Result("crash", message=f"exit code {self._process.exitcode}")
        if result.outcome in ("crash", "hang"):
            self._stop()
        result.seconds = time.perf_counter() - start
        return result

    def _start(self) -> None:
        self._pipe, other = self._context.Pipe()
        self._process = self._context.Process(target=_work, args=(other, self._args), daemon=True)
        self._process.start()
        other.close()

    def _stop(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process = None


def _work(pipe: object, args: argparse.Namespace) -> None:
    """The worker's loop."""
    os.environ.setdefault("PYTHONFAULTHANDLER", "1")
    import warp as wp

    wp.config.log_level = wp.LOG_WARNING
    while True:
        view = pipe.recv()
        try:
            result = _draw(view, args)
        except Exception:
            result = Result("exception", message=traceback.format_exc())
        pipe.send(result)


def _draw(view: View, args: argparse.Namespace) -> Result:
    import numpy as np

    import warprender as wr

    try:
        scene = wr.load(args.assets / view.stage, time=view.time, complexity=view.complexity)
        camera = view.camera or (next(iter(scene.cameras), None) if view.first_camera else None)
        renderer = wr.Renderer(scene, camera=camera, resolution=_resolution(view, args))
        frame = renderer.render(samples=args.samples)
    except wr.SceneError as error:
        return Result("refused", message=str(error))
    path = args.output / f"{view.name}.png"
    frame.save(path)
    color = frame.numpy("color")
    return Result(
        "drawn" if np.isfinite(color).all() else "not finite",
        picture=path.name,
        dropped=int(frame.stats["dropped samples"]),
        lit=float((color[..., 3] > 0).mean()),
        warnings=list(frame.stats["warnings"]),
    )


def _resolution(view: View, args: argparse.Namespace) -> tuple[int, int]:
    """The width asked for, by the first reference's aspect ratio."""
    if not view.references:
        return args.width, round(args.width * 3 / 4)
    import OpenImageIO as oiio

    spec = oiio.ImageInput.open(str(args.assets / view.references[0])).spec()
    return args.width, max(1, round(args.width * spec.height / spec.width))


def _write_json(path: Path, views: list[View], results: list[Result]) -> None:
    rows = [asdict(view) | asdict(result) for view, result in zip(views, results, strict=True)]
    path.write_text(json.dumps(rows, indent=1))


def _write_page(args: argparse.Namespace, views: list[View], results: list[Result]) -> None:
    """One section for each view: our picture, the references, and what was said."""
    style = "body{font:14px sans-serif;background:#777;color:#fff} img{width:320px;background:#555} .bad{color:#fa0}"
    parts = [f"<!doctype html><meta charset=utf-8><title>Assets</title><style>{style}</style>"]
    for view, result in zip(views, results, strict=True):
        parts.append(f"<h3 class={'bad' if result.outcome in BAD else 'good'}>{html.escape(view.name)}</h3>")
        parts.append(f"<p>{result.outcome}, {result.seconds:.1f} s. {html.escape(view.remark)}</p>")
        pictures = [args.output / result.picture] if result.picture else []
        pictures += [args.assets / reference for reference in view.references]
        for picture in pictures:
            source = html.escape(os.path.relpath(picture.resolve(), args.output.resolve()))
            parts.append(f'<img src="{source}" title="{source}">')
        lines = [*filter(None, [result.message]), *result.warnings]
        parts.append("".join(f"<pre>{html.escape(line)}</pre>" for line in lines))
    (args.output / "index.html").write_text("\n".join(parts))


def _summary(views: list[View], results: list[Result]) -> int:
    counts = Counter(result.outcome for result in results)
    for view, result in zip(views, results, strict=True):
        last = result.message.strip().splitlines()[-1:] or [""]
        if result.outcome != "drawn" or result.dropped or len(result.warnings) > 10:
            about = f"{result.dropped} dropped, {len(result.warnings)} warnings"
            print(f"{result.outcome:10} {result.seconds:6.1f} s  {view.name}: {last[0] or about}")
    print(", ".join(f"{count} {outcome}" for outcome, count in counts.most_common()))
    return int(any(counts[outcome] for outcome in BAD))


if __name__ == "__main__":
    sys.exit(main())
