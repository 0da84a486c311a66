"""The directory of a run in progress: OUT.partial, which becomes OUT when the run is finished."""

from __future__ import annotations

import fcntl
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from common.files import read_json, write_json
from common.run_summary import RunSummary, read_summary

SUFFIX = ".partial"
LOCK_WAIT_s = 10.0  # for the engine of a run that was killed, which ends with it

Identity = dict[str, str]


class Busy(RuntimeError):
    """Another process is at work in this directory."""


class RunDirectory:
    """`path` is OUT.partial. `started.json` in it says which run it is: its `identity` covers everything that the
    result depends on, so that no other run goes on from its checkpoints."""

    def __init__(self, out: Path):
        self.out = out
        self.path = out.with_name(out.name + SUFFIX)
        self.started_file = self.path / "started.json"

    @contextmanager
    def claimed(self) -> Iterator[int]:
        """Keep other processes out, as long as this one or an engine that it started is alive. Yields the lock's file
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

    def started(self) -> dict[str, Any] | None:
        """What `start` wrote, None if no run was started here. Raises InputError if it cannot be read."""
        return read_json(self.started_file)

    def start(self, identity: Identity, scene: dict[str, Any], source: str) -> None:
        """Mark a directory that holds the deck and nothing else yet."""
        write_json(self.started_file, {"identity": identity, "source": source, "scene": scene, "resumed_at_s": []})

    def note_resumed(self, t_s: float) -> list[float]:
        """Add to the times at which this run was taken up again, and return them."""
        started = self.started() or {}
        started["resumed_at_s"] = [*started.get("resumed_at_s", []), t_s]
        write_json(self.started_file, started)
        return started["resumed_at_s"]

    def clear(self, keep: tuple[str, ...] = ()) -> None:
        """Remove all but the lock and `keep`."""
        for entry in self.path.iterdir():
            if entry.name not in ("lock", *keep):
                shutil.rmtree(entry) if entry.is_dir() else entry.unlink()

    def finished(self, identity: Identity) -> RunSummary | None:
        """The summary of a run that was stopped between its last file and its new name."""
        started, summary = self.started(), read_summary(self.path / "run.json")
        return summary if started and started["identity"] == identity else None

    def publish(self) -> None:
        """Give the whole directory its name, in the place of an earlier run."""
        for entry in self.path.rglob("*"):
            if entry.is_file():
                with open(entry, "rb") as file:
                    os.fsync(file.fileno())
        for name in (self.started_file.name, "lock"):
            (self.path / name).unlink(missing_ok=True)
        earlier = self.out.with_name(self.out.name + ".earlier")
        if self.out.exists():
            shutil.rmtree(earlier, ignore_errors=True)
            self.out.rename(earlier)
        self.path.rename(self.out)
        shutil.rmtree(earlier, ignore_errors=True)
