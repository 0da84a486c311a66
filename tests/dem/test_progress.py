"""The time left of runs whose speed changes, by a clock that is set."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dem.run.progress import FLIGHT, Progress

#: Simulated and processor time of runs of scenes/single.toml, paper.toml (10 ms and whole), stream.toml (0.35 s), and
#: polyhedra.toml, by whose run no number was chosen.
RECORDED = pd.read_csv(Path(__file__).parent / "data" / "progress.csv").groupby("run")
STREAM_s = [0.02632, 0.03389, 0.04668, 0.06454, 0.06728, 0.08266, 0.10264, 0.10422, 0.10761, 0.15236, 0.16182, 0.17732,
            0.19169, 0.20825, 0.29281]
RUNS = {"single": ([0.0], 2.3e-4), "paper_10_ms": ([0.0] * 10, 2.2e-4), "paper": ([0.0] * 10, 2.2e-4),
        "stream": (STREAM_s, 9e-5), "polyhedra": ([0.0] * 10, 1.8e-4)}


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
def test_the_time_left_is_right_within_a_factor_of_two_after_a_fifth(progress_of, name):
    """At a fifth of the time of recorded runs, and for at least four fifths of the time that follows."""
    arrivals_s, contact_s = RUNS[name]
    t_s, wall_s = RECORDED.get_group(name)[["t_s", "wall_s"]].to_numpy().T
    now = [0.0]
    progress = progress_of(t_s[-1], True, arrivals_s, contact_s, clock=lambda: now[0])
    ratio = []
    for t, wall in zip(t_s, wall_s, strict=True):
        now[0] = 1000.0 + wall
        progress(t)
        ratio.append(progress.left_s() / max(wall_s[-1] - wall, 1e-9))
    right, share = (np.array(ratio) > 0.5) & (np.array(ratio) < 2), wall_s / wall_s[-1]
    assert right[np.searchsorted(share, 0.2)]
    later, weight = (share >= 0.2) & (share < 0.95), np.diff(share, append=1.0)
    assert weight[later & right].sum() > 0.8 * weight[later].sum()


def test_a_run_that_was_taken_up_again_does_not_count_what_was_done(progress_of):
    now = [0.0]
    progress = progress_of(1.0, True, [], clock=lambda: now[0])
    for t_s in np.linspace(0.5, 0.75, 50):
        now[0] = FLIGHT * (t_s - 0.5)
        progress(t_s)
    assert progress.left_s() == pytest.approx(0.25 * FLIGHT)
