"""Tables of the laboratory: lab/results/NAME.csv, each with a head that says what made it, when, and of which sources.

The head is of comment lines, `# key: value`. `sources` is a hash of the files that a case names: a result whose hash is
another is older than the code it speaks of. Results that were typed from a table of the docs have none.
"""

from __future__ import annotations

import hashlib
import subprocess
from collections.abc import Sequence
from datetime import date
from pathlib import Path

import pandas as pd

from common.files.whole import write_text
from lab.cost import machine

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "lab" / "results"
HEAD = ("command", "commit", "date", "machine", "sources")


def hash_of(sources: Sequence[str]) -> str:
    """Of the content of files and folders of the checkout, whatever they are called. FileNotFoundError for one that is
    not there."""
    contents = [hashlib.sha256(file.read_bytes()).digest() for source in sources for file in _files(source)]
    return hashlib.sha256(b"".join(sorted(contents))).hexdigest()[:12]


def _files(source: str) -> list[Path]:
    path = ROOT / source
    if path.is_dir():
        return [p for p in path.rglob("*") if p.is_file() and p.suffix not in (".pyc", ".md")]
    if not path.is_file():
        raise FileNotFoundError(f"{source}: no such file or folder in the checkout")
    return [path]


def write_result(table: pd.DataFrame, file: Path, command: str, sources: Sequence[str]) -> None:
    """Write a table with its head, whole or not at all."""
    values = (command, _commit(sources), date.today().isoformat(), machine(), hash_of(sources))
    head = "".join(f"# {key}: {value}\n" for key, value in zip(HEAD, values, strict=True))
    file.parent.mkdir(parents=True, exist_ok=True)
    write_text(file, head + table.to_csv(index=False, float_format="%.6g", lineterminator="\n"))


def read_result(file: Path) -> tuple[dict[str, str], pd.DataFrame]:
    """Head and table; cells are text, as they stand there. ValueError for a head that lacks a line."""
    lines = [line for line in file.read_text().splitlines() if line.startswith("# ")]
    head = dict(line[2:].split(": ", 1) for line in lines)
    if tuple(head) != HEAD:
        raise ValueError(f"{file}: its head has {', '.join(head)}; must have {', '.join(HEAD)}")
    return head, pd.read_csv(file, skiprows=len(lines), dtype=str, keep_default_na=False)


def _commit(sources: Sequence[str]) -> str:
    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()

    return git("rev-parse", "--short", "HEAD") + (", changed" if git("status", "--porcelain", *sources) else "")
