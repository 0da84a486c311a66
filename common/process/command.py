"""How every command line ends: by itself, by Ctrl-C, at a closed pipe, a full disk, or with too little memory.

This module is imported before anything else, so it imports nothing slow.
"""

import argparse
import atexit
import errno
import gc
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import IO, Any, NoReturn

from common.input_error import CommandError, InputError, printable

INTERRUPTED = 130  # as a shell has it for a program that SIGINT ended
PIPE_CLOSED = 141  # and SIGPIPE
_LINE = "interrupted; what is finished stays, the same command goes on"
_running: list[str] = []  # commands of `run_command`, which catch a KeyboardInterrupt
_told: list[str] = []  # the line with which a command ended, until the next one begins


class Parser(argparse.ArgumentParser):
    """Arguments that cannot be used are refused as any other input."""

    def error(self, message: str) -> NoReturn:
        """Raises InputError, which says which argument is wrong."""
        raise InputError(f"{self.prog}: {message} (--help tells what is allowed)")

    def print_help(self, file: Any = None) -> None:
        """Print the help; unlike that of argparse it raises what keeps it from being printed."""
        print(self.format_help(), end="", file=file)


def listen_for_interrupt() -> None:
    """From now on Ctrl-C ends this program with one line and no traceback. Meant for the first line of a program,
    before its imports. A program that was started with SIGINT ignored goes on ignoring it. Once all is done, while
    Python is taken down, Ctrl-C changes nothing: the exit code is that of what was done."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)
        atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)


@contextmanager
def imports() -> Iterator[None]:
    """Within, Python seeks no garbage, and never among what was made there: modules stay, and a sixth of the time that
    many of them take to import went into that search."""
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


def one_thread() -> None:
    """Let linear algebra use one thread, if the user did not choose otherwise, and numpy was not imported before. The
    numerics are many small operations: threads would only wait for each other, and take the core of another process."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")


def _interrupt(_number: int, frame: FrameType | None) -> None:
    """An import cannot be interrupted by an exception, since extension modules turn it into another or lose it. While
    one is under way nothing is half written that matters, so the program ends at once. One that says why it ended does
    so in one line."""
    if _told:
        return
    if _running and not _within_import(frame):
        raise KeyboardInterrupt
    os.write(2, f"{_LINE}\n".encode())
    os._exit(INTERRUPTED)


def _within_import(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def run_command(program: str, command: Callable[[], int], as_json: bool = False) -> int:
    """Run a command and return its exit code. One that ends without a result says why, in one line on standard error,
    and `as_json` in an object on the output as well."""
    code, line = end_of(program, command)
    if line:
        _told.append(line)
        say(line)
        if as_json:
            _print_refusal(line, code)
    return code


def end_of(program: str, command: Callable[[], int]) -> tuple[int, str]:
    """Run a command; return its exit code and, if it ended without a result, the line that says why. That is what it
    raises as a CommandError, and what any command may meet: Ctrl-C (130), a reader that closed the pipe (141, without a
    line), a disk that is full or cannot be read or written (1), too little memory (1)."""
    one_thread()
    _told.clear()
    _running.append(program)
    try:
        return _ended(program, command)
    except KeyboardInterrupt:  # while the line of another end was made
        return INTERRUPTED, _LINE
    finally:
        _running.pop()


def _ended(program: str, command: Callable[[], int]) -> tuple[int, str]:
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors="backslashreplace")  # a name of a file need not be text
    try:
        try:
            return command(), ""
        finally:
            sys.stdout.flush()  # here, where a full disk can still be told of
    except CommandError as error:
        return error.exit_code, str(error)
    except SystemExit as end:  # of --help and --version
        return int(end.code or 0), ""
    except KeyboardInterrupt:
        return INTERRUPTED, _LINE
    except BrokenPipeError:
        _silence(sys.stdout)
        return PIPE_CLOSED, ""
    except MemoryError:
        return 1, f"{program}: not enough memory"
    except (RuntimeError, ImportError) as error:
        if not any(words in str(error) for words in ("can't start new thread", "failed to map segment")):
            raise
        return 1, f"{program}: not enough memory ({error})"
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EIO):
            _silence(sys.stdout)  # what is left in its buffer would be tried again at the end
        where = f"{error.filename}: " if error.filename else ""
        return 1, f"{program}: {where}{error.strerror or error}"


def _print_refusal(line: str, code: int) -> None:
    """If somebody reads it."""
    import json  # late, as few ask for it

    try:
        print(json.dumps({"error": printable(line), "exit_code": code}), flush=True)
    except OSError:
        _silence(sys.stdout)


def say(line: str) -> None:
    """One line on standard error, if somebody reads it."""
    try:
        print(printable(line), file=sys.stderr, flush=True)
    except OSError:
        _silence(sys.stderr)


def _silence(stream: IO[Any]) -> None:
    """Send what is still to be written to nowhere."""
    try:
        descriptor = stream.fileno()
    except (OSError, ValueError):
        return  # of a test, in memory
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, descriptor)
    os.close(nowhere)
