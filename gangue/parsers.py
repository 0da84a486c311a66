"""Parsers of commands, taken from the packages that carry them out."""

from __future__ import annotations

import argparse
import importlib

from gangue.commands import Command

PROGRAM = "gangue"
DESCRIPTION = "Coal and gangue on a steel plate: simulate impacts, analyse records, recognise the mixing ratio."


def parser_of(name: str, command: Command) -> argparse.ArgumentParser:
    """The parser of a command, as its package has it, under the name that it has here."""
    line = importlib.import_module(f"{command.package}.__main__")
    parser: argparse.ArgumentParser = getattr(line, command.parser)()
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            parser = action.choices[command.word]
    parser.prog = f"{PROGRAM} {name}"
    parser.description = parser.description or command.help
    parser.epilog = examples_of(command.examples)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    return parser


def examples_of(lines: tuple[str, ...]) -> str:
    return "\nexamples:\n" + "".join(f"  {line}\n" for line in lines)
