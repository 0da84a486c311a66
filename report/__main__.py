"""Command line: `python -m report DIRECTORY`.

Exit codes: 0 for a written report, 2 for runs that cannot be used, 1 where a file cannot be read or written, 130 after
Ctrl-C.
"""

from __future__ import annotations

import argparse
import sys

from common.command import Parser, listen_for_interrupt, run_command, say

if __name__ == "__main__":
    listen_for_interrupt()

from common.tables import InputError


def main(argv: list[str] | None = None) -> int:
    """Run a command line and return its exit code."""
    return run_command("report", lambda: _report(_parser().parse_args(argv).directory))


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m report", description="Write report.html and claims.csv into a directory of runs.")
    parser.add_argument("directory", help="directory of runs ratio_*")
    return parser


def _report(directory: str) -> int:
    from report.page import write_report  # late: it takes seconds to import, and --help does not need it
    from report.results.missing import MISSING_RESULT

    try:
        print(f"report written to {write_report(directory)}")
    except (InputError, *MISSING_RESULT) as error:
        say(f"report: {error}")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
