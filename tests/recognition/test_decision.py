"""The test of when to stop drawing, against sums over drawn stones."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from recognition.estimation.errors import RecognitionError
from recognition.innovations.prior import StonePrior
from recognition.stone_forces.forces import load_forces
from recognition.stream.decision import FIRST, LATER_S, NEVER, Judge, Stop, follow, foreseen, mean_stones
from recognition.stream.stone_law import UNKNOWN, LearntLaw, doubted
from tests.recognition.test_stone_law import fallen, told_of

PRIOR = StonePrior(load_forces(), (0.025, 0.025), (2.0, 4.0))
STOP = Stop(0.4, 1.0)


@pytest.mark.parametrize(("share", "threshold"), [(0.2, 2.0), (0.4, 3.0)])
def test_mean_time_to_an_alarm_is_that_of_sums(share, threshold):
    rng = np.random.default_rng(1)
    coal, gangue = rng.normal(-0.2, 0.1, 150), rng.normal(0.5, 0.2, 150)
    counts = []
    for _ in range(400):
        total, stones = 0.0, 0
        while total <= threshold:
            total = max(0.0, total + rng.choice(gangue if rng.random() < share else coal))
            stones += 1
        counts.append(stones)
    found = mean_stones(np.r_[coal, gangue], np.repeat([1 - share, share], 150) / 150, threshold)
    assert found == pytest.approx(np.mean(counts), abs=3 * np.std(counts) / 20 + 0.02 * found)


def test_what_hardly_ever_alarms_has_a_mean_time_of_its_own():
    """Four of five stones take away what the fifth gives: the linear system alone would give any number, or none below
    zero."""
    for threshold in (5.0, 16.0):
        assert mean_stones(np.array([-0.5, 0.05]), np.array([0.8, 0.2]), threshold) == NEVER
    assert mean_stones(np.array([-0.5]), np.array([1.0]), 1.0) == NEVER  # of coal alone


def drawing(coal_first, shares, seed):
    """Stones whose share of gangue follows a list, after known coal."""
    rng = np.random.default_rng(seed)
    gangue = np.r_[np.zeros(coal_first), rng.random(len(shares)) < shares] > 0
    known = np.r_[np.zeros(coal_first, int), np.full(len(shares), UNKNOWN)]
    return told_of(fallen(gangue, rng), known)


@pytest.mark.slow
def test_an_alarm_comes_soon_after_the_share_is_passed():
    """A share of 10 % that becomes 60 % after 60 stones."""
    shares = np.r_[np.full(60, 0.1), np.full(60, 0.6)]
    found = follow(told := drawing(30, shares, 1), np.arange(len(told.x)) / 20, PRIOR, STOP, 0.005)
    alarms = np.flatnonzero(found.alarm)
    assert not found.foreseen.unsafe and found.foreseen.false_alarms_1_h <= 1.0
    assert 60 < alarms[0] < 60 + found.foreseen.delay
    assert len(found.sum) == 120 and found.sum[alarms[0] + 1] < 1.0  # begins anew


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 4])
def test_too_few_known_stones_are_unsafe(seed):
    """Coal alone that one does not know may be gangue: no threshold is safe, and there is no alarm."""
    rng = np.random.default_rng(seed)
    found = follow(told_of(fallen(np.zeros(40) > 0, rng)), np.arange(40) / 20, PRIOR, STOP, 0.005)
    assert found.foreseen.unsafe and not found.alarm.any()


@pytest.mark.slow
def test_what_is_foreseen_is_that_of_known_stones():
    """Coal that is said to be known and of which every other stone is gangue: no law has such coal, yet it would alarm."""
    rng = np.random.default_rng(6)
    told = told_of(fallen(np.arange(80) % 2 == 1, rng), np.r_[np.zeros(80, int)])
    law = LearntLaw.of(drawing(60, np.full(60, 0.3), 4), PRIOR)
    found = foreseen(law, told, STOP, 20.0, 0.005)
    assert found.unsafe and found.false_alarms_1_h > 1


@pytest.mark.slow
def test_fewer_false_alarms_come_later():
    told = drawing(30, np.full(30, 0.3), 4)
    law = LearntLaw.of(told, PRIOR)
    often, rarely = (foreseen(law, told, Stop(0.4, n), 20.0, 0.005) for n in (10.0, 0.1))
    assert often.threshold < rarely.threshold and often.delay < rarely.delay
    assert 0.05 <= rarely.false_alarms_1_h <= 0.1 and often.false_alarms_1_h > 5
    rates = []
    for k in range(0, len(law.laws), 3):
        gains = [STOP.gain(doubted(law.materials(law.drawn(k, m, 150, told))[0], 0.005).mean(axis=1)) for m in (0, 1)]
        rates.append(72_000 / mean_stones(np.r_[tuple(gains)], np.repeat([0.8, 0.2], 150) / 150, often.threshold))
    assert 0.6 <= np.mean(np.array(rates) < 11.0)  # of most laws, drawn anew


@dataclass(frozen=True)
class PlainLaw:
    """Stones are their probability of gangue: of coal 0.1."""

    of_gangue: float
    believed: float
    laws = np.zeros((1, 1))

    def apart_as_believed(self):
        return replace(self, of_gangue=self.believed)

    def probabilities(self, told, least_doubt):
        return told.x[:, :1], np.zeros(len(told.x))

    def drawn(self, number, material, count, told):
        return told_of(np.full((count, 3), (0.1, self.of_gangue)[material]))


@pytest.mark.slow
@pytest.mark.parametrize(("learnt", "believed"), [(0.6, 0.9), (0.9, 0.6)])
def test_false_alarms_are_those_of_the_gangue_that_alarms_more(learnt, believed):
    """Learnt or believed; delays are those of the learnt one."""
    def mean(gangue, share):
        return mean_stones(STOP.gain(np.array([0.1, gangue])), np.array([1 - share, share]), found.threshold)

    found = foreseen(PlainLaw(learnt, believed), told_of(np.zeros((0, 3))), STOP, 20.0, 0.005)
    assert 0.9 < 72_000 / mean(0.9, 0.2) < 1.0
    assert found.false_alarms_1_h == pytest.approx(72_000 / mean(0.9, 0.2)) and found.delay == pytest.approx(mean(learnt, 0.4))


@pytest.mark.parametrize(("above", "false"), [(0.0, 1.0), (1.0, 1.0), (np.nan, 1.0), (0.4, 0.0), (0.4, np.inf)])
def test_what_is_asked_must_make_sense(above, false):
    with pytest.raises(RecognitionError, match="must be from"):
        Stop(above, false)


@pytest.mark.slow
def test_stones_that_come_in_pieces_are_judged_alike():
    """A law that is learnt beside judges those that come LATER_S after the stones that taught it, however fast it was."""
    told, t_s = drawing(0, np.full(110, 0.3), 5), np.arange(110) / 20
    whole = list(Judge(told.only(np.arange(0)), PRIOR, None, 0.005).judge(told, t_s, ended=True))
    judge = Judge(told.only(np.arange(0)), PRIOR, None, 0.005)
    parts = [one for k in range(0, 110, 7) for one in judge.judge(told.only(np.arange(k, min(k + 7, 110))), t_s[k:k + 7])]
    for name in ("by_law", "none"):
        same = [np.concatenate([getattr(one, name) for one in found]) for found in (parts, whole)]
        assert same[0] == pytest.approx(same[1], rel=1e-9)
    first = next(k for k, one in enumerate(whole) if one.by is not whole[0].by)
    assert t_s[sum(len(one.none) for one in whole[:first])] == pytest.approx(t_s[FIRST - 1] + LATER_S)


@pytest.mark.slow
def test_stones_after_a_pause_are_judged_by_the_law_that_all_before_it_taught():
    """A law is due as the pause ends, and had all of it to be learnt in."""
    told, before = drawing(0, np.full(80, 0.3), 6), 2 * FIRST + 10
    t_s = np.r_[np.arange(before) / 50, np.arange(80 - before) / 50 + before / 50 + 3 * LATER_S]
    found = list(Judge(told.only(np.arange(0)), PRIOR, None, 0.005).judge(told, t_s, ended=True))
    assert [len(one.none) for one in found] == [FIRST, before - FIRST, 80 - before]
    again = LearntLaw.of(told.only(np.arange(before)), PRIOR, found[-1].by.rate_1_s)
    assert found[-1].by_law == pytest.approx(again.probabilities(told.only(np.arange(before, 80)), 0.005)[0], rel=1e-9)
