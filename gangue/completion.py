"""`gangue completion SHELL`: a script that completes commands, options and files, by shtab (extra `completion`)."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from common.command import Parser
from gangue.commands import COMMANDS, OWN
from gangue.parsers import DESCRIPTION, PROGRAM, parser_of

SHELLS = ("bash", "zsh", "tcsh")
EXAMPLES = """examples:
  gangue completion bash > ~/.local/share/bash-completion/completions/gangue
  gangue completion zsh > ~/.zfunc/_gangue
"""


def main(arguments: list[str], _as_json: bool) -> int:
    """Print the script."""
    parser = Parser(prog="gangue completion", description="Completion of commands for a shell.", epilog=EXAMPLES,
                    formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shell", choices=SHELLS, help="the shell")
    shell = parser.parse_args(arguments).shell
    try:
        import shtab
    except ImportError:
        print("completion: needs the package shtab (pip install shtab)", file=sys.stderr)
        return 2
    print(shtab.complete(whole_parser(shtab.FILE), shell))
    return 0


def whole_parser(of_files: Any) -> argparse.ArgumentParser:
    """One parser with every command and its options; where a value is not one of a few, files complete it."""
    parser = argparse.ArgumentParser(prog=PROGRAM, description=DESCRIPTION)
    parser.add_argument("--version", action="store_true", help="version of this program")
    parser.add_argument("--quiet", action="store_true", help="no output but errors")
    parser.add_argument("--json", action="store_true", help="the result as JSON")
    commands = parser.add_subparsers()
    for name, command in COMMANDS.items():
        inner = parser_of(name, command)
        sub = commands.add_parser(name, parents=[inner], add_help=False, help=command.help)
        for action in sub._actions:
            if action.nargs != 0 and not action.choices:
                action.complete = of_files  # type: ignore[attr-defined]  # shtab's way
    for name, text in OWN.items():
        commands.add_parser(name, help=text)
    return parser
