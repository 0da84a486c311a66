"""Parquet files whose pages carry checksums, so that a damaged one is refused instead of read as other numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from common.files.whole import named, refuse_irregular

if TYPE_CHECKING:
    import pandas as pd

#: A table as a run makes it, without pandas, which takes longer to import than all else that a run needs: arrays of one
#: length by name.
Columns = dict[str, np.ndarray]


def write_parquet(table: pd.DataFrame | Mapping[str, np.ndarray], file: Path) -> None:
    """Write a table without its index, with a CRC-32 in each page.

    Of numbers in double precision each byte is a stream of its own: signals are smooth in the upper ones, which then
    compress (docs/runs.md).
    """
    import pyarrow as pa
    from pyarrow.parquet import write_table

    if isinstance(table, Mapping):
        arrow = pa.Table.from_arrays([arrow_array(values) for values in table.values()], names=list(table))
    else:
        arrow = pa.Table.from_pandas(table, preserve_index=False)
    numbers = [column.name for column in arrow.schema if pa.types.is_floating(column.type)]
    others = [name for name in arrow.column_names if name not in numbers]
    with named(file):
        write_table(arrow, file, compression="zstd", use_dictionary=others, use_byte_stream_split=numbers,
                    write_page_checksum=True)


def arrow_array(values: np.ndarray) -> Any:
    """Numbers, of which NaN is no number, or text as an array of pyarrow; `pyarrow.array` imports pandas."""
    import pyarrow as pa

    if values.dtype.kind not in "fiu":
        texts = [str(text).encode() for text in values.tolist()]
        ends = np.cumsum([0, *map(len, texts)], dtype=np.int64)
        buffers = [None, pa.py_buffer(ends), pa.py_buffer(b"".join(texts))]
        return pa.Array.from_buffers(pa.large_string(), len(texts), buffers)
    missing = np.isnan(values) if values.dtype.kind == "f" else np.zeros(0, dtype=bool)
    known = pa.py_buffer(np.packbits(~missing, bitorder="little")) if missing.any() else None
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values),
                                 [known, pa.py_buffer(np.ascontiguousarray(values))])


def read_parquet(file: Path, columns: Sequence[str] | None = None) -> pd.DataFrame:
    """Read a table, or some of its columns. OSError or ArrowException where it is damaged, as where a page does not
    have the CRC-32 that it names, or lacks a column; files without checksums are read as well."""
    import pyarrow as pa
    from pyarrow.parquet import read_table

    refuse_irregular(file)
    # pyarrow's own pool asks for huge pages; until the system had gathered 300 MB of them, it took 0.1 to 1 s.
    pa.set_memory_pool(pa.system_memory_pool())
    try:
        table = read_table(file, columns=columns, page_checksum_verification=True)
        return table.to_pandas(split_blocks=True)  # else all columns are copied to one block
    except (KeyError, TypeError, AttributeError, IndexError) as error:  # of what pandas keeps at the end of the file
        raise OSError(f"its description of the columns is damaged: {error}") from error


def read_numbers(file: Path) -> dict[str, np.ndarray]:
    """Read the columns of a table of numbers, as float64, without pandas, which is slow to import. Raises
    OSError or ValueError where it is damaged, or holds anything else, or has an index."""
    from pyarrow import ArrowException
    from pyarrow.parquet import ParquetFile
    from pyarrow.types import is_floating, is_integer

    refuse_irregular(file)
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
