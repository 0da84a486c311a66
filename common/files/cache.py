"""Results that are dear to find, such as modes and packings, kept in a directory of the user's for every later run.

One entry is a file of named arrays under a key, which is a hash of everything that the arrays follow from. Many
processes may ask for one key at once: the first finds the arrays while the others wait for it. A file that is damaged
or foreign is found out by its hash and made anew. The directory is bounded: what was not used for longest goes first.
diskcache checks no hash, unpickles what it finds, and lets all who miss find the same.
"""

import hashlib
import os
import platform
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from math import inf
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import scipy
from platformdirs import user_cache_path

from common.files.output_directory import Busy, locked_directory
from common.files.whole import written_whole
from common.process.messages import PACKAGES

LARGEST_MB = 500
HASH_BYTES = 32  # at the end of a file
BLOCK_BYTES = 1 << 20
# Names of entries, with what a killed process left half written, which ages like the rest.
ENTRY = re.compile(r"[a-z]+-[0-9a-f]{32}\.cache(\.\d+\.part)?")
IMPORT = re.compile(rf"^ *(?:from|import) ((?:{'|'.join(PACKAGES)})\b[\w.]*)(?: import (\([^)]*\)|.*))?", re.MULTILINE)
LOCKS = 16  # of each kind of entry; keys that share one wait for each other now and then

Arrays = dict[str, np.ndarray]
_WAITS = ContextVar("_WAITS", default=True)  # for an entry that another process finds


def user_cache() -> Path:
    """Return the directory that all runs of a user share: ~/.cache/coal-gangue-impact/results, or what the environment
    variable COAL_GANGUE_CACHE names."""
    return Path(os.environ.get("COAL_GANGUE_CACHE") or user_cache_path("coal-gangue-impact") / "results")


def key_of(code: Path, *inputs: Any) -> str:
    """Return the key of what the module in the file `code` finds from `inputs`, whose repr must tell all of them.

    To it belong the text of the module and of all that it imports of these packages, libraries, the kind of machine and
    the number of threads of linear algebra, since round-off differs between them.
    """
    threads = os.environ.get("OPENBLAS_NUM_THREADS") or os.environ.get("OMP_NUM_THREADS") or os.cpu_count()
    content = hashlib.sha256(b"".join(text for _, text in sorted(used_modules(code).items())))
    text = f"{content.hexdigest()} {np.__version__} {scipy.__version__} {platform.machine()} {threads} {inputs!r}"
    return hashlib.sha256(text.encode()).hexdigest()[:32]


@cache
def used_modules(code: Path) -> dict[Path, bytes]:
    """Return files and texts of a module and all that it imports of these packages, late or through others. A pattern
    finds them in a tenth of the time that a parser takes."""
    top = next(directory for directory in code.parents if not (directory / "__init__.py").exists())
    files, found = [code], {}
    while files:
        if (file := files.pop()) in found or not file.is_file():
            continue
        found[file] = file.read_bytes()
        for module, names in IMPORT.findall(found[file].decode()):
            place = top / module.replace(".", "/")
            files += [place.with_suffix(".py"), place / "__init__.py"]
            files += [place / f"{name}.py" for name in re.findall(r"\w+", names)]
    return found


def entry_file(directory: Path, kind: str, key: str) -> Path:
    return directory / f"{kind}-{key}.cache"


def cached(directory: Path | None, kind: str, key: str, find: Callable[[], Mapping[str, Any]]) -> Arrays:
    """Return the arrays that `find` returns, kept in `directory` from the first time on; without one they are found.

    `find` may ask for entries of other kinds, never of its own. Where the directory cannot be written, the arrays are
    found and a warning tells so. Raises BeingFound within `not_waiting`.
    """
    if directory is None:
        return _as_arrays(find())
    file = entry_file(directory, kind, key)
    if (stored := _read(file)) is not None:
        return stored
    try:
        with _locked(directory, kind, key):
            if (stored := _read(file)) is not None:
                return stored
            arrays = _as_arrays(find())
            _write(file, arrays)
            _make_room(directory)
            return arrays
    except CannotKeep as error:
        warnings.warn(f"{directory}: {error}; nothing is kept for later runs", stacklevel=2)
        return _as_arrays(find())


class CannotKeep(Exception):
    """The directory cannot be written."""


class BeingFound(Exception):
    """Another process finds an entry (or, now and then, one that shares its lock)."""


@contextmanager
def not_waiting() -> Iterator[None]:
    """Within, an entry that another process finds raises BeingFound, so that this one may find another meanwhile."""
    token = _WAITS.set(False)
    try:
        yield
    finally:
        _WAITS.reset(token)


def _as_arrays(found: Mapping[str, Any]) -> Arrays:
    """In the order in memory that they will have when they are read, on which round-off depends."""
    return {name: np.asarray(value, order="A") for name, value in found.items()}


@contextmanager
def _locked(directory: Path, kind: str, key: str) -> Iterator[None]:
    """Hold the lock of a key, which the kernel lets go of when the process dies. Raises BeingFound, CannotKeep."""
    try:
        lock = locked_directory(directory, inf if _WAITS.get() else 0.0, f"{kind}-{int(key, 16) % LOCKS}.lock")
    except ImportError:  # Windows
        raise CannotKeep("this system has no locks") from None
    except Busy:
        raise BeingFound(f"{kind} {key}") from None
    except OSError as error:  # also of a file system without locks
        raise CannotKeep(error.strerror or str(error)) from error
    try:
        yield
    finally:
        os.close(lock)


def _digest(name: str, opened: BinaryIO, size: int) -> bytes:
    """Of so many bytes from the beginning, after which the file then stands. The name belongs to it, so that a file
    under another name is foreign."""
    digest = hashlib.sha256(name.encode())
    opened.seek(0)
    for done in range(0, size, BLOCK_BYTES):
        digest.update(opened.read(min(BLOCK_BYTES, size - done)))
    return digest.digest()


def _read(file: Path) -> Arrays | None:
    """Return what is kept in a file, or None if there is no file or not what `_write` wrote."""
    try:
        with open(file, "rb") as opened:
            if _digest(file.name, opened, os.fstat(opened.fileno()).st_size - HASH_BYTES) != opened.read():
                return None
            os.utime(file)  # used now
            opened.seek(0)
            with np.load(opened, allow_pickle=False) as stored:
                return {name: stored[name] for name in stored.files}
    except OSError:  # gone, or not ours to read
        return None


def _write(file: Path, arrays: Arrays) -> None:
    try:
        with written_whole(file) as beside, open(beside, "w+b") as out:
            np.savez(out, **arrays)  # type: ignore[arg-type]  # of the stubs, which take a name for allow_pickle
            out.write(_digest(file.name, out, out.tell()))
    except OSError as error:  # a full disk, too: the arrays are there, only not kept
        warnings.warn(f"{file}: {error.strerror}; not kept for later runs", stacklevel=2)


def _make_room(directory: Path) -> None:
    """Remove what was not used for longest until the entries are small enough together."""
    entries = []
    for file in directory.iterdir():
        if not ENTRY.fullmatch(file.name):  # the directory may be one in which the user keeps other files
            continue
        try:
            status = file.stat()
        except FileNotFoundError:  # another process makes room, too
            continue
        entries.append((status.st_mtime_ns, status.st_size, file))
    size = sum(entry[1] for entry in entries)
    for _, bytes_, file in sorted(entries):
        if size <= LARGEST_MB * 1_000_000:
            return
        file.unlink(missing_ok=True)
        size -= bytes_
