"""The time left of runs whose speed changes, by a clock that is set."""

import numpy as np
import pytest

from dem.run.progress import Progress

SLOW_s, DURATION_s = 2e-3, 0.6  # simulated


def run_of(impacts_s, flights_s, arrivals_s=(0.0,)):
    """Wall times over simulated times of a run that spends so much in the impacts of its stones and in flights."""
    t_s = np.unique(np.concatenate([np.linspace(0, DURATION_s, 3000),
                                    *(arrival + np.linspace(0, 2 * SLOW_s, 400) for arrival in arrivals_s)]))
    middle = (t_s[1:] + t_s[:-1]) / 2
    strikes = np.any([(middle > a) & (middle < a + SLOW_s) for a in arrivals_s], axis=0)
    steps = np.diff(t_s)
    speed = np.where(strikes, impacts_s / steps[strikes].sum(), flights_s / steps[~strikes].sum())
    return t_s, np.concatenate([[0.0], np.cumsum(speed * steps)])


@pytest.mark.parametrize("impacts_s, flights_s", [(144.0, 0.1), (100.0, 44.0), (72.0, 72.0), (55.0, 85.0), (5.0, 140.0)])
@pytest.mark.parametrize("arrivals_s", [(0.0,), tuple(np.linspace(0.01, 0.5, 30))], ids=["volley", "stream"])
def test_the_time_left_is_right_within_a_factor_of_two_after_a_fifth(monkeypatch, impacts_s, flights_s, arrivals_s):
    """Whatever share of the time the flights take; of a volley, whose flights come last, as long as it is early, and of
    a stream until nearly the end."""
    until = 0.25 if len(arrivals_s) == 1 else 0.95
    t_s, wall_s = run_of(impacts_s, flights_s, arrivals_s)
    now = [1000.0]
    progress = Progress("run", DURATION_s, True, arrivals_s, clock=lambda: now[0])
    monkeypatch.setattr(progress, "_shown", True)
    monkeypatch.setattr(progress, "_write", lambda text: None)
    total_s = wall_s[-1]
    for t, wall in zip(t_s, wall_s, strict=True):
        now[0] = 1000.0 + wall
        progress(t)
        left_s = progress.left_s(t)
        assert np.isfinite(left_s) and left_s >= 0
        if 0.2 * total_s <= wall <= until * total_s:
            assert 0.5 <= left_s / (total_s - wall) <= 2, (t, wall, left_s)


def test_a_run_that_was_taken_up_again_does_not_count_what_was_done(monkeypatch):
    now = [0.0]
    progress = Progress("run", 1.0, True, [], clock=lambda: now[0])
    monkeypatch.setattr(progress, "_shown", True)
    monkeypatch.setattr(progress, "_write", lambda text: None)
    for t_s in np.linspace(0.5, 0.75, 50):
        now[0] = 40 * (t_s - 0.5)
        progress(t_s)
    assert progress.left_s(0.75) == pytest.approx(10.0)
