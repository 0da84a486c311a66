"""Parquet files whose pages carry checksums, so that a damaged one is refused instead of read as other numbers."""

from __future__ import annotations

from pathlib import Path

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
    try:
        return pd.read_parquet(file, page_checksum_verification=True)
    except (KeyError, TypeError, AttributeError, IndexError) as error:  # of what pandas keeps at the end of the file
        raise OSError(f"its description of the columns is damaged: {error}") from error
