"""The examples run as they stand, small; each ends in assertions of its own."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parent.parent / "examples").glob("*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example(example, tmp_path):
    out = tmp_path / ("picture.exr" if example.stem == "build_scene" else "picture.png")
    command = [sys.executable, str(example), "--samples", "2", "--width", "32", "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=os.environ)
    assert done.returncode == 0, done.stderr
    if "skipped, because" in done.stdout:
        pytest.skip(done.stdout.strip().splitlines()[-1])
    assert out.stat().st_size > 0
