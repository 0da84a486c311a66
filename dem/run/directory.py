"""The directory of a run in progress: OUT.partial, which becomes OUT when the run is finished."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from common.files import force_to_disk, is_sealed, read_json, read_sealed_json, seal, write_json
from common.output_directory import CONTENTS, files_in, locked_directory, refuse_replacing, write_contents
from common.run_summary import RunSummary, read_summary
from common.tables import InputError

SUFFIX, EARLIER = ".partial", ".earlier"
LOCK_WAIT_s = 10.0  # for the engine of a run that was killed, which ends with it
STARTED, RESULTS = "started.json", "results.json"
LOCK = "lock"  # the first file in OUT.partial; what it holds says who made the directory
MARK = "a run of coal-gangue-impact is in progress here\n"
WORKING = (STARTED, RESULTS, LOCK)  # what only a run in progress has
# Everything that a run writes directly into its directory, under these names or those of files half written.
TABLES = ("signals.parquet", "fast.parquet", "breakage.parquet", "contacts.parquet", "energy.parquet",
          "stones.parquet", "left.parquet", "walls.parquet")
OWN = {*WORKING, *TABLES, "run.json", CONTENTS, "deck", "deck.fresh", "view", "view.pvd", "view.py"}
KIND = "run"

Identity = dict[str, str]


class RunDirectory:
    """`path` is OUT.partial. `started.json` in it says which run it is: its `identity` covers everything that the
    result depends on, so that no other run goes on from its checkpoints."""

    def __init__(self, out: Path):
        self.out = out
        self.path = out.with_name(out.name + SUFFIX)
        self.started_file = self.path / STARTED
        self.results_file = self.path / RESULTS

    def refuse(self, scene_hash: str, overwrite: bool) -> None:
        """Raises InputError where OUT, OUT.partial or OUT.earlier hold what this program did not write, or, without
        `overwrite`, a run of another scene."""
        refuse_replacing(self.out, KIND)
        refuse_replacing(self.out.with_name(self.out.name + EARLIER), KIND)
        self._refuse_foreign_partial()
        if overwrite:
            return
        begun = self._begun()
        if begun is not None and begun["identity"].get("scene") != scene_hash:
            raise InputError(f"--out = {self.out}: a run of another scene was begun in {self.path}; --overwrite "
                             "discards it")
        if begun is not None:  # whoever began it agreed that it takes the place of what is in OUT
            return
        finished = read_summary(self.out / "run.json")
        if finished is not None and finished.scene_hash != scene_hash:
            raise InputError(f"--out = {self.out}: holds a run of another scene; --overwrite replaces it")

    def _refuse_foreign_partial(self) -> None:
        if not self.path.exists() and not self.path.is_symlink():
            return
        names = {file.name for file in self.path.iterdir()} if self.path.is_dir() else {SUFFIX}
        mark = (self.path / LOCK).read_text(errors="replace") if (self.path / LOCK).is_file() else ""
        if mark != MARK and not (names <= {LOCK} and mark == ""):  # killed before it wrote the mark
            raise InputError(f"{self.path}: is there, and no run of this program was begun in it; move it away")
        foreign = min((name for name in names if not _is_own(name)), default=None)
        if foreign is not None:
            raise InputError(f"{self.path}: holds {foreign}, which this program did not write; move it away")

    def _begun(self) -> dict[str, Any] | None:
        """What `start` wrote. Raises InputError if that is damaged, with what to do."""
        try:
            return self.started()
        except InputError as damage:
            raise InputError(f"{damage}; --overwrite begins the run anew") from None

    @contextmanager
    def claimed(self) -> Iterator[int]:
        """Keep other processes out, as long as this one or an engine that it started is alive. Yields the lock's file
        descriptor, for the engine to inherit. Raises Busy."""
        lock = locked_directory(self.path, LOCK_WAIT_s, LOCK)
        try:
            if os.fstat(lock).st_size == 0:
                os.write(lock, MARK.encode())
            yield lock
        finally:
            os.close(lock)

    def started(self) -> dict[str, Any] | None:
        """What `start` wrote, None if no run was started here. Raises InputError if it cannot be read or is damaged."""
        return read_sealed_json(self.started_file)

    def start(self, identity: Identity, scene: dict[str, Any], source: str) -> None:
        """Mark a directory that holds the deck and nothing else yet."""
        write_json(self.started_file,
                   seal({"identity": identity, "source": source, "scene": scene, "resumed_at_s": []}))

    def note_resumed(self, t_s: float) -> list[float]:
        """Add to the times at which this run was taken up again, and return them."""
        started = self.started() or {}
        started["resumed_at_s"] = [*started.get("resumed_at_s", []), t_s]
        write_json(self.started_file, seal(started))
        return started["resumed_at_s"]

    def clear(self, keep: tuple[str, ...] = ()) -> None:
        """Remove what a run writes, but not the lock and `keep`."""
        for entry in self.path.iterdir():
            if _is_own(entry.name) and entry.name not in (LOCK, *keep):
                shutil.rmtree(entry) if entry.is_dir() else entry.unlink()

    def note_finished(self) -> None:
        """Say of which files the results consist, when they are all there, with length and CRC-32 of each. The deck is
        not among them: whoever goes on writes it anew."""
        names = [name for name in self._own_files() if not name.startswith("deck/") and name not in WORKING]
        write_json(self.results_file, seal({"files": {name: fingerprint(self.path / name) for name in names}}))

    def _own_files(self) -> list[str]:
        return [name for name in files_in(self.path) if _is_own(Path(name).parts[0])]

    def finished(self, identity: Identity) -> RunSummary | None:
        """The summary of a run that was stopped between its last file and its new name, if all its results are as they
        were written."""
        started = self.started()
        results = read_json(self.results_file)
        if not started or started["identity"] != identity or results is None or not is_sealed(results):
            return None
        whole = all(fingerprint(self.path / name) == kept for name, kept in results["files"].items())
        return read_summary(self.path / "run.json") if whole else None

    def publish(self) -> None:
        """Give the whole directory its name, in the place of an earlier run."""
        force_to_disk(entry for entry in self.path.rglob("*") if entry.is_file())
        write_contents(self.path, KIND, self._own_files())
        earlier = self.out.with_name(self.out.name + EARLIER)
        refuse_replacing(self.out, KIND)  # it may have come since the run began
        if self.out.exists():
            shutil.rmtree(earlier, ignore_errors=True)
            self.out.rename(earlier)
        self.path.rename(self.out)
        for name in WORKING:
            (self.out / name).unlink(missing_ok=True)
        shutil.rmtree(earlier, ignore_errors=True)


def name_of(identity: Identity) -> str:
    """The name of 64 characters that checkpoints of a run with this identity carry."""
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()


def _is_own(name: str) -> bool:
    """Is this the name of something that a run writes directly into its directory?"""
    return re.sub(r"\.\d+\.part$", "", name) in OWN


def fingerprint(file: Path) -> list[int]:
    """Length and CRC-32 of a file, [-1, 0] if there is none."""
    length, crc = 0, 0
    try:
        with open(file, "rb") as opened:
            while block := opened.read(1 << 20):
                length, crc = length + len(block), zlib.crc32(block, crc)
    except FileNotFoundError:
        return [-1, 0]
    return [length, crc]
