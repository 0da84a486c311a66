"""Text tables as measurement systems write them: any separator, decimal comma, lines before the numbers.

The layout follows from the lines that hold nothing but numbers and dates. The separator is a semicolon, a tab, a comma
or blanks, whichever makes most lines such lines; a comma that does not separate is the decimal mark. The names stand in
the line above the numbers, lines of units between them where there are any. What stands further above is passed over.
Two columns of whole numbers without names may as well be one with a decimal comma, and are refused.
"""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from analysis.signals.records import RecordError
from common.channels import UNITS, plain_unit

if TYPE_CHECKING:
    import pandas as pd

HEAD_LINES = 300  # that the layout is found from
FRACTION = re.compile(r"\d+([eE][-+]?\d+)?")
DATE = re.compile(r"([\d./-]+[T ])?\d+:\d\d[\d:.,]*(Z|[+-][\d:]+)?")
LAYOUTS: tuple[tuple[str | None, str], ...] = (
    (";", "."), (";", ","), ("\t", "."), ("\t", ","), (",", "."), (None, "."), (None, ","))
BOMS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))


@dataclass(frozen=True)
class Layout:
    """Separator (None: blanks), decimal mark, names of the columns (None: no names), number of the first line of
    numbers from 0, and how many cells a line has."""

    separator: str | None
    decimal: str
    names: list[str] | None
    first: int
    width: int


def read_text_table(path: Path) -> pd.DataFrame:
    """Return a text table; columns without names are "0", "1", ... A table whose first lines all hold words is read
    with commas and a line of names, as this project writes tables. Raises RecordError, OSError or ValueError."""
    import pandas as pd

    encoding, head, layout = _looked_at(path)
    if layout is None:
        return pd.read_csv(path, encoding=encoding)
    names = layout.names or [str(k) for k in range(layout.width)]
    # A separator at the end of every line makes cells that nobody named.
    spare = [f"\x00{k}" for k in range(len(head[layout.first].split(layout.separator)) - len(names))]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise RecordError(f"{path}: column {twice!r} appears twice")
    table = pd.read_csv(path, header=None, names=[*names, *spare], skiprows=layout.first, encoding=encoding,
                        sep=layout.separator or r"\s+", decimal=layout.decimal, index_col=False).drop(columns=spare)
    if layout.decimal == ",":  # pandas leaves a column with a word in it as it stands
        for name in table.columns[[not pd.api.types.is_numeric_dtype(kind) for kind in table.dtypes]]:
            table[name] = table[name].astype(str).str.replace(",", ".")
    return table


def read_plain_table(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of a text table that holds numbers alone, each line as many, with decimal points. It is read
    without pandas, which takes longer to import than a short table to read. Raises as `read_text_table`, and ValueError
    for any other table."""
    encoding, head, layout = _looked_at(path)
    if layout is None or layout.decimal != "." or len(head[layout.first].split(layout.separator)) != layout.width:
        raise ValueError("not a plain table")
    names = layout.names or [str(k) for k in range(layout.width)]
    values = np.loadtxt(path, delimiter=layout.separator, skiprows=layout.first, encoding=encoding, comments=None,
                        ndmin=2)
    if len(set(names)) < len(names) or values.shape[1] != len(names):
        raise ValueError("not a plain table")
    return dict(zip(names, values.T, strict=True))


def _looked_at(path: Path) -> tuple[str, list[str], Layout | None]:
    """Encoding, first lines, and layout of a file."""
    encoding = encoding_of(path)
    with path.open(encoding=encoding, newline=None) as file:
        head = [line.rstrip("\n") for line, _ in zip(file, range(HEAD_LINES), strict=False)]
    return encoding, head, find_layout(head, str(path))


def find_layout(head: list[str], source: str) -> Layout | None:
    """The layout of a table by its first lines, None where none of them holds numbers alone. Raises RecordError for a
    line of numbers and words where the names should be."""
    found = [one for separator, decimal in LAYOUTS if (one := _try(head, separator, decimal)) is not None]
    if not found:
        return None
    _, named, layout = max(found, key=lambda one: one[:2])
    if (layout.separator, layout.width, named) == (",", 2, False):
        _refuse_fractions(head, layout, source)
    above = [k for k in range(layout.first) if head[k].strip()]
    if named and len(above) > 1:
        cells = _split(head[above[-1]], layout.separator)
        if any(_is_value(cell, layout.decimal) for cell in cells):
            raise RecordError(f"{source}: line {above[-1] + 1} holds words and numbers; needs names, or numbers alone")
    return layout


def _refuse_fractions(head: list[str], layout: Layout, source: str) -> None:
    """Raises RecordError where every second cell may be the digits behind a decimal comma."""
    rows = [_split(line, ",") for line in head[layout.first:]]
    if all(len(row) != 2 or FRACTION.fullmatch(row[1]) and "." not in row[0] for row in rows):
        raise RecordError(f"{source}: line {layout.first + 1}: {','.join(rows[0])!r} is one number with a decimal "
                          "comma, or two numbers; needs a line of names above, of one word or of two with a comma")


def _try(head: list[str], separator: str | None, decimal: str) -> tuple[int, bool, Layout] | None:
    """How many lines are numbers alone with these marks, whether the line above has as many cells, and the layout."""
    rows = {}
    for k, line in enumerate(head):
        cells = _split(line, separator)
        if cells and (separator is None or separator in line) and all(_is_value(c, decimal) for c in cells):
            rows[k] = len(cells)
    if not rows:
        return None
    first = min(rows)
    names = _names([line for line in head[:first] if line.strip()], separator, rows[first])
    count = sum(width == rows[first] for width in rows.values())
    return count, names is not None, Layout(separator, decimal, names, first, rows[first])


def _names(above: list[str], separator: str | None, width: int) -> list[str] | None:
    """Names from the lines above the numbers, with the units that stand below them; None where there are none."""
    lines = [_split(line.lstrip("#% "), separator) for line in above[-4:]]
    lowest = next((k for k in range(len(lines) - 1, -1, -1) if not _are_units(lines[k])), -1)
    if 0 <= lowest < len(lines) - 1 and len(lines[lowest]) == width:
        units = [cell.replace(")(", "/").strip("[]()") for cell in max(lines[lowest + 1:], key=len)]
        return [f"{name} [{unit}]" if unit else name for name, unit in zip_longest(lines[lowest], units, fillvalue="")]
    return lines[-1] if lines and len(lines[-1]) == width else None


def _are_units(cells: list[str]) -> bool:
    """Those of the columns, (m/s²)(N) being a ratio, or the word that announces them."""
    parts = [part for cell in cells for part in re.findall("[^()]+", cell)]
    return cells == ["Units:"] or all(plain_unit(part) in UNITS for part in parts)


def _split(line: str, separator: str | None) -> list[str]:
    """Cells of a line without quotes, and without the empty ones at its end."""
    cells = [cell.strip().strip('"').strip() for cell in line.split(separator)]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def is_date(cell: object) -> bool:
    """Is it text with a time of day, with or without a date?"""
    return isinstance(cell, str) and DATE.fullmatch(cell) is not None


def _is_value(cell: str, decimal: str) -> bool:
    if is_date(cell):
        return True
    if decimal == ",":
        if "." in cell:
            return False
        cell = cell.replace(",", ".")
    try:
        float(cell)
    except ValueError:
        return False
    return True


def encoding_of(path: Path) -> str:
    """That of the file's mark, else UTF-8 if it can be that, else Windows' western one."""
    with path.open("rb") as file:
        data = file.read(1 << 16)
    for mark, name in BOMS:
        if data.startswith(mark):
            return name
    try:
        codecs.getincrementaldecoder("utf-8")().decode(data)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"
