"""`python -m lab list`, and `python -m lab run NAME ... [--out DIR] [--jobs N] [OPTION=VALUE ...]`.

Results are written to lab/results, and what they are made of to runs/lab. With --out both are written there, and a case
may be given options, which are those of its function `rows`.
"""

from __future__ import annotations

import argparse
import inspect
import os
import tempfile
from pathlib import Path
from typing import Any
from unittest.mock import patch

from lab.cases import CASES, Case
from lab.results import RESULTS, ROOT, hash_of, read_result, write_result
from lab.study import made


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m lab", description="Run what proves the product.")
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("list", help="cases, what each varies, against what, and of when its result is")
    run = commands.add_parser("run", help="run cases")
    run.add_argument("words", nargs="+", metavar="NAME | OPTION=VALUE", help="as `list` names them")
    run.add_argument("--out", type=Path, help="directory for the results (default: lab/results)")
    run.add_argument("--jobs", type=int, default=1, help="processes side by side; for what measures no time")
    given = parser.parse_args(argv)
    if given.command == "list":
        for case in CASES.values():
            print(f"{case.name:24} {age(case):28} {case.varies}; against {case.against}")
        return 0
    names = [word for word in given.words if "=" not in word]
    options = dict(word.split("=", 1) for word in given.words if "=" in word)
    for name in names:
        if name not in CASES:
            parser.error(f"case {name!r}; choose among {', '.join(CASES)}")
        known = options_of(CASES[name])
        for option in options.keys() - known.keys():
            parser.error(f"option {option!r} of {name}; choose among {', '.join(known) or 'none'}")
    if options and given.out is None:
        parser.error("options need --out: lab/results has what the cases give without them")
    # MPI of engines that are started side by side must not share a directory.
    with tempfile.TemporaryDirectory() as own, patch.dict(os.environ, TMPDIR=own):
        return max(run_case(CASES[name], given.out, given.jobs, options) for name in names)


def options_of(case: Case) -> dict[str, Any]:
    """Options of a case and their defaults."""
    found = list(inspect.signature(case.load("rows")).parameters.values())[1:]
    return {one.name: one.default for one in found}


def run_case(case: Case, out: Path | None, jobs: int, options: dict[str, str]) -> int:
    """Make what is missing of a case, and write its result; 1 where a check of the case itself fails."""
    defaults = options_of(case)
    values = {name: _parsed(text, defaults[name]) for name, text in options.items()}
    work = out or ROOT / "runs" / "lab"
    work.mkdir(parents=True, exist_ok=True)
    of = "".join(f".{name}={text}" for name, text in sorted(options.items())).replace("/", "_")
    rows = made(case.load("rows")(work, **values), work / f"{case.name}.{hash_of(case.sources)}{of}.csv", jobs)
    table = case.load("table")(rows, work)
    words = " ".join(["python -m lab run", case.name, *(f"{name}={text}" for name, text in options.items())])
    write_result(table, (out or RESULTS) / f"{case.name}.csv", words, case.sources)
    print(table.to_string(index=False, float_format=lambda x: f"{x:.4g}"))
    return int(not case.load("holds")(rows))


def _parsed(text: str, default: Any) -> Any:
    """As the default is: words apart by commas for a tuple."""
    if isinstance(default, tuple):
        return tuple(_parsed(word, default[0]) for word in text.split(","))
    return default.__class__(text)


def age(case: Case) -> str:
    """Date of a result, and whether it is older than the code it speaks of."""
    file = RESULTS / f"{case.name}.csv"
    if not file.is_file():
        return "no result"
    head, _ = read_result(file)
    return head["date"] + ("" if head["sources"] == hash_of(case.sources) else ", older than its code")


if __name__ == "__main__":
    raise SystemExit(main())
