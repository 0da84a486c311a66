"""Command line: `python -m report DIRECTORY`, `python -m report compare A B`.

Exit codes: 0 for a written report, 2 for runs that cannot be used, 1 where a file cannot be read or written, 130 after
Ctrl-C.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from common.command import Parser, imports, listen_for_interrupt, run_command, say

if __name__ == "__main__":
    listen_for_interrupt()


def main(argv: list[str] | None = None) -> int:
    """Run a command line and return its exit code."""
    arguments = sys.argv[1:] if argv is None else argv
    if arguments[:1] == ["compare"]:
        return run_command("report compare", lambda: _compare(_compare_parser().parse_args(arguments[1:])))
    return run_command("report", lambda: _report(_parser().parse_args(arguments).directory))


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m report", description="Write report.html and claims.csv into a directory of runs; "
                    "`python -m report compare A B` puts two runs or sweeps side by side.")
    parser.add_argument("directory", help="directory of runs ratio_*")
    return parser


def _compare_parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m report compare",
                    description="Write a page of what differs between two runs or two sweeps.")
    parser.add_argument("a", type=Path, metavar="A", help="run directory, or directory of runs ratio_*")
    parser.add_argument("b", type=Path, metavar="B", help="another one of the same kind")
    parser.add_argument("--out", type=Path, help="the page (default: compare_A_B.html beside B)")
    return parser


def _report(directory: str) -> int:
    with imports():  # late: they take seconds, and --help needs none
        from common.tables import InputError
        from report.page import write_report
        from report.results.missing import MISSING_RESULT
    try:
        print(f"report written to {write_report(directory)}")
    except (InputError, *MISSING_RESULT) as error:
        say(f"report: {error}")
        return 2
    return 0


def _compare(options: argparse.Namespace) -> int:
    from analysis import RecordError
    from common.tables import InputError
    from report.compare_page import write_comparison  # late, as above

    try:
        page = write_comparison(options.a, options.b, options.out)
    except (InputError, RecordError, OSError) as error:
        say(f"report: {error}")
        return 1 if isinstance(error, OSError) else 2
    print(f"comparison written to {page}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
