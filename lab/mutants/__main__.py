"""Command line: python -m lab.mutants. Do the tests see what they should? Each mutation of the table is tried."""

from __future__ import annotations

import argparse
import csv
import hashlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from queue import Queue

from lab.mutants.table import ROOT, Mutant, TableError, read_table
from lab.mutants.weave import WeaveError, build, weaves

COLUMNS = ("name", "file", "outcome", "seconds", "by", "harmless", "state")
OWN_ENGINE = ROOT / "build" / "engine" / "liggghts-bonded"
Engines = dict[str, tuple[Path, int]]  # by the name of a mutation: the engine that has it, and its number there
Refused = dict[str, str]  # by the name of a mutation: why it does not compile
FAILED_TEST = re.compile(r"^(?:FAILED|ERROR) (\S.*?)(?: - |$)", re.MULTILINE)


@dataclass(frozen=True)
class Outcome:
    """`word` is killed, survived, timeout or error; `by` the test that failed, or what went wrong."""

    word: str
    seconds: float
    by: str


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return 0 if all mutants that change physics are killed, 1 if some are not, 2 for an error
    of the table."""
    options = _parser().parse_args(arguments)
    options.work.mkdir(parents=True, exist_ok=True)
    try:
        mutants = [mutant for mutant in read_table() if not options.only or re.search(options.only, mutant.name)]
        states = {mutant.name: _state(mutant) for mutant in mutants}
        results = Results(options.work / "mutants.csv")
        todo = [mutant for mutant in mutants if options.again or results.state(mutant.name) != states[mutant.name]]
        runner = Runner(options.work, options.jobs, options.timeout)
        engines, refused = runner.build_engines(todo)
        if options.unmutated:
            return runner.try_unmutated(todo, engines)
        for mutant in (mutant for mutant in todo if mutant.name in refused):
            results.add(mutant, states[mutant.name], Outcome("error", 0, refused[mutant.name]))
        runner.run([mutant for mutant in todo if mutant.name not in refused], engines,
                   lambda mutant, outcome: results.add(mutant, states[mutant.name], outcome))  # fmt: skip
    except (TableError, WeaveError) as error:
        print(error, file=sys.stderr)
        return 2
    return results.say({mutant.name for mutant in mutants})


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m lab.mutants", description=__doc__)
    parser.add_argument("--only", metavar="PATTERN", help="only mutations whose name matches (a regular expression)")
    parser.add_argument("--jobs", metavar="N", type=int, default=2, help="so many at once")
    parser.add_argument("--timeout", metavar="S", type=float, default=300,
                        help="what takes longer is given up, and tried again by the next call")  # fmt: skip
    parser.add_argument("--work", metavar="DIR", type=lambda name: Path(name).resolve(), default=ROOT / "build" / "mutants",
                        help="copies, engines and mutants.csv; a second call goes on there")  # fmt: skip
    parser.add_argument("--again", action="store_true", help="try those, too, whose row and tests are as they were")
    parser.add_argument("--unmutated", action="store_true", help="the named tests without a mutation: all must pass")
    return parser


def _state(mutant: Mutant) -> str:
    """Return a hash of what the outcome follows from, but for the rest of the product."""
    texts = [repr(mutant), mutant.source().read_text(), *(file.read_text() for file in mutant.test_files())]
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:12]


class Results:
    """The table of results, written anew after each mutation."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._rows: dict[str, Mapping[str, str]] = {}
        if file.is_file():
            with file.open(newline="") as stored:
                self._rows = {row["name"]: row for row in csv.DictReader(stored)}

    def state(self, name: str) -> str | None:
        """Return the state in which it was tried, None if it was not or could not be."""
        row = self._rows.get(name)
        return row["state"] if row and row["outcome"] in ("killed", "survived") else None

    def add(self, mutant: Mutant, state: str, outcome: Outcome) -> None:
        values = (mutant.name, mutant.file, outcome.word, f"{outcome.seconds:.0f}", outcome.by, mutant.harmless, state)
        self._rows[mutant.name] = dict(zip(COLUMNS, values, strict=True))
        print(f"{outcome.word:9} {outcome.seconds:4.0f} s  {mutant.name}  {outcome.by}", flush=True)
        with self._file.open("w", newline="") as out:
            writer = csv.DictWriter(out, COLUMNS)
            writer.writeheader()
            writer.writerows(self._rows[name] for name in sorted(self._rows))

    def say(self, names: set[str]) -> int:
        """Print the share that was killed of those that change physics, and name those that were not."""
        rows = [row for name, row in self._rows.items() if name in names and not row["harmless"]]
        others = [row["name"] for row in rows if row["outcome"] != "killed"]
        killed = len(rows) - len(others)
        print(f"killed {killed} of {len(rows)} that change physics ({100 * killed / max(1, len(rows)):.1f} %)")
        for name in sorted(others):
            print(f"  {self._rows[name]['outcome']}: {name}")
        return 1 if others else 0


class Runner:
    """Copies of the checkout, one a job, in each of which one mutation at a time is tried."""

    def __init__(self, work: Path, jobs: int, timeout_s: float) -> None:
        self._work, self._jobs, self._timeout_s = work, jobs, timeout_s
        self._copies: Queue[Path] = Queue()
        for job in range(jobs):
            self._copies.put(_copy_of_checkout(work / f"copy_{job}"))

    def build_engines(self, mutants: Sequence[Mutant]) -> tuple[Engines, Refused]:
        """Raises WeaveError."""
        engines, refused = Engines(), Refused()
        if any(mutant.is_of_engine for mutant in mutants):
            for k, group in enumerate(weaves(read_table())):  # of all, so that --only compiles nothing anew
                engine, not_in_it = build(group, self._work / f"weave_{k}")
                engines |= {one.mutant.name: (engine, number) for number, one in enumerate(group, 1)}
                refused |= not_in_it
        return engines, refused

    def run(self, mutants: Sequence[Mutant], engines: Engines, tell: Callable[[Mutant, Outcome], None]) -> None:
        """Try mutations, and tell of each as soon as it is known."""
        with ThreadPoolExecutor(self._jobs) as pool:
            tried = {pool.submit(self._try, mutant, *engines.get(mutant.name, (OWN_ENGINE, 0))): mutant
                     for mutant in mutants}  # fmt: skip
            for done in as_completed(tried):
                tell(tried[done], done.result())

    def try_unmutated(self, mutants: Sequence[Mutant], engines: Engines) -> int:
        """Return 0 if all the named tests pass in a copy, and with each woven engine while no mutation acts."""
        tests = sorted({test for mutant in mutants for test in mutant.test_arguments()})
        copy = self._copies.get()
        codes = []
        for engine in sorted({OWN_ENGINE} | {engine for engine, _ in engines.values()}):
            codes.append(subprocess.run(self._pytest(copy, tests), cwd=copy, env=_environment(copy, engine, 0),
                                        check=False).returncode)  # fmt: skip
        return max(codes)

    @staticmethod
    def _pytest(copy: Path, tests: Sequence[str]) -> list[str]:
        there = [str(copy / Path(test).relative_to(ROOT)) for test in tests]
        return [sys.executable, "-m", "pytest", "-q", "--tb=short", "-p", "no:cacheprovider", *there]

    def _try(self, mutant: Mutant, engine: Path, number: int) -> Outcome:
        copy = self._copies.get()
        file = copy / mutant.source().relative_to(ROOT)
        text = file.read_text()
        try:
            if not mutant.is_of_engine:
                file.write_text(mutant.applied(text))
                compile(file.read_text(), file, "exec")
            return self._tested(copy, mutant, _environment(copy, engine, number))
        except SyntaxError as error:
            return Outcome("error", 0, str(error))
        finally:
            file.write_text(text)
            self._copies.put(copy)

    def _tested(self, copy: Path, mutant: Mutant, environment: Mapping[str, str]) -> Outcome:
        begin = time.monotonic()
        tests = subprocess.Popen([*self._pytest(copy, mutant.test_arguments()), "-x"], cwd=copy, env=environment,
                                 stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
                                 start_new_session=True)  # fmt: skip
        try:
            said, _ = tests.communicate(timeout=self._timeout_s)
        except subprocess.TimeoutExpired:
            os.killpg(tests.pid, signal.SIGKILL)
            tests.communicate()
            return Outcome("timeout", self._timeout_s, f"longer than {self._timeout_s:g} s")
        seconds, failed = time.monotonic() - begin, FAILED_TEST.search(said)
        if tests.returncode == 0:
            return Outcome("survived", seconds, "")
        if tests.returncode in (1, 2) and failed:
            return Outcome("killed", seconds, failed[1])
        return Outcome("error", seconds, (said.strip().splitlines() or ["no word"])[-1])


def _environment(copy: Path, engine: Path, number: int) -> dict[str, str]:
    """Each copy has temporary files of its own: engines that start side by side must not share those of MPI."""
    temporary = copy.with_name(f"temporary_{copy.name}")
    temporary.mkdir(exist_ok=True)
    return os.environ | {"PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1", "LIGGGHTS_BONDED": str(engine),
                         "MUTANT": str(number), "TMPDIR": str(temporary), "OMP_NUM_THREADS": "1",
                         "OPENBLAS_NUM_THREADS": "1"}  # fmt: skip


def _copy_of_checkout(directory: Path) -> Path:
    """Return a directory with the files of the checkout that git knows or would."""
    git = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", "-z"], cwd=ROOT, capture_output=True,
                         check=True)  # fmt: skip
    shutil.rmtree(directory, ignore_errors=True)
    for name in git.stdout.decode().split("\0"):
        if name and (ROOT / name).is_file():
            (directory / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, directory / name)
    subprocess.run([sys.executable, "-m", "compileall", "-q", str(directory)], check=False)
    return directory


if __name__ == "__main__":
    sys.exit(main())
