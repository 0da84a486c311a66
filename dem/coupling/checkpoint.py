"""The state of a run on disk, from which it goes on after it was stopped or killed (docs/runs.md).

A checkpoint has two halves, one of each program, in `deck/checkpoint`: `engine_STEP.checkpoint`, written by the
engine (dem/engine/record/fix_checkpoint.h), and `plate_STEP.checkpoint`, written here when the engine says that its
half is on disk. Each file appears whole or not at all and carries the identity of the run, its length and CRC-32; the
engine's half has length and CRC-32 of the streams, the files that the engine appends to, as well. A checkpoint counts
when all of that is as this run wrote it. A rigid plate has no half.
"""

from __future__ import annotations

import io
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from common.files.whole import written_whole
from common.tables import InputError

HEADER = struct.Struct("<8sq64sqq")  # magic, version, identity of the run, bytes that follow, their CRC-32
BLOCK = struct.Struct("<32sq")  # of an engine's file: name, count of the numbers that follow
ENGINE, PLATE = b"CGISTATE", b"CGIPLATE"
VERSION = {ENGINE: 6, PLATE: 2}
BY_HAND = "none"  # identity of a run whose engine is started by hand
KEPT = 2  # checkpoints: the one before the last is there for when the last is damaged

State = dict[str, np.ndarray]


def engine_file(directory: Path, step: int) -> Path:
    """The engine's half of the checkpoint at DEM step `step`."""
    return directory / f"engine_{step}.checkpoint"


def plate_file(directory: Path, step: int) -> Path:
    """The plate's half of the checkpoint at DEM step `step`."""
    return directory / f"plate_{step}.checkpoint"


def steps_of(directory: Path, half: str = "engine") -> list[int]:
    """The DEM steps of which there is a half of a checkpoint, the last one first."""
    found = (re.fullmatch(rf"{half}_(\d+)\.checkpoint", file.name) for file in directory.glob(f"{half}_*.checkpoint"))
    return sorted((int(match[1]) for match in found if match), reverse=True)


def latest(directory: Path, flexible: bool) -> int:
    """The DEM step of the last checkpoint, whole or damaged, 0 if there is none. That of a `flexible` plate has two
    halves."""
    return next((step for step in steps_of(directory) if not flexible or plate_file(directory, step).exists()), 0)


def last_whole(deck: Path, streams: Sequence[str], flexible: bool, identity: str, note: Callable[[str], None]) -> int:
    """The DEM step of the last checkpoint that is as the run `identity` wrote it, with the streams as far as they went
    then; 0 if there is none. `note` is called with one line for each damage found. All other checkpoints are
    removed, so that none is gone on from later."""
    directory, chosen = deck / "checkpoint", 0
    for step in steps_of(directory):
        if chosen:
            break
        if flexible and not plate_file(directory, step).exists():
            continue  # killed between the two halves
        try:
            check_streams(deck, streams, read_checked(engine_file(directory, step), ENGINE, identity))
            if flexible:
                read_plate_state(plate_file(directory, step), identity)
            chosen = step
        except (InputError, OSError) as damage:
            note(f"the checkpoint of step {step} is passed over: {damage}")
    for half, name in (("engine", engine_file), ("plate", plate_file)):
        for step in set(steps_of(directory, half)) - {chosen}:
            name(directory, step).unlink()
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
    with written_whole(plate_file(directory, step)) as beside:
        beside.write_bytes(HEADER.pack(PLATE, VERSION[PLATE], identity.encode(), len(data), zlib.crc32(data)) + data)
    for earlier in steps_of(directory, "plate")[KEPT:]:
        plate_file(directory, earlier).unlink()


def read_plate_state(file: Path, identity: str) -> State:
    """Return the state of a plate. Raises InputError as `read_checked` does."""
    data = read_checked(file, PLATE, identity)
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except (ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"{file}: not the state of a plate ({error})") from None
