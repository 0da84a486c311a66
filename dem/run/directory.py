"""The directory of a run in progress: OUT.partial, which becomes OUT when the run is finished.

From checkpoints a run goes on after it was stopped or killed. A checkpoint has two halves, one of each program, in
`deck/checkpoint`: `engine_STEP.checkpoint`, written by the engine (dem/engine/record/fix_checkpoint.h), and
`plate_STEP.checkpoint`, written here when the engine says that its half is on disk. Each file appears whole or not at
all and carries the identity of the run, its length and CRC-32; the engine's half has length and CRC-32 of the streams,
the files that the engine appends to, as well. A checkpoint counts when all of that is as this run wrote it. A rigid
plate has no half.
"""

import hashlib
import io
import json
import os
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from common.files.output_directory import (
    files_in,
    hash_of,
    listed_files,
    locked_directory,
    refuse_replacing,
    remove_empty,
    remove_written,
    write_contents,
)
from common.files.whole import force_to_disk, read_sealed_json, seal, write_json, written_whole
from common.run_summary import RunSummary, read_summary
from common.tables import InputError

SUFFIX, EARLIER = ".partial", ".earlier"
LOCK_WAIT_s = 10.0  # for the engine of a run that was killed, which ends with it
STARTED = "started.json"
LOCK = "lock"  # the first file in OUT.partial; what it holds says who made the directory
MARK = "a run of coal-gangue-impact is in progress here\n"
WORKING = (STARTED, LOCK)  # what only a run in progress has
KIND, REPLACED = "run", "run in the place of which another comes"
# What the engine writes for the user.
OF_ENGINE = r"deck/(engine\.(out|log)|log\.liggghts)"
# All names that a run gives to files, in a directory that it was killed in, too.
OWN = re.compile(rf"""{OF_ENGINE}
    |lock|(started|run|contents)\.json|(signals|fast|breakage|contacts|energy|stones|left|walls)\.parquet|modes\.npz
    |view\.(py|pvd)|view/(particles|bonds|plate|contacts|rods|walls)((_\d+)?\.vtu|\.pvd)
    |deck(\.fresh)?/(deck\.liggghts|atoms\.data|(agglomerates|bonds|surface|faces)\.txt|(stones|shapes)\.bin)
    |deck/((ledger|forces|contacts|pictures|wall_\w+)\.bin|(events|left)\.csv|(to|from)_plate)
    |deck/checkpoint/(engine|plate)_\d+\.checkpoint""", re.VERBOSE)
HALF_WRITTEN = re.compile(r"(\.\d+)?\.part$")

Identity = dict[str, str]


class RunDirectory:
    """`path` is OUT.partial. `started.json` in it says which run it is: its `identity` covers everything that the
    result depends on, so that no other run goes on from its checkpoints."""

    def __init__(self, out: Path):
        self.out = out
        self.path = out.with_name(out.name + SUFFIX)
        self.started_file = self.path / STARTED
        self._earlier = out.with_name(out.name + EARLIER)
        self._written = set(WORKING)  # names of files that this process wrote

    def refuse(self, scene_hash: str, overwrite: bool) -> None:
        """Raises InputError where OUT, OUT.partial or OUT.earlier hold what this program did not write or what was
        changed since, or, without `overwrite`, a run of another scene."""
        refuse_replacing(self.out, KIND, REPLACED)
        refuse_replacing(self._earlier, REPLACED)
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
        if self.path.is_symlink() or not self.path.is_dir():
            raise InputError(f"{self.path}: is no directory; move it away")
        mark = (self.path / LOCK).read_text(errors="replace") if (self.path / LOCK).is_file() else ""
        if mark != MARK and (mark or os.listdir(self.path) not in ([], [LOCK])):  # killed before it wrote the mark
            raise InputError(f"{self.path}: is there, and no run of this program was begun in it; move it away")
        foreign = min((name for name in files_in(self.path) if not _is_own(name)), default=None)
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

    def file(self, name: str) -> Path:
        """The path of a file that is written now, and so belongs to the run."""
        self._written.add(name)
        return self.path / name

    def clear(self, keep: tuple[str, ...] = ()) -> None:
        """Remove what a run writes, but not the lock and `keep`."""
        for name in {*os.listdir(self.path)} - {LOCK, *keep}:
            self.remove(name)

    def remove(self, name: str) -> None:
        """Remove a file that a run writes, or of a directory all those."""
        for file in [file for file in files_in(self.path) if file == name or file.startswith(f"{name}/")]:
            if _is_own(file):
                (self.path / file).unlink()
        remove_empty(self.path / name)

    def note_finished(self, without: Collection[str]) -> None:
        """Say of which files the run consists, when they are all there: those that this process wrote, and its engine,
        but for those `without`."""
        of_engine = [name for name in files_in(self.path) if re.fullmatch(OF_ENGINE, name)]
        names = {*self._written, *of_engine} - {*without}
        force_to_disk(self.path / name for name in names)
        write_contents(self.path, KIND, {name: hash_of(self.path / name) for name in names})

    def finished(self, identity: Identity) -> RunSummary | None:
        """The summary of a run that was stopped between its last file and its new name, if all its results are as they
        were written."""
        started, files = self.started(), listed_files(self.path, KIND)
        if not started or started["identity"] != identity or files is None:
            return None
        whole = all(hash_of(self.path / name) == kept for name, kept in files.items())
        return read_summary(self.path / "run.json") if whole else None

    def publish(self) -> None:
        """Give the whole directory its name, in the place of an earlier run. Raises InputError where something came or
        was changed since the run began that would be lost; the run stays whole beside it."""
        refuse_replacing(self.out, KIND, REPLACED)
        remove_empty(self.out)
        if self.out.exists():
            refuse_replacing(self._earlier, REPLACED)
            remove_written(self._earlier, REPLACED)
            write_contents(self.out, REPLACED, listed_files(self.out, KIND, REPLACED))
            self.out.rename(self._earlier)
        self.path.rename(self.out)
        for name in WORKING:
            (self.out / name).unlink(missing_ok=True)
        remove_written(self._earlier, REPLACED)


def name_of(identity: Identity) -> str:
    """The name of 64 characters that checkpoints of a run with this identity carry."""
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()


def _is_own(name: str) -> bool:
    """Is this the name of a file that a run writes, or of one half written?"""
    return OWN.fullmatch(HALF_WRITTEN.sub("", name)) is not None


HEADER = struct.Struct("<8sq64sqq")  # magic, version, identity of the run, bytes that follow, their CRC-32
BLOCK = struct.Struct("<32sq")  # of an engine's file: name, count of the numbers that follow
ENGINE, PLATE = b"CGISTATE", b"CGIPLATE"
VERSION = {ENGINE: 7, PLATE: 2}
BY_HAND = "none"  # identity of a run whose engine is started by hand
KEPT = 2  # checkpoints: the one before the last is there for when the last is damaged

State = dict[str, np.ndarray]


def half_of(directory: Path, half: str, step: int) -> Path:
    """The file of one half, "engine" or "plate", of the checkpoint at DEM step `step`."""
    return directory / f"{half}_{step}.checkpoint"


def steps_of(directory: Path, half: str = "engine") -> list[int]:
    """The DEM steps of which there is a half of a checkpoint, the last one first."""
    found = (re.fullmatch(rf"{half}_(\d+)\.checkpoint", file.name) for file in directory.glob(f"{half}_*.checkpoint"))
    return sorted((int(match[1]) for match in found if match), reverse=True)


def latest(directory: Path, flexible: bool) -> int:
    """The DEM step of the last checkpoint, whole or damaged, 0 if there is none. That of a `flexible` plate has two
    halves."""
    return next((step for step in steps_of(directory) if not flexible or half_of(directory, "plate", step).exists()), 0)


def last_whole(deck: Path, streams: Sequence[str], flexible: bool, identity: str, note: Callable[[str], None]) -> int:
    """The DEM step of the last checkpoint that is as the run `identity` wrote it, with the streams as far as they went
    then; 0 if there is none. `note` is called with one line for each damage found. All other checkpoints are
    removed, so that none is gone on from later."""
    directory, chosen = deck / "checkpoint", 0
    for step in steps_of(directory):
        if chosen:
            break
        if flexible and not half_of(directory, "plate", step).exists():
            continue  # killed between the two halves
        try:
            check_streams(deck, streams, read_checked(half_of(directory, "engine", step), ENGINE, identity))
            if flexible:
                read_plate_state(half_of(directory, "plate", step), identity)
            chosen = step
        except (InputError, OSError) as damage:
            note(f"the checkpoint of step {step} is passed over: {damage}")
    for half in ("engine", "plate"):
        for step in set(steps_of(directory, half)) - {chosen}:
            half_of(directory, half, step).unlink()
    return chosen


def read_checked(file: Path, magic: bytes, identity: str) -> bytes:
    """What follows the header of a file of checkpoints. Raises InputError for one that is cut off, damaged, of another
    run than `identity`, or no such file."""
    data = file.read_bytes()
    if len(data) < HEADER.size or data[:8] != magic:
        raise InputError(f"{file}: not a checkpoint of this program")
    _, version, run, size, crc = HEADER.unpack_from(data)
    if version != VERSION[magic]:
        raise InputError(f"{file}: a checkpoint of version {version}; allowed is {VERSION[magic]}")
    if run.rstrip(b"\0") != identity.encode():
        raise InputError(f"{file}: of another run")
    if len(data) != HEADER.size + size or zlib.crc32(data[HEADER.size:]) != crc:
        raise InputError(f"{file}: cut off or damaged")
    return data[HEADER.size:]


def check_streams(deck: Path, streams: Sequence[str], engine_state: bytes) -> None:
    """Raises InputError if a stream is not, as far as it went at the checkpoint, what the engine had written."""
    name, count = BLOCK.unpack_from(engine_state)
    kept = np.frombuffer(engine_state, "<f8", count, BLOCK.size).reshape(-1, 2) if count else np.empty((0, 2))
    if name.rstrip(b"\0") != b"streams" or len(kept) != len(streams):
        raise InputError(f"{deck}: the checkpoint is of another deck")
    for stream, (length, crc) in zip(streams, kept, strict=True):
        if crc_of_beginning(deck / stream, int(length)) != int(crc):
            raise InputError(f"{deck / stream}: cut off, damaged or of another run")


def crc_of_beginning(file: Path, length: int) -> int | None:
    """CRC-32 of the first `length` bytes of a file; None if it is shorter."""
    if length == 0:
        return 0
    crc, left = 0, length
    try:
        with open(file, "rb") as opened:
            while left and (block := opened.read(min(left, 1 << 20))):
                crc, left = zlib.crc32(block, crc), left - len(block)
    except FileNotFoundError:
        return None
    return None if left else crc


def write_plate_state(directory: Path, step: int, state: State, identity: str) -> None:
    """Write the plate's half of the checkpoint of the run `identity` at DEM step `step`, and remove its halves but the
    last ones."""
    packed = io.BytesIO()
    np.savez(packed, allow_pickle=False, **state)
    data = packed.getvalue()
    with written_whole(half_of(directory, "plate", step)) as beside:
        beside.write_bytes(HEADER.pack(PLATE, VERSION[PLATE], identity.encode(), len(data), zlib.crc32(data)) + data)
    for earlier in steps_of(directory, "plate")[KEPT:]:
        half_of(directory, "plate", earlier).unlink()


def read_plate_state(file: Path, identity: str) -> State:
    """Return the state of a plate. Raises InputError as `read_checked` does."""
    data = read_checked(file, PLATE, identity)
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except (ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"{file}: not the state of a plate ({error})") from None
