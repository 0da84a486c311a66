"""Command line of everything: `gangue COMMAND`, or `python -m gangue COMMAND`."""

from __future__ import annotations

import argparse
import contextlib
import importlib
import json
import os
import sys
from typing import Any, cast

from gangue.commands import COMMANDS, OWN, Command

PROGRAM = "gangue"
DESCRIPTION = "Coal and gangue on a steel plate: simulate impacts, analyse records, recognise the mixing ratio."
EXAMPLES = ("gangue doctor", "gangue run scenes/single.toml --out runs/single",
            "gangue sweep scenes/small.toml --out runs/small && gangue report runs/small", "gangue run --help")
SWITCHES = ("--quiet", "--json")  # may stand before or behind the command


def main(argv: list[str] | None = None) -> int:
    """Run a command line and return the exit code of its command; 2 for bad input."""
    words = list(sys.argv[1:] if argv is None else argv)
    options = _top_parser().parse_args(words[:_start_of_command(words) + 1])
    rest = [word for word in words[_start_of_command(words) + 1:] if word not in SWITCHES]
    quiet, as_json = (getattr(options, switch[2:]) or switch in words for switch in SWITCHES)
    if quiet:
        from common.messages import LEVEL

        os.environ[LEVEL] = "WARNING"  # of the runs that are started from here too
    if options.command in OWN:
        module = importlib.import_module(f"{PROGRAM}.{options.command}")
        return cast(int, module.main(rest, as_json))
    command = COMMANDS[options.command]
    if {"-h", "--help"} & set(rest):
        print(parser_of(options.command, command).format_help(), end="")
        return 0
    return _carry_out(options.command, command, rest, quiet, as_json)


def _carry_out(name: str, command: Command, rest: list[str], quiet: bool, as_json: bool) -> int:
    """Hand the command to its package. Its words go nowhere if quiet; as JSON they make room for the result."""
    if as_json and not command.json:
        print(f"--json: {name} has no result but the files that it writes; allowed are "
              f"{', '.join(n for n, c in COMMANDS.items() if c.json)}, doctor", file=sys.stderr)
        return 2
    words = [command.word, *rest] if command.word else rest
    line = importlib.import_module(f"{command.package}.__main__")
    if not as_json:
        with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere if quiet else sys.stdout):
            return cast(int, line.main(words))
    from gangue.results import RESULTS, result_of_call

    if name in RESULTS:  # of the files that the command leaves
        with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere if quiet else sys.stderr):
            code = cast(int, line.main(words))
        found: Any = RESULTS[name](line._parser().parse_args(words)) if code == 0 else None
    else:
        code, found = result_of_call(name, line._parser().parse_args(words))
    if found is not None:
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
    parser = argparse.ArgumentParser(prog=PROGRAM, description=DESCRIPTION, epilog=epilog + _examples(EXAMPLES),
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


def parser_of(name: str, command: Command) -> argparse.ArgumentParser:
    """The parser of a command, as its package has it, under the name that it has here."""
    parser: argparse.ArgumentParser = importlib.import_module(f"{command.package}.__main__")._parser()
    if command.word:
        (commands,) = (a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
        parser = commands.choices[command.word]
    parser.prog = f"{PROGRAM} {name}"
    parser.description = parser.description or command.help
    parser.epilog = _examples(command.examples)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    return parser


def _examples(lines: tuple[str, ...]) -> str:
    return "\nexamples:\n" + "".join(f"  {line}\n" for line in lines)


if __name__ == "__main__":
    sys.exit(main())
