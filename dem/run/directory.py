"""The directory of a run that is not finished: OUT.partial, which becomes OUT when it is."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from common.tables import InputError

SUFFIX = ".partial"
LOCK_WAIT_s = 10.0  # for the engine of a run that was killed, which ends with it


class Busy(RuntimeError):
    """Another process is at work in this directory."""


class Unfinished:
    """`path` is OUT.partial. `begun.json` in it says which run it is: `identity` is of everything that its result depends
    on, so that no other run goes on from its checkpoints."""

    def __init__(self, out: Path):
        self.out = out
        self.path = out.with_name(out.name + SUFFIX)

    @contextmanager
    def claimed(self) -> Iterator[int]:
        """Keeps other processes out, as long as this one or an engine that it started is alive. Yields the lock's file
        descriptor, for the engine to inherit. Raises Busy."""
        self.path.mkdir(parents=True, exist_ok=True)
        lock = os.open(self.path / "lock", os.O_RDWR | os.O_CREAT, 0o666)
        try:
            deadline = time.monotonic() + LOCK_WAIT_s
            while True:
                try:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                except BlockingIOError:
                    if time.monotonic() > deadline:
                        raise Busy(f"{self.path}: another process is at work on this run") from None
                    time.sleep(0.1)
            yield lock
        finally:
            os.close(lock)

    def begun(self) -> dict | None:
        """What `begin` wrote, None if there is nothing of the kind. Raises InputError if it cannot be read."""
        return read_json(self.path / "begun.json")

    def begin(self, identity: dict, scene: dict, source: str) -> None:
        """Mark a directory that holds the deck and nothing else yet."""
        write_json(self.path / "begun.json", {"identity": identity, "source": source, "scene": scene, "resumed_at_s": []})

    def note_resumed(self, t_s: float) -> list[float]:
        """Add to the times at which this run was taken up again, and return them."""
        begun = read_json(self.path / "begun.json") or {}
        begun["resumed_at_s"] = [*begun.get("resumed_at_s", []), t_s]
        write_json(self.path / "begun.json", begun)
        return begun["resumed_at_s"]

    def clear(self, keep: tuple[str, ...] = ()) -> None:
        """Remove all but the lock and `keep`."""
        for entry in self.path.iterdir():
            if entry.name not in ("lock", *keep):
                shutil.rmtree(entry) if entry.is_dir() else entry.unlink()

    def finished(self, identity: dict) -> dict | None:
        """The summary of a run that was stopped between its last file and its new name."""
        begun, summary = self.begun(), read_json(self.path / "run.json")
        return summary if summary and begun and begun["identity"] == identity else None

    def publish(self) -> None:
        """Give the whole directory its name, in the place of an earlier run."""
        for entry in self.path.rglob("*"):
            if entry.is_file():
                with open(entry, "rb") as file:
                    os.fsync(file.fileno())
        for name in ("begun.json", "lock"):
            (self.path / name).unlink(missing_ok=True)
        earlier = self.out.with_name(self.out.name + ".earlier")
        if self.out.exists():
            shutil.rmtree(earlier, ignore_errors=True)
            self.out.rename(earlier)
        self.path.rename(self.out)
        shutil.rmtree(earlier, ignore_errors=True)


def write_json(file: Path, content: dict) -> None:
    """Beside and then renamed: whole or as it was."""
    beside = file.with_name(file.name + ".part")
    with open(beside, "w") as out:
        out.write(json.dumps(content, indent=1) + "\n")
        out.flush()
        os.fsync(out.fileno())
    beside.replace(file)


def read_json(file: Path) -> dict | None:
    """None if there is no such file. Raises InputError if it holds something else."""
    try:
        content = json.loads(file.read_text())
    except FileNotFoundError:
        return None
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{file}: cut off or not JSON ({error}); allowed is what a run wrote") from None
    if not isinstance(content, dict):
        raise InputError(f"{file}: not what a run wrote")
    return content
