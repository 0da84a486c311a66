"""Errors that end a command, apart from the checks that raise them, which take long to import."""

import stat
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

MOST_DEEP, MOST_BITS = 32, 2000  # tables within tables; of a whole number, six hundred digits


class CommandError(Exception):
    """What ends a command without a result. The message is one line, whatever names it repeats; `exit_code` is that of
    the command."""

    exit_code = 1

    def __init__(self, message: str) -> None:
        super().__init__(printable(message))


class InputError(CommandError, ValueError):
    """Input that cannot be used; the message is one line naming file, key, value and what is allowed."""

    exit_code = 2


@contextmanager
def raised_as(kind: type[InputError]) -> Iterator[None]:
    """Within, input that cannot be used is refused by this kind of error."""
    try:
        yield
    except InputError as error:
        raise kind(str(error)) from None


def optional_library(name: str, use: str, package: str, kind: type[InputError]) -> Any:
    """Return a module of an optional package. Raises `kind`, which says for which use it is missing."""
    try:
        return import_module(name)
    except (ImportError, OSError):  # OSError: without a library in C that it needs
        raise kind(f"{use} needs the package {package} (pip install {package})") from None


def printable(text: str) -> str:
    """One line: names come from outside and may hold anything."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def refuse_unreadable(path: Path, most_bytes: float) -> None:
    """Raises InputError for what is there but no regular file, such as a device or a pipe, and for a file so large that
    it cannot be what is asked for."""
    try:
        found = path.stat()
    except (OSError, ValueError):
        return  # which opening it will say better
    if not stat.S_ISREG(found.st_mode) and not stat.S_ISDIR(found.st_mode):
        raise InputError(f"{path}: must be a regular file, not a device or a pipe")
    if found.st_size > most_bytes:
        raise InputError(f"{path}: {found.st_size / 1e6:.4g} MB; must have at most {most_bytes / 1e6:g} MB")


def refuse_monstrous(source: object, content: Any) -> None:
    """Raises InputError for tables and lists so deep within each other, or whole numbers so long, that what looks at
    them later would fail: they are legal in TOML and JSON."""
    values = [content]
    for _ in range(MOST_DEEP):
        kinds = set(map(type, values))  # of a million numbers in no time
        if int in kinds and any(type(value) is int and value.bit_length() > MOST_BITS for value in values):
            raise InputError(f"{source}: holds a number of more than {MOST_BITS * 3 // 10} digits")
        values = [inner for value in values if isinstance(value, (dict, list))
                  for inner in (value.values() if isinstance(value, dict) else value)] if kinds & {dict, list} else []
        if not values:
            return
    raise InputError(f"{source}: tables within tables, more than {MOST_DEEP} deep")
