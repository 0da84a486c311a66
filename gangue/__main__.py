"""The command line: `gangue COMMAND`, and `python -m PACKAGE COMMAND` for the commands of a package.

A command line is parsed, one function is called, and its result is printed, as words or as JSON.
"""

import contextlib
import json
import os
import sys
from collections.abc import Callable, Iterator
from functools import partial

from common.process.command import imports, listen_for_interrupt, run_command
from common.process.messages import show_messages, told
from gangue.commands import COMMANDS, PROGRAM, parser_of


def main(argv: list[str] | None = None, package: str = "") -> int:
    """Run a command line and return its exit code; `package`: one of the commands of that package.

    >>> main(["--quiet", "features", "runs/paper/ratio_030"])
    0
    """
    if argv is None:
        listen_for_interrupt()
    words = list(sys.argv[1:] if argv is None else argv)
    if package == "report" and next((word for word in words if not word.startswith("-")), "") != "compare":
        words = ["report", *words]  # python -m report DIRECTORY
    as_json = any(word.startswith("--js") for word in words)  # known before the words are
    return run_command(package or PROGRAM, lambda: _command(words, package), as_json)


def door(package: str) -> Callable[..., int]:
    """`main` of the commands of a package, for its `python -m`."""
    return partial(main, package=package)


def _command(words: list[str], package: str) -> int:
    given, unknown = parser_of(package).parse_known_args(words)
    options = vars(given)
    command, parser, quiet, as_json = (options.pop(name) for name in ("command", "parser", "quiet", "json"))
    if unknown:
        parser.error(f"unrecognized arguments: {' '.join(unknown)}")
    show_messages(quiet)
    with _output_aside(quiet) if quiet or as_json else contextlib.nullcontext():
        starts = f"{command} starts" if sys.stderr.isatty() else ""  # which takes seconds on a busy machine
        with imports(), told(starts):  # also for the runs of a sweep, which are copies of this process
            function = COMMANDS[command].load()
        result = function(**options)
    if as_json:
        print(json.dumps(result.as_json(), indent=1, allow_nan=False))
    elif not quiet or result.exit_code:
        for line in result.words():
            print(line)
    return result.exit_code


@contextlib.contextmanager
def _output_aside(quiet: bool) -> Iterator[None]:
    """Within, what is printed, by the programs that are started as well, goes to the error output, or nowhere if
    quiet."""
    sys.stdout.flush()
    kept = os.dup(1)
    try:
        with (open(os.devnull, "w", errors="backslashreplace") as nowhere,
              contextlib.redirect_stdout(nowhere if quiet else sys.stderr)):
            os.dup2(nowhere.fileno() if quiet else 2, 1)
            yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


if __name__ == "__main__":
    sys.exit(main())
