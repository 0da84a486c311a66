"""Files that appear whole or not at all."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from common.tables import InputError


@contextmanager
def written_whole(file: Path) -> Iterator[Path]:
    """Yield a path beside `file` to write to; at the end what is written there is on disk and takes the name `file`.

    If the block raises, `file` stays as it was and nothing is left beside it.
    """
    beside = file.with_name(f"{file.name}.{os.getpid()}.part")
    try:
        yield beside
        with open(beside, "rb") as written:
            os.fsync(written.fileno())
        beside.replace(file)
    finally:
        beside.unlink(missing_ok=True)


def write_text(file: Path, text: str) -> None:
    """Write a text file whole or not at all."""
    with written_whole(file) as beside:
        beside.write_text(text)


def write_json(file: Path, content: dict[str, Any]) -> None:
    """Write a JSON file whole or not at all."""
    write_text(file, json.dumps(content, indent=1) + "\n")


def read_json(file: Path) -> dict[str, Any] | None:
    """Return the object in a JSON file, or None without such a file. Raises InputError if it holds anything else."""
    try:
        content = json.loads(file.read_text())
    except FileNotFoundError:
        return None
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{file}: cut off or not JSON ({error}); allowed is what a run wrote") from None
    if not isinstance(content, dict):
        raise InputError(f"{file}: not what a run wrote")
    return content
