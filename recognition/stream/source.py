"""Samples as they come: a line of JSON, then frames of float32, little-endian, one number a channel.

    {"rate_Hz": 51200, "channels": ["north", "east"], "unit": "g"}
"""

import json
import os
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import Queue
from threading import Thread

import numpy as np

from analysis.signals.records import RecordError
from recognition.estimation.arrays import Floats
from recognition.plate.records import MOST

TCP = "tcp://"
AT_ONCE, WAITING, LONGEST_LINE = 1 << 16, 64, 1 << 16  # bytes; so many times AT_ONCE may wait
BLOCK_S, PATIENCE_S = 0.01, 0.01  # least block of samples; before a file is looked at again


def is_live(record: str) -> bool:
    """Whether a record is the standard input or a socket."""
    return record == "-" or record.startswith(TCP)


class Source:
    """The standard input ("-"), a socket (tcp://HOST:PORT) or a file, which may grow; its rate, channels and unit.
    RecordError for what cannot be read."""

    broken: RecordError | None = None  # why no more can be read

    def __init__(self, record: str, follow: bool) -> None:
        self.name = "standard input" if record == "-" else record
        self._waiting: Queue[bytes | OSError] = Queue(WAITING)
        Thread(target=self._read, args=(_opened(record), follow), daemon=True).start()
        line = b""
        while b"\n" not in line and len(line) < LONGEST_LINE and (more := self._next()):
            line += more
        if self.broken is not None:
            raise self.broken
        line, end, self._left = line.partition(b"\n")
        try:
            header = json.loads(line) if end else None
        except ValueError:
            header = None
        if not isinstance(header, dict) or set(header) - {"unit"} != {"rate_Hz", "channels"}:
            raise RecordError(f"{self.name}: must begin with a line of JSON with rate_Hz, channels and perhaps unit")
        self.rate_Hz, self.channels, self.unit = header["rate_Hz"], header["channels"], header.get("unit")
        if isinstance(self.rate_Hz, bool) or not isinstance(self.rate_Hz, int | float) or not 0 < self.rate_Hz < 1e7:
            raise RecordError(f"{self.name}: rate_Hz = {self.rate_Hz!r}; must be a number above 0, below 1e7")
        names = self.channels if isinstance(self.channels, list) else []
        if not names or not all(isinstance(name, str) for name in names) or len(set(names)) < len(names):
            raise RecordError(f"{self.name}: channels = {self.channels!r}; must be a list of different names")

    def blocks(self) -> Iterator[Floats]:
        """Samples (c, n), of BLOCK_S at least, up to one that is not finite, or cut off, or until no more can be read:
        `broken` then says why."""
        c, parts, done = len(self.channels), bytearray(self._left), 0
        while self.broken is None:
            more = self._next()
            parts += more
            frames = len(parts) // (4 * c)
            if more and frames < BLOCK_S * self.rate_Hz:
                continue
            values = np.frombuffer(bytes(parts[:4 * c * frames]), "<f4").reshape(frames, c).T.astype(float)
            if (wrong := ~(abs(values) <= MOST)).any():
                frame, channel = np.argwhere(wrong.T)[0]
                at_s = (done + frame) / self.rate_Hz
                self.broken = RecordError(f"{self.name}: {self.channels[channel]} at {at_s:.6g} s: every sample must "
                                          f"be finite, and at most {MOST:g}")
                values = values[:, :frame]
            yield values
            del parts[:4 * c * frames]
            done += frames
            if not more:
                break
        if parts and self.broken is None:
            self.broken = RecordError(f"{self.name}: ends within a frame, {len(parts)} of {4 * c} bytes")

    def _next(self) -> bytes:
        found = self._waiting.get()
        if isinstance(found, OSError):
            self.broken = RecordError(f"{self.name}: {found.strerror or found}")
            return b""
        return found

    def _read(self, read: Callable[[], bytes], follow: bool) -> None:
        """What comes waits, while stones are sought."""
        try:
            while (found := read()) or follow:
                if found:
                    self._waiting.put(found)
                else:
                    time.sleep(PATIENCE_S)
            self._waiting.put(b"")
        except OSError as error:
            self._waiting.put(error)


def _opened(record: str) -> Callable[[], bytes]:
    """What gives the bytes that are there, and none at the end."""
    if record == "-":
        standard_input = os.dup(0)  # an earlier reader, which still waits, takes no bytes of what replaces it
        return lambda: os.read(standard_input, AT_ONCE)
    try:
        if record.startswith(TCP):
            host, _, port = record.removeprefix(TCP).rpartition(":")
            connection = socket.create_connection((host.strip("[]"), int(port)))
            return lambda: connection.recv(AT_ONCE)
        file = Path(record).open("rb", buffering=0)
        return lambda: file.read(AT_ONCE) or b""
    except (OSError, ValueError, OverflowError) as error:
        raise RecordError(f"{record}: cannot be read: {error}") from None
