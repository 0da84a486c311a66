"""The state of a run on disk, from which it goes on after it was stopped or killed (docs/runs.md).

A checkpoint has two halves, one of each program, in `deck/checkpoint`: `engine_STEP.checkpoint`, written by the engine
(dem/engine/fix_checkpoint.h), and `plate_STEP.npz`, written here when the engine says that its half is on disk. Each
file appears whole or not at all. A checkpoint counts when all its halves are there; a rigid plate has none.
"""

from __future__ import annotations

import re
import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np

from common.files import written_whole
from common.tables import InputError

ENGINE_HEADER = struct.Struct("<8sqqq")  # magic, version, bytes that follow, their CRC-32
ENGINE_MAGIC, ENGINE_VERSION = b"CGISTATE", 1

State = dict[str, np.ndarray]


def engine_file(directory: Path, step: int) -> Path:
    """The engine's half of the checkpoint at DEM step `step`."""
    return directory / f"engine_{step}.checkpoint"


def plate_file(directory: Path, step: int) -> Path:
    """The plate's half of the checkpoint at DEM step `step`."""
    return directory / f"plate_{step}.npz"


def latest(directory: Path, flexible: bool) -> int:
    """The DEM step of the last whole checkpoint, 0 if there is none. That of a `flexible` plate has two halves."""
    steps = [int(found[1]) for file in directory.glob("engine_*.checkpoint")
             if (found := re.fullmatch(r"engine_(\d+)\.checkpoint", file.name))]
    return max((step for step in steps if not flexible or plate_file(directory, step).exists()), default=0)


def check_engine_file(file: Path) -> None:
    """Raises InputError for a file that is cut off, damaged or none of the engine's."""
    data = file.read_bytes()
    if len(data) < ENGINE_HEADER.size or data[:8] != ENGINE_MAGIC:
        raise InputError(f"{file}: not a checkpoint of the engine; allowed is what the engine wrote")
    _, version, size, crc = ENGINE_HEADER.unpack_from(data)
    if version != ENGINE_VERSION:
        raise InputError(f"{file}: a checkpoint of version {version}; allowed is {ENGINE_VERSION}")
    if len(data) != ENGINE_HEADER.size + size or zlib.crc32(data[ENGINE_HEADER.size:]) != crc:
        raise InputError(f"{file}: cut off or damaged; allowed is what the engine wrote")


def write_plate_state(directory: Path, step: int, state: State) -> None:
    """Write the plate's half of the checkpoint at DEM step `step`, and remove its earlier halves."""
    file = plate_file(directory, step)
    with written_whole(file) as beside, open(beside, "wb") as out:  # savez would add .npz to a name
        np.savez(out, allow_pickle=False, **state)
    for earlier in directory.glob("plate_*.npz"):
        if earlier != file:
            earlier.unlink()


def read_plate_state(file: Path) -> State:
    """Return the state of a plate. Raises InputError for a file that is cut off, damaged or something else."""
    try:
        with np.load(file, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except (ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"{file}: cut off, damaged or not the state of a plate ({error})") from None
