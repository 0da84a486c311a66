"""The parser of the command line, made of the table of commands, and the script by which shells complete it."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import Any

from common.process.command import Parser
from common.result import Result
from gangue.commands import COMMANDS

PROGRAM = "gangue"
DESCRIPTION = "Coal and gangue on a steel plate: simulate impacts, analyse records, recognise the mixing ratio."
EXAMPLES = ("gangue doctor", "gangue run scenes/single.toml --out runs/single",
            "gangue sweep scenes/small.toml --out runs/small && gangue report runs/small", "gangue run --help")
EXIT_CODES = """
exit codes:
  0 a result     1 failed             2 bad input, refused in one line
  3 a record without an answer to be trusted        75 stopped at a checkpoint        130 interrupted
"""
JSON_HELP = ("the result as JSON, which says all that the words would; what is told meanwhile goes to the error "
             'output. A command without a result gives {"error": the line that says why, "exit_code": its exit code}')


def parser_of(package: str = "") -> argparse.ArgumentParser:
    """The parser of all commands, or of those of a package."""
    program = f"python -m {package}" if package else PROGRAM
    parser = Parser(prog=program, description=DESCRIPTION, epilog=_examples(EXAMPLES) + EXIT_CODES,
                    formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--version", action=_Version, nargs=0, default=argparse.SUPPRESS,
                        help="version of this program")
    _add_output(parser, False, JSON_HELP)
    commands = parser.add_subparsers(dest="command", required=True, metavar="command", title="commands")
    for name, command in COMMANDS.items():
        if package in ("", command.package):
            sub = commands.add_parser(name, prog=program if package == name else f"{program} {name}", help=command.help,
                                      description=command.help, epilog=_examples(command.examples),
                                      formatter_class=argparse.RawDescriptionHelpFormatter)
            for names, settings in command.arguments:
                sub.add_argument(*names, **settings)
            _add_output(sub, argparse.SUPPRESS, "the result as JSON")  # leaves what was said before the command
            sub.set_defaults(parser=sub)
    return parser


def commands_of(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """The parser of each command by its name."""
    return next(action.choices for action in parser._actions if isinstance(action, argparse._SubParsersAction))


def _add_output(parser: argparse.ArgumentParser, unsaid: Any, help_of_json: str) -> None:
    """What may stand before or behind the command."""
    parser.add_argument("--quiet", action="store_true", default=unsaid, help="no output but errors and what goes wrong")
    parser.add_argument("--json", action="store_true", default=unsaid, help=help_of_json)


def _examples(lines: tuple[str, ...]) -> str:
    return "examples:\n" + "".join(f"  {line}\n" for line in lines)


class _Version(argparse.Action):
    """Print the version, which takes a while to look up and so is not looked up for anything else."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version

        print(f"{PROGRAM} {version('coal-gangue-impact')}")
        parser.exit()


@dataclass(frozen=True)
class CompletionResult(Result):
    """The script for a shell."""

    line = "{script}"
    shell: str
    script: str


def completion(shell: str) -> CompletionResult:
    """Write the script. Where a value is not one of a few, files complete it."""
    import shtab  # late: no other command needs it

    parser = parser_of()
    for sub in commands_of(parser).values():
        for action in sub._actions:
            if action.nargs != 0 and not action.choices:
                action.complete = shtab.FILE  # type: ignore[attr-defined]  # shtab's way
    return CompletionResult(shell, shtab.complete(parser, shell, root_prefix=PROGRAM))
