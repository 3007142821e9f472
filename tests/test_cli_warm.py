"""`warprender warm`: what it compiles, a render with the same flags finds in the cache."""

import os
import subprocess
import sys
from pathlib import Path

BOX = str(Path(__file__).parent.parent / "scenes_usd" / "cornell_box.usda")
FLAGS = ["--resolution", "16x16", "--transport", "local", "--aov", "color,normal", "--threads", "1"]


def run(cache, *arguments):
    """Standard output of a command with a kernel cache of its own."""
    command = [sys.executable, "-m", "warprender", *arguments]
    environment = {**os.environ, "WARP_CACHE_PATH": str(cache)}
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout


def binaries(cache):
    return {path: path.stat().st_mtime_ns for path in cache.rglob("*.o")}


def test_a_render_after_it_compiles_nothing(tmp_path):
    cache = tmp_path / "cache"
    said = run(cache, "warm", *FLAGS, BOX)
    assert "outputs: normal, Mesh" in said and "DisplayColor, RectLight, perspective" in said
    warm = binaries(cache)
    assert len(warm) > 2
    run(cache, "render", *FLAGS, "--samples", "2", BOX, str(tmp_path / "box.exr"))
    assert binaries(cache) == warm
