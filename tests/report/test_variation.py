"""Breakage over stones, and a sweep beside draws of stones that vary."""

import json

import numpy as np
import pytest

from analysis import read_run, read_sweep
from report.missing import MissingResult
from report.sweep_results import SweepResults
from report.variation import one_stone, varying
from tests.analysis.synthetic import BROKEN_BONDS, write_run, write_sweep

RATIOS = (0.0, 0.2, 0.5, 0.8, 1.0)


@pytest.fixture
def paper(tmp_path):
    return write_sweep(tmp_path / "paper", ratios=RATIOS)


def row(table, name):
    header, rows = table
    return dict(zip(header, next(cells for cells in rows if cells[0].startswith(name)), strict=True))


def test_one_stone_is_shown_over_all_stones_with_its_deviation_and_resolution(paper):
    for k, run in enumerate(sorted(paper.iterdir())):
        info = json.loads((run / "run.json").read_text())
        (run / "run.json").write_text(json.dumps(info | {"fragment_size_over_subsphere": [3.0 - 0.1 * k] * 9 + [None]}))
    found = row(one_stone(SweepResults(read_sweep(paper))), "coal")
    assert found["stones"] == str(sum(10 - round(10 * r) for r in RATIOS))
    assert float(found["crack area, cm²"].split(" ± ")[0]) == pytest.approx(1e4 * 3e-6 * BROKEN_BONDS["coal"], rel=5e-3)
    assert found["crack area, cm²"].endswith("± 0") or float(found["crack area, cm²"].split(" ± ")[1]) < 1e-10
    assert found["fragment size over sub-sphere, least"] == "2.7"  # of the run of 80 %: that of 100 % has no coal


def test_a_sweep_stands_beside_draws_with_their_mean_deviation_and_rank(paper):
    results = SweepResults(read_sweep(paper))
    with pytest.raises(MissingResult, match="no runs in natural beside this directory; `make natural`"):
        varying(results)
    peaks = []
    for draw in range(3):
        for ratio in RATIOS:
            group = paper.parent / "natural" / "natural" / f"{draw:03d}"
            run = write_run(group / f"ratio_{round(100 * ratio):03d}", ratio, seed=50 + draw, scatter=0.3)
            if ratio == 0.5:
                peaks.append(1e-3 * read_run(run).peak("force_N"))
    table = varying(results)
    found = row(table, "peak total force")
    assert table[0][2] == "50%: 3 draws" and table[0][4] == "Spearman: 15 runs"
    assert found["50%: 3 draws"] == f"{np.mean(peaks):.3g} ± {np.std(peaks, ddof=1):.2g}"
    assert float(found["Spearman with the ratio: this sweep"]) == pytest.approx(1.0)
    coal = row(table, "crack area of one coal")
    assert float(coal["50%: this sweep"]) == pytest.approx(1e4 * 3e-6 * BROKEN_BONDS["coal"], rel=5e-3)
