"""The time left of runs whose speed changes, by a clock that is set."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dem.run.progress import Progress

#: Simulated and processor time of runs of scenes/single.toml, paper.toml (10 ms and whole), stream.toml (0.35 s),
#: polyhedra.toml and wide.toml (0.2 s), beside which the rule was chosen; and of listening.toml and sizes.toml (3 ms).
RECORDED = pd.read_csv(Path(__file__).parent / "data" / "progress.csv").groupby("run")
STREAM_s = [0.02632, 0.03389, 0.04668, 0.06454, 0.06728, 0.08266, 0.10264, 0.10422, 0.10761, 0.15236, 0.16182, 0.17732,
            0.19169, 0.20825, 0.29281]
LISTENING_s = [0.0939, 0.1065, 0.1278, 0.1302, 0.1576, 0.1621, 0.1731, 0.1756, 0.1878, 0.2181, 0.2211, 0.2237, 0.2293,
               0.2878, 0.3039, 0.3181, 0.3197, 0.3455, 0.3617, 0.3695, 0.3888, 0.3971, 0.4348, 0.4417, 0.4418, 0.4438,
               0.4465, 0.4505, 0.5005, 0.538]
RUNS = {"single": [0.0], "paper_10_ms": [0.0] * 10, "paper": [0.0] * 10, "stream": STREAM_s, "polyhedra": [0.0] * 10,
        "sizes": [0.0] * 8, "listening": LISTENING_s,
        "wide": [0.00084, 0.00192, 0.00216, 0.00253, 0.00323, 0.00347, 0.00375, 0.00392, 0.00469, 0.00498]}


@pytest.fixture
def progress_of(monkeypatch):
    """Progress that is shown to nobody."""
    def made(*args, **kwargs):
        found = Progress("run", *args, **kwargs)
        monkeypatch.setattr(found, "_shown", True)
        monkeypatch.setattr(found, "_write", lambda text: None)
        return found
    return made


@pytest.mark.parametrize("name", RUNS)
def test_the_time_left_is_between_the_least_and_the_most_after_a_fifth(progress_of, name):
    """At a fifth of the time of recorded runs, and for at least four fifths of the time that follows."""
    t_s, wall_s = RECORDED.get_group(name)[["t_s", "wall_s"]].to_numpy().T
    now = [0.0]
    progress = progress_of(t_s[-1], True, RUNS[name], clock=lambda: now[0])
    bounds_s = []
    for t, wall in zip(t_s, wall_s, strict=True):
        now[0] = 1000.0 + wall
        progress(t)
        bounds_s.append(progress.left_s())
    (least_s, most_s), left_s, share = np.transpose(bounds_s), wall_s[-1] - wall_s, wall_s / wall_s[-1]
    right = (least_s <= left_s) & (left_s <= most_s)
    assert right[np.searchsorted(share, 0.2)]
    later, weight = (share >= 0.2) & (share < 0.95), np.diff(share, append=1.0)
    assert weight[later & right].sum() > 0.8 * weight[later].sum()
    half = np.searchsorted(share, 0.5)
    assert 0.1 * left_s[half] < least_s[half] and most_s[half] < 30 * left_s[half]  # it says something


def test_until_a_stone_has_come_nobody_knows_how_long_stones_take(progress_of, monkeypatch):
    now, said = [0.0], []
    progress = progress_of(1.0, True, [0.5], clock=lambda: now[0])
    monkeypatch.setattr(progress, "_write", said.append)
    for t_s in np.linspace(0.0, 0.45, 10):
        now[0] = t_s
        progress(t_s)
    assert said and all(" left over " in line for line in said)
    assert progress.left_s()[1] == np.inf


def test_a_run_that_was_taken_up_again_does_not_count_what_was_done(progress_of):
    """Of 0.5 to 1 s a half has passed at the speed of 5."""
    now = [0.0]
    progress = progress_of(1.0, True, [], clock=lambda: now[0])
    for t_s in np.linspace(0.5, 0.75, 50):
        now[0] = 5.0 * (t_s - 0.5)
        progress(t_s)
    least_s, most_s = progress.left_s()
    assert least_s == pytest.approx(0.25 * 5.0 * 0.5 / 2, rel=0.02) and most_s == pytest.approx(0.25 * 5.0 * 2.5, rel=0.02)
