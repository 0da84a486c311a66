"""Parquet files whose pages carry checksums, so that a damaged one is refused instead of read as other numbers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas as pd


def write_parquet(table: pd.DataFrame, file: Path) -> None:
    """Write a table without its index, with a CRC-32 in each page.

    Of numbers in double precision each byte is a stream of its own: signals are smooth in the upper ones, which then
    compress (docs/runs.md).
    """
    numbers = [name for name in table.columns if table[name].dtype.kind == "f"]
    others = [name for name in table.columns if name not in numbers]
    table.to_parquet(file, index=False, compression="zstd", use_dictionary=others, use_byte_stream_split=numbers,
                     write_page_checksum=True)


def read_parquet(file: Path) -> pd.DataFrame:
    """Read a table. OSError or ArrowException where it is damaged, as where a page does not have the CRC-32 that it
    names; files without any are read as well."""
    import pandas as pd

    try:
        return pd.read_parquet(file, page_checksum_verification=True)
    except (KeyError, TypeError, AttributeError, IndexError) as error:  # of what pandas keeps at the end of the file
        raise OSError(f"its description of the columns is damaged: {error}") from error


def read_numbers(file: Path) -> dict[str, np.ndarray]:
    """Read the columns of a table of numbers, as float64, without pandas, which is slow to import. Raises
    OSError or ValueError where it is damaged, or holds anything else, or has an index."""
    from pyarrow import ArrowException
    from pyarrow.parquet import ParquetFile
    from pyarrow.types import is_floating, is_integer

    try:
        with ParquetFile(file, page_checksum_verification=True) as opened:  # read_table imports pandas
            table = opened.read()
    except ArrowException as error:
        raise ValueError(str(error)) from error
    index = (table.schema.pandas_metadata or {}).get("index_columns", [])
    if any(isinstance(one, str) for one in index):
        raise ValueError(f"{file}: has an index")
    if not all(is_floating(column.type) or is_integer(column.type) for column in table.columns):
        raise ValueError(f"{file}: holds more than numbers")
    if any(column.null_count for column in table.columns):
        raise ValueError(f"{file}: has missing numbers")
    # `to_numpy` of a column imports pandas.
    return {name: np.concatenate([np.from_dlpack(part).astype(float) for part in column.chunks] or [np.empty(0)])
            for name, column in zip(table.column_names, table.columns, strict=True)}
