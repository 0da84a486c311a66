"""Tables for other programs: text between commas (.csv), or a sheet a table for a spreadsheet (.xlsx)."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from common.files.output_directory import refuse_file
from common.files.whole import written_whole
from common.tables import InputError

if TYPE_CHECKING:
    import pandas as pd


def refuse_export(out: Path) -> None:
    """Raises InputError for a file that `export` cannot write, or must not: such a table holds no mark of its writer,
    which another program would read as a row, so that what is there is never replaced."""
    refuse_file(str(out), lambda _: True, ".csv", ".xlsx")
    if out.exists():
        raise InputError(f"--out = {out}: is there; move it away or choose another name")
    if out.suffix == ".xlsx" and find_spec("openpyxl") is None:
        raise InputError(f"--out = {out}: needs the package openpyxl (pip install openpyxl)")


def export(tables: Mapping[str, pd.DataFrame], out: Path) -> None:
    """Write tables by their names as the sheets of a .xlsx, or the first one as a .csv; whole or not at all."""
    import pandas as pd

    with written_whole(out) as beside:
        if out.suffix == ".csv":
            next(iter(tables.values())).to_csv(beside, index=False)
            return
        with beside.open("wb") as file, pd.ExcelWriter(file, engine="openpyxl") as writer:
            for name, table in tables.items():
                table.to_excel(writer, sheet_name=name, index=False)
