"""`gangue completion SHELL`: a script that completes commands, options and files, by shtab."""

from __future__ import annotations

from dataclasses import dataclass

from common.result import Result
from gangue.parser import PROGRAM, commands_of, parser_of


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
