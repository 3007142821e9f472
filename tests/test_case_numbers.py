"""Every hard case has a test that names it, or a reason; docs/numerics.md says which."""

from pathlib import Path

from case_numbers import ABSENT, CASES, named_cases, table

from warprender.study.numerics import _CASES as SHOWN


def test_every_case_has_a_test_or_a_reason():
    named = set(named_cases())
    assert len(CASES) == 82 and named | set(ABSENT) == set(CASES) and not named & set(ABSENT)


def test_the_table_of_the_documentation_is_this_one():
    page = (Path(__file__).parent.parent / "docs" / "numerics.md").read_text(encoding="utf-8")
    assert table() in page and len(SHOWN) >= 9
