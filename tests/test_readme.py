"""What the README states of the package, held against it."""

import re
from pathlib import Path

import warp as wp

from warprender.cli import build_parser
from warprender.outputs import FILM_OUTPUTS, OUTPUTS

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
TYPES = {wp.float32: "float32", wp.int32: "int32", wp.vec3: "3 × float32"}


def test_the_table_of_outputs_is_complete():
    for name, output in OUTPUTS.items():
        clear = f"{output.clear:g}".replace("-", "−")
        assert f"| `{name}` | {TYPES[output.dtype]} | {clear} |" in README, name


def test_the_table_has_what_the_samples_tell():
    for name, dtype in FILM_OUTPUTS.items():
        assert f"| `{name}` | {TYPES[dtype]} |" in README, name


def test_the_flags_exist_and_all_are_there():
    commands = next(action.choices for action in build_parser()._actions if action.choices)
    known = {flag for command in commands.values() for flag in command._option_string_actions}
    shown = set(re.findall(r"--[A-Za-z]+", README)) - {"--help"}
    assert shown <= known
    assert {flag for flag in known if flag.startswith("--")} - shown <= {"--help", "--disableGpu", "--renderer"}


def test_ci_runs_the_commands_of_the_readme():
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert 'python -m pip install -e ".[test]"' in README
    assert 'python -m pip install --quiet --disable-pip-version-check -e ".[test]"' in script
    assert README.count("python -m pytest") == 1 and "\npython -m pytest\n" in script


def test_links_lead_somewhere():
    for target in re.findall(r'(?:\]\(|src=")([^)"#]+)', README + (ROOT / "CONTRIBUTING.md").read_text("utf-8")):
        assert target.startswith("https://") or (ROOT / target).exists(), target
