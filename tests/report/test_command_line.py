"""`python -m report`: one line and an exit code for every end."""

import pytest

import report.page
from report.__main__ import main


def ends_with(capsys, code, argument):
    assert main([str(argument)]) == code
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1
    return captured.err


def test_unusable_runs(tmp_path, capsys):
    assert "no such directory" in ends_with(capsys, 2, tmp_path / "none")
    assert "no finished run" in ends_with(capsys, 2, tmp_path)


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

    monkeypatch.setattr(report.page, "write_report", fails)
    assert line in ends_with(capsys, code, "runs")
