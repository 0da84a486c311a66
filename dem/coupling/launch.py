"""Build and find the engine and its library, tell where that is another than the tested one, and start the engine."""

import hashlib
import logging
import os
import secrets
import shutil
import signal
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, partial
from itertools import pairwise
from pathlib import Path

from platformdirs import user_cache_path

from common.files.output_directory import Busy, locked, locked_directory
from common.process.processes import die_with_parent
from common.resources import checkout
from common.tables import InputError

LIGGGHTS_VERSION = "3.8.0+repack1-9+b2"  # Debian package that all is tested with
_log = logging.getLogger(__name__)
SHARED_MEMORY, PREFIX = Path("/dev/shm"), "cgi-"  # a short path, as that of a socket must be
SOURCES = Path(__file__).resolve().parent.parent / "engine"
TOOLS = {"make": "make", "mpicxx": "libopenmpi-dev", "g++": "g++"}  # and the Debian package of each


def build_directory() -> Path:
    """Return where the engine is built: `build/engine` in a checkout; else a directory of the user's cache that is
    named after the sources, so that a program built from other ones is never taken for this one."""
    top = checkout()
    if top is not None:
        return top / "build" / "engine"
    return user_cache_path("coal-gangue-impact") / f"engine-{hash_of_sources(SOURCES)[:12]}"


def hash_of_sources(directory: Path) -> str:
    """SHA-256 of the names and contents of all files below a directory."""
    files = sorted(file for file in directory.rglob("*") if file.is_file())
    told = (f"{file.relative_to(directory)}\0".encode() + hashlib.sha256(file.read_bytes()).digest() for file in files)
    return hashlib.sha256(b"".join(told)).hexdigest()


ENGINE = Path(os.environ.get("LIGGGHTS_BONDED", build_directory() / "liggghts-bonded"))


@cache
def library_version() -> str:
    """The version of LIGGGHTS. One that is not the tested one is told: the engine, when it starts, compares the sizes
    of its classes with those that it was built with (dem/engine/library_check.cpp). Raises InputError, one line, if
    LIGGGHTS is missing, OSError if one cannot ask."""
    query = subprocess.run(["dpkg-query", "-W", "-f=${Version}", "libliggghts-dev"], capture_output=True, text=True,
                           check=False)
    if query.returncode < 0:
        raise OSError(f"dpkg-query, which tells the version of LIGGGHTS, was ended by signal {-query.returncode}")
    if query.returncode != 0:
        raise InputError(f"LIGGGHTS: libliggghts-dev is not installed; version {LIGGGHTS_VERSION} is needed "
                         f"(apt-get install libliggghts-dev={LIGGGHTS_VERSION})")
    if query.stdout != LIGGGHTS_VERSION:
        _log.warning("note: LIGGGHTS: libliggghts-dev is of version %s; tested is %s", query.stdout, LIGGGHTS_VERSION)
    return query.stdout


def check_engine() -> Path:
    """The engine. Raises InputError, one line, if LIGGGHTS or it is missing."""
    library_version()
    if not os.access(ENGINE, os.X_OK):
        raise InputError(f"LIGGGHTS: the engine {ENGINE} is missing; `gangue build-engine` builds it")
    return ENGINE


def _before_engine() -> None:
    """The engine dies with this process. Ctrl-C on a terminal, which reaches it too, is this process's to answer."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    die_with_parent()


@contextmanager
def engine_running(directory: Path, np: int = 1, inherit: tuple[int, ...] = (),
                   **variables: object) -> Iterator[subprocess.Popen[bytes]]:
    """The engine on deck.liggghts in `directory` with `np` MPI ranks and these `variables` of the deck, which is killed
    at the end if it still runs. What it prints goes to engine.out there. The file descriptors `inherit` stay open as
    long as it lives."""
    command = [*mpirun(np), "-in", "deck.liggghts", "-log", "engine.log"]
    for name, value in variables.items():
        command += ["-var", name, str(value)]
    before = _before_engine if np == 1 else partial(die_with_parent, signal.SIGTERM)  # which mpirun passes on
    with _place_of_ranks(np) as (places, locks):
        with open(directory / "engine.out", "wb") as out:
            engine = subprocess.Popen(command, cwd=directory, env=_environment() | places, stdin=subprocess.DEVNULL,
                                      stdout=out, stderr=subprocess.STDOUT, pass_fds=inherit + locks,
                                      preexec_fn=before)  # noqa: PLW1509 - takes no lock
        try:
            yield engine
        finally:
            if engine.poll() is None:
                engine.kill()
                engine.wait()


@contextmanager
def _place_of_ranks(np: int) -> Iterator[tuple[dict[str, str], tuple[int, ...]]]:
    """A directory for what the ranks of one engine share. In the one that MPI gives all its programs, one that starts
    may miss what another that ends has just removed. Yields the variables of the environment that name it, and a lock
    for the engine to inherit; neither for one rank, which makes no such files."""
    if np == 1:
        yield {}, ()
        return
    memory = SHARED_MEMORY if os.access(SHARED_MEMORY, os.W_OK) else Path(tempfile.gettempdir())
    for left in memory.glob(f"{PREFIX}*"):
        _remove_if_left(left)
    place = memory / f"{PREFIX}{os.getpid()}-{secrets.token_hex(4)}"
    lock = locked_directory(place)
    try:
        yield {"TMPDIR": str(place), "OMPI_MCA_btl_vader_backing_directory": str(place)}, (lock,)
    finally:
        shutil.rmtree(place, ignore_errors=True)
        os.close(lock)


def _remove_if_left(place: Path) -> None:
    """Remove what an engine of this user that was killed with its run could not."""
    try:
        if place.lstat().st_uid == os.getuid():
            lock = locked(place / "lock")
            shutil.rmtree(place, ignore_errors=True)
            os.close(lock)
    except (Busy, OSError):  # in use, or just gone
        return


def mpirun(np: int) -> list[str]:
    """The command that starts the engine on `np` ranks of this machine; its arguments are to be added. A rank that
    waits lets others work: the plate is one more process than MPI counts, and on a busy machine two ranks that wait
    in turn would else use up a time slice at every step."""
    ranks = [] if np == 1 else ["mpirun", "-np", str(np), "--oversubscribe", "--bind-to", "none",
                                "--mca", "mpi_yield_when_idle", "1"]
    return [*ranks, str(ENGINE)]


def _environment() -> dict[str, str]:
    """Without what a queue tells MPI: all ranks are on this machine, and LIGGGHTS is no task of the queue's own. The
    engine learns which process the plate is, to see when that is stuck (dem/engine/coupling/watchdog.h). mpirun looks
    for no graphics cards, as the engine does not (dem/engine/main.cpp)."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("SLURM_", "PMI_", "PMIX_"))}
    return {"HWLOC_COMPONENTS": "-gl"} | kept | {"PLATE_PROCESS": f"{socket.gethostname()} {os.getpid()}"}


def engine_error(directory: Path) -> str:
    """The ERROR line of what the engine printed, else what mpirun framed with dashes first, else its last line."""
    lines = [line for line in (directory / "engine.out").read_text(errors="replace").splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("ERROR")]  # MPI writes of its own errors when it is ended
    framed = [line for frame, line in pairwise(lines) if _is_frame(frame) and not _is_frame(line)]
    return (errors or framed[:1] or lines or ["no output"])[-1]


def _is_frame(line: str) -> bool:
    """Is it one of the two lines of dashes about a message of mpirun?"""
    return len(line) > 10 and not line.strip("-")


def build_engine() -> Path:
    """Build the engine; return where it is. Raises InputError, one line, if LIGGGHTS, a compiler or make is missing, if
    LIGGGHTS is of another version, or after the compiler's errors.
    """
    library_version()
    for tool, package in TOOLS.items():
        if shutil.which(tool) is None:
            raise InputError(f"the engine: {tool} is not installed; it is needed to build it "
                             f"(apt-get install {package})")
    directory = build_directory()
    command = ["make", "-s", "-j", str(os.cpu_count() or 1), "-C", str(SOURCES), f"BUILD={directory}"]
    if subprocess.run(command, check=False).returncode:
        raise InputError("the engine: not built, for what make and the compiler have said")
    return directory / "liggghts-bonded"
