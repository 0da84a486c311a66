"""What the commands that write pages answer: `report` and `compare`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from common.result import Result


@dataclass(frozen=True)
class ReportResult(Result):
    """The page of a directory of runs."""

    line = "report written to {report}"
    report: Path


def report(directory: str) -> ReportResult:
    """Write the report of a run or of a directory of runs, see `report.page.write_report`."""
    from report.page import write_report  # late, as below: each takes seconds to import

    return ReportResult(write_report(directory))


@dataclass(frozen=True)
class ComparisonResult(Result):
    """The page of two runs or sweeps."""

    line = "comparison written to {page}"
    page: Path


def compare(a: Path, b: Path, out: Path | None = None) -> ComparisonResult:
    """Write the page of what differs between two runs or sweeps, see `report.comparison.page.write_comparison`."""
    from report.comparison.page import write_comparison

    return ComparisonResult(write_comparison(a, b, out))
