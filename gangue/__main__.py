"""Command line of everything: `gangue COMMAND`, or `python -m gangue COMMAND`."""

from __future__ import annotations

import argparse
import contextlib
import importlib
import json
import os
import sys
from collections.abc import Iterator
from typing import Any, cast

from common.command import Parser, listen_for_interrupt, run_command, say
from gangue.commands import COMMANDS, OWN, Command
from gangue.parsers import DESCRIPTION, PROGRAM, examples_of, parser_of

EXAMPLES = ("gangue doctor", "gangue run scenes/single.toml --out runs/single",
            "gangue sweep scenes/small.toml --out runs/small && gangue report runs/small", "gangue run --help")
GIVES_RESULT = (0, 3)  # exit codes; 3 is of a record that is out of distribution
SWITCHES = ("--quiet", "--json")  # may stand before or behind the command


def main(argv: list[str] | None = None) -> int:
    """Run a command line and return the exit code of its command; 2 for bad input."""
    if argv is None:
        listen_for_interrupt()
    words = list(sys.argv[1:] if argv is None else argv)
    return run_command(PROGRAM, lambda: _command(words))


def _command(words: list[str]) -> int:
    options = _top_parser().parse_args(words[:_start_of_command(words) + 1])
    rest = [word for word in words[_start_of_command(words) + 1:] if word not in SWITCHES]
    quiet, as_json = (getattr(options, switch[2:]) or switch in words for switch in SWITCHES)
    if options.command in OWN:
        module = importlib.import_module(f"{PROGRAM}.{options.command}")
        return cast(int, module.main(rest, as_json))
    command = COMMANDS[options.command]
    if {"-h", "--help"} & set(rest):
        print(parser_of(options.command, command).format_help(), end="")
        return 0
    with _level("WARNING" if quiet else None):
        return _carry_out(options.command, command, rest, quiet, as_json)


@contextlib.contextmanager
def _level(level: str | None) -> Iterator[None]:
    """Show messages from this level on, if one is given, also in the runs that are started from here."""
    from common.messages import LEVEL

    before = os.environ.get(LEVEL)
    if level is not None:
        os.environ[LEVEL] = level
    try:
        yield
    finally:
        os.environ.pop(LEVEL, None)
        os.environ |= {} if before is None else {LEVEL: before}


def _carry_out(name: str, command: Command, rest: list[str], quiet: bool, as_json: bool) -> int:
    """Hand the command to its package. Its words go nowhere if quiet; as JSON they make room for the result."""
    if as_json and not command.json:
        print(f"--json: {name} has no result but the files that it writes; allowed are "
              f"{', '.join(n for n, c in COMMANDS.items() if c.json)}, doctor", file=sys.stderr)
        return 2
    options = parser_of(name, command).parse_args(rest)
    words = [command.word, *rest] if command.word else rest
    line = importlib.import_module(f"{command.package}.__main__")
    aside = sys.stderr if as_json else sys.stdout
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere if quiet else aside):
        code = cast(int, line.main(words))
    if as_json and code in GIVES_RESULT:
        return _print_result(name, options, code)
    return code


def _print_result(name: str, options: argparse.Namespace, code: int) -> int:
    """Read again what the command wrote, which may be gone or damaged by now."""
    from common.tables import InputError
    from gangue.results import RESULTS

    try:
        found = RESULTS[name](options, code)
    except InputError as error:
        say(str(error))
        return 2
    print(json.dumps(found, indent=1, allow_nan=False))
    return code


def _start_of_command(words: list[str]) -> int:
    """Where the command stands among the words, the end where there is none."""
    return next((k for k, word in enumerate(words) if not word.startswith("-")), len(words))


def _top_parser() -> argparse.ArgumentParser:
    """Of what stands up to the command."""
    commands = {name: command.help for name, command in COMMANDS.items()} | OWN
    width = max(map(len, commands))
    epilog = "commands:\n" + "".join(f"  {name:<{width}}  {text}\n" for name, text in commands.items())
    parser = Parser(prog=PROGRAM, description=DESCRIPTION, epilog=epilog + examples_of(EXAMPLES),
                    formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--version", action=_Version, nargs=0, help="version of this program")
    parser.add_argument("--quiet", action="store_true", help="no output but errors and what goes wrong")
    parser.add_argument("--json", action="store_true", help="the result as JSON; words go to the error output")
    parser.add_argument("command", choices=list(commands), metavar="command",
                        help="see below; COMMAND --help tells more")
    return parser


class _Version(argparse.Action):
    """Print the version, which takes a while to look up and so is not looked up for anything else."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version

        print(f"{PROGRAM} {version('coal-gangue-impact')}")
        parser.exit()


if __name__ == "__main__":
    sys.exit(main())
