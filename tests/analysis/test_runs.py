import json
from dataclasses import replace

import numpy as np
import pytest

from analysis import RecordError, read_run, read_sweep
from tests.analysis.synthetic import write_run, write_sweep


@pytest.fixture(scope="module")
def sweep_path(tmp_path_factory):
    return write_sweep(tmp_path_factory.mktemp("sweep"), ratios=(0.5, 0.0, 1.0))


def test_runs_come_in_order_with_what_is_missing(sweep_path):
    sweep = read_sweep(sweep_path)
    assert sweep.ratios.tolist() == [0.0, 0.5, 1.0]
    assert sweep.missing == [0.1, 0.2, 0.3, 0.4, 0.6, 0.7, 0.8, 0.9]
    assert sweep.stack("total_J").shape == (3, 267)
    assert sweep.runs[1].materials.count("gangue") == 5


def test_runs_compare_by_what_they_hold(sweep_path):
    sweep, again = read_sweep(sweep_path), read_sweep(sweep_path)
    assert sweep == again and again.runs.index(read_run(sweep_path / "ratio_050")) == 1
    again.runs[1] = replace(sweep.runs[1], signals=sweep.runs[1].signals + 1.0)
    assert sweep != again and sweep.runs[0] != sweep.runs[1]


def test_peaks_come_from_the_fast_stream(sweep_path):
    run = read_sweep(sweep_path).runs[0]
    assert run.peak("force_N") == pytest.approx(10 * 2812.0, rel=1e-3)
    assert np.abs(run.record("force_N").values).max() < run.peak("force_N")


def test_breakage_is_in_order_of_time(sweep_path):
    table = read_sweep(sweep_path).runs[0].breakage
    assert len(table) == 900 and np.all(np.diff(table["t_s"]) >= 0)


def test_unfinished_and_broken_runs_are_passed_over_by_name(tmp_path):
    write_sweep(tmp_path, ratios=(0.0, 1.0))
    (tmp_path / "ratio_050").mkdir()
    info = json.loads((tmp_path / "ratio_100" / "run.json").read_text())
    (tmp_path / "ratio_100" / "run.json").write_text(json.dumps(info | {"status": "running"}))
    sweep = read_sweep(tmp_path)
    assert sweep.ratios.tolist() == [0.0]
    assert len(sweep.passed_over) == 2 and "running" in sweep.passed_over[1]


def test_errors_name_the_file(tmp_path):
    with pytest.raises(RecordError, match="no finished run"):
        read_sweep(tmp_path)
    run = write_run(tmp_path / "ratio_000", 0.0)
    (run / "signals.parquet").write_bytes(b"broken")
    with pytest.raises(RecordError, match="signals.parquet") as error:
        read_run(run)
    assert "\n" not in str(error.value)
