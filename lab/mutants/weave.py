"""Mutations of the engine, woven into few engines: the environment variable MUTANT says which one acts.

To compile an engine for each would take hours. An expression E with the mutation M becomes
`(mutant_acts(n) ? (M) : (E))`, and a statement, which ends in a semicolon, `{ if (mutant_acts(n)) { M } else { E } }`.
Mutations of texts that overlap go into different engines.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Container, Sequence
from dataclasses import dataclass
from pathlib import Path

from lab.mutants.table import ROOT, Mutant

ENGINE = ROOT / "dem" / "engine"
SWITCH = """#pragma once
#include <cstdlib>
inline const int acting_mutant = std::getenv("MUTANT") ? std::atoi(std::getenv("MUTANT")) : 0;
inline bool mutant_acts(int number) { return acting_mutant == number; }
"""


ERROR = re.compile(r"^(\S+?):(\d+):(\d+): error: (.*)", re.MULTILINE)  # as the compiler says it
NUMBER = re.compile(r"mutant_acts\((\d+)\)")


class WeaveError(Exception):
    """An engine with mutations does not compile, and no mutation stands where the compiler says so."""


@dataclass(frozen=True)
class Woven:
    """A mutation of the engine, and where its original text stands in `file`, a path below dem/engine."""

    mutant: Mutant
    file: str
    start: int

    @property
    def end(self) -> int:
        return self.start + len(self.mutant.original)

    def overlaps(self, other: Woven) -> bool:
        return self.file == other.file and self.start < other.end and other.start < self.end

    def text(self, number: int) -> str:
        """Return what stands for the original one."""
        one = self.mutant
        if one.original.endswith(";"):
            return f"{{ if (mutant_acts({number})) {{ {one.mutated} }} else {{ {one.original} }} }}"
        return f"(mutant_acts({number}) ? ({one.mutated}) : ({one.original}))"


def weaves(mutants: Sequence[Mutant]) -> list[list[Woven]]:
    """Return the mutations of the engine in as many groups as keep overlapping ones apart."""
    groups: list[list[Woven]] = []
    for mutant in mutants:
        if not mutant.is_of_engine:
            continue
        source = mutant.source()
        one = Woven(mutant, source.relative_to(ENGINE).as_posix(), mutant.place(source.read_text()))
        for group in groups:
            if not any(one.overlaps(other) for other in group):
                group.append(one)
                break
        else:
            groups.append([one])
    return groups


def build(group: Sequence[Woven], directory: Path) -> tuple[Path, dict[str, str]]:
    """Build the engine with all of a group, numbered from 1 in their order. Only what has changed since the last build
    there is compiled. Return it, and what the compiler says of those that it refuses, by name: they are left out.
    Raises WeaveError."""
    sources, refused = directory / "engine", dict[str, str]()
    while True:
        _write(group, refused, sources)
        make = shutil.which("make") or "make"
        done = subprocess.run([make, "-k", "-j2", "-C", str(sources), f"BUILD={directory / 'build'}",
                               f"CXX=mpicxx -include {sources / 'mutant_switch.h'}"],
                              capture_output=True, text=True, check=False)  # fmt: skip
        if not done.returncode:
            return directory / "build" / "liggghts-bonded", refused
        if not (more := _refused(group, sources, done.stderr)):
            errors = [line for line in done.stderr.splitlines() if "error:" in line]
            raise WeaveError("\n".join(errors or done.stderr.splitlines()[-20:]))
        refused |= more


def _write(group: Sequence[Woven], left_out: Container[str], sources: Path) -> None:
    """Write the sources of the engine with a group in them, leave files alone that are so already, and remove others."""
    texts = {file.relative_to(ENGINE).as_posix(): file.read_text() for file in ENGINE.rglob("*") if file.is_file()}
    for number, one in sorted(enumerate(group, 1), key=lambda pair: -pair[1].start):
        if one.mutant.name not in left_out:
            texts[one.file] = texts[one.file][: one.start] + one.text(number) + texts[one.file][one.end :]
    texts["mutant_switch.h"] = SWITCH
    for file in sources.rglob("*"):
        if file.is_file() and file.relative_to(sources).as_posix() not in texts:
            file.unlink()
    for name, text in texts.items():
        file = sources / name
        file.parent.mkdir(parents=True, exist_ok=True)
        if not file.is_file() or file.read_text() != text:
            file.write_text(text)


def _refused(group: Sequence[Woven], sources: Path, said: str) -> dict[str, str]:
    """Return what the compiler said of the mutations in whose lines it found errors, by their names."""
    found = dict[str, str]()
    for file, line, column, message in ERROR.findall(said):
        if (sources / file).is_file():
            text = (sources / file).read_text().splitlines()[int(line) - 1]
            places = list(NUMBER.finditer(text))
            if places:
                before = [place for place in places if place.start() < int(column)]
                found.setdefault(group[int((before or places)[-1][1]) - 1].mutant.name, message)
    return found
