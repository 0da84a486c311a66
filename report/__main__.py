"""Command line: `python -m report DIRECTORY`.

Exit codes: 0 for a written report, 2 for runs that cannot be used, 1 where a file cannot be read or written, 130 after
Ctrl-C.
"""

from __future__ import annotations

import argparse
import sys

from common.tables import InputError


def main(argv: list[str] | None = None) -> int:
    directory = _parser().parse_args(argv).directory
    try:
        return _report(directory)
    except KeyboardInterrupt:
        print("report: interrupted; no file is half written", file=sys.stderr)
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m report", description="Write report.html and claims.csv into a directory of runs."
    )
    parser.add_argument("directory", help="directory of runs ratio_*")
    return parser


def _report(directory: str) -> int:
    from report.page import write_report  # late: it takes seconds to import, and --help does not need it
    from report.results.missing import MISSING_RESULT

    try:
        print(f"report written to {write_report(directory)}")
    except (InputError, *MISSING_RESULT) as error:
        print(f"report: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"report: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
