"""What a command may write to: a new directory or file, or one that this program wrote itself.

A directory that this program wrote says so in `contents.json`: its kind, and for a directory that is replaced as a
whole the files in it. Nothing that is not in that list is ever deleted.
"""

from __future__ import annotations

import fcntl
import os
import re
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from common.files import read_json, write_json
from common.tables import InputError

CONTENTS = "contents.json"
WRITER = "coal-gangue-impact"
GENERATOR = f'name="generator" content="{WRITER}"'  # by which the templates of pages say who wrote them
LOCK = ".lock"
# What directories of earlier versions, which have no contents.json, are known by.
RUNS_IN = {"sweep": "ratio_*/run.json", "campaign": "*/ratio_*/run.json", "dataset": "*/*/ratio_*/run.json"}


class Busy(RuntimeError):
    """Another process is at work in this directory."""


def refuse_place(out: Path) -> None:
    """Raises InputError for a path that cannot become a directory of results: the working directory or one above it, a
    file, a symbolic link, or a path without a last name."""
    real, here = Path(os.path.realpath(out)), Path.cwd()
    if real == here or real in here.parents:
        raise InputError(f"--out = {out}: must not be the working directory or one above it")
    if out.name in ("", ".."):
        raise InputError(f"--out = {out}: must end in the name of a directory")
    if ".." in out.parts and not out.parent.is_dir():
        raise InputError(f"--out = {out}: there is no directory {out.parent}")
    if out.is_symlink():
        raise InputError(f"--out = {out}: is a symbolic link; must be a directory or absent")
    if out.exists() and not out.is_dir():
        raise InputError(f"--out = {out}: is a file; must be a directory or absent")
    refuse_below_a_file(out)


def refuse_below_a_file(out: Path) -> None:
    """Raises InputError where the nearest of the directories above `out` that is there is none."""
    above = next(place for place in out.parents if os.path.lexists(place))
    if not above.is_dir():
        raise InputError(f"--out = {out}: {above} is no directory")


def write_contents(directory: Path, kind: str, files: Iterable[str] | None = None) -> None:
    """Say in a directory that this program wrote it, and which `files` in it where it is replaced as a whole."""
    listed = {} if files is None else {"files": sorted(files)}
    write_json(directory / CONTENTS, {"written_by": WRITER, "kind": kind, **listed})


def files_in(directory: Path) -> Iterator[str]:
    """Every file below a directory but contents.json; a symbolic link counts as a file."""
    for place, directories, names in os.walk(directory):
        links = [name for name in directories if (Path(place) / name).is_symlink()]
        for name in [*names, *links]:
            if (file := (Path(place) / name).relative_to(directory)) != Path(CONTENTS):
                yield str(file)


def kind_of(directory: Path) -> str | None:
    """What this program says it wrote there, None if it does not say."""
    try:
        contents = read_json(directory / CONTENTS)
    except (InputError, OSError):
        return None
    return str(contents.get("kind")) if contents is not None and contents.get("written_by") == WRITER else None


def refuse_replacing(directory: Path, kind: str) -> None:
    """Raises InputError unless the directory is absent, empty, or holds nothing but what this program wrote."""
    first = next(files_in(directory), None)
    if first is None:
        return
    if kind_of(directory) != kind:
        raise InputError(f"--out = {directory}: holds {first} and no {CONTENTS} of a {kind}; must be absent, empty or "
                         f"a {kind} that this program wrote")
    contents = read_json(directory / CONTENTS) or {}
    listed = set(contents.get("files", []))
    foreign = next((name for name in files_in(directory) if name not in listed), None)
    if foreign is not None:
        raise InputError(f"--out = {directory}: holds {foreign}, which this program did not write; move it away or "
                         "choose another directory")


@contextmanager
def at_work_in(out: Path, kind: str) -> Iterator[int]:
    """Make a directory of many runs, or take up one that this program began, and keep other processes out. Yield the
    descriptor of the lock, which a copy of this process has to close: the lock lasts until all have.

    Raises InputError for a directory with anything else in it, Busy where another process is at work.
    """
    refuse_place(out)
    foreign = out.is_dir() and any(map(_is_foreign, out.iterdir())) and kind_of(out) != kind
    if foreign and not (kind in RUNS_IN and next(out.glob(RUNS_IN[kind]), None)):
        raise InputError(f"--out = {out}: holds files and no {CONTENTS} of a {kind}; must be absent, empty or a {kind} "
                         "that this program wrote")
    out.mkdir(parents=True, exist_ok=True)
    lock = locked(out / LOCK)
    try:
        if kind_of(out) != kind:
            write_contents(out, kind)
        yield lock
    finally:
        os.close(lock)


def _is_foreign(entry: Path) -> bool:
    """Is an entry none of what a process that is just beginning, or was killed then, has before `contents.json`?"""
    return entry.name != LOCK and not re.fullmatch(re.escape(CONTENTS) + r"\.\d+\.part", entry.name)


def locked(file: Path, wait_s: float = 0.0) -> int:
    """Lock a file, made where there is none, and return its descriptor; the lock lasts until all its copies are closed.
    Raises Busy if another process has it for longer than `wait_s`."""
    deadline = time.monotonic() + wait_s
    while True:
        lock = os.open(file, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _is_still(lock, file):
                return lock
        except BlockingIOError:
            if time.monotonic() > deadline:
                os.close(lock)
                raise Busy(f"{file.parent}: another process is at work here") from None
            time.sleep(0.1)
        except BaseException:
            os.close(lock)
            raise
        os.close(lock)


def locked_directory(directory: Path, wait_s: float = 0.0, name: str = "lock") -> int:
    """Make a directory where there is none, and lock the file `name` in it, as `locked` does."""
    while True:
        directory.mkdir(parents=True, exist_ok=True)
        try:
            return locked(directory / name, wait_s)
        except FileNotFoundError:
            continue  # who had it has just removed or renamed the directory


def _is_still(lock: int, file: Path) -> bool:
    """Who waited for a lock may get that of a file that has been removed meanwhile."""
    try:
        return os.path.samestat(os.fstat(lock), os.stat(file))
    except FileNotFoundError:
        return False


def refuse_file(out: str, *known_by: str) -> None:
    """Raises InputError for an `--out` that cannot become a file of this program: one that ends in no name, whose
    directory is not there, or where there is something that `refuse_foreign_file` refuses."""
    file = Path(out)
    if out.endswith("/") or file.name in ("", ".."):
        raise InputError(f"--out = {out}: must be the name of a file")
    if not file.parent.is_dir():
        raise InputError(f"--out = {out}: there is no directory {file.parent}")
    refuse_foreign_file(file, *known_by)


def refuse_foreign_file(file: Path, *known_by: str) -> None:
    """Raises InputError if there is something at `file` that this program did not write: no regular file, or one
    with none of the texts `known_by` among its first 4096 bytes."""
    if not file.exists() and not file.is_symlink():
        return
    if not file.is_file() or not any(text.encode() in _beginning(file) for text in known_by):
        raise InputError(f"{file}: is there, and this program did not write it; choose another name")


def _beginning(file: Path) -> bytes:
    with open(file, "rb") as opened:
        return opened.read(4096)
