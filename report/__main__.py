"""Command line: `python -m report DIRECTORY`.

Exit codes: 0 for a written report, 2 for runs that cannot be used, 1 where a file cannot be read or written, 130 after
Ctrl-C.
"""

from __future__ import annotations

import argparse
import sys

from analysis import RecordError
from common.tables import InputError
from recognition.errors import RecognitionError


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m report", description="Write report.html and claims.csv into a directory of runs."
    )
    parser.add_argument("directory", help="directory of runs ratio_*")
    directory = parser.parse_args(argv).directory
    try:
        from report.page import write_report  # late: matplotlib is slow to import and --help does not need it

        print(f"report written to {write_report(directory)}")
    except (InputError, RecordError, RecognitionError) as error:
        print(f"report: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"report: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("report: interrupted; an earlier report stays as it was", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
