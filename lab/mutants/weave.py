"""Mutations of the engine, woven into few engines: the environment variable MUTANT says which one acts.

To compile an engine for each would take hours. An expression E with the mutation M becomes
`(mutant_acts(n) ? (M) : (E))`, and a statement, which ends in a semicolon, `{ if (mutant_acts(n)) { M } else { E } }`.
Mutations of texts that overlap go into different engines.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lab.mutants.table import ROOT, Mutant

ENGINE = ROOT / "dem" / "engine"
SWITCH = """#pragma once
#include <cstdlib>
inline const int acting_mutant = std::getenv("MUTANT") ? std::atoi(std::getenv("MUTANT")) : 0;
inline bool mutant_acts(int number) { return acting_mutant == number; }
"""


class WeaveError(Exception):
    """An engine with mutations does not compile."""


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


def build(group: Sequence[Woven], directory: Path) -> Path:
    """Build the engine with all of a group, numbered from 1 in their order, and return it. Only what has changed since
    the last build there is compiled. Raises WeaveError."""
    sources = directory / "engine"
    sources.mkdir(parents=True, exist_ok=True)
    texts = {file.relative_to(ENGINE).as_posix(): file.read_text() for file in ENGINE.rglob("*") if file.is_file()}
    for one, number in sorted(((one, k) for k, one in enumerate(group, 1)), key=lambda pair: -pair[0].start):
        texts[one.file] = texts[one.file][: one.start] + one.text(number) + texts[one.file][one.end :]
    for name, text in (texts | {"mutant_switch.h": SWITCH}).items():
        file = sources / name
        file.parent.mkdir(exist_ok=True)
        if not file.is_file() or file.read_text() != text:
            file.write_text(text)
    make = shutil.which("make") or "make"
    done = subprocess.run([make, "-k", "-j2", "-C", str(sources), f"BUILD={directory / 'build'}",
                           f"CXX=mpicxx -include {sources / 'mutant_switch.h'}"],
                          capture_output=True, text=True, check=False)  # fmt: skip
    if done.returncode:
        errors = [line for line in done.stderr.splitlines() if "error:" in line]
        raise WeaveError("\n".join(errors or done.stderr.splitlines()[-20:]))
    return directory / "build" / "liggghts-bonded"
