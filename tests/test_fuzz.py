"""Broken stages, half a minute of them; `python tests/fuzz_stages.py` goes on for ten."""

from fuzz_stages import fuzz, mutant


def test_mutants_follow_from_their_number():
    assert mutant(0, 7).ExportToString() == mutant(0, 7).ExportToString()
    assert len({mutant(0, k).ExportToString() for k in range(20)}) == 20


def test_broken_stages_neither_crash_nor_hang_nor_give_nan():
    drawn, failures = fuzz(seed=0, first=0, seconds=25.0)
    assert not failures, "\n".join(failures)
    assert drawn > 0
