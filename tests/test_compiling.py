"""Whoever waits for a compiler is told, once, and nobody where Warp's cache has the kernel."""

import pytest
import warp as wp

from warprender.cli import main, progress, render
from warprender.launch import is_compiled, launch, tell_of_compiling


@wp.kernel(module="unique", enable_backward=False)
def numbered(first: wp.int32, numbers: wp.array(dtype=wp.int32)):
    numbers[first + wp.tid()] = first + wp.tid()


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    wp.init()
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))


def test_a_kernel_that_is_not_cached_is_announced_once(empty_cache):
    told = []
    tell_of_compiling(lambda: told.append("compiling"))
    cpu, numbers = wp.get_device("cpu"), wp.zeros(5, dtype=wp.int32, device="cpu")
    assert not is_compiled(numbered, cpu)
    launch(numbered, 5, [numbers], "cpu")
    assert told == ["compiling"] and is_compiled(numbered, cpu)
    tell_of_compiling(lambda: told.append("again"))
    launch(numbered, 5, [numbers], "cpu")
    tell_of_compiling(None)
    assert told == ["compiling"] and numbers.numpy().tolist() == [0, 1, 2, 3, 4]


def test_the_line(capsys, empty_cache):
    progress.announce_compiling()
    launch(numbered, 0, [], "cpu")
    assert capsys.readouterr().err == ""
    # Loaded already, and not in this cache.
    launch(numbered, 1, [wp.zeros(1, dtype=wp.int32, device="cpu")], "cpu")
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("warprender: compiling kernels for this stage, once")


@pytest.mark.parametrize(("argv", "quiet"), [(None, False), (None, True), (["called"], False)])
def test_who_is_told(argv, quiet, monkeypatch):
    """The program is, unless --quiet is set; a program that calls `main` is not."""
    given = ["render", "a.usda", "b.png", *(["--quiet"] if quiet else [])]
    monkeypatch.setattr("sys.argv", ["warprender", *given])
    seen = []
    monkeypatch.setattr(render, "run", lambda args: seen.append(args.told) or 0)
    assert main(argv and given) == 0
    assert seen == [argv is None and not quiet]
