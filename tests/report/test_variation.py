"""Breakage over stones, and a sweep beside draws of stones that vary."""

import io
import json
import shutil

import numpy as np
import pandas as pd
import pytest

from analysis import read_run, read_sweep
from report.breakage import BREAKAGE_FIGURES, BREAKAGE_STATEMENTS, broken_areas
from report.drawing.data import to_csv
from report.missing import MissingResult
from report.sweep_results import SweepResults
from report.variation import one_stone, varying
from report.verdicts import NOT_TESTED, check_statements
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
        (run / "run.json").write_text(json.dumps(info | {
            "fragment_size_over_subsphere": [3.0 - 0.1 * k] * 9 + [None], "speed_over_critical": [None] + [0.8] * 9}))
    found = row(one_stone.build(SweepResults(read_sweep(paper))), "coal")
    assert found["stones"] == str(sum(10 - round(10 * r) for r in RATIOS))
    assert float(found["crack area, cm²"].split(" ± ")[0]) == pytest.approx(1e4 * 3e-6 * BROKEN_BONDS["coal"], rel=5e-3)
    assert found["crack area, cm²"].endswith("± 0") or float(found["crack area, cm²"].split(" ± ")[1]) < 1e-10
    assert found["fragment size over sub-sphere"] == "2.7 to 3"  # to the run of 80 %: that of 100 % has no coal
    assert found["speed over critical speed"] == "0.8"


@pytest.mark.slow
def test_a_sweep_stands_beside_draws_with_their_mean_deviation_and_rank(paper):
    results = SweepResults(read_sweep(paper))
    with pytest.raises(MissingResult, match="no runs in natural beside this directory; `make natural`"):
        varying.build(results)
    peaks = []
    for draw in range(3):
        for ratio in RATIOS:
            group = paper.parent / "natural" / "natural" / f"{draw:03d}"
            run = write_run(group / f"ratio_{round(100 * ratio):03d}", ratio, seed=50 + draw, scatter=0.3)
            if ratio == 0.5:
                peaks.append(1e-3 * read_run(run).peak("force_N"))
    table = varying.build(results)
    found = row(table, "peak total force")
    assert table[0][2] == "50%: 3 draws" and table[0][4] == "Spearman: 15 runs"
    assert found["50%: 3 draws"] == f"{np.mean(peaks):.3g} ± {np.std(peaks, ddof=1):.2g}"
    assert float(found["Spearman with the ratio: this sweep"]) == pytest.approx(1.0)
    coal = row(table, "crack area of one coal")
    assert float(coal["50%: this sweep"]) == pytest.approx(1e4 * 3e-6 * BROKEN_BONDS["coal"], rel=5e-3)


@pytest.mark.slow
def test_breakage_of_one_draw_says_that_its_spread_is_not_known(paper):
    results = SweepResults(read_sweep(paper))
    for spec in BREAKAGE_FIGURES:
        assert spec.finished(results).caption.lower().endswith("one draw: no spread known.")
    claims = check_statements(results, BREAKAGE_STATEMENTS)
    assert all(claim.value.endswith("one draw: no spread known") for claim in claims if claim.verdict != NOT_TESTED)
    assert sum(claim.verdict != NOT_TESTED for claim in claims) >= 5


@pytest.mark.slow
def test_breakage_of_several_draws_has_their_deviation(paper):
    """Runs of other seeds in the directory: the second draw breaks half of the bonds of the first."""
    for run in sorted(paper.iterdir()):
        other = shutil.copytree(run, paper / f"{run.name}_b")
        info = json.loads((other / "run.json").read_text())
        (other / "run.json").write_text(json.dumps(info | {"seeds": [7]}))
        table = pd.read_parquet(other / "breakage.parquet")
        table.assign(area_m2=table["area_m2"] / 2).to_parquet(other / "breakage.parquet")
    results = SweepResults(read_sweep(paper))
    assert all(spec.finished(results).caption.endswith("2 draws a ratio.") for spec in BREAKAGE_FIGURES)
    table = pd.read_csv(io.StringIO(to_csv(broken_areas.drawn(results)[0])), comment="#")
    area = table[(table["panel"] == "crack area of one stone, cm²") & (table["x"] == 50)].set_index("series")["y"]
    first, second = (1e4 * 3e-6 * round(0.9 * BROKEN_BONDS["coal"]) * share for share in (1, 0.5))
    assert area["coal"] == pytest.approx((first + second) / 2, rel=1e-3)
    assert area["coal + sd"] - area["coal"] == pytest.approx((first - second) / np.sqrt(2), rel=1e-3)
    ratio, = (claim.value for claim in check_statements(results, BREAKAGE_STATEMENTS[:1]))
    error = (first - second) / 2 / np.sqrt(9)  # of ten coal, five of either draw
    mean, _, of_mean = ratio.split(": ")[1].split(" ")[:3]
    assert [float(mean), float(of_mean)] == pytest.approx([(first + second) / 2, error], rel=5e-3)
    assert ratio.endswith("2 draws a ratio")
