"""Files that appear whole or not at all."""

import errno
import hashlib
import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from common.input_error import InputError, refuse_monstrous, refuse_unreadable

MOST_JSON_BYTES = 100e6
AT_A_TIME = 16  # files that are forced to disk
SEAL = "sha256"  # key of a JSON object under which the hash of its other keys stands
BEFORE_SEAL = f', "{SEAL}": "'


@contextmanager
def written_whole(file: Path) -> Iterator[Path]:
    """Yield a path beside `file`; what is written there is on disk at the end and takes the name `file`. If the block
    raises, `file` stays as it was and nothing is left beside it."""
    beside = file.with_name(f"{file.name}.{os.getpid()}.part")
    try:
        with named(file):
            yield beside
            _force_to_disk(beside)
            beside.replace(file)
    finally:
        beside.unlink(missing_ok=True)


@contextmanager
def named(file: Path) -> Iterator[None]:
    """An error of writing that does not say where, as that of a full disk, is one of this file."""
    try:
        yield
    except OSError as error:
        if error.filename is not None:
            raise
        raise OSError(error.errno, error.strerror or str(error), str(file)) from error


def force_to_disk(files: Iterable[Path]) -> None:
    """Return when all that was written to the files is on disk, which takes many of them at a time hardly longer than
    one."""
    from concurrent.futures import ThreadPoolExecutor  # late: slow beside what a command that only reads may take

    waiting = list(files)
    try:
        with ThreadPoolExecutor(AT_A_TIME) as pool:
            list(pool.map(_force_to_disk, waiting))
    except RuntimeError:  # no memory for another thread
        for file in waiting:
            _force_to_disk(file)


def _force_to_disk(file: Path) -> None:
    with open(file, "rb") as written:
        os.fsync(written.fileno())


def refuse_irregular(file: Path) -> None:
    """Raises OSError for a pipe, which reading would wait for, a directory, or what else is there and no file."""
    if file.exists() and not file.is_file():
        raise OSError(errno.EINVAL, "must be a regular file", str(file))


def write_text(file: Path, text: str) -> None:
    """Write a text file whole or not at all."""
    with written_whole(file) as beside:
        beside.write_text(text, encoding="utf-8")


def write_json(file: Path, content: dict[str, Any]) -> None:
    """Write a JSON file whole or not at all."""
    write_text(file, json.dumps(content, indent=1) + "\n")


def read_json(file: Path) -> dict[str, Any] | None:
    """Return the object in a JSON file, or None without such a file. Raises InputError if it holds anything else."""
    refuse_unreadable(file, MOST_JSON_BYTES)
    try:
        content = json.loads(file.read_text())
    except FileNotFoundError:
        return None
    except (ValueError, RecursionError) as error:
        raise InputError(f"{file}: cut off or not JSON ({error}); allowed is what a run wrote") from None
    if not isinstance(content, dict):
        raise InputError(f"{file}: not what a run wrote")
    refuse_monstrous(file, content)
    return content


def seal(content: dict[str, Any]) -> dict[str, Any]:
    """The same object with the hash of its contents, in the place of an earlier one."""
    return {**content, SEAL: _hash(_text(content))}


def is_sealed(content: dict[str, Any]) -> bool:
    """Is the object as it was when it was sealed?"""
    return content.get(SEAL) == _hash(_text(content))


def _text(content: dict[str, Any]) -> str:
    """What is hashed: numbers are written so that they read back exactly, and then hash alike."""
    return json.dumps({key: value for key, value in content.items() if key != SEAL}, sort_keys=True)


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def write_sealed_json(file: Path, content: dict[str, Any]) -> None:
    """Write an object with its hash at its end, so that the text can be hashed: many numbers take long to write."""
    text = _text(content)
    write_text(file, f'{text[:-1]}{BEFORE_SEAL}{_hash(text)}"}}\n')


def read_sealed_json(file: Path) -> dict[str, Any] | None:
    """As `read_json`; InputError as well for an object that is not as it was sealed."""
    content = read_json(file)
    if content is not None and not _is_sealed_at_its_end(file) and not is_sealed(content):
        raise InputError(f"{file}: damaged or changed by hand: its contents do not have the hash that it names")
    return content


def _is_sealed_at_its_end(file: Path) -> bool:
    """As `write_sealed_json` left it?"""
    before, _, after = file.read_text().rpartition(BEFORE_SEAL)
    return after == f'{_hash(before + "}")}"}}\n'
