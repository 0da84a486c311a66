"""`python -m report compare A B`: what differs, and nothing else."""

import json
import re

import numpy as np
import pandas as pd
import pytest

from analysis import RecordError
from report.__main__ import main
from report.comparison import compared
from tests.analysis.synthetic import write_run, write_sweep


@pytest.fixture
def runs(tmp_path):
    return write_run(tmp_path / "first", 0.5), write_run(tmp_path / "second", 0.5)


def change(run, **keys):
    info = json.loads((run / "run.json").read_text())
    for key, value in keys.items():
        *tables, last = key.split("__")
        table = info
        for name in tables:
            table = table[name]
        table[last] = value
    (run / "run.json").write_text(json.dumps(info))


def change_signal(run, column, change):
    for name in ("signals", "fast"):
        table = pd.read_parquet(run / f"{name}.parquet")
        table[column] = change(table)
        table.to_parquet(run / f"{name}.parquet")


def test_a_run_and_its_copy_do_not_differ(runs):
    (pair,) = compared(*runs).pairs
    assert pair.scene_rows() == []
    assert all(row.difference == 0 for rows in pair.groups().values() for row in rows)
    assert all(pair.groups()[title] for title in ("Counts", "Peaks", "Energies"))
    assert [curve.percent_rms for curve in pair.curves()] == [0, 0, 0, 0]


def test_what_was_changed_is_found_by_key_and_size(runs):
    change(runs[1], scene__plate__thickness_m=0.03, peak_force_N=1000.0, energy={"plate": 3.0, "closure": 1e-5})
    change(runs[0], peak_force_N=800.0, energy={"plate": 2.0})
    (pair,) = compared(*runs).pairs
    (row,) = pair.scene_rows()
    assert (row.key, row.b) == ("plate.thickness_m", 0.03)
    assert (pair.number("peak_force_N").difference, pair.number("peak_force_N").percent) == (200.0, 25.0)
    energy = {row.key: row for row in pair.groups()["Energies"]}
    assert energy["energy.plate"].percent == 50.0
    closure = energy["energy.closure"]
    assert (closure.a, closure.b, closure.difference) == (None, 1e-5, None)


def test_curves_differ_by_what_was_added_to_one(runs):
    """A tenth more force everywhere; an acceleration with a tone of known root mean square added."""
    change_signal(runs[1], "force_N", lambda table: 1.1 * table["force_N"])
    change_signal(runs[1], "a_m_s2", lambda table: table["a_m_s2"] + 0.5)
    curves = compared(*runs).pairs[0].curves()
    assert [curve.percent_rms for curve in curves[:2]] == pytest.approx([10.0, 10.0])
    for curve in curves[2:]:
        assert curve.b - curve.a == pytest.approx(0.5)
        assert curve.percent_rms == pytest.approx(50 / np.sqrt(np.mean(curve.a**2)))
    assert curves[0].t_s[-1] <= 1e-3 < curves[1].t_s[-1]


@pytest.mark.parametrize("table", ["signals", "fast"])
def test_a_sample_that_is_no_number_is_named(runs, table):
    file = runs[1] / f"{table}.parquet"
    pd.read_parquet(file).assign(force_N=lambda t: t["force_N"].where(t.index != 7)).to_parquet(file)
    with pytest.raises(RecordError, match=rf"second/{table}\.parquet: force_N: sample 7 is nan"):
        compared(*runs).pairs[0].curves()


def test_rates_and_lengths_may_differ(runs):
    """Every other sample of the first half: a linear signal is the same at all common times."""
    change_signal(runs[0], "a_m_s2", lambda table: 3 * table["t_s"])
    change_signal(runs[1], "a_m_s2", lambda table: 3 * table["t_s"])
    table = pd.read_parquet(runs[1] / "signals.parquet")
    table.iloc[:len(table) // 2:2].to_parquet(runs[1] / "signals.parquet")
    curve = compared(*runs).pairs[0].curves()[3]
    assert curve.b == pytest.approx(curve.a, abs=1e-12)
    assert curve.t_s[-1] <= table["t_s"].iloc[len(table) // 2] < table["t_s"].iloc[-1]


def test_the_page_of_two_runs_stands_alone_and_says_what_differs(runs, capsys):
    change(runs[1], scene__plate__thickness_m=0.03)
    assert main(["compare", *map(str, runs)]) == 0
    page = runs[1].parent / "compare_first_second.html"
    assert capsys.readouterr().out == f"comparison written to {page}\n"
    html = page.read_text()
    assert not re.search(r'(?:src|href)="(?!data:)', html) and str(runs[0].parent) not in html
    assert "plate.thickness_m" in html and html.count("data:image/svg+xml") == 4
    assert "nan" not in re.sub(r'"data:[^"]*"', "", html)


@pytest.mark.slow
def test_sweeps_are_paired_by_ratio_and_the_rest_is_named(tmp_path, capsys):
    write_sweep(tmp_path / "old", ratios=(0.0, 0.2, 0.5))
    write_sweep(tmp_path / "new" / "paper", ratios=(0.2, 0.5, 0.8))
    (tmp_path / "new" / "paper" / "ratio_010").mkdir()
    out = tmp_path / "page.html"
    assert main(["compare", str(tmp_path / "old"), str(tmp_path / "new" / "paper"), "--out", str(out)]) == 0
    html = out.read_text()
    assert html.count("<details") == 2 and html.count("data:image/svg+xml") == 1 + 2 * 4
    assert "Only old has 0 %" in html and "Only paper has 80 %" in html
    assert "Passed over: ratio_010: no run.json" in html


@pytest.mark.parametrize("a, b, line", [
    ("first", "none", "none: no run.json, but"),
    ("none", "nothing", "none: no such directory"),
    ("empty", "sweep", "empty: no finished run"),
    ("sweep", "other", "no mixing ratio that both have"),
])
def test_what_cannot_be_compared_ends_in_one_line(tmp_path, capsys, a, b, line):
    write_run(tmp_path / "first", 0.5)
    (tmp_path / "empty").mkdir()
    write_sweep(tmp_path / "sweep", ratios=(0.2,))
    write_sweep(tmp_path / "other", ratios=(0.3,))
    assert main(["compare", str(tmp_path / a), str(tmp_path / b)]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1 and line in captured.err
    assert not list(tmp_path.glob("*.html"))


def test_runs_on_a_rigid_plate_are_compared_by_their_force(runs):
    for run in runs:
        change(run, scene__plate__thickness_m=None)
        for name in ("signals", "fast"):
            file = run / f"{name}.parquet"
            pd.read_parquet(file)[["t_s", "force_N"]].to_parquet(file)
    curves = compared(*runs).pairs[0].curves()
    assert [curve.title for curve in curves] == 2 * ["force on the plate, N"]


@pytest.mark.slow
def test_a_page_of_somebody_else_is_not_replaced(runs, capsys):
    page = runs[1].parent / "compare_first_second.html"
    page.write_text("mine")
    assert main(["compare", *map(str, runs)]) == 2
    assert "compare_first_second.html" in capsys.readouterr().err and page.read_text() == "mine"
    page.unlink()
    for _ in range(2):  # its own it replaces
        assert main(["compare", *map(str, runs)]) == 0


def test_a_page_that_cannot_be_written_ends_in_one_line(runs, capsys):
    assert main(["compare", *map(str, runs), "--out", str(runs[0] / "run.json" / "page.html")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
