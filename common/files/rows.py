"""Lines of numbers as text, for programs that read no tables. pyarrow writes them ten times as fast as NumPy."""

from typing import BinaryIO

import numpy as np

from common.files.parquet import arrow_array


def write_rows(out: BinaryIO, rows: np.ndarray, head: str = "") -> None:
    """Write a head, and numbers (n, k), each with as few digits as tell it from all others."""
    import pyarrow as pa
    from pyarrow.csv import WriteOptions, write_csv

    out.write(head.encode())
    table = pa.table({str(k): arrow_array(column) for k, column in enumerate(rows.T)})
    write_csv(table, out, WriteOptions(include_header=False, delimiter=" "))
