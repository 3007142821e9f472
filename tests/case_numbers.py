"""Which cases of the catalogue of hard cases have a test that names them: `python tests/case_numbers.py` prints it.

A test names a case in its function's name (`test_I12_contact`) or in the id of its parameters (`I4-needles`).
"""

import ast
import re
from pathlib import Path

TESTS = Path(__file__).parent
#: Letter of a chapter to how many cases it has.
CHAPTERS = {"R": 12, "I": 21, "S": 10, "L": 7, "A": 8, "C": 9, "U": 8, "M": 7}
CASES = tuple(f"{letter}{n}" for letter, count in CHAPTERS.items() for n in range(1, count + 1))
#: Cases without a test of that number, and why.
ABSENT: dict[str, str] = {}
_IN_NAME = re.compile(r"(?:^|_)([RISLACUMrislacum]\d{1,2})(?=_|$)")
_IN_ID = re.compile(r"^([RISLACUM]\d{1,2})(?![\w.])")


def named_cases() -> dict[str, list[str]]:
    """Case to the files with tests that name it, in the order of the catalogue."""
    found = {}
    for file in sorted(TESTS.rglob("test_*.py")):
        if file.name != "test_case_numbers.py":
            for number in _numbers(ast.parse(file.read_text(encoding="utf-8"))):
                found.setdefault(number, set()).add(file.relative_to(TESTS).as_posix())
    return {case: sorted(found[case]) for case in CASES if case in found}


def _numbers(tree: ast.Module) -> set[str]:
    numbers = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            numbers.update(number.upper() for number in _IN_NAME.findall(node.name))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            numbers.update(_IN_ID.findall(node.value))
    return numbers


def table() -> str:
    """Markdown: each case with its tests, or the reason that there are none."""
    named = named_cases()
    lines = ["| case | tests |", "|---|---|"]
    for case in CASES:
        lines.append(f"| {case} | {', '.join(f'`{f}`' for f in named[case]) if case in named else ABSENT[case]} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(table(), end="")
