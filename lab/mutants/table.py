"""The table of mutations: what is changed in which file, and which tests should see it."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
TABLE = Path(__file__).with_name("mutants.toml")
SOURCES = ("common", "dem", "plate_fem", "analysis", "recognition", "lab")
KEYS = {"name", "file", "original", "mutated", "tests", "harmless"}


class TableError(Exception):
    """A row of the table that does not fit the checkout."""


@dataclass(frozen=True)
class Mutant:
    """One row. `file` and `tests` are names of files, with as much of their directories as makes them unique, so that
    they stay right when directories are renamed; a test may go on with ::NAME. `original` stands once in the file.
    `harmless` says why a mutation changes no physics, if it does not."""

    name: str
    file: str
    original: str
    mutated: str
    tests: tuple[str, ...]
    harmless: str = ""

    @property
    def is_of_engine(self) -> bool:
        return self.file.endswith((".cpp", ".h"))

    def source(self, root: Path = ROOT) -> Path:
        """Raises TableError where no file, or more than one, has the name."""
        return unique(self.file, [file for top in SOURCES for file in _files(root / top, "*.*")])

    def place(self, text: str) -> int:
        """Return where `original` begins in the text of the file. Raises TableError unless it is there exactly once."""
        if (count := text.count(self.original)) != 1:
            raise TableError(f"{self.name}: its original text is {count} times in {self.file}, not once")
        return text.index(self.original)

    def applied(self, text: str) -> str:
        """Return the text of the file after the mutation. Raises TableError as `place` does."""
        start = self.place(text)
        return text[:start] + self.mutated + text[start + len(self.original) :]

    def test_files(self, root: Path = ROOT) -> list[Path]:
        """Raises TableError where one is missing or names none of the tests in it."""
        return [unique(test.partition("::")[0], _files(root / "tests", "test_*.py")) for test in self.tests]

    def test_arguments(self, root: Path = ROOT) -> list[str]:
        """Return what pytest is told."""
        files = self.test_files(root)
        names = [test.partition("::")[2] for test in self.tests]
        return [f"{file}::{name}" if name else str(file) for file, name in zip(files, names, strict=True)]


@cache
def _files(directory: Path, pattern: str) -> list[Path]:
    return sorted(directory.rglob(pattern))


def unique(name: str, files: list[Path]) -> Path:
    """Return the file that has this name, or ends so. Raises TableError where there is none, or more than one."""
    last = name.rpartition("/")[2]
    found = [file for file in files if file.name == last and file.as_posix().endswith(f"/{name}")]
    if len(found) != 1:
        raise TableError(f"{name}: {len(found)} files have this name, not one")
    return found[0]


def read_table(file: Path = TABLE) -> list[Mutant]:
    """Return all rows. Raises TableError for rows that are no mutations, whatever the checkout."""
    mutants = []
    for row in tomllib.loads(file.read_text())["mutant"]:
        if set(row) - KEYS or not KEYS - {"harmless"} <= set(row):
            raise TableError(f"{row.get('name')}: has the keys {sorted(row)}, must have {sorted(KEYS)}")
        mutants.append(Mutant(**(row | {"tests": tuple(row["tests"])})))
    names = [mutant.name for mutant in mutants]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise TableError(f"{', '.join(twice)}: more than one row has this name")
    return mutants
