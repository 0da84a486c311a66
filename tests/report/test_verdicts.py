"""The rules that give a verdict."""

from types import SimpleNamespace

import numpy as np
import pytest

from analysis import RecordError
from report.missing import MissingResult
from report.sweep_results import SweepResults
from report.verdicts import (
    HELD,
    NOT_HELD,
    NOT_TESTED,
    PARTLY,
    Statement,
    check_statements,
    claims_csv,
    graded,
    held_if_all,
    trend,
)

RATIOS = np.arange(11) / 10


class SweepOfNumbers:
    """All that a trend needs of the results of a sweep."""

    ratios = RATIOS


SHUFFLED = RATIOS[[2, 0, 5, 1, 4, 9, 3, 7, 6, 10, 8]]


@pytest.mark.parametrize(
    ("values", "direction", "verdict"),
    [(RATIOS, 1, HELD), (-RATIOS, 1, NOT_HELD), (-RATIOS, -1, HELD), (SHUFFLED, 1, PARTLY)],
)
def test_trend_verdicts(values, direction, verdict):
    assert trend(lambda results: values, direction)(SweepOfNumbers())[0] == verdict


def test_graded_works_in_both_directions():
    assert [graded(v, 2.0, 1.0) for v in (3, 1.5, 0.5)] == [HELD, PARTLY, NOT_HELD]
    assert [graded(v, 0.1, 0.3) for v in (0.05, 0.2, 0.5)] == [HELD, PARTLY, NOT_HELD]


def test_all_some_or_none_of_several_parts():
    assert [held_if_all(parts) for parts in ([True, True], [True, False], [False, False])] == [HELD, PARTLY, NOT_HELD]


def test_what_cannot_be_tested_says_why_and_goes_into_the_table():
    def fails(results):
        raise MissingResult("no such run")

    claims = check_statements(SweepOfNumbers(), [Statement("A, with comma", "Fig. 1", "fig-1", "x", fails)])
    assert claims[0].verdict == NOT_TESTED
    assert claims_csv(claims).splitlines() == [
        "claim,where,verdict,value,expected",
        '"A, with comma",Fig. 1,not tested,no such run,x',
    ]


def test_a_missing_value_is_not_a_trend():
    values = RATIOS.copy()
    values[3] = np.nan
    with pytest.raises(MissingResult, match="every run"):
        trend(lambda results: values)(SweepOfNumbers())


@pytest.mark.parametrize("at_3", [[], ["coal"]])
def test_runs_without_a_place_3_or_always_with_coal_there_are_told_so(at_3):
    runs = [SimpleNamespace(materials=["coal", "gangue", *at_3])] * 2
    with pytest.raises(RecordError, match="no run has coal at place 3, or none gangue"):
        SweepResults.indices_coal_gangue_at_3(SimpleNamespace(runs=runs, sweep=SimpleNamespace(path="x")))
