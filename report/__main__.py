"""Command line: `python -m report DIRECTORY`."""

from __future__ import annotations

import argparse
import sys

from analysis import RecordError
from recognition.estimation.errors import RecognitionError


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m report", description="Write report.html into a directory of runs.")
    parser.add_argument("directory", help="directory of runs ratio_*")
    directory = parser.parse_args(argv).directory
    from report.page import write_report  # late: matplotlib is slow to import and --help does not need it

    try:
        print(f"report written to {write_report(directory)}")
    except (RecordError, RecognitionError) as error:
        print(f"report: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
