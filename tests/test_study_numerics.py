"""The table of hard cases: measured here, and ours on the right side of it."""

import json
import re

import pytest
from case_numbers import CASES

from warprender.cli import main
from warprender.study import numerics


def number(text):
    return float(re.search(r"\d[\d.]*(e[-+]?\d+)?", text).group())


def test_ours_is_better_in_every_case(tmp_path, capsys):
    assert main(["study", "--numerics", str(tmp_path / "table")]) == 0
    out = capsys.readouterr().out
    cases = json.loads((tmp_path / "table" / "numerics.json").read_text())
    assert (tmp_path / "table" / "numerics.md").read_text() == out
    page = (tmp_path / "table" / "numerics.html").read_text()
    assert "http" not in page and page.count("<tr>") == len(cases) + 2
    assert [case["number"] for case in cases if not case["measured"]] == list(CASES)
    cases = [case for case in cases if case["measured"]]
    assert len(cases) == len(numerics._CASES)
    for case in cases:
        plain, ours = number(case["plain"]) if "infinite" not in case["plain"] else 1e9, number(case["ours"])
        if case["number"] in ("I8", "S7"):
            assert ours > plain, case
        elif case["number"] == "A2":
            assert plain == ours == 0
        else:
            assert ours < plain, case
        if case["number"] == "I2":
            assert ours == 0
        if case["number"] in ("S1", "L1"):
            assert ours < 1e-5


def test_the_folder_is_needed_and_enough(capsys):
    for arguments in (["study", "a.usda"], ["study", "--numerics", "a.usda", "folder"]):
        with pytest.raises(SystemExit) as stopped:
            main(arguments)
        assert stopped.value.code == 2 and "FOLDER" in capsys.readouterr().err
