"""`python -m report`: one line and an exit code for every end."""

import re

import pandas as pd
import pytest

import report.page
from report.__main__ import main
from tests.analysis.synthetic import write_sweep


def ends_with(capsys, code, argument):
    assert main([str(argument)]) == code
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1
    return captured.err


def test_unusable_runs(tmp_path, capsys):
    assert "no such directory" in ends_with(capsys, 2, tmp_path / "none")
    assert "no finished run" in ends_with(capsys, 2, tmp_path)


@pytest.mark.slow
def test_a_sweep_of_streams_has_no_forces_by_stone(tmp_path, capsys):
    """Nor has it the same stone at place 3 of every run; the figure of those is left out."""
    sweep = write_sweep(tmp_path / "sweep", ratios=(0.0, 0.5, 1.0))
    for file in sweep.glob("*/*.parquet"):
        table = pd.read_parquet(file)
        table[[name for name in table if not re.fullmatch(r"force_\d+_N", name)]].to_parquet(file)
    assert main([str(sweep)]) == 0
    assert "no force_03_N" in (sweep / "report.html").read_text()


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (PermissionError(13, "Permission denied", "report.html"), 1, "Permission denied"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
)
def test_ends_without_a_traceback(monkeypatch, capsys, error, code, line):
    def fails(directory):
        raise error

    monkeypatch.setattr(report.page, "report", fails)
    assert line in ends_with(capsys, code, "runs")
