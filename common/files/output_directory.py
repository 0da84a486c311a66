"""What a command may write to: a new directory or file, or one that this program wrote itself.

A directory that this program wrote says so in `contents.json`: its kind, and for a directory that is replaced as a
whole the files in it with their hashes. Nothing that is not in that list, as it was written, is ever deleted. A single
file holds its hash itself: JSON as common.files.whole.seal puts it, other text in a comment at its end.

A lock is a descriptor that processes which are started inherit, and lasts until all have ended, the engine included;
that of filelock ends with the process that took it.
"""

import hashlib
import json
import os
import re
import stat
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from common.files.whole import is_sealed, read_json, write_json
from common.input_error import CommandError
from common.tables import InputError

CONTENTS = "contents.json"
WRITER = "coal-gangue-impact"
STAMP = re.compile(rb"^(?:<!--|#) coal-gangue-impact ([0-9a-f]{64})(?: -->)?\n\Z", re.MULTILINE)
IsOwn = Callable[[bytes], bool]  # of what is in a file: did this program write it?
LOCK = ".lock"


class Busy(CommandError, RuntimeError):
    """Another process is at work in this directory."""


def refuse_place(out: Path) -> None:
    """Raises InputError for a path that cannot become a directory of results: the working directory or one above it, a
    file, a symbolic link, or a path without a last name."""
    refuse_bytes(str(out))
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


def refuse_bytes(out: str) -> None:
    """Raises InputError for a path that is no text: the libraries that write tables would fail at it."""
    try:
        os.path.abspath(out).encode()
    except UnicodeEncodeError:
        raise InputError(f"--out = {out}: the whole path must be text in UTF-8") from None


def refuse_below_a_file(out: Path) -> None:
    """Raises InputError where the nearest of the directories above `out` that is there is none."""
    above = next(place for place in out.parents if os.path.lexists(place))
    if not above.is_dir():
        raise InputError(f"--out = {out}: {above} is no directory")


def write_contents(directory: Path, kind: str, files: Mapping[str, str | None] | None = None) -> None:
    """Say in a directory that this program wrote it, and where it is replaced as a whole the hashes of its `files`."""
    listed = {} if files is None else {"files": dict(sorted(files.items()))}
    write_json(directory / CONTENTS, {"written_by": WRITER, "kind": kind, **listed})


def listed_files(directory: Path, *kinds: str) -> dict[str, str] | None:
    """The files that this program wrote into a directory of one of these kinds, with their hashes; None where it does
    not say so."""
    files = (read_json(directory / CONTENTS) or {}).get("files") if kind_of(directory) in kinds else None
    return files if isinstance(files, dict) else None


def hash_of(file: Path) -> str | None:
    """SHA-256 of a file, None of what is no regular file, such as a link or a pipe, or is not there."""
    try:
        if not stat.S_ISREG(file.lstat().st_mode):
            return None
        with open(file, "rb") as opened:
            return hashlib.file_digest(opened, "sha256").hexdigest()
    except (FileNotFoundError, NotADirectoryError):
        return None


def files_in(directory: Path) -> Iterator[str]:
    """Every file below a directory but contents.json; a symbolic link counts as a file. Raises OSError for a directory
    that cannot be read."""
    above = len(os.path.join(directory, ""))
    for place, directories, names in os.walk(directory, onerror=_raise):
        links = [name for name in directories if os.path.islink(os.path.join(place, name))]
        for name in [*names, *links]:
            if (file := os.path.join(place, name)[above:]) != CONTENTS:
                yield file


def _raise(error: OSError) -> None:
    if not isinstance(error, FileNotFoundError):
        raise error


def kind_of(directory: Path) -> str | None:
    """What this program says it wrote there, None if it does not say."""
    try:
        contents = read_json(directory / CONTENTS)
    except (InputError, OSError):
        return None
    return str(contents.get("kind")) if contents is not None and contents.get("written_by") == WRITER else None


def refuse_replacing(directory: Path, *kinds: str) -> None:
    """Raises InputError unless the directory is absent, empty, or of one of the kinds and holds nothing but what this
    program wrote, as it wrote it."""
    if directory.is_symlink() or (directory.exists() and not directory.is_dir()):
        raise InputError(f"--out = {directory}: is no directory; move it away or choose another one")
    listed = listed_files(directory, *kinds)
    first = CONTENTS if (directory / CONTENTS).exists() else next(files_in(directory), None)
    if listed is None and first is not None:
        raise InputError(f"--out = {directory}: holds {first} and no {CONTENTS} of a {kinds[0]}; must be absent, empty "
                         f"or a {kinds[0]} that this program wrote")
    for name in files_in(directory):
        if listed is None or name not in listed:
            raise InputError(f"--out = {directory}: holds {name}, which this program did not write; move it away or "
                             "choose another directory")
        if not _is_as_written(directory / name, listed[name]):
            raise InputError(f"--out = {directory}: {name} was changed since this program wrote it; move it away or "
                             "choose another directory")


def remove_written(directory: Path, *kinds: str, below: tuple[str, ...] = ("",)) -> None:
    """Remove of a directory of one of these kinds what this program wrote, as far as it is as it was written, or only
    what has a name that begins like one of `below`; a directory goes when it is empty."""
    listed = listed_files(directory, *kinds)
    if listed is None:
        return
    for name in [name for name in files_in(directory) if name.startswith(below)]:
        if _is_as_written(directory / name, listed.get(name)):
            (directory / name).unlink()
    if next(files_in(directory), None) is None:
        (directory / CONTENTS).unlink()
    remove_empty(directory)


def _is_as_written(file: Path, digest: str | None) -> bool:
    return digest is not None and hash_of(file) == digest


def remove_empty(directory: Path) -> None:
    """Remove a directory and those below it, as far as they are empty."""
    for place, _, _ in os.walk(directory, topdown=False):
        with suppress(OSError):
            os.rmdir(place)


@contextmanager
def at_work_in(out: Path, kind: str) -> Iterator[int]:
    """Make a directory of many runs, or take up one that this program began, and keep other processes out. Yield the
    descriptor of the lock, which a copy of this process has to close: the lock lasts until all have.

    Raises InputError for a directory with anything else in it, Busy where another process is at work.
    """
    refuse_place(out)
    if out.is_dir() and any(map(_is_foreign, out.iterdir())) and kind_of(out) != kind:
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
    import fcntl  # late: Windows has none, and what writes no directories works there

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


def refuse_file(out: str, is_own: IsOwn, *endings: str) -> None:
    """Raises InputError for an `--out` that cannot become a file of this program: one that ends in no name or has
    another ending, whose directory is not there, or where there is something that `refuse_foreign_file` refuses."""
    refuse_bytes(out)
    file = Path(out)
    if out.endswith("/") or file.name in ("", ".."):
        raise InputError(f"--out = {out}: must be the name of a file")
    if file.suffix not in endings:
        raise InputError(f"--out = {out}: the name must end in {' or '.join(endings)}")
    if not file.parent.is_dir():
        raise InputError(f"--out = {out}: there is no directory {file.parent}")
    refuse_foreign_file(file, is_own)


def refuse_foreign_file(file: Path, is_own: IsOwn) -> None:
    """Raises InputError if there is something at `file` that this program did not write, or that was changed since."""
    if not os.path.lexists(file):
        return
    if not file.is_file() or not is_own(file.read_bytes()):
        raise InputError(f"{file}: is there, and this program did not write it, or it was changed since; move it away "
                         "or choose another name")


def stamped(text: str, comment: str = "<!-- {} -->") -> str:
    """A text with a comment at its end that says who wrote it and what its hash is."""
    text = text.rstrip("\n") + "\n"
    return text + comment.format(f"{WRITER} {hashlib.sha256(text.encode()).hexdigest()}") + "\n"


def is_stamped(content: bytes) -> bool:
    """Is this what `stamped` gave, unchanged?"""
    found = STAMP.search(content, max(0, len(content) - 200))
    return found is not None and hashlib.sha256(content[:found.start()]).hexdigest() == found[1].decode()


def is_sealed_as(form: str) -> IsOwn:
    """Tells whether a file is JSON of this format, unchanged since this program wrote it."""
    def is_own(content: bytes) -> bool:
        try:
            data = json.loads(content)
        except (ValueError, RecursionError):
            return False
        return isinstance(data, dict) and data.get("format") == form and is_sealed(data)
    return is_own
