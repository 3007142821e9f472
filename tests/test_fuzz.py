"""Broken stages, half a minute of them; `python tests/fuzz_stages.py` goes on for ten."""

import pytest
from fuzz_stages import fuzz, mutant
from pxr import Sdf


def test_mutants_follow_from_their_number():
    assert mutant(0, 7).ExportToString() == mutant(0, 7).ExportToString()
    assert len({mutant(0, k).ExportToString() for k in range(20)}) == 20


@pytest.mark.parametrize("number", [199, 278, 569])
def test_relationships_are_given_targets_that_usd_takes(number):
    # These mutants aim a relationship elsewhere; USD refuses the root of all prims there with an exception.
    layer, aimed = mutant(0, number), []
    layer.Traverse(Sdf.Path.absoluteRootPath, lambda path: aimed.append(path) if path.IsTargetPath() else None)
    assert aimed and all(path.targetPath != Sdf.Path.absoluteRootPath for path in aimed)
    with pytest.raises(Exception, match="Sdf_ListEditor"):
        layer.GetRelationshipAtPath(aimed[0].GetParentPath()).targetPathList.explicitItems = [Sdf.Path("/")]


def test_broken_stages_neither_crash_nor_hang_nor_give_nan():
    drawn, failures = fuzz(seed=0, first=0, seconds=25.0)
    assert not failures, "\n".join(failures)
    assert drawn > 0
