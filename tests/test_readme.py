"""What the README and the pages in docs/ state of the package, held against it."""

import re
from pathlib import Path

import pytest
import warp as wp

import warprender as wr
from warprender.cli import build_parser
from warprender.outputs import FILM_OUTPUTS, OUTPUTS

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
OUTPUT_TABLE = (ROOT / "docs" / "outputs.md").read_text(encoding="utf-8")
#: What the programs in examples/ and tests/benchmarks/ take besides.
EXAMPLES_FLAGS = {"--out", "--width", "--time", "--processor"}
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
TYPES = {wp.float32: "float32", wp.int32: "int32", wp.vec3: "3 × float32"}


def test_the_table_of_outputs_is_complete():
    for name, output in OUTPUTS.items():
        clear = f"{output.clear:g}".replace("-", "−")
        assert f"| `{name}` | {TYPES[output.dtype]} | {clear} |" in OUTPUT_TABLE, name
        assert f"`{name}`" in README, name


def test_the_table_has_what_the_samples_tell():
    for name, dtype in FILM_OUTPUTS.items():
        assert f"| `{name}` | {TYPES[dtype]} |" in OUTPUT_TABLE, name
        assert f"`{name}`" in README, name


def test_the_flags_exist_and_all_are_there():
    commands = next(action.choices for action in build_parser()._actions if action.choices)
    known = {flag for command in commands.values() for flag in command._option_string_actions}
    pages = {page: set(re.findall(r"--[A-Za-z]+", page.read_text("utf-8"))) for page in PAGES[2:]}
    pages[README] = set(re.findall(r"--[A-Za-z]+", README))
    assert set().union(*pages.values()) - EXAMPLES_FLAGS <= known
    explained = pages[README] | pages[ROOT / "docs" / "command_line.md"]
    assert {flag for flag in known if flag.startswith("--")} - explained <= {"--help", "--disableGpu", "--renderer"}


def test_the_loop_runs_as_it_stands(monkeypatch, tmp_path):
    (tmp_path / "scenes_usd").symlink_to(ROOT / "scenes_usd")
    monkeypatch.chdir(tmp_path)
    loop = re.search(r"```python\n(.*?)```", README, re.DOTALL)[1]
    short = loop.replace("range(24)", "range(2)").replace("(160, 160)", "(32, 32)")
    assert short.count("(2)") == 1 and short.count("(32, 32)") == 1
    names = {}
    exec(short, names)
    assert names["frame"].numpy("cameraDepth").shape == (32, 32) and (tmp_path / "risen.png").exists()


def test_ci_runs_the_commands_of_the_readme():
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert 'python -m pip install -e ".[test]"' in README
    assert 'python -m pip install --quiet --disable-pip-version-check -e ".[test]"' in script
    assert README.count("python -m pytest") == 1 and "\npython -m pytest\n" in script


def anchors(page):
    """What GitHub makes of a page's headings."""
    headings = re.findall(r"^#+ (.*)$", page.read_text("utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for target, anchor in re.findall(r'(?:\]\(|src=")([^)"#]*)#?([^)"]*)', page.read_text("utf-8")):
        if target.startswith("https://"):
            continue
        place = (page.parent / target) if target else page
        assert place.exists(), target
        assert not anchor or anchor in anchors(place), f"{target}#{anchor}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_named_tests_exist(page):
    for cell in re.split(r"[|\n]", page.read_text("utf-8")):
        file = None
        for named, test in re.findall(r"`(tests/[\w/]+\.py)?::(\w+)`", cell):
            file = named or file
            assert re.search(rf"^def {test}\(", (ROOT / file).read_text("utf-8"), re.MULTILINE), f"{file}::{test}"


def test_the_commands_of_the_gallery_are_taken():
    pages = README + (ROOT / "docs" / "lecture.md").read_text("utf-8")
    commands = re.findall(r"`warprender (render scenes_usd/[^`]+)`", pages)
    assert len(commands) > 12
    for command in commands:
        args = build_parser().parse_args(command.split())
        assert (ROOT / args.stage).exists() and args.output
    for example in re.findall(r"`python (examples/\w+\.py)", pages):
        assert (ROOT / example).exists(), example


def test_pictures_are_small_and_each_is_shown():
    pictures = sorted((ROOT / "docs").glob("*.png"))
    sizes = [picture.stat().st_size for picture in pictures]
    assert max(sizes) < 60_000 and sum(sizes) < 600_000
    shown = "".join(page.read_text("utf-8") for page in PAGES)
    assert all(picture.name in shown for picture in pictures)


def test_help_leads_to_every_public_name():
    for name in wr.__all__:
        assert re.search(rf"\b{name}\b", wr.__doc__), name
        # A dataclass without a docstring shows its signature.
        text = getattr(wr, name).__doc__
        assert text and not text.startswith(f"{name}("), name
        assert "Attributes:" in text or "Args:" in text or name in ("CameraLight", "SceneError", "StageReader"), name
